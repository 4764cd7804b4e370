"""A study's store: what it keeps, and how damage is found."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.study.kinds import Result
from comparisons.study.running import index as indexing
from comparisons.study.running.index import Entry, index
from comparisons.study.running.lock import held
from comparisons.study.running.records import DamagedError, checked_record, record
from comparisons.study.running.store import Store
from comparisons.study.running.work import Broke, Finished, Ran
from comparisons.study.spec import RunSpec
from worlds import UserError

SPEC = RunSpec("learn", 1, {"gamma": 0.99, "graph": "mein größtes"}, 3, {"a.yaml": "tasks:\r\n"})
RESULT = Result(
    {"steps": 1200, "share": 0.1, "never": None},
    {"learning": {"steps": [0, 1e-7, 3], "share": [None, 0.5, -0.0]}},
    {"cells": [{"row": 1, "names": ["ü", "\u2028", ""]}], "deep": {}},
)
PROVENANCE = {"host": "here", "wall_seconds": 1.5}
RAN = Finished(SPEC, Ran(RESULT, PROVENANCE))
BROKE = Finished(SPEC, Broke("raised", "no: ü", "Traceback ...", PROVENANCE))
SOMEWHERE = Path("runs/aa/aa.json")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Return a new store."""
    return Store.create(tmp_path / "store", "study: mine\r\n", {"../a.yaml": "tasks:\r\n", "b": "ü"})


def other(seed: int) -> Finished:
    """Return the same run with another seed."""
    return Finished(RunSpec("learn", 1, SPEC.settings, seed), Ran(RESULT, PROVENANCE))


def test_it_gives_back_what_it_was_given(store: Store) -> None:
    """Study, texts with their newlines, spec, result to the last bit, and provenance."""
    store.save(RAN)
    kept = store.read(SPEC.hash)
    assert (kept.spec, kept.result, kept.provenance) == (SPEC, RESULT, PROVENANCE)
    assert json.dumps(kept.result.curves) == json.dumps(RESULT.curves)
    assert list(kept.result.curves["learning"]) == ["steps", "share"]  # the first is the abscissa
    assert store.text() == "study: mine\r\n"
    assert store.files() == {"../a.yaml": "tasks:\r\n", "b": "ü"}
    assert store.hashes() == (SPEC.hash,)
    assert (store.failures(), store.damaged()) == ((), ())


def test_a_failure_lasts_until_there_is_a_result(store: Store) -> None:
    """It is told with its traceback; it is no result; a result takes its place."""
    store.save(BROKE)
    (failure,) = store.failures()
    assert (failure.spec, failure.reason, failure.message) == (SPEC, "raised", "no: ü")
    assert failure.traceback == "Traceback ..."
    assert store.hashes() == ()
    with pytest.raises(UserError, match="there is no such run"):
        store.read(SPEC.hash)
    store.save(RAN)
    assert (store.failures(), store.hashes()) == ((), (SPEC.hash,))


def test_a_failure_beside_a_result_is_forgotten(store: Store) -> None:
    """As a driver leaves it that is killed between the two."""
    store.save(BROKE)
    failure = store.directory / "failures" / f"{SPEC.hash}.json"
    content = failure.read_bytes()
    store.save(RAN)
    failure.write_bytes(content)
    store.save(replace(BROKE, spec=other(4).spec))
    store.tidy()
    assert [failure.spec.seed for failure in store.failures()] == [4]


def test_long_names_of_other_scripts_and_folders_can_be_kept(tmp_path: Path) -> None:
    """One letter is three bytes, and stays so."""
    files = {f"迷路/{80 * '迷'}": "a", "50%2F/b": "b"}
    assert Store.create(tmp_path / "store", "study: mine", files).files() == files


def test_a_store_begins_where_nothing_is(store: Store, tmp_path: Path) -> None:
    """An existing folder is refused and left alone; a folder without a study is no store."""
    with pytest.raises(UserError, match="exists already"):
        Store.create(store.directory, "other", {})
    assert store.text() == "study: mine\r\n"
    with pytest.raises(UserError, match="this is no store of a study"):
        Store(tmp_path).text()
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


@given(at=st.integers(min_value=0), bit=st.integers(0, 7))
def test_any_bit_that_flips_is_found(at: int, bit: int) -> None:
    """Whatever the byte, also where the JSON still says the same."""
    content = bytearray(record(_content()))
    content[at % len(content)] ^= 1 << bit
    with pytest.raises(DamagedError):
        checked_record(bytes(content), SOMEWHERE)


@given(cut=st.integers(min_value=0), tail=st.binary(max_size=5))
def test_any_file_cut_off_or_grown_is_found(cut: int, tail: bytes) -> None:
    """Wherever it ends, whatever follows."""
    whole = record(_content())
    changed = whole[: cut % (len(whole) + 1)] + tail
    if changed == whole:
        assert checked_record(changed, SOMEWHERE) == _content()
    else:
        with pytest.raises(DamagedError):
            checked_record(changed, SOMEWHERE)


