"""The transition model of a Gymnasium environment that exposes one: Taxi, FrozenLake, CliffWalking."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from numbers import Real
from typing import Any, Final

from gymnasium import Env
from gymnasium.envs.toy_text.cliffwalking import CliffWalkingEnv
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from gymnasium.envs.toy_text.taxi import TaxiEnv

from worlds.finite import Outcomes, State, WorldError, finite_world, refuse_if_no_state
from worlds.layout import Cell
from worlds.model import TransitionModel
from worlds.taxi import ABOARD, DELIVERED, SITES, changes_of_mind, taxi_variables
from worlds.variables import Variable

Decode = Callable[[int], Sequence[Hashable]]
"""Turns an observation's number into values of the state variables."""


@dataclass(frozen=True)
class _Reading:
    """How an environment's numbers are read; `ended` is the variable and value of an episode that is over."""

    variables: tuple[Variable, ...]
    decode: Decode
    actions: tuple[str, ...]
    ended: tuple[str, Hashable] | None = None
    fickle: float = 0.0


def gym_model(
    env: Env[Any, Any],
    *,
    variables: Sequence[Variable] | None = None,
    decode: Decode | None = None,
    actions: str | Sequence[str] | None = None,
    ended: tuple[str, Hashable] | None = None,
    starts: Iterable[int] | None = None,
) -> TransitionModel:
    """Return the model of an environment that exposes it as ``P[state][action]``.

    Entries of P are (probability, next state, reward, done). Wrappers are looked through, so that a time
    limit is no part of the model. Taxi, FrozenLake and CliffWalking are read without further words: as
    taxi, passenger and destination (and `mind`, see below), and as cell. Any other environment is read as
    one variable `state` and actions `action0`, `action1`, ..., unless told otherwise.

    How an episode ends: without `ended`, a state that a done transition leads to keeps to itself at no
    reward, which is refused if it can be reached without the episode ending, too. With ``ended=(name,
    value)``, a done transition sets that variable to that value, and such states keep to themselves.

    A fickle passenger of Taxi is not in P: the environment draws at each reset, unseen, whether he will
    change his mind. Drawing it as the taxi first moves with him aboard gives the same episodes and is
    Markov once the variable `mind` tells whether that has happened; so is it done here.

    Parameters
    ----------
    env
        The environment, its observations and actions discrete and counted from 0.
    variables, decode
        The state variables, and the function that gives their values for an observation; both or neither.
        Every observation has values, and no two have the same. Joint states that are no observation keep to
        themselves.
    actions
        Names of the actions, by number; one string of names will do.
    ended
        The variable, and its value, that tell an episode that is over.
    starts
        Observations that an episode may begin with, by default those that its
        ``initial_state_distrib`` gives a chance.

    Raises
    ------
    WorldError
        If the environment exposes no model, it cannot be read in this way, or its table is wrong; the
        message names the observation, and the action where there is one.

    Examples
    --------
    >>> import gymnasium
    >>> lake = gym_model(gymnasium.make("FrozenLake-v1"))
    >>> lake.actions, lake.index.shape, lake.is_deterministic
    (('Left', 'Down', 'Right', 'Up'), (16,), False)
    >>> taxi = gym_model(gymnasium.make("Taxi-v4", is_rainy=True))
    >>> taxi.index.names, taxi.index.shape, int(taxi.starts.sum())
    (('taxi', 'passenger', 'destination'), (25, 6, 4), 300)
    """
    base = env.unwrapped
    table = getattr(base, "P", None)
    if table is None or not hasattr(base.observation_space, "n") or not hasattr(base.action_space, "n"):
        problem = f"{type(base).__name__} exposes no model P over discrete observations and actions"
        raise WorldError(f"{problem}; describe the world with worlds.finite.finite_world instead")
    if getattr(base.observation_space, "start", 0) or getattr(base.action_space, "start", 0):
        problem = f"{type(base).__name__} counts its observations or actions from another number than 0"
        raise WorldError(f"{problem}; count both from 0, in P too")
    if (variables is None) != (decode is None):
        raise WorldError("variables and decode belong together; give both, or neither")
    reading = _reading(base)
    if variables is not None and decode is not None:
        reading = replace(reading, variables=tuple(variables), decode=decode, ended=ended, fickle=0.0)
        if getattr(base, "fickle_passenger", False):
            raise WorldError("a fickle passenger is not in P; leave variables and decode to gym_model")
    elif ended is not None:
        raise WorldError("ended names one of your variables; give variables and decode with it")
    if actions is not None:
        reading = replace(reading, actions=tuple(actions.split() if isinstance(actions, str) else actions))
    if len(reading.actions) != base.action_space.n:
        raise WorldError(f"{len(reading.actions)} names for {base.action_space.n} actions; give each one")
    return _World(base, table, reading).model(_first(base) if starts is None else list(starts))


