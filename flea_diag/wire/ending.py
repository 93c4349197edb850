"""Prompt exit on SIGINT and SIGTERM in every phase of a process: status 0, no traceback.

Three phases. Before rclpy is loaded, a signal ends the process at once: nothing is open yet.
While rclpy installs its handlers, signals are blocked, so that none is lost between two handlers.
From then on rclpy's handler shuts the context down, which ends the executor. A thread enforces
the exit if the main thread does not return to Python in time, for example during compilation.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ENDING = (signal.SIGINT, signal.SIGTERM)
LOOK_S = 0.05


def end_at_once() -> None:
    """Phase one: a signal ends the process, with status 0.

    An exception would be raised in the middle of an import.
    """
    for number in ENDING:
        signal.signal(number, lambda *_: os._exit(0))


@contextmanager
def handed_over() -> Iterator[None]:
    """Phase two: block signals; on exit they are delivered to the handlers set inside.

    rclpy also calls the previous handler; Python's default would raise KeyboardInterrupt anywhere.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        for number in ENDING:
            signal.signal(number, lambda *_: None)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


def ignore() -> None:
    """Ignore further signals during interpreter shutdown.

    The interpreter restores the default handlers before it exits; a SIGINT would then kill the
    process. Ignored signals stay ignored.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def leave() -> None:
    """End the process with status 0 although a thread of it is busy outside Python.

    The interpreter's own end would fail when that thread comes back.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


class Deadline:
    """Phase three: ends the process if it does not end in time after a shutdown request.

    Parameters
    ----------
    running
        Whether no shutdown has been requested; called from another thread.
    patience_s
        Time allowed for the shutdown. May be changed until a shutdown is requested.
    """

    def __init__(self, running: Callable[[], bool], patience_s: float) -> None:
        self.patience_s = patience_s
        self._running = running
        self._ended = threading.Event()
        threading.Thread(target=self._watch, name="deadline", daemon=True).start()

    def met(self) -> None:
        """Cancel the deadline: the process ends by itself."""
        self._ended.set()

    def _watch(self) -> None:
        while self._running():
            if self._ended.wait(LOOK_S):
                return
        if not self._ended.wait(self.patience_s):
            os._exit(0)
