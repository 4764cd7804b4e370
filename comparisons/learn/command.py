"""`affordant learn`: a learner on a task graph, held to the oracle while it learns; it can be broken off."""

from __future__ import annotations

import csv
import io
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from comparisons.learn.line import Line, Measured
from comparisons.learn.logging_to import Log, logging_to
from comparisons.learn.registry import Carry, Request, Run, new_run
from comparisons.learn.spec import Spec
from comparisons.outputs import refuse_existing
from comparisons.stopping import told_to_stop
from hierarchy import GroundGraph
from hierarchy.check import checked
from hierarchy.starts import beginning_where
from hierarchy.text import graph_text, load_graph, load_world
from planners.option_critic.checkpoint import Checkpoint, digest, load_checkpoint, restore, save_checkpoint
from worlds.errors import UserError
from worlds.files import replace_files

CHECKPOINT: Final = "checkpoint.safetensors"
CURVE: Final = "curve.csv"
EVERY: Final = 20.0
"""Seconds between two checkpoints."""
_FIXED: Final = ("steps", "share_optimal", "share_ending", "mean_return", "mean_loss")


class Outcome(NamedTuple):
    """What came of learning: the summary, and whether it came to the line."""

    text: str
    reached: bool


def learn(spec: Spec, console: Console) -> Outcome:
    """Learn until the oracle agrees or the steps are done; Ctrl-C and SIGTERM save what was learnt.

    Raises
    ------
    UserError
        If the graph, the learner, its settings or the folder will not do.
    KeyboardInterrupt, SystemExit
        If it was told to stop; then what was learnt has been saved.
    """
    if not spec.resume:
        refuse_existing(spec.out)
    graph, world = load_graph(spec.graph, None if spec.world is None else load_world(spec.world))
    grounded = checked(graph, world.model())
    if spec.starts is not None:
        grounded = _beginning_where(grounded, spec.starts)
    line = Line.of(grounded)
    asked = Request(spec.learner, grounded, spec.seed, spec.config, dict(spec.settings), spec.steps)
    # A run that goes on has all its networks in its own checkpoint.
    run = new_run(asked if spec.resume else replace(asked, carry=_carry(spec, console)))
    about = Checkpoint(
        spec.learner,
        graph_text(graph, world),
        world.name,
        spec.seed,
        dict(run.settings),
        digest(grounded),
        steps=0,
        starts=spec.starts or "",
        carried=_identity(spec),
    )
    session = _Session(spec, run, line, about)
    if spec.resume:
        session.take_up(console)
    if not session.over():
        so_far = session.columns, session.rows
        with _folder(spec.out), logging_to(spec.logger, spec.out, *so_far) as session.log:
            session.learn(console)
    return session.outcome()


class _Session:
    """A run, its learning curve, and where they are kept."""

    def __init__(self, spec: Spec, run: Run, line: Line, about: Checkpoint) -> None:
        self.spec, self.run, self.line, self.about = spec, run, line, about
        self.path = spec.out / CHECKPOINT
        self.steps, self.total = 0, int(run.settings["total"])
        self.columns: tuple[str, ...] = _FIXED
        self.rows: list[tuple[float, ...]] = []
        self.log = Log()

    @property
    def last(self) -> Measured | None:
        """What was measured last."""
        return Measured(*self.rows[-1][1 : len(_FIXED)]) if self.rows else None

    def over(self) -> bool:
        """Return whether there is nothing left to learn, or no step left to learn it in."""
        last = self.last
        return self.steps >= self.total or (last is not None and last.enough(self.spec.tolerance))

    def take_up(self, console: Console) -> None:
        """Go on from the checkpoint."""
        if not self.path.exists():
            raise UserError(f"--resume: {self.path} is not there; leave --resume out to begin")
        stored = load_checkpoint(self.path)
        _refuse_other(self.path, stored.about, self.about)
        restore(self.path, stored, self.run)
        for name, was in stored.about.versions.items():
            if was != (now := self.about.versions.get(name)):
                console.print(f"note: it was begun with {name} {was}, this is {now}; bits may differ")
        self.about = replace(self.about, carried=stored.about.carried)
        self.steps, self.columns = stored.about.steps, stored.about.columns
        self.rows = [tuple(row) for row in stored.curve.tolist()]

    def learn(self, console: Console) -> None:
        """Learn until it is over, or until told to stop."""
        saved = time.monotonic()
        with told_to_stop() as told, _bar(console, self) as show, closing(self.run.learn()) as pieces:
            for steps, measures in pieces:
                self.steps = steps
                _refuse_astray(steps, measures)
                if self.run.due() or steps >= self.total:
                    self.evaluate(measures)
                show()
                if told or self.over():
                    break
                if time.monotonic() - saved > EVERY:
                    self.save()
                    saved = time.monotonic()
            self.save()
        if told and not self.over():
            going_on = f"stopped after {self.steps} steps; to go on: {self.spec.going_on()}"
            console.print(going_on, soft_wrap=True, markup=False, highlight=False)
            told.obey()

    def evaluate(self, measures: Mapping[str, float]) -> None:
        """Add a row to the learning curve."""
        if not self.rows:
            self.columns = (*_FIXED, *measures)
        others = (float(measures.get(name, float("nan"))) for name in self.columns[len(_FIXED) :])
        self.rows.append((float(self.steps), *self.line.measure(self.run.greedy()), *others))
        self.log.add(self.columns, self.rows[-1])

    def save(self) -> None:
        """Write checkpoint and curve."""
        curve = np.array(self.rows, dtype=np.float64).reshape(len(self.rows), len(self.columns))
        about = replace(self.about, steps=self.steps, columns=self.columns)
        save_checkpoint(self.path, about, self.run.state(), curve)
        replace_files({self.spec.out / CURVE: _csv(self.columns, self.rows).encode()})

    def outcome(self) -> Outcome:
        """Return the summary."""
        line, spec = self.line, self.spec
        # A run that goes on for fewer steps than it has made may never have been evaluated.
        last = self.last or line.measure(self.run.greedy())
        count, best = len(line.starts), float(line.best.mean())
        optimal, ending = round(last.share_optimal * count), round(last.share_ending * count)
        text = [
            f"task graph {spec.graph} on world {self.about.world}: {spec.learner}, seed {spec.seed}, "
            f"{self.steps} steps",
            f"optimal from {optimal} of {count} starts; ends from {ending}",
        ]
        if ending == count:
            text.append(f"mean return {last.mean_return:.4g}, the best possible {best:.4g}")
        text += [str(self.path), str(spec.out / CURVE)]
        return Outcome("\n".join(text), last.enough(spec.tolerance))