def _first(base: Any) -> list[int]:
    """Return the observations that an episode may begin with."""
    chances = getattr(base, "initial_state_distrib", None)
    if chances is None:
        raise WorldError(f"{type(base).__name__} does not tell where an episode begins; give starts=[...]")
    return [number for number, chance in enumerate(chances) if chance > 0]


class _World:
    """An environment's table, read as states."""

    def __init__(self, base: Any, table: Any, reading: _Reading) -> None:
        self.table = table
        self.reading = reading
        self.width = len(reading.variables) - (reading.fickle > 0)
        self.values = [self._decoded(number) for number in range(int(base.observation_space.n))]
        self.numbers: dict[tuple[Hashable, ...], int] = {}
        for number, values in enumerate(self.values):
            if values in self.numbers:
                same = f"observations {self.numbers[values]} and {number} are both {values!r}"
                raise WorldError(f"{same}; let decode tell them apart")
            self.numbers[values] = number
        self._check_ended()

    def _decoded(self, number: int) -> tuple[Hashable, ...]:
        """Return the values of an observation."""
        try:
            given = self.reading.decode(number)
        except Exception as error:
            error.add_note(f"while observation {number} was decoded")
            raise
        values = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else given
        refuse_if_no_state(values, self.reading.variables[: self.width], f"decode of observation {number}")
        return tuple(values)

    def _entries(self, number: int, action: int) -> list[tuple[float, int, float, bool]]:
        """Return the entries of an action in an observation: probability, next one, reward, done."""
        where = f"P[{number}][{action}]"
        try:
            entries = list(self.table[number][action])
        except (LookupError, TypeError):
            mend = "each action needs entries in every observation from which an episode goes on"
            raise WorldError(f"{where} is missing; {mend}") from None
        for entry in entries:
            if not isinstance(entry, Sequence) or len(entry) != 4 or not isinstance(entry[0], Real):
                mend = "give (probability, next observation, reward, done)"
                raise WorldError(f"{where} has the entry {entry!r}; {mend}")
            self._check_observation(entry[1], f"{where} leads to")
        return entries

    def _check_observation(self, number: Any, where: str) -> None:
        """Refuse what is no observation's number."""
        if number not in range(len(self.values)):
            last = len(self.values) - 1
            raise WorldError(f"{where} {number!r}, which is no observation; they are 0 to {last}")

    def _check_ended(self) -> None:
        if self.reading.ended is None:
            return
        name, value = self.reading.ended
        by_name = {variable.name: place for place, variable in enumerate(self.reading.variables)}
        if name not in by_name or value not in self.reading.variables[by_name[name]]:
            listed = ", ".join(f"{v.name} ({', '.join(v.labels)})" for v in self.reading.variables)
            raise WorldError(f"ended: there is no {name} = {value!r}; variables and values: {listed}")
        taken = [
            n for n, values in enumerate(self.values) if values[by_name[name] : by_name[name] + 1] == (value,)
        ]
        if taken:
            problem = f"ended: observation {taken[0]} has {name} = {value!r} already"
            raise WorldError(f"{problem}; keep that value for episodes that are over")

    def model(self, starts: Sequence[int]) -> TransitionModel:
        """Return the model."""
        reading = self.reading
        for number in starts:
            self._check_observation(number, "starts: an episode would begin with")
        final = self._final(starts) if reading.ended is None else frozenset()
        place = {name: action for action, name in enumerate(reading.actions)}

        def over(state: State) -> bool:
            if reading.ended is not None:
                return bool(getattr(state, reading.ended[0]) == reading.ended[1])
            return self.numbers.get(tuple(state)) in final

        def outcomes(state: State, action: str) -> Outcomes:
            number = self.numbers.get(tuple(state)[: self.width])
            if number is None:
                return state, 0.0
            return [
                (chance * share, decided, reward)
                for chance, to, reward, done in self._entries(number, place[action])
                for share, decided in changes_of_mind(
                    state, self._after(state, to, done=done), reading.fickle
                )
            ]

        rest = ("open",) if reading.fickle else ()
        first = [(*self.values[int(number)], *rest) for number in starts]
        return finite_world(reading.variables, reading.actions, outcomes, first, ends=over)

    def _after(self, state: State, to: int, *, done: bool) -> State:
        """Return the state that an entry of the table leads to."""
        after = type(state)(*self.values[int(to)], *tuple(state)[self.width :])
        return after._replace(**dict([self.reading.ended])) if done and self.reading.ended else after

    def _final(self, starts: Sequence[int]) -> frozenset[int]:
        """Return the observations that end an episode, each in every way to reach it."""
        seen, queue = set(starts), list(starts)
        ending: set[int] = set()
        going_on = set(starts)
        while queue:
            number = queue.pop()
            for action in range(len(self.reading.actions)):
                for chance, to, _, done in self._entries(number, action):
                    if chance > 0:
                        (ending if done else going_on).add(int(to))
                    if chance > 0 and not done and int(to) not in seen:
                        seen.add(int(to))
                        queue.append(int(to))
        both = sorted(ending & going_on)
        if both:
            problem = f"observation {both[0]} ends an episode on one way to it and does not on another"
            mend = "decode it with a variable of its own for the end, such as over = yes, named by ended"
            raise WorldError(f"{problem}; {mend}")
        return frozenset(ending)


