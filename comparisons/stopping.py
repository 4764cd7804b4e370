"""How a command ends when it is told to: in order, with what is half-made taken away."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def orderly_exit() -> Iterator[None]:
    """Let SIGTERM end the program as an exception would, so that nothing half-made is left behind.

    The exit status is 143, as of a program that the signal ended itself. Elsewhere than on the main thread,
    which alone gets signals, this does nothing.

    Examples
    --------
    >>> from os import getpid, kill
    >>> try:
    ...     with orderly_exit():
    ...         kill(getpid(), signal.SIGTERM)
    ... except SystemExit as end:
    ...     print(end.code)
    143
    """

    def end(number: int, _frame: object) -> None:
        signal.signal(number, signal.SIG_IGN)  # a second one must not break off the tidying up
        sys.exit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)
