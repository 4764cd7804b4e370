"""A kind of run that needs no learner, a study of it, and what is told of faulty ones."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import pytest

from comparisons.study import kinds
from comparisons.study.declaring import checking
from comparisons.study.declaring.declaration import StudyError, parse_study
from comparisons.study.kinds import Kind, Measure, Result
from comparisons.study.spec import Value
from worlds import UserError, suggest

DEFAULTS: Mapping[str, Value] = {
    "learner": "plain",
    "rate": 0.5,
    "endings": "given",
    "world": "",
    "steps": 10,
}
MEASURES = (
    Measure("steps", "steps taken", "steps", "less"),
    Measure("optimal", "share that is optimal", parts=("Goto", "Leave")),
)


def complete(given: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return all settings; only the learner "deep" has endings."""
    for name, value in given.items():
        if name not in DEFAULTS:
            raise UserError(f"{name}: there is no such setting; {suggest(name, DEFAULTS)}")
        if name == "rate" and not (isinstance(value, int | float) and value <= 1):
            raise UserError(f"rate: {value!r} is not possible; give a number up to 1")
    settings = {**DEFAULTS, **given}
    if settings["learner"] not in ("plain", "deep"):
        raise UserError(f"learner: there is no {settings['learner']}; use one of plain, deep")
    if settings["learner"] == "plain" and "endings" in given:
        raise UserError("endings: the learner plain has none; leave it out")
    if settings["steps"] == 13:
        raise UserError("this cannot go well; think again")
    if (settings["learner"], settings["rate"]) == ("plain", 0.8):
        raise UserError("rate: too low for plain; give more")
    rate = settings["rate"]
    assert isinstance(rate, int | float)
    return {**settings, "rate": float(rate)}


def file_settings(settings: Mapping[str, Value]) -> tuple[str, ...]:
    """Return which settings name files: a world whose name has a dot in it."""
    return ("world",) if "." in str(settings["world"]) else ()


FAKE = Kind("fake", 3, MEASURES, complete, file_settings, lambda *_: Result({}))


TEXT = """\
study: rates
question: Is a high rate better?
kind: fake
seeds: 3
settings: {steps: 20}
vary:
  rate: [1, 0.9, .5]
  learner:
    plain: {learner: plain}
    deep: {learner: deep, endings: learnt}
leave_out: [{rate: 0.9, learner: deep}]
answer: {measure: steps, compare: rate, against: 1, within: [learner], statistic: median}
"""


def told(text: str, files: Mapping[str, str] | None = None) -> list[str]:
    """Return the mistakes of a text that has some."""
    with pytest.raises(StudyError) as caught:
        parse_study(text, "mine.yaml", files)
    assert all(fault.problem and fault.mend for fault in caught.value.faults)
    assert str(caught.value).startswith("mine.yaml, line ")
    return [str(fault) for fault in caught.value.faults]


@contextmanager
def known(*also: Kind) -> Iterator[None]:
    """Let there be some kinds of run besides those there are."""
    by_name = {each.name: each for each in also}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checking, "kind", lambda name: by_name.get(name) or kinds.kind(name))
        yield


def fake_kind() -> Iterator[None]:
    """Let there be the fake kind: a fixture of the modules that need it."""
    with known(FAKE):
        yield
