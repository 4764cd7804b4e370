"""What the doctor finds and says."""

from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from comparisons import doctor
from comparisons.doctor import Check, examine


def find(checks: tuple[Check, ...], what: str) -> Check:
    """Return the check of that name."""
    return next(check for check in checks if check.what == what)


@pytest.fixture(autouse=True)
def _no_loading(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Leave the loading of heavy libraries to the one test of it."""
    if "loads" not in request.node.name:
        monkeypatch.setattr(doctor, "HEAVY", ())


def test_a_sound_installation_has_nothing_to_mend() -> None:
    """The environment that runs the tests is sound, and every import name is ours."""
    checks = examine()
    assert [check for check in checks if not check.well] == []
    assert find(checks, "import worlds").found == "ours"
    assert find(checks, "torchrl").found == "0.14.1"


@pytest.mark.slow
def test_a_library_that_loads_not_is_named() -> None:
    """The library's own last line is shown, with what to do."""
    check = doctor._loads("no_such_library")
    assert check.found == "ModuleNotFoundError: No module named 'no_such_library'"
    assert "reinstall" in check.mend
    assert doctor._loads("cv2").well


def test_a_wrong_python_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python 3.12 has no PyBullet wheels."""
    monkeypatch.setattr(doctor.sys, "version_info", (3, 12, 1))
    check = find(examine(), "Python")
    assert (check.found, check.mend[:15]) == ("3.12.1", "use Python 3.11")


def test_a_missing_and_an_old_package_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each says what is needed and how to get it; extras' packages are not asked for."""
    wanted = ["numpy>=99", "no-such-package>=1", 'mypy>=1; extra == "dev"']
    monkeypatch.setattr(doctor, "requires", lambda _name: wanted)
    checks = examine()
    assert "needs >=99" in find(checks, "numpy").mend
    assert find(checks, "no-such-package").found == "not installed"
    assert "mypy" not in {check.what for check in checks}


def test_an_import_name_of_somebody_else_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A folder that comes first on the path is found."""
    spec = ModuleSpec("worlds", None, origin=str(tmp_path / "worlds" / "__init__.py"))
    monkeypatch.setattr(doctor, "find_spec", lambda name: spec if name == "worlds" else None)
    check = find(examine(), "import worlds")
    assert "not to affordant" in check.found
    assert "comes first on the path" in check.mend


def test_an_import_name_that_two_packages_install_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other package is to be uninstalled."""
    both = {"planners": ["affordant", "planners-of-others"]}
    monkeypatch.setattr(doctor, "packages_distributions", lambda: both)
    check = find(examine(), "import planners")
    assert "pip uninstall planners-of-others" in check.mend


def test_two_opencv_wheels_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are to go, and the headless one to come back."""
    monkeypatch.setattr(doctor, "_installed", lambda name: "contrib" not in name)
    check = find(examine(), "OpenCV wheels")
    assert check.found == "opencv-python, opencv-python-headless"
    assert "pip uninstall -y opencv-python opencv-python-headless" in check.mend


def test_a_check_prints_its_verdict_and_its_mend() -> None:
    """A fault takes two lines, the second the mend."""
    assert str(Check("cv2", "loads")) == "[ok] cv2: loads"
    assert str(Check("cv2", "broken", "reinstall it")) == "[!!] cv2: broken\n     reinstall it"
