"""Signals such as Ctrl+C while threads work.

A handler that raises in the main thread may do so inside of a lock, between taking it and noting that it is taken. It
then stays locked, and the threads that wait for it never end.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

HELD = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def signals_held() -> Iterator[Callable[[], None]]:
    """Hold signals back in the block; the function that it gives lets their handlers run, and so does its end.

    Only handlers in Python are held back, and only in the main thread, where all of them run.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    handlers = {number: signal.getsignal(number) for number in HELD}
    came: list[tuple[int, FrameType | None]] = []

    def hold(number: int, frame: FrameType | None) -> None:
        came.append((number, frame))

    def let_in() -> None:
        while came:
            number, frame = came.pop(0)
            handler = handlers[signal.Signals(number)]
            assert callable(handler)
            handler(number, frame)

    held = [number for number, handler in handlers.items() if callable(handler)]
    for number in held:
        signal.signal(number, hold)
    try:
        yield let_in
    finally:
        for number in held:
            # A handler that ran may have set another one.
            if signal.getsignal(number) is hold:
                signal.signal(number, handlers[number])
    let_in()
