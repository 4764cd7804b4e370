"""How a command ends when it is told to: in order, at once or between two pieces of work."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NoReturn

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


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


class Told:
    """Whether the program was told to stop: false until then.

    Attributes
    ----------
    number
        The signal that told it; None until then.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def __bool__(self) -> bool:
        return self.number is not None

    def obey(self) -> NoReturn:
        """End as the signal would have ended it: by KeyboardInterrupt (130), or by SystemExit (143)."""
        if self.number == signal.SIGTERM:
            raise SystemExit(128 + signal.SIGTERM)
        raise KeyboardInterrupt


@contextmanager
def told_to_stop() -> Iterator[Told]:
    """Let Ctrl-C and SIGTERM be noted rather than break in; a second one breaks in as ever.

    Elsewhere than on the main thread, which alone gets signals, nothing is ever noted.

    Examples
    --------
    >>> from os import getpid, kill
    >>> with told_to_stop() as told:
    ...     before = bool(told)
    ...     kill(getpid(), signal.SIGINT)
    ...     print(before, bool(told))
    False True
    """
    told = Told()
    if threading.current_thread() is not threading.main_thread():
        yield told
        return
    before = {number: signal.getsignal(number) for number in _SIGNALS}

    def back() -> None:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def note(number: int, _frame: object) -> None:
        told.number = number
        back()

    for number in _SIGNALS:
        signal.signal(number, note)
    try:
        yield told
    finally:
        back()
