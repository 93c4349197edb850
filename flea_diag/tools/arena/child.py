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

"""The process of an entrant: one line of JSON to it, one line back, within limits."""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from flea_diag.errors import DiagnoserError, shown
from flea_diag.wire.json_text import parse_json

LONGEST_LINE = 1 << 20
LAST_WORDS = 400
"""Characters of the error output that a reason quotes."""
MEGABYTE = 1 << 20
PATIENCE_S = 5.0
"""Time from the last answer to the end of the process."""


class Child:
    """One process of a diagnoser, from its start to its end.

    Parameters
    ----------
    command
        What to start.
    limit_s
        Wall clock time that it may take in all.
    memory_mb
        Memory that it may take, as its data (RLIMIT_DATA).

    Raises
    ------
    DiagnoserError
        It cannot be started.
    """

    def __init__(self, command: Sequence[str], limit_s: float, memory_mb: int) -> None:
        self._limit_s, self._memory_mb = limit_s, memory_mb
        self._late = False
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self.cpu_s, self.peak_bytes = 0.0, 0
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                start_new_session=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
        except OSError as error:
            self._said.close()
            raise DiagnoserError(f"{command[0]} cannot be started: {error.strerror}") from error
        self._bound()
        self._watch = threading.Timer(limit_s, self._end_late)
        self._watch.daemon = True
        self._watch.start()

    def _bound(self) -> None:
        """Limits of the process: memory at once, processor time as a last resort."""
        limits = (
            (resource.RLIMIT_DATA, self._memory_mb * MEGABYTE),
            (resource.RLIMIT_CPU, math.ceil(self._limit_s) + 5),
        )
        for kind, limit in limits:
            with suppress(OSError, ProcessLookupError):  # it may have ended
                resource.prlimit(self._process.pid, kind, (limit, limit))

    def ask(self, message: dict[str, Any]) -> dict[str, Any]:
        """Send one message; the answer, a mapping.

        Raises
        ------
        DiagnoserError
            It ended, took too long, or wrote something else than a line of JSON.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):  # it may have ended, and said why before
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        line = self._process.stdout.readline(LONGEST_LINE)
        if not line.endswith(b"\n"):
            raise DiagnoserError(self._why_ended(line))
        try:
            answer = parse_json(line.decode())
        except ValueError as error:
            raise DiagnoserError(
                f"wrote {shown(line.decode(errors='replace').rstrip())}, no line of JSON ({error})"
            ) from None
        if not isinstance(answer, dict):
            raise DiagnoserError(f"answered {shown(answer)}: a mapping is needed")
        if "failed" in answer:
            raise DiagnoserError(self._with_memory(str(answer["failed"])))
        return answer

    def close(self) -> None:
        """End the process, at the latest after some seconds, and note what it has taken."""
        if self._said.closed:
            return
        self.peak_bytes = self._peak()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                assert pipe is not None
                pipe.close()
        grace = threading.Timer(PATIENCE_S, self._kill)
        grace.start()
        self._reap()
        grace.cancel()
        self._watch.cancel()
        self._kill()  # whatever it has started itself
        self._said.close()

    def _why_ended(self, line: bytes) -> str:
        if len(line) >= LONGEST_LINE:
            return f"wrote a line of more than {LONGEST_LINE} bytes"
        self._reap()
        status = self._process.returncode
        if self._late:
            return f"took longer than {self._limit_s:g} s (--limit-s): ended"
        how = f"status {status}"
        if status < 0:
            how = f"signal {signal.Signals(-status).name}"
        return self._with_memory(f"its process ended with {how}{self._last_words()}")

    def _with_memory(self, reason: str) -> str:
        if "MemoryError" in reason or "bad_alloc" in reason or "allocate memory" in reason:
            return f"needed more than {self._memory_mb} MB (--memory-mb): {reason}"
        return reason

    def _last_words(self) -> str:
        size = self._said.seek(0, os.SEEK_END)
        self._said.seek(max(size - LAST_WORDS, 0))
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return f": {lines[-1]}" if lines else ""

    def _reap(self) -> None:
        """Wait for the end of the process, which may have come, and note its costs."""
        if self._process.returncode is not None:
            return
        with suppress(ChildProcessError):
            _, status, used = os.wait4(self._process.pid, 0)
            self._process.returncode = os.waitstatus_to_exitcode(status)
            self.cpu_s = used.ru_utime + used.ru_stime

    def _peak(self) -> int:
        """Peak resident memory in bytes; the usage of a child counts its parent's at the start."""
        try:
            lines = Path(f"/proc/{self._process.pid}/status").read_text("ascii").splitlines()
        except OSError:
            return 0
        return next((int(w.split()[1]) * 1024 for w in lines if w.startswith("VmHWM:")), 0)

    def _end_late(self) -> None:
        self._late = True
        self._kill()

    def _kill(self) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
