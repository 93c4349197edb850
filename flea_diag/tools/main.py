"""The ``flea`` command: one subcommand a module, each with the same four names.

``NAME``, ``SUMMARY``, ``add_arguments(parser)`` and ``run(arguments) -> int``; ``EXAMPLES``
if it has any. Modules import numpy and what is slower inside ``run``, so that ``flea --help``
answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any

from flea_diag import __version__
from flea_diag.errors import FleaError

MODULES = (
    "model.model",
    "calibrate.calibrate",
    "stand.simulate",
    "stand.scenarios",
    "stand.realism",
    "features.features",
    "recordings.importer",
    "replay.replay",
    "evaluate.evaluate",
    "score.diff",
    "replay.trend",
    "bags.check",
    "bags.recover",
)
"""Modules of this package that are subcommands, in the order of ``flea --help``."""

DESCRIPTION = "Fault diagnosis of electro-mechanical actuators: model, calibrate, replay, inspect."
EXAMPLES = """\
examples:
  flea import recordings/*.data -o bags        FLEA text files to bags
  flea calibrate bags/*Nominal* -o cal.yaml    thresholds and parameters from nominal runs
  flea replay bags/run --calibration cal.yaml  the diagnosis of a bag, without ROS
  flea model signatures                        what each fault does to each residual
"""

USAGE_ERROR = 2
INTERRUPTED = 130


def commands() -> dict[str, Any]:
    """Import every subcommand there is, by the name it is called."""
    modules = [importlib.import_module(f"{__package__}.{name}") for name in MODULES]
    return {module.NAME: module for module in modules}


def parser_of(known: dict[str, Any]) -> argparse.ArgumentParser:
    """Build the parser of the whole command."""
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
    """Run one subcommand; 0 success, 1 done in part, 2 refused, 130 interrupted."""
    # BLAS threads on matrices this small only wait for each other; read once, by numpy's import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    known = commands()
    parsed = parser_of(known).parse_args(arguments)
    try:
        status = int(known[parsed.command].run(parsed))
        sys.stdout.flush()
        return status
    except FleaError as error:
        print(f"flea: {error}", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("flea: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe has gone (flea … | head). Python flushes stdout once more at
        # its exit, so that has to go where it cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
