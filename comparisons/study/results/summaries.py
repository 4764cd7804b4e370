"""A study's tables: what was measured at each combination of levels, and how levels compare."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite

from comparisons.study.kinds import Measure
from comparisons.study.results.paired import Comparison
from comparisons.study.results.question import Told
from comparisons.study.results.rows import Levelled, Row, by_levels
from comparisons.study.results.samples import FEWEST_SEEDS, samples_of
from comparisons.study.results.sizes import warning
from comparisons.study.results.statistics import Estimate, Interval, estimate
from comparisons.study.results.tables import Table
from comparisons.study.results.wording import chance_of, counted, decimals_of, plain, ratio_decimals, spread

_CALLED = {"iqm": "interquartile mean", "median": "median", "mean": "mean"}
_FEW = "*"  # marks estimates of few seeds
_NOTHING = "\N{EN DASH}"


def study_table(
    rows: Sequence[Row],
    measures: Sequence[Measure],
    *,
    statistic: str = "iqm",
    missing: Iterable[Levelled] = (),
    failed: Iterable[Levelled] = (),
    caption: str = "What was measured",
) -> Table:
    """Return a table of estimates: a row for each combination of levels, a column for each measure.

    Parameters
    ----------
    rows
        Runs with their results, in the plan's order.
    measures
        What to show.
    statistic
        "iqm", "median" or "mean".
    missing
        Planned runs without a result, failed ones among them.
    failed
        Those of them that failed.
    caption
        The table's.

    Examples
    --------
    >>> from comparisons.study.kinds import Result
    >>> steps = Measure("steps_to_goal", "steps to the goal", "steps", "less")
    >>> rows = [Row({"gamma": "1"}, seed, "", Result({steps.name: 10.0 + seed % 2})) for seed in range(8)]
    >>> table = study_table(rows, [steps])
    >>> table.columns, table.rows
    (('gamma', 'steps to goal', 'seeds', 'failed'), (('1', '10.5 (10.0 to 11.0)', '8', '0'),))
    """
    absent, broken = list(missing), list(failed)
    factors = list(next(iter([*rows, *absent])).levels) if rows or absent else []
    here = by_levels(rows, factors)
    gone, lost = by_levels(absent, factors), by_levels(broken, factors)
    shown, few, untold = [], False, False
    for levels in by_levels([*rows, *absent], factors):
        alike = here.get(levels, [])
        cells = []
        for measure in measures:
            found = estimate(samples_of(alike, measure), statistic)
            few |= found is not None and found.few
            untold |= found is not None and found.untold > 0
            cells.append(_cell(found, measure))
        planned = len(alike) + len(gone.get(levels, []))
        seeds = str(len(alike)) if planned == len(alike) else f"{len(alike)} of {planned}"
        shown.append((*levels, *cells, seeds, str(len(lost.get(levels, [])))))
    heads = (*factors, *(measure.name.replace("_", " ") for measure in measures), "seeds", "failed")
    return Table(
        heads, tuple(shown), caption, _note(measures, statistic, few=few, untold=untold), len(factors)
    )


def comparisons_table(
    told: Sequence[Told], measure: Measure, caption: str = "How the levels compare"
) -> Table:
    """Return a table of comparisons: a row for each.

    Parameters
    ----------
    told
        The comparisons, of one question.
    measure
        What they compare.
    caption
        The table's.
    """
    within = list(told[0].within) if told else []
    factor = told[0].factor if told else "level"
    heads = (*within, factor, "against", "ratio", "difference", "better in", "pairs", "p", "p corrected")
    rows = tuple(
        (
            *(each.within[name] for name in within),
            each.level,
            each.against,
            *_compared(each.comparison, measure),
        )
        for each in told
    )
    called = _CALLED[told[0].comparison.statistic] if told and told[0].comparison else "statistic"
    tests = max((each.comparison.tests for each in told if each.comparison), default=1)
    note = (
        f"Of {measure.about}: ratio and difference of the {called}s of runs paired by seed, with 95 % "
        "intervals; the share of all pairs of runs in which the level is better; p of Wilcoxon's signed-rank "
        f"test, and after Holm's correction for {counted(tests, 'comparison')}. Not ranked where there are "
        f"fewer than {FEWEST_SEEDS} seeds."
    )
    if mixed := warning(
        max((each.comparison.apart for each in told if each.comparison), default=1.0), measure
    ):
        note += f" {mixed}"
    return Table(heads, rows, caption, note, len(within) + 2)


def _compared(comparison: Comparison | None, measure: Measure) -> tuple[str, ...]:
    if comparison is None:
        return (_NOTHING,) * 3 + ("0",) + (_NOTHING,) * 2
    ratio, chance = comparison.ratio, comparison.chance
    share = Measure("chance", "chance")
    ranked = (_NOTHING, _NOTHING)
    if not comparison.few:
        ranked = (_p(comparison.p), _p(comparison.corrected))
    return (
        _NOTHING if ratio is None else _unlimited(ratio, ratio_decimals),
        _difference(comparison.difference, measure),
        _NOTHING if chance is None or comparison.few else _spread(chance, share),
        str(comparison.pairs),
        *ranked,
    )


def _unlimited(interval: Interval, decimals_of: Callable[[float, float, float], int]) -> str:
    """Return a ratio or a difference, which may be infinite."""
    decimals = decimals_of(interval.value, interval.low, interval.high)
    value, low, high = (
        plain(bound, decimals) if isfinite(bound) else ("infinite" if bound > 0 else "-infinite")
        for bound in (interval.value, interval.low, interval.high)
    )
    if not interval.bounded:
        return f"{value} (no interval)"
    return value if low == high and not isfinite(interval.low) else f"{value} ({low} to {high})"


def _difference(difference: Interval | None, measure: Measure) -> str:
    if difference is None:
        return _NOTHING
    if not measure.unit:
        values = (100 * bound for bound in (difference.value, difference.low, difference.high))
        return f"{_unlimited(Interval(*values), decimals_of)} points"
    return _unlimited(difference, decimals_of)


def _spread(interval: Interval, measure: Measure) -> str:
    return spread(interval.value, interval.low, interval.high, measure)


def _p(value: float) -> str:
    return chance_of(value).removeprefix("p ").removeprefix("= ")


def _cell(found: Estimate | None, measure: Measure) -> str:
    if found is None:
        return _NOTHING
    text = f"{_spread(found, measure)}{_FEW * found.few}"
    if found.reached < found.runs:
        text += f", {found.reached} of {found.runs} got there"
    return f"{text}, {found.untold} without" if found.untold else text


def _note(measures: Sequence[Measure], statistic: str, *, few: bool, untold: bool) -> str:
    """Return what the columns are."""
    about: Mapping[str, str] = {measure.name.replace("_", " "): measure.about for measure in measures}
    units = {measure.name.replace("_", " "): measure.unit for measure in measures}
    parts = [f"{name}: {text}" + f" ({units[name]})" * bool(units[name]) for name, text in about.items()]
    marks = f" {_FEW} fewer than {FEWEST_SEEDS} seeds: not to be ranked." if few else ""
    marks += " Without: runs in which there was nothing of it to measure." * untold
    return f"Each is the {_CALLED[statistic]} over seeds with its 95 % interval. {'; '.join(parts)}.{marks}"
