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

"""Child processes of a live run: started, restarted after a crash, and ended in order."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import IO

from flea_diag.errors import ConfigurationError

END_S = 5.0
MOST_RESTARTS = 3
WITHIN_S = 60.0
"""Largest number of restarts of a node within ``WITHIN_S``; beyond it the run is given up."""
STAND = "daq"
"""The process that is not restarted: without the stand the run is over."""
PR_SET_PDEATHSIG = 1

Parameters = Mapping[str, str]
Tell = Callable[[str], None]


@dataclass
class _Child:
    """One node: its parameters, its process, and the times of its restarts (s, monotonic)."""

    parameters: dict[str, str]
    show: bool
    keys: bool
    process: subprocess.Popen[bytes]
    restarted: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_RESTARTS))


class Children:
    """The processes of one run; only these are ended, by their own handles.

    Parameters
    ----------
    log
        File for their output.
    tell
        Reports an action in one line.
    """

    def __init__(self, log: IO[bytes], tell: Tell) -> None:
        self._log = log
        self._tell = tell
        self._running: dict[str, _Child] = {}

    def start(
        self, name: str, parameters: Parameters, show: bool = False, keys: bool = False
    ) -> None:
        """Start a node; output goes to the log or (``show``) the terminal, with its ``keys``."""
        process = self._process(name, parameters, show, keys)
        self._running[name] = _Child(dict(parameters), show, keys, process)

    def _process(
        self, name: str, parameters: Parameters, show: bool, keys: bool
    ) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            command(name, parameters),
            stdin=None if keys else subprocess.DEVNULL,
            stdout=None if show else self._log,
            stderr=None if keys else self._log,
            # Ctrl-C must reach this process alone, which ends the nodes in order; a node that
            # reads the keyboard has to stay in this session.
            start_new_session=not keys,
            preexec_fn=end_with_parent,
        )

    def ended(self, name: str) -> bool:
        """Whether a node has ended."""
        return self._running[name].process.poll() is not None

    def supervise(self, finished: Collection[str], anew: Callable[[str], Parameters]) -> None:
        """Restart nodes ended by a signal; raise for nodes that ended by themselves.

        A node that exits with a status has reported an error that would recur. A node ended by a
        signal is restarted, at most ``MOST_RESTARTS`` times within ``WITHIN_S``.

        Parameters
        ----------
        finished
            Nodes that may end with status 0.
        anew
            Name -> parameters that replace the first ones at a restart (another bag).

        Raises
        ------
        ConfigurationError
            Names the node and its log.
        """
        for name, child in self._running.items():
            status = child.process.poll()
            if status is None or (status == 0 and name in finished):
                continue
            if status >= 0 or name == STAND:
                raise ConfigurationError(f"{name} ended with status {status}: see {self._log.name}")
            self._restart(name, child, -status, anew)

    def _restart(
        self, name: str, child: _Child, number: int, anew: Callable[[str], Parameters]
    ) -> None:
        now = time.monotonic()
        why = signal.Signals(number).name
        if len(child.restarted) == MOST_RESTARTS and now - child.restarted[0] < WITHIN_S:
            raise ConfigurationError(
                f"{name} was ended by {why} after {MOST_RESTARTS} restarts within "
                f"{WITHIN_S:.0f} s, the limit: run stopped, see {self._log.name}"
            )
        child.restarted.append(now)
        child.parameters.update(anew(name))
        child.process = self._process(name, child.parameters, child.show, child.keys)
        count = len(child.restarted)
        self._tell(f"{name} was ended by {why}: restart {count} of at most {MOST_RESTARTS}")

    def end(self) -> None:
        """End all running nodes, the last started first."""
        for name in reversed(self._running):
            self._end(name)

    def _end(self, name: str) -> None:
        child = self._running[name].process
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
        try:
            child.wait(END_S)
        except subprocess.TimeoutExpired:
            self._tell(f"{name} did not end within {END_S:.0f} s: killed")
            child.kill()
            child.wait()


def command(name: str, parameters: Parameters, *arguments: str) -> list[str]:
    """Command line of a node with these parameters."""
    given = [text for pair in parameters.items() for text in ("-p", "{}:={}".format(*pair))]
    ros = ["--ros-args", *given] if given else []
    return [sys.executable, "-m", "flea_diag.nodes.main", name, *arguments, *ros]


def refuse_unsound(nodes: Mapping[str, Parameters]) -> None:
    """Have each of these nodes check its parameters, before anything is started.

    Raises
    ------
    ConfigurationError
        What the first of them says that refuses its own.
    """
    checks = [
        subprocess.Popen(
            command(name, parameters, "--check"),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name, parameters in nodes.items()
    ]
    said = [check.communicate()[1] for check in checks]
    for check, text in zip(checks, said, strict=True):
        if check.returncode:
            line = text.strip().splitlines()[-1] if text.strip() else "a node cannot be checked"
            raise ConfigurationError(line.removeprefix("flea_diag: "))


def end_with_parent() -> None:
    """Have the kernel end this child when its parent is killed."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
