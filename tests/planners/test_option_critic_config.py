"""Settings of an option-critic: the dataclass, its file, and what is refused."""

import re
from dataclasses import asdict, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from planners.config_text import ConfigError
from planners.option_critic.config import OptionCriticConfig, load_config, parse_config
from worlds import UserError

COUNTS = st.integers(1, 100_000)
SHARES = st.floats(0, 1)
WEIGHTS = st.floats(0, 1e6)
CONFIGS = st.builds(
    OptionCriticConfig,
    terminations=st.sampled_from(["given", "learnt", "prior"]),
    abstracted=st.booleans(),
    hidden=COUNTS,
    total=COUNTS,
    rate=st.floats(1e-12, 1.0),
    gamma=SHARES,
    epsilon=SHARES,
    deliberation=WEIGHTS,
)


def test_the_file_of_defaults_is_the_dataclass() -> None:
    """Every setting stands in it once, in order, with its default and a comment."""
    text = files("planners.option_critic").joinpath("option_critic.yaml").read_text(encoding="utf-8")
    assert parse_config(text) == OptionCriticConfig() == load_config()
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    names = [field.name for field in fields(OptionCriticConfig)]
    assert [line.partition(":")[0] for line in lines] == names
    assert all(re.fullmatch(r"\w+: \S+ +# .{5,}", line) for line in lines)


@given(config=CONFIGS)
def test_any_config_comes_back_from_its_text(config: OptionCriticConfig) -> None:
    """Numbers keep every bit on their way through YAML."""
    text = "".join(f"{name}: {value}\n" for name, value in asdict(config).items())
    assert parse_config(text) == config
    assert parse_config(yaml.safe_dump(asdict(config))) == config


def test_a_file_gives_what_differs_and_overrides_count_more(tmp_path: Path) -> None:
    """What neither says keeps its default; an empty file says nothing."""
    path = tmp_path / "mine.yaml"
    path.write_text("gamma: 0.9\nhidden: 8  # small\n", encoding="utf-8-sig")
    found = load_config(path, {"gamma": "0.8", "abstracted": "false"})
    assert found == replace(OptionCriticConfig(), gamma=0.8, hidden=8, abstracted=False)
    for nothing in ("", "# only\n\n---\n"):
        path.write_text(nothing)
        assert load_config(str(path)) == OptionCriticConfig()


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"prior": "2"}, "prior: it is not read with terminations=given; leave it out, or give another"),
        ({"termination": "0.2"}, "termination: it is not read with terminations=given"),
        ({"terminations": "learnt", "prior": "2"}, "prior: it is not read with terminations=learnt"),
    ],
)
def test_what_would_never_be_read_is_refused(given: dict[str, str], problem: str, tmp_path: Path) -> None:
    """A sweep over it would show no effect; in a file, or as it is by default, it does no harm."""
    with pytest.raises(UserError, match=problem):
        load_config(overrides=given)
    (name,) = given.keys() - {"terminations"}
    assert load_config(overrides={**given, name: str(getattr(OptionCriticConfig(), name))})
    assert load_config(overrides={**given, "terminations": "prior"}) != OptionCriticConfig()
    path = tmp_path / "mine.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in given.items()))
    assert getattr(load_config(path), name) == float(given[name])


def test_every_mistake_of_a_file_is_told_by_line_and_key() -> None:
    """All at once, in order, each with its mend."""
    text = "rte: 1\ngamma: 9\nhidden: [3]\nnum_envs:\nrate: nan\nterminations: learned\nabstracted: maybe\n"
    with pytest.raises(UserError) as error:
        parse_config(text + "horizon: 3.5\nlast_rate: -0.1\nclip: 0\nepochs: 1000000\n", "mine.yaml")
    assert str(error.value).splitlines() == [
        "mine.yaml, line 1, rte: there is no such setting; did you mean 'rate'?",
        "mine.yaml, line 2, gamma: 9 is not possible; give a number from 0 to 1",
        "mine.yaml, line 3, hidden: this is no single value; give a whole number from 1 to 100000",
        "mine.yaml, line 4, num_envs: nothing is not possible; give a whole number from 1 to 100000",
        "mine.yaml, line 5, rate: nan is not possible; give a number above 0",
        "mine.yaml, line 6, terminations: learned is not possible; did you mean 'learnt'?",
        "mine.yaml, line 7, abstracted: maybe is not possible; give true or false",
        "mine.yaml, line 8, horizon: 3.5 is not possible; give a whole number from 1 to 100000",
        "mine.yaml, line 9, last_rate: -0.1 is not possible; give a number from 0 on",
        "mine.yaml, line 10, clip: 0 is not possible; give a number above 0",
        "mine.yaml, line 11, epochs: 1000000 is not possible; give a whole number from 1 to 100000",
    ]


def test_of_many_mistakes_the_first_are_told() -> None:
    """A file that is something else does not fill the screen; `faults` has them all."""
    with pytest.raises(ConfigError, match=r"^mine\.yaml, line 1, a0: ") as error:
        parse_config("".join(f"a{i}: 1\n" for i in range(40)), "mine.yaml")
    assert str(error.value).splitlines()[-1] == "and 28 more in mine.yaml"
    assert len(error.value.faults) == 40


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("- a\n- b\n", "line 1: these are no settings; write NAME: VALUE"),
        ("words", "these are no settings"),
        ("gamma: 0.9\ngamma: 0.8\n", "line 2, gamma: the key 'gamma' is given again"),
        ("rate: {a: 1}\n", "line 1, rate: this is no single value"),
        ("rate: &x 1\nclip: *x\n", "anchors"),
        ("rate: !!python/object/apply:os.system ['true']\n", "the tag .* is not read here"),
        ("rate: 1\n\tclip: 1\n", "no YAML"),
        ("{", "no YAML"),
        ("rate: " + "[" * 50, "deep"),
    ],
)
def test_what_is_no_settings_file_is_refused(text: str, problem: str) -> None:
    """The message begins with the file; nothing in it is executed."""
    with pytest.raises(UserError, match=problem) as error:
        parse_config(text, "mine.yaml")
    assert str(error.value).startswith("mine.yaml, line ")


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """A missing one, a folder, and one that is no text."""
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe")
    for name, problem in {"no.yaml": "no such file", ".": "a folder", "bytes.yaml": "UTF-16"}.items():
        with pytest.raises(UserError, match=problem):
            load_config(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "value", "mend"),
    [
        ("terminations", "prio", "did you mean 'prior'?"),
        ("terminations", 3, "use one of given, learnt, prior"),
        ("abstracted", 1, "give true or false"),
        ("hidden", 0, "from 1 to 100000"),
        ("hidden", 8.0, "from 1 to 100000"),
        ("total", 0, "from 1 to 1000000000000"),
        ("gamma", -0.1, "from 0 to 1"),
        ("lmbda", float("nan"), "from 0 to 1"),
        ("rate", 0.0, "above 0"),
        ("rate", "0.1", "above 0"),
        ("entropy", float("inf"), "from 0 on"),
    ],
)
def test_the_dataclass_refuses_what_the_file_would(name: str, value: Any, mend: str) -> None:
    """By keyword as well, the message names the setting, the value and the mend."""
    with pytest.raises(UserError, match=re.escape(mend)) as error:
        OptionCriticConfig(**{name: value})
    assert str(error.value).startswith(f"{name}: {value!r} is not possible")
