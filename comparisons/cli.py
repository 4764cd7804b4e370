"""The command line `affordant`. Heavy libraries load only in the command that needs them."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console

from comparisons.stopping import orderly_exit
from comparisons.study.command import study
from worlds.errors import UserError

app = App(
    name="affordant",
    help="Learn, plan and prove affordances of hierarchical tasks.",
    version=lambda: version("affordant"),
    help_format="plaintext",
)
app.command(study)


@app.command
def reproduce(
    *,
    out: Path,
    perception: str = "hough",
    seed: int = 0,
    quick: bool = False,
    layout: str = "two_rooms",
) -> int:
    """Run the experiment of Min et al. (2015) and write a report, figures and results.

    Parameters
    ----------
    out
        Directory to make; it must not exist.
    perception
        Backend that tells shapes: hough, truth, or one that an installed package adds.
    seed
        Seed of everything random; the same seed gives the same results.json.
    quick
        Fewer frames, pushes and random episodes, for a first look.
    layout
        Maze: a name (two_rooms) or the path of a .maze file.
    """
    from comparisons.experiment import Spec
    from comparisons.reproduce import reproduce as run
    from comparisons.summary import summarise

    console = Console(stderr=True)
    results = run(Spec(seed, perception, quick, layout), out, console)
    print(summarise(results))
    print(f"report: {out / 'report.html'}")
    return 0


@app.command
def perceive(path: Path, /, *, perception: str = "hough", out: Path | None = None) -> int:
    """Tell what stands ahead in your own pictures: none, cube or sphere, how far, and how surely.

    Exit status 0 says that every file could be read, 1 that some could not (a line each on standard error),
    2 that nothing was looked at.

    Parameters
    ----------
    path
        A picture (PNG, JPEG, BMP or WebP), or a folder of them. The middle square of each is looked at.
    perception
        Backend: hough, cnn, hog, ensemble, one that an installed package adds, or, for weights of your own,
        NAME=FILE such as cnn=mine/cnn.safetensors.
    out
        Directory to make, for percepts.csv and annotated pictures; it must not exist.
    """
    from comparisons.perceive_commands import perceive as run

    found = run(
        path,
        perception,
        out,
        lambda one: print(one, file=sys.stdout if one.detection else sys.stderr, flush=True),
    )
    return 1 if any(one.detection is None for one in found) else 0


@app.command
def train_perception(*, backend: str = "cnn", out: Path, frames: int = 5000, seed: int = 0) -> int:
    """Train a backend on frames that are rendered, and labelled by pushing what they show.

    Parameters
    ----------
    backend
        Backend that learns: cnn, hog, ensemble, or one that an installed package adds.
    out
        Folder for the weights and the frames. After a break, the same command goes on with the frames.
    frames
        Number of frames to learn from.
    seed
        Of frames and training, 0 to 99.
    """
    from comparisons.learnt import train_perception as run

    weights = run(backend, out, frames, seed, Console(stderr=True))
    print(weights)
    print(weights.with_suffix(".json"))
    return 0


@app.command
def compare_perception(
    *,
    out: Path,
    backends: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative_iterable=())] = (),
    frames: int | None = None,
    episodes: int | None = None,
    seed: int = 200,
    quick: bool = False,
    learning: bool = True,
    training_seeds: int | None = None,
    effort: float | None = None,
    workers: int | None = None,
) -> int:
    """Compare perception backends: accuracy, calibration, latency, learning, and what mistakes cost.

    Backends that learn are also trained anew, on few pushes and many, on wrong labels, and with colours,
    distances and sizes kept out; --no-learning leaves that out.

    Parameters
    ----------
    out
        Directory to make; it must not exist.
    backends
        Names, or NAME=FILE for weights of your own. Defaults to every backend that reads frames.
    frames
        Frames of every set. Defaults to 1000, or 90 if quick.
    episodes
        Random episodes of the task. Defaults to 200, or 20 if quick.
    seed
        Of the frames, 200 to 299; the seeds below train and tune.
    quick
        Fewer frames, episodes, severities and trainings, and short ones, for a first look.
    learning
        Whether backends are trained anew.
    training_seeds
        How many times each training is done, with other pushes; 0 leaves them out. Defaults to 3, or 1 if
        quick.
    effort
        Length of each training, as a share of the usual number of steps. Defaults to 0.3, or 0.02 if quick.
    workers
        Processes that train; their number changes nothing in the results. Defaults to one for each core.
    """
    from comparisons.perception_compare import compare_perception as run
    from comparisons.perception_compare import summarise_perception
    from comparisons.perception_spec import QUICK, LearningSpec, StudySpec

    usual = QUICK if quick else LearningSpec()
    seeds = usual.seeds if training_seeds is None else training_seeds
    spec = StudySpec(
        backends,
        seed,
        (90 if quick else 1000) if frames is None else frames,
        (20 if quick else 200) if episodes is None else episodes,
        (1, 3, 5) if quick else (1, 2, 3, 4, 5),
        replace(usual, seeds=seeds if learning else 0, effort=usual.effort if effort is None else effort),
    )
    print(summarise_perception(run(spec, out, Console(stderr=True), workers)))
    print(f"report: {out / 'report.html'}")
    return 0


@app.command
def doctor() -> int:
    """Check versions, import names and heavy libraries, and say how to mend each fault."""
    from comparisons.doctor import examine

    checks = examine()
    for check in checks:
        print(check)
    return 0 if all(check.well for check in checks) else 1


@app.command
def check(graph: str, /, *, world: str | None = None, gamma: float = 1.0) -> int:
    """Check a task graph: print it, what is wrong with it, what it stores, and what is proved safe.

    Exit status 0 says that it may run, 1 that there are findings, 2 that it cannot be read.

    Parameters
    ----------
    graph
        A YAML file, or the name of a graph that comes with the package (two_rooms, taxi, hdg, four_rooms).
    world
        World to check it on: a name (also gym:Taxi-v4 and its like), or a .maze file. Defaults to the one
        that the graph names.
    gamma
        Discount factor that it is to be learnt with; below 1, tables that forget time are findings.
    """
    from comparisons.graph_commands import check_graph

    verdict = check_graph(graph, world, gamma)
    print(verdict.text)
    return 0 if verdict.well else 1


@app.command
def draw(graph: str, /, *, world: str | None = None, out: Path = Path()) -> int:
    """Draw a task graph: Mermaid (.mmd) and Graphviz (.dot) text, and a picture (.png, .svg).

    Parameters
    ----------
    graph
        A YAML file, or the name of a graph that comes with the package (two_rooms, taxi, hdg, four_rooms).
    world
        World that it is for: a name (also gym:Taxi-v4 and its like), or a .maze file. Defaults to the one
        that the graph names.
    out
        Folder of the files. None of them may exist.
    """
    from comparisons.graph_drawing import draw_graph

    for path in draw_graph(graph, world, out):
        print(path)
    return 0


@app.command
def maze(
    *,
    rows: int,
    cols: int,
    seed: int = 0,
    out: Path | None = None,
    rooms: Annotated[tuple[int, int], Parameter(negative_iterable=())] = (1, 2),
    doors: int = 2,
    triggers: int = 4,
    goals: int = 4,
    obstacles: int = 6,
) -> int:
    """Draw a maze from a seed: rooms, passages, doors, triggers, goals and obstacles. It can be played.

    Parameters
    ----------
    rows
        Rows of cells.
    cols
        Columns of cells.
    seed
        Names the maze: the same seed and numbers give the same one.
    out
        File to write, such as large.maze; it must not exist. Left out, the maze is printed.
    rooms
        Rows and columns of rooms; the wall with the doors stands in the middle of the columns.
    doors
        Number of doors that the trigger opens.
    triggers
        Number of candidate triggers, all before the doors.
    goals
        Number of candidate goals, all behind the doors.
    obstacles
        Number of cubes and spheres that appear in the example run.
    """
    from comparisons.maze_command import draw_maze

    numbers = {"doors": doors, "triggers": triggers, "goals": goals, "obstacles": obstacles}
    print(draw_maze(out, rows, cols, seed, rooms=rooms, **numbers), end="")
    return 0


@app.command
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


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one message and exit status 2, never a traceback.

    Ctrl-C ends it with status 130 and SIGTERM with 143; what was half-made is taken away first.
    """
    try:
        with orderly_exit():
            status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
            sys.stdout.flush()
    except (CycloptsError, UserError) as error:
        print(f"affordant: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("affordant: stopped", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:  # whoever read the output, such as head, has had enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is flushed at the end
        sys.exit(128 + signal.SIGPIPE)
    sys.exit(status or 0)
