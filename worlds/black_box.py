"""A Gymnasium environment as a black box: nothing but reset and step, its observations read as states."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from worlds.errors import UserError
from worlds.finite import WorldError
from worlds.model import TransitionModel
from worlds.variables import StateIndex, Variable

_UNKNOWN: Final = frozenset({"outcomes", "outcome_rewards", "probabilities"})


@dataclass(frozen=True)
class Move:
    """What a step of the environment led to.

    Parameters
    ----------
    state
        Number of the next state.
    reward
        The reward of the step.
    terminated, truncated
        Whether the episode has ended there, or has been cut off, such as by a time limit.
    """

    state: int
    reward: float
    terminated: bool
    truncated: bool


class BlackBox:
    """An environment of which nothing is known but what its episodes show.

    Parameters
    ----------
    env
        The environment; its actions are discrete, its observations may be anything.
    variables
        The state variables.
    decode
        Gives the variables' values for an observation. What it leaves out must not matter to what follows
        (the states must be Markov); without a model nobody can check that.
    actions
        Names of the actions, by number; by default action0, action1, ...

    Raises
    ------
    WorldError
        If the actions are not discrete, or are not named one by one.

    Examples
    --------
    >>> import gymnasium
    >>> row, col = Variable("row", (0, 1, 2, 3)), Variable("col", tuple(range(12)))
    >>> cliff = gymnasium.make("CliffWalking-v1")
    >>> box = BlackBox(cliff, [row, col], lambda n: divmod(n, 12), "Up Right Down Left".split())
    >>> box.index.state(box.reset(seed=1))
    (3, 0)
    >>> move = box.step(box.actions.index("Up"))
    >>> box.index.state(move.state), move.reward, move.terminated
    ((2, 0), -1.0, False)
    """

    def __init__(
        self,
        env: Env[Any, Any],
        variables: Sequence[Variable],
        decode: Callable[[Any], Sequence[Hashable]],
        actions: Sequence[str] | None = None,
    ) -> None:
        space = env.action_space
        if not isinstance(space, Discrete):
            raise WorldError(f"the actions are {space}, not discrete; wrap the environment so that they are")
        count, self._first = int(space.n), int(space.start)
        self.actions = tuple(f"action{i}" for i in range(count)) if actions is None else tuple(actions)
        if len(self.actions) != count:
            raise WorldError(f"{len(self.actions)} names for {count} actions; give each one")
        self.env = env
        self.index = StateIndex(tuple(variables))
        self._decode = decode

    def reset(self, seed: int | None = None) -> int:
        """Begin an episode and return the number of the state it begins in."""
        observation, _ = self.env.reset(seed=seed)
        return self._number(observation)

    def step(self, action: int) -> Move:
        """Carry out an action, given by its place among `actions`."""
        observation, reward, terminated, truncated, _ = self.env.step(self._first + action)
        return Move(self._number(observation), float(reward), bool(terminated), bool(truncated))

    def _number(self, observation: Any) -> int:
        values = tuple(self._decode(observation))
        names = ", ".join(self.index.names)
        if len(values) != len(self.index.variables):
            raise WorldError(f"decode({observation!r}) gives {values!r}; give a value each for {names}")
        for variable, value in zip(self.index.variables, values, strict=True):
            if value not in variable:
                known = ", ".join(variable.labels[:8])
                problem = f"decode({observation!r}) gives {variable.name} = {value!r}"
                raise WorldError(f"{problem}, which is none of its values ({known}); add it to them")
        return self.index.number(values)


class UnknownModel(TransitionModel):
    """The model of a world that has none to show: an action may lead anywhere, and surely leads nowhere.

    An episode may begin in any state, and every state counts as reachable. Expected rewards are NaN. Outcomes
    and probabilities are refused, and with them whatever needs them: exact solutions, distance fields and
    proofs.

    Parameters
    ----------
    index
        Numbers the states.
    actions
        Names of the primitive actions.

    Examples
    --------
    >>> model = UnknownModel(StateIndex((Variable("x", (0, 1, 2)),)), ("left", "right"))
    >>> goal = np.array([False, False, True])
    >>> bool(model.may_reach(goal).all()), bool(model.must_reach(goal).any())
    (True, False)
    """

    def __init__(self, index: StateIndex, actions: tuple[str, ...]) -> None:
        # The arrays of the base class are not set, so that each reading of them is refused below.
        self.index = index
        self.actions = actions
        self.starts = np.ones(index.size, np.bool_)

    def __getattr__(self, name: str) -> Any:
        if name in _UNKNOWN:
            raise UserError(
                f"this needs the model's {name.replace('_', ' ')}, and a black box shows none; "
                "describe the world with worlds.finite_world or worlds.gym_model"
            )
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def rewards(self) -> NDArray[np.float64]:
        """Expected reward of every action, shape (states, actions): NaN, for nobody knows."""
        return np.full((self.index.size, len(self.actions)), np.nan)

    def may_reach(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return whether an action may lead into `mask`, shape (states, actions): yes, unless it is empty."""
        return np.full((self.index.size, len(self.actions)), bool(mask.any()))

    def following(self, mask: NDArray[np.bool_], action: int) -> NDArray[np.int64]:  # noqa: ARG002
        """Return the states that an action may lead to from the states of `mask`: all, or none from none."""
        return np.arange(self.index.size if mask.any() else 0, dtype=np.int64)

    def reachable(self, starts: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """Return the states that may be reached from `starts`, shape (states,): all, or none from none."""
        return np.full(self.index.size, bool((self.starts if starts is None else starts).any()))
