"""What backends learn from pushes, told: how many they need, and what they fail on unmet."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from comparisons.figures_pushes import Learnt, Pair, held_out_figure, learning_figure
from comparisons.intervals import paired_difference, wilson
from comparisons.perception_learning import Learning, Point
from comparisons.perception_spec import StudySpec
from comparisons.perception_words import unbroken, with_interval
from comparisons.report import Section, Table, Value
from comparisons.story_parts import Part, share
from perception.audit import HeldOut
from perception.protocol import LABELS


def learning_sections(spec: StudySpec, found: Learning) -> list[Part]:
    """Return what is told of training anew; nothing if no backend learnt."""
    if not found.backends:
        return []
    return [
        pushes_section(spec, found),
        *([held_out_section(spec, found)] if any(found.held_out.values()) else []),
    ]


def pushes_section(spec: StudySpec, found: Learning) -> Part:
    """Report how right backends are after how many pushes, with how many wrong labels."""
    its = spec.learning
    panels = {
        name: {
            _labels(wrong): [
                Learnt(one.pushes, one.accuracy, *one.interval, one.shares)
                for one in found.points
                if (one.backend, one.wrong) == (name, wrong)
            ]
            for wrong in its.wrong
        }
        for name in found.backends
    }
    by = {(one.backend, one.pushes, one.wrong): one for one in found.points}
    settings = [(pushes, wrong) for pushes in its.pushes for wrong in its.wrong]
    rows: list[tuple[Value, ...]] = []
    seeds: list[tuple[Value, ...]] = []
    for pushes, wrong in settings:
        own = [by[name, pushes, wrong] for name in found.backends]
        which = (pushes, unbroken(f"{100 * wrong:g} %"))
        rows.append((*which, *(with_interval(one.accuracy, *one.interval) for one in own)))
        seeds.append((*which, *(_each(one) for one in own)))
    text = (
        "Backends that learn, trained anew on the first so many frames of a training seed, each labelled by "
        "driving on and pushing what is met (nothing, in a third of them), and told the varied frames of "
        f"seed {spec.seed} afterwards. Wrong labels are made so at random. One of ten pushes sets the "
        f"temperature and is not learnt from. {_effort(its.effort)}"
    )
    built = (
        "The ensemble is more than what it learns: Hough, which needs no pushes, is half of it. How much "
        "each half counts hangs on the temperature of its CNN, and of 25 pushes only two set that."
    )
    paragraphs = (text, built) if "ensemble" in found.backends else (text,)
    runs = "one training seed" if its.seeds == 1 else f"{its.seeds} training seeds, each a small dot,"
    caption = (
        "Right labels by number of pushes (logarithmic axis) and share of wrong labels: mean over "
        f"{runs} with its 95 % interval."
    )
    header = ("pushes", "wrong labels", *found.backends)
    both = "whichever reaches farther of Wilson's interval (frames) and the bootstrap's (seeds)"
    tables = [Table(f"Mean of right labels over seeds, in %; 95 % intervals: {both}.", header, tuple(rows))]
    if its.seeds > 1:
        tables.append(Table("Right labels seed by seed, in %.", header, tuple(seeds)))
    section = Section("Pushes needed", paragraphs, (("pushes_needed", caption),), tuple(tables))
    return Part(section, {"pushes_needed": learning_figure(panels)})


def held_out_section(spec: StudySpec, found: Learning) -> Part:
    """Report what backends make of groups that they did not learn."""
    most = max(spec.learning.pushes)
    panels = {
        name: {
            one.group: Pair(
                (one.reference_right / one.frames, *wilson(one.reference_right, one.frames)),
                (one.right / one.frames, *wilson(one.right, one.frames)),
            )
            for one in groups
        }
        for name, groups in found.held_out.items()
    }
    left = [one.learnt_from for groups in found.held_out.values() for one in groups]
    rows: list[tuple[Value, ...]] = []
    for alike in zip(*found.held_out.values(), strict=True):  # one group, a backend each
        for name, one in zip(found.held_out, alike, strict=True):
            first = name == found.backends[0]
            which = (unbroken(one.group), one.frames) if first else ("", "")
            rights = (share(one.reference_right, one.frames), share(one.right, one.frames))
            errors = ", ".join(map(str, one.errors))
            rows.append((*which, name, *rights, _difference(one), errors))
    text = (
        "A backend that goes by colour, scale or place fails on a group that it never met. Each group of "
        f"obstacles is kept out of the {most} pushes of seed 0 in turn, and the backend trained on the rest "
        "is held to the one trained on all of them, for as many steps, on the test frames of that group. "
        f"That leaves {min(left)} to {max(left)} pushes; things beside the way may still have the colour. "
        f"{_effort(spec.learning.effort)}"
    )
    caption = "Right labels on a group, learnt with it and without it; bars are Wilson's 95 % intervals."
    header = ("kept out", "frames", "backend", "met", "kept out", "difference, points")
    table = Table(
        "Right labels on each group, met in training and kept out of it; the difference, on the same "
        "frames, with Newcombe's 95 % interval for pairs; and how many frames of the group a backend that "
        "had not met it wrongly took for none, for a cube and for a sphere.",
        (*header, "taken for"),
        tuple(rows),
    )
    section = Section("Kept out of training", (text,), (("held_out", caption),), (table,))
    return Part(section, {"held_out": held_out_figure(panels)})


def learning_results(found: Learning) -> dict[str, Any]:
    """Return what results.json holds of training anew."""
    return {
        "learning": [asdict(one) | {"accuracy": one.accuracy} for one in found.points],
        "held_out": [
            {"backend": name}
            | asdict(one)
            | {"frames": one.frames, "right": one.right, "reference_right": one.reference_right}
            | {"difference": list(_paired(one)), "errors": dict(zip(LABELS, one.errors, strict=True))}
            for name, groups in found.held_out.items()
            for one in groups
        ],
    }


def _paired(one: HeldOut) -> tuple[float, float, float]:
    return paired_difference(one.right, one.reference_right, one.both, one.frames)


def _difference(one: HeldOut) -> str:
    difference, low, high = (_signed(bound) for bound in _paired(one))
    return unbroken(f"{difference} ({low} to {high})")


def _signed(points: float) -> str:
    """Return a difference of shares in points, with its sign unless it is none.

    >>> _signed(0.125), _signed(-0.0001)
    ('+12.5', '0.0')
    """
    text = f"{100 * points:+.1f}".replace("-", "\N{MINUS SIGN}")
    return "0.0" if text[1:] == "0.0" else text


def _each(one: Point) -> str:
    return unbroken(", ".join(f"{100 * part:.1f}" for part in one.shares))


def _labels(wrong: float) -> str:
    return f"{100 * wrong:g} % of the labels wrong" if wrong else "labels as pushed"


def _effort(effort: float) -> str:
    steps = (
        f"Every training takes {100 * effort:g} % of the usual number of steps, where a backend counts them"
    )
    short = ": what is wrong after it may be for want of steps, and is not all for want of pushes"
    return f"{steps}{short if effort < 1 else ''}."