def test_a_number_written_another_way_is_found() -> None:
    """1E-07 is 1e-07 to JSON; it was still not written so."""
    whole = record(_content())
    assert b"1e-07" in whole
    with pytest.raises(DamagedError, match="checksum"):
        checked_record(whole.replace(b"1e-07", b"1E-07"), SOMEWHERE)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "it is empty"),
        (b"\0" * 4096, "it is no JSON"),
        (b'{"format": 1', "it is no JSON"),
        (b"[" * 100_000, "it is no JSON"),
        (b"\xff\xfe", "it is no JSON"),
        (b"[]", "it is none of the store's"),
        (b'{"spec": {}}', "it is none of the store's"),
        (b'{"format":true,"sha256":""}', "it is none of the store's"),
        (b'{"sha256":"","format":1}', "it is none of the store's"),
        (b'{"format":1,"sha256":"00"}', "its checksum is wrong"),
        (b'{"format":1,"sha256":"00","a":1e999}', "its checksum is wrong"),
        (record({"spec": 3}), "it has no spec"),
        (record({"spec": {"kind": "learn"}}), "it has no spec"),
        (
            record({"spec": SPEC.as_data(), "measures": {}, "curves": {}, "provenance": {}}),
            "it has no details",
        ),
        (record({"spec": other(9).spec.as_data()}), "its name should be"),
    ],
)
def test_damage_is_named_and_set_aside(store: Store, content: bytes, problem: str) -> None:
    """The file, what is wrong and what to do; the good run beside it is left alone."""
    store.save(RAN)
    store.save(other(4))
    path = store.path(SPEC.hash)
    path.write_bytes(content)
    with pytest.raises(DamagedError, match="affordant study resume"):
        store.read(SPEC.hash)
    (damaged,) = store.damaged()
    assert damaged.path == path
    assert problem in damaged.problem
    moved = store.set_aside(damaged)
    assert moved.read_bytes() == content
    assert moved.parent == store.directory / "damaged"
    assert (store.damaged(), store.hashes()) == ((), (other(4).spec.hash,))
    path.write_bytes(content)
    assert store.set_aside(store.damaged()[0]).name == f"{path.name}.1"
    assert len(list(moved.parent.iterdir())) == 2


def test_a_file_in_the_wrong_folder_is_found(store: Store) -> None:
    """It would never be read there."""
    store.save(RAN)
    path = store.path(SPEC.hash)
    wrong = path.parent.parent / "zz" / path.name
    wrong.parent.mkdir()
    path.rename(wrong)
    assert store.hashes() == ()
    assert [damaged.path for damaged in store.damaged()] == [wrong]


def test_a_damaged_failure_is_found(store: Store) -> None:
    """It is not shown as a failure, and not forgotten either."""
    store.save(BROKE)
    path = store.directory / "failures" / f"{SPEC.hash}.json"
    path.write_bytes(path.read_bytes()[:-9])
    assert store.failures() == ()
    assert [damaged.path for damaged in store.damaged()] == [path]


def test_a_newer_format_is_refused_and_left_alone(store: Store) -> None:
    """Moved aside as damaged, it would be lost to the newer affordant."""
    store.save(RAN)
    path = store.path(SPEC.hash)
    path.write_bytes(_of_format(2))
    for reading in (lambda: store.read(SPEC.hash), store.damaged):
        with pytest.raises(UserError, match=r"format 2; this affordant reads format 1: update it") as told:
            reading()
        assert not isinstance(told.value, DamagedError)
    assert path.read_bytes() == _of_format(2)


def test_an_older_format_is_read_where_it_is_known(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """By what makes its content into today's; otherwise it is refused."""
    path = store.path(SPEC.hash)
    path.parent.mkdir()
    path.write_bytes(_of_format(0))
    with pytest.raises(UserError, match="format 0, which no affordant has ever written"):
        store.read(SPEC.hash)
    renew = {0: lambda data: {**data, "details": {"renewed": True}}}
    monkeypatch.setattr("comparisons.study.running.records._RENEWED", renew)
    assert store.read(SPEC.hash).result.details == {"renewed": True}


def test_the_index_follows_the_files(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made where it is missing or broken; files that come, change or go are seen; others are not read."""
    for seed in (1, 2):
        store.save(other(seed))
    one, two = (other(seed).spec.hash for seed in (1, 2))
    entry = Entry("learn", 1, RESULT.measures, 1.5)
    assert index(store)[one] == entry
    path = store.directory / "index.json"
    written = path.read_bytes()
    for broken in (b"", b"[]", written[:-20], written.replace(b"1200", b"1300"), record({}), _of_format(2)):
        path.write_bytes(broken)
        assert index(store)[one] == entry
        assert path.read_bytes() == written

    with monkeypatch.context() as unread:
        unread.setattr(Store, "read", None)
        assert set(index(store)) == {one, two}
    store.path(one).unlink()
    store.path(two).write_bytes(b"{}")
    store.save(other(3))
    assert set(index(store)) == {other(3).spec.hash}


def test_an_index_that_cannot_be_written_is_no_harm(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """It can be made again at any time."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    store.save(RAN)
    monkeypatch.setattr(indexing, "replace_file", full)
    assert set(index(store)) == {SPEC.hash}
    assert not (store.directory / "index.json").exists()


def test_a_store_is_held_by_one_driver(store: Store) -> None:
    """The second is told who holds it; when the first lets go, it may."""
    with (
        held(store.directory),
        pytest.raises(UserError, match=r"\(process \d+ on .*\)"),
        held(store.directory),
    ):
        pass
    with held(store.directory):
        assert store.damaged() == ()


def _content() -> dict[str, Any]:
    return {
        "spec": SPEC.as_data(),
        "measures": RESULT.measures,
        "curves": RESULT.curves,
        "details": RESULT.details,
        "provenance": PROVENANCE,
    }


def _of_format(number: int) -> bytes:
    rest = json.dumps({"format": number, **_content()}, separators=(",", ":"), ensure_ascii=False)
    checksum = hashlib.sha256(rest.encode()).hexdigest()
    first = f'{{"format":{number},'
    return f'{first}"sha256":"{checksum}",{rest.removeprefix(first)}\n'.encode()
