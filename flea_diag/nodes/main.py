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

"""Starts an executable of the package by name: ``python -m flea_diag.nodes.main diagnoser``.

Imports take longer than a user waits after Ctrl-C. Signal handlers are therefore set before them,
and the launcher blocks signals until then, so that no traceback appears even during start-up.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

from flea_diag.nodes.executables import EXECUTABLES, program_of
from flea_diag.wire.ending import ENDING, end_at_once


def main(argv: Sequence[str] | None = None) -> int:
    """Run the executable named by the first argument; returns the exit status."""
    end_at_once()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments else ""
    if name not in EXECUTABLES:
        known = ", ".join(EXECUTABLES)
        print(f"flea_diag: no executable {name!r}, known are {known}", file=sys.stderr)
        return 2
    from flea_diag.wire.bus import run

    return run(lambda: program_of(name), arguments[1:])


if __name__ == "__main__":
    sys.exit(main())
