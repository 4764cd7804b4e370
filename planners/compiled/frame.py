"""What stands around the tasks of every kernel: its helpers, its two entries, and how it fails."""

from __future__ import annotations

from textwrap import indent
from typing import Final

from planners.compiled.tables import CALLS, ENDED, SHORT

TOO_LONG: Final = -1
"""An episode passed its limit of steps."""
NO_SCHEDULE: Final = -2
"""A task had more episodes than the schedules' tables are long."""
STUCK: Final = -3
"""A task had nothing to call; the task and the state stand in `trouble`."""

TABLES: Final = "words, rows, links, values"
"""What functions that only look are given."""
ACTING: Final = f"{TABLES}, key, scratch, trouble, first, after, reward, up_to"
"""What functions that act are given."""
LEARNING: Final = f"{ACTING}, counts, at, schedule, length"
"""What functions that learn are given."""

HEAD: Final = f'''\
"""Generated: the learner of a ground task graph."""

import math

import numpy as np

from worlds.jit import below, kernel, lowest, moved, ones, pointer, uniform, without_lowest

ENDED = np.uint64(1 << {ENDED})
SHORT = np.uint64(1 << {SHORT})
NONE = np.uint64(0)
WORST = -np.inf


@kernel(cached=False, forceinline=True)
def nth(words, span, n):
    for j in range(span):
        rest = words[j]
        here = ones(rest)
        if n < here:
            for _ in range(n):
                rest = without_lowest(rest)
            return {CALLS} * j + lowest(rest)
        n -= here
    return 0


@kernel(cached=False, forceinline=True)
def boltzmann(q, words, span, draw, temperature):
    most = WORST
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            most = q[k] if q[k] > most else most
    total = 0.0
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            q[k] = math.exp((q[k] - most) / temperature)
            total += q[k]
    k = 0
    for j in range(span):
        rest = words[j]
        while rest != NONE:
            k = {CALLS} * j + lowest(rest)
            rest = without_lowest(rest)
            draw -= q[k] / total
            if draw < 0.0:
                return k
    return k
'''
"""The beginning of every kernel's module."""

_WORLD: Final = "uint64[::1], int32[::1], int64[:, ::1], int32[::1], int32[::1], float64[::1], float64[::1]"
_POINTERS: Final = """\
    words, rows, links = pointer(words_), pointer(rows_), pointer(links_)
    first, after = pointer(first_), pointer(after_)
    reward, up_to, trouble, scratch = pointer(reward_), pointer(up_to_), pointer(trouble_), pointer(scratch_)
"""


def learn_entry(call: str) -> str:
    """Return the entry that learns: all episodes of some runs, each by a call of a task from state `s`."""
    return f"""
@kernel(
    "int64(int64[::1], int64, int64, uint64[::1], int64[::1], float64[:, ::1], int64[:, ::1], int64[::1], "
    "float64[::1], int64, int64[::1], int64, int64, int32[:, ::1], {_WORLD}, int64[::1], float64[::1])"
)
def learn(
    me, low, high, keys, counters, values_, counts_, at_, schedule_, length, starts, episodes, limit, steps,
    words_, rows_, links_, first_, after_, reward_, up_to_, trouble_, scratch_,
):
{_POINTERS}    at, schedule = pointer(at_), pointer(schedule_)
    for run in range(low, high):
        key, c = keys[run], counters[run]
        values = moved(pointer(values_), run * values_.shape[1])
        counts = moved(pointer(counts_), run * counts_.shape[1])
        t = np.int64(0)
        for episode in range(episodes):
            c += 1
            s = starts[below(key, c, starts.size)]
            left = limit
{indent(call, " " * 12)}
            if t < 0:
                trouble[2], trouble[3] = run, episode
                return t
            steps[run, episode] = limit - left
        counters[run] = c
    return 0
"""


def follow_entry(call: str) -> str:
    """Return the entry that follows greedy policies: of some runs from all starts, by a call of a task."""
    return f"""
@kernel(
    "int64(int64[::1], int64, int64, uint64[::1], int64[::1], float64[:, ::1], int64[::1], int64, "
    "int64[:, ::1], {_WORLD}, int64[::1], float64[::1])"
)
def follow(
    me, low, high, keys, counters, values_, starts, limit, steps,
    words_, rows_, links_, first_, after_, reward_, up_to_, trouble_, scratch_,
):
{_POINTERS}    for run in range(low, high):
        key, c = keys[run], counters[run]
        values = moved(pointer(values_), run * values_.shape[1])
        t = np.int64(0)
        for start in range(starts.size):
            s = starts[start]
            left = limit
{indent(call, " " * 12)}
            if t == {STUCK}:
                trouble[2], trouble[3] = run, start
                return t
            steps[run, start] = -1 if t < 0 else limit - left
        counters[run] = c
    return 0
"""