def _beginning_where(grounded: GroundGraph, starts: str) -> GroundGraph:
    try:
        return beginning_where(grounded, starts)
    except UserError as error:
        raise UserError(f"--starts: {error}") from error


def _carry(spec: Spec, console: Console) -> Carry | None:
    """Return what is to be carried over; what was is told on the console."""

    def tell(names: tuple[str, ...]) -> None:
        words = f"carried over from {spec.carry}: {', '.join(names)}"
        console.print(words, soft_wrap=True, markup=False, highlight=False)

    return None if spec.carry is None else Carry(spec.carry, spec.moved, tell)


def _identity(spec: Spec) -> str:
    """Return what is carried over, told from anything else that could be; empty for nothing."""
    if spec.carry is None:
        return ""
    arrays = load_checkpoint(spec.carry).about.sha256
    return f"{arrays[:16]} without {', '.join(sorted(set(spec.moved)))}"


def _refuse_astray(steps: int, measures: Mapping[str, float]) -> None:
    """Refuse to go on, and to keep, what has no finite numbers any more."""
    for name, value in measures.items():
        if not np.isfinite(value):
            raise UserError(
                f"learning went astray: after {steps} steps {name} is {value}; "
                "lower the setting rate, or give another seed"
            )


def _refuse_other(path: Path, was: Checkpoint, now: Checkpoint) -> None:
    """Refuse to go on with another run; only the number of steps may have changed."""
    pairs: dict[str, tuple[Any, Any]] = {
        "--learner": (was.learner, now.learner),
        "--seed": (was.seed, now.seed),
        "--world": (was.world, now.world),
        "--starts": (was.starts or "all", now.starts or "all"),
    }
    if now.carried:  # it may be left out
        pairs["--carry"] = (was.carried or "nothing", now.carried)
    for name in now.config:
        if name != "total":
            pairs[f"setting {name}"] = (was.config.get(name), now.config[name])
    for name, (before, after) in pairs.items():
        if before != after:
            raise UserError(
                f"{path}: begun with {name} {before}, not {after}; give the same, or another --out"
            )
    if was.graph != now.graph:
        raise UserError(f"{path}: this run is of another task graph; give the same, or another --out")


@contextmanager
def _folder(out: Path) -> Iterator[None]:
    """Make the folder at once, so that nothing is learnt in vain; take it away if nothing is kept in it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {out}: it cannot be made ({error.strerror}); name another place") from error
    try:
        yield
    finally:
        if not (out / CHECKPOINT).exists():  # a log there tells of nothing that could go on
            shutil.rmtree(out, ignore_errors=True)


@contextmanager
def _bar(console: Console, session: _Session) -> Iterator[Callable[[], None]]:
    """Show how far a session is; what is yielded brings it up to date."""
    columns = (TextColumn("{task.description}"), BarColumn(16), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("learning", total=session.total, completed=session.steps)

        def show() -> None:
            last = session.last
            told = "" if last is None else f", {100 * last.share_optimal:.1f} % optimal"
            if last is not None and last.share_ending == 1:
                told += f", return {last.mean_return:.4g}, best {last.mean_return + last.mean_loss:.4g}"
            progress.update(task, completed=session.steps, description=f"{session.steps} steps{told}")

        yield show


def _csv(columns: tuple[str, ...], rows: list[tuple[float, ...]]) -> str:
    """Return the curve as CSV; what could not be measured is left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for steps, *others in rows:
        writer.writerow([int(steps), *("" if np.isnan(value) else f"{value:.9g}" for value in others)])
    return text.getvalue()
