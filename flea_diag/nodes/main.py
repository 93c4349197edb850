"""Starts an executable of the package by name: ``python -m flea_diag.nodes.main diagnoser``.

What an executable imports takes longer than people wait after Ctrl-C. So signals are taken before
that, and a launcher holds them back until then: not even the start of Python shows a traceback.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from importlib import import_module

from flea_diag.nodes.executables import EXECUTABLES
from flea_diag.wire.ending import ENDING, end_at_once


def main(argv: Sequence[str] | None = None) -> int:
    """Run the executable named first, with the other arguments; the exit status."""
    end_at_once()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments else ""
    if name not in EXECUTABLES:
        known = ", ".join(EXECUTABLES)
        print(f"flea_diag: no executable {name!r}, known are {known}", file=sys.stderr)
        return 2
    return int(import_module(EXECUTABLES[name]).main(arguments[1:]))


if __name__ == "__main__":
    sys.exit(main())
