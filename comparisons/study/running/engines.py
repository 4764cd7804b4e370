"""What carries out runs: the seam between a study and the processes or machines that it runs on."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from types import TracebackType
from typing import Protocol, Self

from comparisons.study.running.work import Finished
from comparisons.study.spec import RunSpec


def never() -> bool:
    """Return False: nobody tells the engine to stop.

    >>> never()
    False
    """
    return False


class Engine(Protocol):
    """Carries out runs, each alone in a process on one thread, so that results never depend on the engine.

    A context manager: it has workers only inside. Whatever becomes of a run, it comes back: with its result,
    with the error that it raised, as "too long", or as "died" if its worker did so twice.
    """

    @property
    def name(self) -> str:
        """Such as "local"; it stands in every run's provenance."""

    def __enter__(self) -> Self:
        """Make ready; raises a `UserError` if that cannot be."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all workers, and what they are at."""

    def execute(
        self,
        jobs: Iterable[RunSpec],
        limit: float | None = None,
        stop: Callable[[], bool] = never,
    ) -> Generator[Finished, None, None]:
        """Yield runs as they end, in no order.

        Parameters
        ----------
        jobs
            What to run; taken as workers become free, never many ahead.
        limit
            Seconds that a run may take; None for as long as it likes.
        stop
            Asked a few times a second, even while nothing ends; once it is true, what is under way is dropped
            and nothing more is yielded.
        """
