"""Prompt and orderly end on SIGINT and SIGTERM in every phase of a process: status 0, no traceback.

Before rclpy is loaded, a signal ends the process at once: nothing is open yet. From then on both
signals are blocked, in every thread, and a thread of its own waits for them: it asks the program to
end, which closes what it has open and only then its context of rclpy. rclpy's own handlers would
end the context in the middle of a call that publishes or logs. The same thread enforces the exit if
the program does not end in time, for example during compilation.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable

ENDING = (signal.SIGINT, signal.SIGTERM)


def end_at_once() -> None:
    """Have a signal end the process, with status 0: nothing is open yet.

    An exception would be raised in the middle of an import.
    """
    for number in ENDING:
        signal.signal(number, lambda *_: os._exit(0))


def leave() -> None:
    """End the process with status 0 although a thread of it is busy outside Python.

    The interpreter's own end would fail when that thread comes back.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


class Ending:
    """Waits for SIGINT and SIGTERM in a thread, and enforces the end of the process.

    To be made before rclpy starts its threads, which inherit that the signals are blocked. They
    remain blocked until the process has gone: its interpreter restores the default handlers first.

    Parameters
    ----------
    patience_s
        Time allowed from a signal to the end of the process. May be changed until then.
    """

    def __init__(self, patience_s: float) -> None:
        self.patience_s = patience_s
        self.on_signal: Callable[[], None] = lambda: None
        """Asks the program to end; called at the first signal, in the thread of this object."""
        self._begun = threading.Event()
        self._met = threading.Event()
        signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        self._thread = threading.Thread(target=self._watch, name="ending", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """Begin the time allowed for the end, which the program has decided on itself."""
        self._begun.set()
        if self._thread.ident is not None:
            signal.pthread_kill(self._thread.ident, ENDING[0])

    def met(self) -> None:
        """Cancel what enforces the end: the process ends by itself."""
        self._met.set()

    def _watch(self) -> None:
        # No sigtimedwait: that of Python 3.11 takes being stopped past its time for a signal.
        signal.sigwait(ENDING)
        if not self._begun.is_set():
            self.on_signal()
        if not self._met.wait(self.patience_s):
            os._exit(0)
