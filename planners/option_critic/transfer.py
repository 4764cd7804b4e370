"""What an option-critic has learnt, carried over to a new one after something in the world has moved.

A network that does not see a variable is a function of the others alone, so that what it has learnt holds
wherever that variable stands. That is what state abstraction buys: with the goal moved, the ways to the
hallways of the four rooms are as they were, and only what sees the goal is learnt anew.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import torch

from planners.option_critic.checkpoint import digest
from planners.option_critic.loading import load_option_critic
from planners.option_critic.networks import SideBySide, called_tasks
from planners.option_critic.training import OptionCritic
from worlds import UserError

_ALIKE: Final = ("terminations", "abstracted", "hidden", "gamma")  # settings that networks hang on
_CHUNK: Final = 1 << 16  # states looked at at once


def carry_over(source: OptionCritic, into: OptionCritic, moved: Iterable[str]) -> tuple[str, ...]:
    """Copy the networks that do not see some variables from one option-critic into a new one.

    The other networks of the new one stay as they were drawn, and so do its moments and schedules.

    Parameters
    ----------
    source
        What has learnt.
    into
        What is to learn: of the same task graph and world, wherever its episodes begin, and with networks of
        the same kind. Nothing has been learnt by it.
    moved
        Names of the state variables whose values will be others than those that were learnt of; with none of
        them every network is carried.

    Returns
    -------
    tuple of str
        What was carried: policies of tasks, parts of values (`Part`), terminations of tasks.

    Raises
    ------
    UserError
        If the two are not alike, there is no such variable, or every network sees one that has moved.

    Examples
    --------
    >>> from hierarchy import ground, two_rooms
    >>> from worlds import load_layout, maze_model
    >>> maze = load_layout("two_rooms")
    >>> grounded = ground(two_rooms(maze), maze_model(maze))
    >>> first, later = OptionCritic(grounded, seed=0), OptionCritic(grounded, seed=1)
    >>> carried = carry_over(first, later, ["goal"])
    >>> len(carried), carried[0], carried[-1]
    (24, 'policy of GotoTrigger(T1)', 'C Root GotoGoal(G4)')
    """
    names = (moved,) if isinstance(moved, str) else tuple(dict.fromkeys(moved))
    sees_moved = into.world.encoding.reading(names)
    _refuse_unlike(source, into)
    carried = list[str]()
    pairs = zip(_networks(source), _networks(into), strict=True)
    for (_, learnt), (called, new) in pairs:
        kept = ~(new.sees.bool() & sees_moved.to(new.sees.device)).any(dim=1)
        with torch.no_grad():
            for old, fresh in zip(learnt.parameters(), new.parameters(), strict=True):
                fresh[kept] = old[kept.to(old.device)].to(fresh.device)
        carried += [name for name, keep in zip(called, kept.tolist(), strict=True) if keep]
    if not carried:
        seen = ", ".join(names)
        mend = "learn anew" if into.config.abstracted else "learn both with abstracted: true, or learn anew"
        raise UserError(f"every network sees {seen}: nothing can be carried over; {mend}")
    return tuple(carried)


def carry_from(path: Path | str, into: OptionCritic, moved: Iterable[str]) -> tuple[str, ...]:
    """Carry over from a checkpoint, as `carry_over` does.

    Raises
    ------
    UserError
        If the checkpoint cannot be read, or `carry_over` refuses; the message begins with the path.
    """
    source = load_option_critic(path)
    try:
        return carry_over(source, into, moved)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def _networks(learner: OptionCritic) -> Iterator[tuple[Sequence[str], SideBySide]]:
    """Return the networks side by side of actor, critic and terminations, each with its networks' names."""
    options, nodes, policy = learner.options, learner.grounded.nodes, learner.policy
    named = [
        (policy.actor, [f"policy of {nodes[place].name}" for place in options.tasks]),
        (policy.critic, [part.name for part in options.parts]),
        (policy.termination, [f"termination of {nodes[place].name}" for place in called_tasks(options)]),
    ]
    for module, names in named:
        # There is no policy where every option is an action, and no termination where the graph ends tasks.
        if module is not None and module.module.networks is not None:
            yield names, module.module.networks


def _refuse_unlike(source: OptionCritic, into: OptionCritic) -> None:
    """Refuse to carry between learners of which one's networks would mean nothing to the other."""
    if into.updates:
        raise UserError(
            f"what is to be carried into has learnt for {into.steps} steps already; give one that has not"
        )
    starts = source.grounded.model.starts
    model = into.grounded.model
    same = model.starts.shape == starts.shape
    # Where episodes begin may differ: that is how a goal is moved.
    there = replace(into.grounded, model=model.beginning(starts)) if same else into.grounded
    if digest(source.grounded) != digest(there):
        name, other = source.grounded.graph.name, into.grounded.graph.name
        raise UserError(
            f"what was learnt is of another task graph or world ({name}) than what is to be learnt "
            f"({other}); give the same, with other starts at most"
        )
    for name in _ALIKE:
        before, after = getattr(source.config, name), getattr(into.config, name)
        if before != after:
            raise UserError(f"setting {name} was {before} and is {after} now; give {name}: {before}")
    if not _looks_alike(source, into):
        raise UserError("the two have other encodings, and see states differently; give both the same")


def _looks_alike(source: OptionCritic, into: OptionCritic) -> bool:
    """Return whether every state looks the same to both."""
    one, other = source.world.encoding, into.world.encoding
    states = torch.split(torch.arange(into.grounded.model.index.size), _CHUNK)
    return one.columns == other.columns and all(
        torch.equal(one(part.to(source.world.device)).cpu(), other(part.to(into.world.device)).cpu())
        for part in states
    )
