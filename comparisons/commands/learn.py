"""The command that learns a task graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console


def learn(
    graph: str,
    /,
    *,
    out: Path,
    learner: str = "option-critic",
    world: str | None = None,
    seed: int = 0,
    config: Path | None = None,
    terminations: str | None = None,
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", consume_multiple=True, negative_iterable=())
    ] = (),
    steps: int | None = None,
    tolerance: float = 0.0,
    starts: str | None = None,
    carry: Path | None = None,
    moved: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative_iterable=())] = (),
    logger: str | None = None,
    resume: bool = False,
) -> int:
    """Learn a task graph on its world, held to the oracle, until every start's return is the best possible.

    Exit status 0 says that it came so far, 1 that its steps were done before, 2 that nothing was learnt.
    Ctrl-C and SIGTERM save what was learnt (130, 143), and --resume goes on as if nothing had happened.

    Parameters
    ----------
    graph
        A YAML file, or the name of a graph that comes with the package (two_rooms, taxi, hdg, four_rooms).
    out
        Directory to make, for checkpoint.safetensors, its card as JSON, and the learning curve, curve.csv.
    learner
        Learner: option-critic; flat-ppo or flat-dqn, which know no tasks (setting hidden is 128 unless
        given); maxq-0, maxq-q, hsmq or flat-q, which keep tables; or one that an installed package adds.
    world
        World to learn on: a name (also gym:Taxi-v4 and its like), or a .maze file. Defaults to the one that
        the graph names.
    seed
        Of learning: the same seed and settings give the same curve and checkpoint on one machine.
    config
        YAML file of the learner's settings, those that differ from the defaults.
    terminations
        What ends a task: given (the graph), learnt, or prior (learnt, with the graph as a prior).
    settings
        Single settings as NAME=VALUE, such as --set rate=1e-3 gamma=0.95; they count more than the file.
    steps
        Environment steps to learn for. Defaults to the setting total, 1000000.
    tolerance
        Learning also ends when it ends from every start and the mean return is so near the best possible,
        for worlds with chance, where learning cannot be exact.
    starts
        Begin only where this holds, a predicate such as "goal = 7,9"; the oracle asks for no more, either.
        Defaults to all the world's starts.
    carry
        Begin with the networks of this checkpoint of an option-critic that do not see what has moved.
    moved
        State variables that have moved since, such as --moved goal.
    logger
        Keep the learning curve in the directory's log, too, by a logger of TorchRL's: csv, tensorboard,
        wandb or mlflow.
    resume
        Go on from the checkpoint in the directory; give the rest of the command as before. Only --steps
        and --tolerance may change, and --carry may be left out; so may --logger.
    """
    from comparisons.learn.command import learn as run
    from comparisons.learn.spec import Spec, named_settings

    named = named_settings(settings, terminations)
    asked = (graph, out, learner, world, seed, config, named, steps, tolerance, starts, resume)
    spec = Spec(*asked, carry, moved, logger)
    outcome = run(spec, Console(stderr=True))
    print(outcome.text)
    return 0 if outcome.reached else 1
