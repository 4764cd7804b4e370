"""The sections of the comparison of perception backends: what each says, with its figures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Final

import numpy as np

from comparisons.figures_perception import (
    Bar,
    confusion_figure,
    contact_sheet_figure,
    reliability_figure,
    robustness_figure,
    scenes_figure,
)
from comparisons.intervals import wilson
from comparisons.perception_price import Price
from comparisons.perception_study import SCENES, UNKNOWN, VARIED, Score, Seen
from comparisons.perception_words import between, interval, unbroken, with_interval, words
from comparisons.report import Section, Table, Value
from comparisons.story_parts import Part, percent, share
from perception.corruptions import HELD_OUT
from perception.protocol import LABELS

_MOST_MISTAKES: Final = 21  # on one contact sheet


def score_of(seen: Seen, backend: str, condition: str, severity: int) -> Score:
    """Return the score of a backend on a set of frames."""
    return next(
        s for s in seen.scores if (s.backend, s.condition, s.severity) == (backend, condition, severity)
    )


def _bar(score: Score) -> Bar:
    return score.severity, score.accuracy, *score.interval


def _row(score: Score) -> tuple[str, ...]:
    answered = score.frames - score.abstained
    return (
        with_interval(score.accuracy, *score.interval),
        f"{score.calibration_error:.3f}",
        share(score.abstained, score.frames),
        share(score.answered_right, answered),
        share(score.distance_right, score.found),
    )


_MEASURES: Final = ("right, %", "calibration error", "abstains", "if it answers", "distance")


def scenes_section(seen: Seen) -> Part:
    """Report how right each backend is on every set of scenes."""
    bars = {c: {name: _bar(score_of(seen, name, c, 0)) for name in seen.backends} for c in SCENES}
    rows = tuple(
        (unbroken(c), name, *_row(score_of(seen, name, c, 0))) for c in SCENES for name in seen.backends
    )
    text = (
        "Each set varies the paper's maze in one respect, and the last in all of them. A frame counts as "
        "right if its likeliest label is the true one, whether or not the backend would rather abstain."
    )
    table = Table(
        "Right labels by set of scenes, with 95 % intervals.", ("scenes", "backend", *_MEASURES), rows
    )
    caption = "Right labels by set of scenes, with Wilson's 95 % intervals."
    section = Section("Scenes", (text,), (("scenes", caption),), (table,))
    return Part(section, {"scenes": scenes_figure(bars)})


def corruptions_section(seen: Seen) -> Part:
    """Report how right each backend stays when frames are spoilt."""
    spoilt = dict.fromkeys((one.condition, one.severity) for one in seen.scores if one.severity)
    panels = {
        _starred(condition): {
            name: [
                (0.0, *_bar(score_of(seen, name, "clean", 0))[1:]),
                *(_bar(s) for s in seen.scores if (s.backend, s.condition) == (name, condition)),
            ]
            for name in seen.backends
        }
        for condition in dict.fromkeys(condition for condition, _ in spoilt)
    }
    rows: list[tuple[Value, ...]] = []
    for condition, severity in spoilt:
        own = (score_of(seen, name, condition, severity) for name in seen.backends)
        cells = (with_interval(one.accuracy, *one.interval) for one in own)
        rows.append((_starred(condition), severity, *cells))
    text = "The clean frames, spoilt in one way at a time, from severity 1 (slight) to 5 (severe)."
    footnote = (
        "* No backend that comes with the package was trained on these: they measure what it makes of the "
        "unforeseen. They were not all unforeseen by its makers: Hough's median filter and contrast stretch "
        "were chosen after some of them had been looked at, on other frames (docs/perception-hough.md)."
    )
    header = ("corruption", "severity", *seen.backends)
    table = Table("Right labels by corruption and severity, in %, with 95 % intervals.", header, tuple(rows))
    caption = "Right labels by corruption and severity; bands are 95 % intervals, severity 0 is clean."
    section = Section("Corruptions", (text, footnote), (("corruptions", caption),), (table,))
    return Part(section, {"corruptions": robustness_figure(panels)})


def _starred(condition: str) -> str:
    return unbroken(words(condition) + (" *" if condition in HELD_OUT else ""))


def confusions_section(seen: Seen) -> Part:
    """Show what each backend takes for what."""
    figures, named = {}, []
    for i, name in enumerate(seen.backends):
        figures[f"confusion_{i + 1}"] = confusion_figure(score_of(seen, name, VARIED, 0).confusion, LABELS)
        named.append((f"confusion_{i + 1}", f"What {name} takes the varied frames for."))
    return Part(Section("Confusion", figures=tuple(named)), figures)


def reliability_section(seen: Seen) -> Part:
    """Report whether confidence means what it says."""
    panels = {
        name: {
            title: (found.confidence, found.accuracy, found.counts)
            for title, found in zip(("scenes", "corrupted"), both, strict=True)
        }
        for name, both in seen.reliability.items()
    }
    rows = tuple((name, f"{a.error:.3f}", f"{b.error:.3f}") for name, (a, b) in seen.reliability.items())
    text = (
        "A backend that is 80 % sure should be right in 80 of 100 frames. The expected calibration error is "
        "the mean distance from that, in 15 bins of confidence; dots grow with the frames in their bin."
    )
    table = Table("Expected calibration error.", ("backend", "all scenes", "all corrupted frames"), rows)
    caption = "Share of right labels by confidence."
    section = Section("Reliability", (text,), (("reliability", caption),), (table,))
    return Part(section, {"reliability": reliability_figure(panels)})


def audit_section(seen: Seen) -> Part:
    """Report accuracy by what a label must not hang on."""
    groups = list(dict.fromkeys((one.by, one.group, one.frames) for one in seen.groups))
    found = {(one.backend, one.by, one.group): one for one in seen.groups}
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (by, group, frames, *(share(found[name, by, group].right, frames) for name in seen.backends))
        for by, group, frames in groups
    )
    spread = tuple(
        (name, *(percent(_spread(seen, name, by)) for by in dict.fromkeys(one.by for one in seen.groups)))
        for name in seen.backends
    )
    text = (
        "A backend that took a short cut, such as colour or scale, is right about one group of obstacles and "
        "wrong about another. These are the varied frames with something in the way."
    )
    kinds = tuple(dict.fromkeys(one.by for one in seen.groups))
    tables = (
        Table("Right labels by group.", ("by", "group", "frames", *seen.backends), rows),
        Table("Best group less worst, among those of 10 frames or more.", ("backend", *kinds), spread),
    )
    return Part(Section("Short cuts", (text,), tables=tables))


def _spread(seen: Seen, backend: str, by: str) -> float:
    shares = [
        g.right / g.frames for g in seen.groups if (g.backend, g.by) == (backend, by) and g.frames >= 10
    ]
    return max(shares) - min(shares) if shares else 0.0


def strangers_section(seen: Seen) -> Part:
    """Report what becomes of solids that no backend has learnt."""
    found = {(one.backend, one.family): one for one in seen.strangers}
    rows: list[tuple[Value, ...]] = []
    for family in UNKNOWN:
        first = found[seen.backends[0], family]
        still = first.frames - first.rolled
        called = (share(found[name, family].false_rollable, still) for name in seen.backends)
        rows.append((family, first.frames, first.rolled, *called))
    totals: list[tuple[Value, ...]] = []
    for name in seen.backends:
        own = [one for one in seen.strangers if one.backend == name]
        strange = [one for one in own if one.family != "sphere"]
        false, still = sum(o.false_rollable for o in strange), sum(o.frames - o.rolled for o in strange)
        balls = [one for one in own if one.family == "sphere"]
        accepted, rolled = sum(o.accepted for o in balls), sum(o.rolled for o in balls)
        totals.append(
            (
                name,
                *(share(false, still), interval(*wilson(false, still))),
                *(share(accepted, rolled), interval(*wilson(accepted, rolled))),
            )
        )
    text = (
        "Solids that no training set holds stand in the way. Calling one a sphere, without abstaining, has "
        "the robot push what does not roll; abstaining has it push and learn. The goal is at most 5 % false, "
        "with at least 90 % of the balls accepted."
    )
    header = ("backend", "false rollable", "95 % interval", "balls accepted", "95 % interval")
    each = ("solid", "frames", "rolled when pushed", *seen.backends)
    tables = (
        Table("All of them together.", header, tuple(totals)),
        Table("One by one: false rollable.", each, tuple(rows)),
    )
    return Part(Section("Solids never learnt", (text,), tables=tables))


def latency_section(seen: Seen) -> Part:
    """Report how long a look takes."""
    rows = tuple(
        (name, f"{median(times):.2f} ms", f"{float(np.quantile(times, 0.95)):.2f} ms")
        for name, times in seen.latency.items()
    )
    text = "Wall time of one frame looked at alone, on this machine; no two runs share these numbers."
    table = Table("Latency.", ("backend", "median", "95 of 100 are below"), rows)
    return Part(Section("Latency", (text,), tables=(table,)))


def prices_section(prices: Sequence[Price]) -> Part:
    """Report what mistakes cost the robot in its task."""
    rows: list[tuple[Value, ...]] = []
    errors: list[tuple[Value, ...]] = []
    ends: list[tuple[Value, ...]] = []
    for one in prices:
        where = unbroken(words(one.condition) + (f" {one.severity}" if one.severity else ""))
        low, high = one.success
        reached = f"{one.reached} of {one.episodes} " + between(f"{100 * low:.0f}", f"{100 * high:.0f} %")
        extra = f"{one.extra:.2f} " + between(f"{one.extra_low:.2f}", f"{one.extra_high:.2f}")
        wrong = f"{one.wrong} of {one.asked}"
        rows.append((one.backend, where, unbroken(reached), unbroken(extra), one.blocked, wrong))
        mistaken = (one.cube_as_sphere, one.sphere_as_cube, one.missed, one.imagined)
        errors.append((one.backend, where, one.looks, *mistaken))
        ends.append((one.backend, where, *one.outcomes.values()))
    text = (
        "The same random episodes of the paper's task for every backend, as seen through the camera and "
        "through a spoilt one. A cube taken for a sphere costs a blocked step, a sphere taken for a cube a "
        "detour. Extra steps are counted in the episodes that the truth ends at the goal as well; an "
        "affordance is wrong if it is no optimal first action once every known obstacle has its real shape."
    )
    which = ("backend", "frames")
    costs = ("goal reached", "extra steps", "blocked steps", "wrong affordances")
    errs = ("looks", "cube as sphere", "sphere as cube", "missed", "imagined")
    tables = (
        Table("What mistakes cost, with 95 % intervals.", (*which, *costs), tuple(rows)),
        Table("What was mistaken for what.", (*which, *errs), tuple(errors)),
        Table("How the episodes ended.", (*which, *prices[0].outcomes), tuple(ends)),
    )
    return Part(Section("The price of mistakes", (text,), tables=tables))


def mistakes_section(seen: Seen) -> list[Part]:
    """Show the mistakes; nothing if there are none."""
    figures, named = {}, []
    for i, name in enumerate(seen.backends):
        own = sorted(
            (m for m in seen.mistakes if m.backend == name), key=lambda m: (m.severity, -m.confidence)
        )
        items = [
            (
                f"{words(m.condition)}{f' {m.severity}' if m.severity else ''}\n"
                f"{m.truth}, seen as\n{m.seen} ({100 * m.confidence:.0f} %)",
                m.frame,
            )
            for m in own[:_MOST_MISTAKES]
        ]
        if items:
            figures[f"mistakes_{i + 1}"] = contact_sheet_figure(items)
            named.append(
                (f"mistakes_{i + 1}", f"Mistakes of {name}: its surest of each set, the mildest first.")
            )
    return [Part(Section("Mistakes", figures=tuple(named)), figures)] if figures else []
