"""The ``flea`` command: one module per subcommand, each with the same names.

``NAME``, ``SUMMARY``, ``add_arguments(parser)`` and ``run(arguments) -> int``, optionally
``EXAMPLES``. Modules import numpy and slower packages inside ``run``, so that ``flea --help``
responds at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from flea_diag import __version__
from flea_diag.errors import FleaError, line_of
from flea_diag.tools.garbage import search_less
from flea_diag.wire.command_budget import begin_command

MODULES = {
    "stand": "stand_folder.command",
    "model": "model.model",
    "calibrate": "calibrate.calibrate",
    "simulate": "stand.simulate",
    "scenarios": "stand.scenarios",
    "realism": "stand.realism",
    "warm-up": "stand.warm_up",
    "features": "features.features",
    "import": "recordings.importer",
    "replay": "replay.replay",
    "evaluate": "evaluate.evaluate",
    "coverage": "evaluate.coverage",
    "diff": "score.diff",
    "trend": "replay.trend",
    "events": "replay.events",
    "bag": "bags.check",
    "recover": "bags.recover",
}
"""Modules of the subcommands, in the order of ``flea --help``."""

DESCRIPTION = "Fault diagnosis of electro-mechanical actuators: model, calibrate, replay, inspect."
EXAMPLES = """\
examples:
  flea import recordings/*.data -o bags        convert FLEA text files to bags
  flea calibrate bags/*Nominal* -o cal.yaml    identify parameters and limits from nominal runs
  flea replay bags/run --calibration cal.yaml  diagnose a bag
  flea model signatures                        show the signature of each fault
"""

USAGE_ERROR = 2
INTERRUPTED = 130


def commands(names: Iterable[str] = MODULES) -> dict[str, Any]:
    """Import these subcommands, all by default."""
    return {name: importlib.import_module(f"{__package__}.{MODULES[name]}") for name in names}


def parser_of(known: dict[str, Any]) -> argparse.ArgumentParser:
    """Parser of the whole command."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="flea", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=raw
    )
    parser.add_argument("--version", action="version", version=f"flea_diag {__version__}")
    parts = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in known.items():
        part = parts.add_parser(
            name,
            help=module.SUMMARY,
            description=module.SUMMARY,
            epilog=getattr(module, "EXAMPLES", None),
            formatter_class=raw,
        )
        module.add_arguments(part)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand; 0 success, 1 partial success, 2 refused, 130 interrupted."""
    # BLAS threads only slow down matrices of this size; numpy reads the setting at its import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    search_less()
    given = sys.argv[1:] if arguments is None else arguments
    known = commands(name for name in given[:1] if name in MODULES) or commands()
    begin_command()
    parsed = parser_of(known).parse_args(given)
    try:
        status = int(known[parsed.command].run(parsed))
        sys.stdout.flush()
        return status
    except FleaError as error:
        print(f"flea: {line_of(error)}", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("flea: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of the pipe has closed it (flea … | head). Python flushes stdout again at
        # exit, which must not fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
