"""Any finite world as a transition model: variables, actions, and a function that says what follows."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from keyword import iskeyword
from math import isfinite
from numbers import Real
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from worlds.errors import UserError, suggest
from worlds.model import TransitionModel
from worlds.variables import StateIndex, Variable

State = Any
"""A state as a named tuple with a field for each variable; Any, since its fields are the user's."""
Values = Sequence[Hashable] | Mapping[str, Hashable]
"""A state's values in variable order, or those that change by name."""
Outcomes = tuple[Values, float] | Iterable[tuple[float, Values, float]]
"""One next state and its reward; or several, each with its probability before it."""

_SLACK: Final = 1e-9  # how far probabilities may sum from 1: what adding thirds and tenths leaves


class WorldError(UserError):
    """A world's description is wrong; the message names the state, the action and the mend."""


def finite_world(
    variables: Sequence[Variable],
    actions: str | Sequence[str],
    outcomes: Callable[[State, str], Outcomes],
    starts: Callable[[State], bool] | Iterable[Values],
    *,
    ends: Callable[[State], bool] | None = None,
) -> TransitionModel:
    """Return the transition model of a finite world that is given by what follows each action.

    Parameters
    ----------
    variables
        The state variables; their names must be fit for fields of a named tuple.
    actions
        Names of the primitive actions, in the order that breaks ties; one string of names will do.
    outcomes
        What an action does in a state: ``outcomes(state, action)`` returns the next state and the reward,
        or, where chance has a say, triples of probability, next state and reward. The state is a named
        tuple; a next state is its values in variable order (``state._replace(x=1)``) or a mapping of
        those that change (``{"x": 1}``). Every joint state is asked about, whether or not it can occur.
    starts
        Where an episode may begin: a condition on a state, or the states themselves, all values given.
    ends
        Where an episode is over. Such a state keeps to itself at no reward, and `outcomes` is not asked.

    Raises
    ------
    WorldError
        If a variable's or action's name will not do, there is no start, or some outcomes are wrong: none,
        probabilities that do not sum to 1, a value outside its variable's domain, a reward that is no number.

    Examples
    --------
    A robot in a corridor opens the door at its end, which sticks in one of four cases.

    >>> x, door = Variable("x", (0, 1, 2)), Variable("door", ("shut", "open"))
    >>> def outcomes(state, action):
    ...     if action == "right":
    ...         return {"x": min(state.x + 1, 2)}, -1
    ...     if state.x == 2:
    ...         return [(0.75, {"door": "open"}, 10), (0.25, state, -1)]
    ...     return state, -1
    >>> model = finite_world([x, door], "right push", outcomes, starts=[(0, "shut")])
    >>> state = model.index.number((2, "shut"))
    >>> model.actions, model.is_deterministic, float(model.rewards[state, 1])
    (('right', 'push'), False, 7.25)
    """
    index = StateIndex(tuple(variables))
    names = tuple(actions.split() if isinstance(actions, str) else actions)
    if len(set(names)) != len(names) or not names:
        raise WorldError(
            f"actions {', '.join(names) or 'none'}: give at least one, and each a name of its own"
        )
    reader = _Reader(index)
    table: list[list[list[tuple[float, int, float]]]] = []
    over = np.zeros(index.size, dtype=np.bool_)
    for number, values in enumerate(index):
        state = reader.state(*values)
        over[number] = ends is not None and bool(ends(state))
        if over[number]:
            table.append([[(1.0, number, 0.0)] for _ in names])
        else:
            table.append([reader.outcomes(state, action, outcomes) for action in names])
    arrays = _arrays(table, index.size)
    return TransitionModel(
        index, names, arrays.after, arrays.rewards, reader.starts(starts), probabilities=arrays.chances
    )


@dataclass(frozen=True, eq=False)
class _Arrays:
    """Outcomes as arrays of shape (states, actions, outcomes); those of probability 0 fill up."""

    after: NDArray[np.int64]
    rewards: NDArray[np.float64]
    chances: NDArray[np.float64]