def _reading(base: Any) -> _Reading:
    """Return how an environment is read that we know; any other is one variable."""
    for kind, read in _KNOWN.items():
        if isinstance(base, kind):
            return read(base)
    numbers = tuple(range(int(base.observation_space.n)))
    names = tuple(f"action{number}" for number in range(int(base.action_space.n)))
    return _Reading((Variable("state", numbers),), lambda number: (number,), names)


def _grid(rows: int, cols: int, actions: str) -> _Reading:
    cells = tuple(Cell(row, col) for row, col in product(range(rows), range(cols)))
    variable = Variable("cell", cells, tuple(str(cell) for cell in cells))
    return _Reading((variable,), lambda number: (cells[number],), tuple(actions.split()))


def _taxi(base: Any) -> _Reading:
    sites = tuple(SITES.values())

    def decode(number: int) -> Sequence[Hashable]:
        row, col, passenger, destination = base.decode(number)
        return Cell(row, col), (*sites, ABOARD)[passenger], sites[destination]

    fickle = float(base.fickle_probability) if base.fickle_passenger else 0.0
    names = ("South", "North", "East", "West", "Pickup", "Putdown")
    return _Reading(taxi_variables(fickle=fickle > 0), decode, names, ("passenger", DELIVERED), fickle)


_KNOWN: Final[Mapping[type, Callable[[Any], _Reading]]] = {
    TaxiEnv: _taxi,
    FrozenLakeEnv: lambda base: _grid(base.nrow, base.ncol, "Left Down Right Up"),
    CliffWalkingEnv: lambda base: _grid(base.shape[0], base.shape[1], "Up Right Down Left"),
}
