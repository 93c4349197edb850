"""SIGINT and SIGTERM from the first line of a process to its last: status 0, no traceback, soon.

Three phases. Before rclpy is there a signal ends the process at once: nothing is open yet. While
rclpy takes the signals over they are held back, so that none falls between two handlers. From
then on rclpy's handler shuts the context down, which ends the executor; a thread sees to it that
the process ends even where Python gets no turn for long, as in a compiler.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ENDING = (signal.SIGINT, signal.SIGTERM)
LOOK_S = 0.05


def end_at_once() -> None:
    """Phase one: a signal ends the process, with status 0.

    An exception would come out of the middle of some import.
    """
    for number in ENDING:
        signal.signal(number, lambda *_: os._exit(0))


@contextmanager
def handed_over() -> Iterator[None]:
    """Phase two: what arrives meanwhile is delivered at the end, to the handlers set inside.

    rclpy calls the handler that it found; Python's own would raise KeyboardInterrupt anywhere.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        for number in ENDING:
            signal.signal(number, lambda *_: None)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


def ignore() -> None:
    """At the very end: the interpreter gives handlers back to the system before it is gone.

    One more SIGINT would then kill the process; an ignored signal it leaves alone.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


class Deadline:
    """Phase three: ends the process where it has not ended itself soon after it was told to.

    Parameters
    ----------
    running
        Whether nobody has asked it to end; called from another thread.
    patience_s
        How long the end may take. May be changed while nobody has asked.
    """

    def __init__(self, running: Callable[[], bool], patience_s: float) -> None:
        self.patience_s = patience_s
        self._running = running
        self._ended = threading.Event()
        threading.Thread(target=self._watch, name="deadline", daemon=True).start()

    def met(self) -> None:
        """The process ends by itself: nothing is to be done any more."""
        self._ended.set()

    def _watch(self) -> None:
        while self._running():
            if self._ended.wait(LOOK_S):
                return
        if not self._ended.wait(self.patience_s):
            os._exit(0)
