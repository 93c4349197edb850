# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Prompt and orderly end on SIGINT and SIGTERM in every phase of a process: status 0, no traceback.

Before rclpy is loaded, a signal ends the process at once: nothing is open yet. From then on a
thread of its own is told of each signal, whichever thread the system gives it to (a library may
have begun one early), and asks the program to end, which closes what it has open and only then its
context of rclpy. rclpy's own handlers would end the context in the middle of a call that publishes
or logs. The same thread enforces the exit if the program does not end in time, for example during
compilation.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

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
    """Hears SIGINT and SIGTERM in a thread, and enforces the end of the process.

    To be made in the main thread.

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
        self._heard, self._tell = os.pipe()
        os.set_blocking(self._tell, False)
        # The system's handler writes there at once, even while Python is busy elsewhere; where an
        # event loop has put its own descriptor in place, that of Python does.
        signal.set_wakeup_fd(self._tell, warn_on_full_buffer=False)
        for number in ENDING:
            signal.signal(number, lambda *_: self._wake())
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
        threading.Thread(target=self._watch, name="ending", daemon=True).start()

    def begin(self) -> None:
        """Begin the time allowed for the end, which the program has decided on itself."""
        self._begun.set()
        self._wake()

    def met(self) -> None:
        """Cancel what enforces the end: the process ends by itself, and hears no more signals."""
        self._met.set()
        for number in ENDING:
            signal.signal(number, signal.SIG_IGN)  # the interpreter would restore the default

    def _wake(self) -> None:
        with suppress(BlockingIOError):
            os.write(self._tell, b"\0")

    def _watch(self) -> None:
        os.read(self._heard, 1)
        if not self._begun.is_set():
            self.on_signal()
        if not self._met.wait(self.patience_s):
            os._exit(0)
