"""Tests of paired differences, and their correction for there being many."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Final

import numpy as np
from scipy.stats import norm, rankdata

from comparisons.study.results.resampling import Array

SIGNIFICANT: Final = 0.05
"""A difference is told as one where p is below this."""
_MOST_EXACT: Final = 200  # pairs; the exact distribution takes some 10 ms then


def signed_rank(gaps: Sequence[float] | Array) -> float:
    """Return the p value of Wilcoxon's signed-rank test, both sides, of paired differences.

    Pairs that do not differ are left out, as Wilcoxon does (Biometrics Bulletin 1, 1945); equal ones share
    their middle rank, and infinite ones come last. Up to 200 pairs, the distribution is that of all ways to
    give these very ranks signs, so that ties do not make it less exact; beyond, it is the normal one of the
    same mean and variance.

    Examples
    --------
    >>> signed_rank([1.0, 2.0, 3.0, 4.0, 5.0, float("inf")]), signed_rank([1.0, 1.0, 1.0, -1.0])
    (0.03125, 0.625)
    >>> signed_rank([0.0, 0.0])
    1.0
    """
    given = np.asarray(gaps, dtype=np.float64)
    given = given[given != 0]
    if not len(given):
        return 1.0
    ranks = rankdata(np.abs(given))
    above = float(ranks[given > 0].sum())
    if len(given) > _MOST_EXACT:
        spread = sqrt(float((ranks**2).sum())) / 2
        return float(2 * norm.sf(abs(above - ranks.sum() / 2) / spread))
    # Middle ranks are multiples of a half: doubled, sums of them are places in an array.
    doubled = np.rint(2 * ranks).astype(np.int64)
    chances = np.zeros(int(doubled.sum()) + 1)
    chances[0] = 1.0
    for rank in doubled:
        shifted = np.concatenate([np.zeros(rank), chances[: len(chances) - rank]])
        chances = (chances + shifted) / 2
    place = round(2 * above)
    return float(min(2 * min(chances[: place + 1].sum(), chances[place:].sum()), 1.0))


def leaning(gaps: Sequence[float] | Array) -> int:
    """Return which sign has the larger sum of ranks in that test; 0 if neither has.

    >>> leaning([-1.0, 2.0, 3.0]), leaning([-1.0, -2.0, 3.0]), leaning([0.0])
    (1, 0, 0)
    """
    given = np.asarray(gaps, dtype=np.float64)
    given = given[given != 0]
    return int(np.sign((np.sign(given) * rankdata(np.abs(given))).sum()))


def least_p(pairs: int) -> float:
    """Return the least p value that so many pairs can have: all differ, and all the same way.

    >>> least_p(5), least_p(6)
    (0.0625, 0.03125)
    """
    return float(2.0 ** (1 - pairs))


def holm(values: Sequence[float]) -> list[float]:
    """Return p values corrected for there being many: Holm, Scandinavian Journal of Statistics 6 (1979).

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    order = sorted(range(len(values)), key=lambda i: values[i])
    corrected, least = [0.0] * len(values), 0.0
    for place, i in enumerate(order):
        least = max(least, min((len(values) - place) * values[i], 1.0))
        corrected[i] = least
    return corrected
