"""Signals that end a command: Ctrl+C (SIGINT), and SIGTERM, which `kill`, containers and job schedulers send."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """A signal that ends the command.

    Parameters
    ----------
    number : int
        Of the signal.
    state : str
        What was done by then and how to continue, as the end of the message.

    Attributes
    ----------
    number : int
    code : int
        Exit code, as shells have it: 130 after Ctrl+C, 143 after SIGTERM.
    """

    def __init__(self, number: int, state: str = "") -> None:
        super().__init__(("interrupted" if number == signal.SIGINT else "ended from outside (SIGTERM)") + state)
        self.number, self.code = number, 128 + number


def interruptible() -> AbstractContextManager[None]:
    """Raise Interrupted in the block at the first signal; the next one ends the process at once."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise Interrupted(number)

    return handled(interrupt)


@contextmanager
def handled(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> Iterator[None]:
    """Handle the signals in this way in the block, which only the main thread can; Blender has a way of its own."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in SIGNALS}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, signal.SIG_DFL if earlier is None else earlier)
