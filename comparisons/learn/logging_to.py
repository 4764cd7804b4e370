"""The learning curve, row by row, into TorchRL's loggers: CSV files, TensorBoard, Weights & Biases, MLflow.

TorchRL is loaded only when a log is opened, and the loggers' own packages only by TorchRL.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from worlds.errors import UserError, suggest

LOGGERS: Final = {"csv": "torchrl", "tensorboard": "tensorboard", "wandb": "wandb", "mlflow": "mlflow"}
"""The loggers there are, each with the package that it needs."""
FOLDER: Final = "log"
"""Where a log is, inside the folder of its run."""
_FILES: Final = {"csv": "scalars/**/*.csv", "tensorboard": "events.out.tfevents.*"}


class Log:
    """Takes rows of a learning curve.

    Parameters
    ----------
    logger
        A `torchrl.record.loggers.common.Logger`; None lets the rows go.
    """

    def __init__(self, logger: Any = None) -> None:
        self._logger = logger

    def add(self, columns: Sequence[str], row: Sequence[float]) -> None:
        """Log a row: each number as a scalar of its column's name, at the step that the first column tells.

        What could not be measured, nan, is left out.

        Parameters
        ----------
        columns
            Names, "steps" first.
        row
            A number for each.
        """
        if self._logger is None:
            return
        named = zip(columns[1:], row[1:], strict=True)
        measured = {name: float(value) for name, value in named if not math.isnan(value)}
        self._logger.log_metrics(measured, step=int(row[0]))


def refuse_missing(name: str | None) -> None:
    """Refuse a logger that there is not, or whose package is missing, before anything is learnt.

    Raises
    ------
    UserError
        That names the nearest logger, or what to install.

    Examples
    --------
    >>> refuse_missing("csv")
    >>> refuse_missing("tensorbord")
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: --logger tensorbord: there is none; did you mean 'tensorboard'?
    """
    if name is None:
        return
    if name not in LOGGERS:
        raise UserError(f"--logger {name}: there is none; {suggest(name, LOGGERS)}")
    if find_spec(LOGGERS[name]) is None:
        package = LOGGERS[name]
        raise UserError(
            f"--logger {name}: it needs the package {package}, which is not installed; "
            f"pip install {package}, or use --logger csv"
        )


@contextmanager
def logging_to(
    name: str | None, out: Path, columns: Sequence[str] = (), rows: Iterable[Sequence[float]] = ()
) -> Iterator[Log]:
    """Open a log in a run's folder; it is closed at the end.

    A run that goes on gives the rows that its checkpoint holds: they take the place of what a csv or
    tensorboard log holds there, which may be ahead of the checkpoint, so that no row is lost or comes twice.
    With wandb and mlflow they begin a new run of theirs.

    Parameters
    ----------
    name
        One of `LOGGERS`; None for a log that keeps nothing.
    out
        The run's folder.
    columns, rows
        The learning curve so far.

    Raises
    ------
    UserError
        As `refuse_missing`; and if the logger's service does not let itself be opened.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     with logging_to("csv", Path(folder)) as log:
    ...         log.add(("steps", "share_optimal"), (4096.0, 0.5))
    ...     print(Path(folder, "log/scalars/share_optimal.csv").read_text().strip())
    4096,0.5
    """
    refuse_missing(name)
    if name is None:
        yield Log()
        return
    for old in list((out / FOLDER).glob(_FILES[name])) if name in _FILES else ():
        old.unlink()
    logger = _opened(name, out)
    try:
        with logger.experiment if name == "mlflow" else nullcontext():  # shutdown() leaves its run open
            log = Log(logger)
            for row in rows:
                log.add(columns, row)
            yield log
    finally:
        logger.shutdown()
        _take_away_empty(out / FOLDER)


def _take_away_empty(folder: Path) -> None:
    """Take away folders that were made for nothing: of videos and texts, or all if nothing was learnt."""
    inside = sorted((path for path in folder.rglob("*") if path.is_dir()), reverse=True)
    for path in (*inside, folder):
        with suppress(OSError):  # there is something in it
            path.rmdir()


def _opened(name: str, out: Path) -> Any:
    """Return TorchRL's logger of a run, which is called as its folder is."""
    from torchrl.record import loggers  # type: ignore[import-untyped]  # noqa: PLC0415 - see above

    if name in _FILES:
        return loggers.get_logger(name, logger_name=str(out), experiment_name=FOLDER)
    folder, run = (out / FOLDER).absolute(), out.absolute().name
    try:
        if name == "wandb":
            settings = {"project": "affordant"}
            return loggers.get_logger(name, str(folder), run, wandb_kwargs=settings)
        # get_logger would have MLflow keep its numbers in bare files, which MLflow gave up in 3.10.
        folder.mkdir(parents=True, exist_ok=True)
        database, artifacts = f"sqlite:///{folder / 'mlflow.db'}", (folder / "artifacts").as_uri()
        return loggers.MLFlowLogger(run, database, artifact_location=artifacts)
    except Exception as error:  # services have errors of their own: no network, no account, an old database
        raise UserError(
            f"--logger {name}: it does not open ({error}); mend that, or use --logger csv"
        ) from error