def _arrays(table: list[list[list[tuple[float, int, float]]]], states: int) -> _Arrays:
    most = max(len(found) for row in table for found in row)
    shape = (states, len(table[0]), most)
    # A filler stays in its own state, so that it hints at no step which the world does not have.
    after = np.broadcast_to(np.arange(states)[:, None, None], shape).copy()
    rewards, chances = np.zeros(shape), np.zeros(shape)
    for number, row in enumerate(table):
        for action, found in enumerate(row):
            for place, (chance, to, reward) in enumerate(found):
                after[number, action, place] = to
                rewards[number, action, place] = reward
                chances[number, action, place] = chance
    return _Arrays(after, rewards, chances)


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads what a user's functions return, and says where it is wrong."""

    index: StateIndex
    state: Callable[..., State] = field(init=False)

    def __post_init__(self) -> None:
        for name in self.index.names:
            if not name.isidentifier() or iskeyword(name) or name.startswith("_"):
                problem = f"variable {name!r}: the name cannot be a field of a named tuple"
                raise WorldError(f"{problem}; use letters, digits and underscores")
        object.__setattr__(self, "state", namedtuple("State", self.index.names))  # noqa: PYI024

    def outcomes(
        self, state: State, action: str, function: Callable[[State, str], Outcomes]
    ) -> list[tuple[float, int, float]]:
        """Return the outcomes of an action that occur: probability, number of the next state, reward."""
        where = f"{self._words(state)}, action {action}"
        try:
            given = function(state, action)
        except Exception as error:
            error.add_note(f"while the outcomes were asked for in {where}")
            raise
        found: dict[tuple[int, float], float] = {}
        for chance, values, reward in self._triples(given, where):
            if not isinstance(chance, Real) or not 0 <= float(chance) <= 1 + _SLACK:
                _fail(where, f"the probability {chance!r} is not between 0 and 1", "mend it")
            if not isinstance(reward, Real) or not isfinite(reward):
                _fail(where, f"the reward {reward!r} is not a finite number", "return a number")
            key = (self._number(state, values, where), float(reward))
            if float(chance) > 0:
                found[key] = found.get(key, 0.0) + float(chance)
        total = sum(found.values())
        if abs(total - 1) > _SLACK:
            mend = "give every outcome, 'nothing happens' included"
            _fail(where, f"the probabilities sum to {total:.10g}, not to 1", mend)
        return [(chance, to, reward) for (to, reward), chance in found.items()]

    def _triples(self, given: Any, where: str) -> list[tuple[Any, Any, Any]]:
        """Return outcomes with their probabilities, which a single outcome need not give."""
        if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Real):
            return [(1.0, *given)]
        mend = "return (next state, reward), or a list of (probability, next state, reward)"
        if not isinstance(given, Iterable) or isinstance(given, str):
            _fail(where, f"the outcomes are {given!r}", mend)
        triples = list(given)
        for triple in triples:
            if not isinstance(triple, tuple | list) or len(triple) != 3:
                _fail(where, f"an outcome is {triple!r}", mend)
        return triples

    def starts(self, given: Callable[[State], bool] | Iterable[Values]) -> NDArray[np.bool_]:
        """Return the mask of the starts, shape (states,)."""
        if callable(given):
            mask = np.array([bool(given(self.state(*values))) for values in self.index], dtype=np.bool_)
        else:
            mask = np.zeros(self.index.size, dtype=np.bool_)
            for values in given:
                mask[self._number(None, values, f"start {values!r}")] = True
        if not mask.any():
            raise WorldError("no state is a start; give at least one state in which an episode may begin")
        return mask

    def _number(self, state: State | None, values: Any, where: str) -> int:
        """Return the number of a next state or a start."""
        if isinstance(values, Mapping):
            values = self._merged(state, values, where)
        refuse_if_no_state(values, self.index.variables, where)
        return self.index.number(values)

    def _merged(self, state: State | None, changes: Mapping[str, Hashable], where: str) -> tuple[Any, ...]:
        for name in changes:
            if name not in self.index.names:
                _fail(
                    where, f"there is no variable {name!r}", suggest(str(name), self.index.names, "there are")
                )
        missing = [name for name in self.index.names if name not in changes]
        if state is None and missing:
            _fail(where, f"no value for {', '.join(missing)}", "give a start all its values")
        return tuple(changes[name] if name in changes else getattr(state, name) for name in self.index.names)

    def _words(self, state: State) -> str:
        named = zip(self.index.variables, state, strict=True)
        return "state " + ", ".join(f"{variable.name} = {variable.label(value)}" for variable, value in named)


def refuse_if_no_state(values: Any, variables: Sequence[Variable], where: str) -> None:
    """Raise a WorldError unless `values` are one value of each variable, in order.

    >>> refuse_if_no_state((3,), [Variable("x", (0, 1))], "start")
    Traceback (most recent call last):
    worlds.finite.WorldError: start: x would be 3, which is outside its domain; its values are 0, 1
    """
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) != len(variables):
        names = ", ".join(variable.name for variable in variables)
        _fail(where, f"{values!r} is no state", f"give {len(variables)} values: {names}")
    for variable, value in zip(variables, values, strict=True):
        if not _belongs(value, variable):
            problem = f"{variable.name} would be {value!r}, which is outside its domain"
            _fail(where, problem, f"its values are {_listed(variable.labels)}")


def _belongs(value: Any, variable: Variable) -> bool:
    try:
        return value in variable
    except TypeError:  # a list, say, which cannot be hashed
        return False


def _listed(labels: Sequence[str], most: int = 8) -> str:
    return ", ".join(labels[:most]) + (f", ... ({len(labels)} in all)" if len(labels) > most else "")


def _fail(where: str, problem: str, mend: str) -> NoReturn:
    raise WorldError(f"{where}: {problem}; {mend}")
