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

"""The ``flea`` command: one module per subcommand, each with the same names.

``NAME``, ``SUMMARY``, ``add_arguments(parser)`` and ``run(arguments) -> int``, optionally
``EXAMPLES``. Modules import numpy and slower packages inside ``run``, so that ``flea --help``
responds at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from typing import Any, NoReturn

from flea_diag import __version__
from flea_diag.errors import FleaError, line_of, question, shown
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
    "export": "export.export",
    "evaluate": "evaluate.evaluate",
    "coverage": "evaluate.coverage",
    "fmea": "fmea.fmea",
    "diff": "score.diff",
    "trend": "replay.trend",
    "events": "replay.events",
    "report": "replay.report",
    "bag": "bags.check",
    "recover": "bags.recover",
}
"""Modules of the subcommands, in the order of ``flea --help``."""

EXIT_STATUS = """\
exit status: 0 done, 1 done in part or a limit not met, 2 refused, 130 interrupted
"""
DESCRIPTION = "Fault diagnosis of electro-mechanical actuators: model, calibrate, replay, inspect."
EXAMPLES = """\
examples:
  flea import recordings/*.data -o bags        convert FLEA text files to bags
  flea calibrate bags/*Nominal* -o cal.yaml    identify parameters and limits from nominal runs
  flea replay bags/run --calibration cal.yaml  diagnose a bag
  flea model signatures                        show the signature of each fault

exit status of every command: 0 done, 1 done in part or a limit not met, 2 refused, 130 interrupted
completion in bash and zsh (extra completion): eval "$(register-python-argcomplete flea)"
"""

COMPLETING = "_ARGCOMPLETE"
"""Set by a shell that asks argcomplete for what may come next."""
USAGE_ERROR = 2
INTERRUPTED = 130


def commands(names: Iterable[str] = MODULES) -> dict[str, Any]:
    """Import these subcommands, all by default."""
    return {name: importlib.import_module(f"{__package__}.{MODULES[name]}") for name in names}


class CommandParser(argparse.ArgumentParser):
    """A parser that names the word that is wrong, and the one that was meant.

    Python 3.14 has a part of it (``suggest_on_error``), for choices alone.
    """

    _given: tuple[str, ...] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does; the words are kept, to find the one that is wrong among them."""
        self._given = tuple(args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """End with status 2; a mistyped word comes with the closest one that is known."""
        if message.startswith("the following arguments are required") and self._stray():
            message = f"unrecognized arguments: {self._stray()}"
        unknown = message.removeprefix("unrecognized arguments: ")
        if unknown != message:
            word = next((w for w in unknown.split() if w.startswith("-")), unknown.split()[0])
            known = [option for option in self._option_string_actions if option.startswith("--")]
            message = f"unknown argument {shown(word)}{meant(word, known)}"
        elif wrong := _CHOICE.search(message):
            choices = re.findall(r"[^\s,']+", wrong[2])
            message = f"{wrong[1]!r} is unknown, choose from {wrong[2]}{meant(wrong[1], choices)}"
        super().error(message)

    def _stray(self) -> str:
        """The first option that is none of this command, also by its first letters."""
        options = self._option_string_actions
        words = (word.partition("=")[0] for word in self._given if word.startswith("--"))
        return next((w for w in words if not any(o.startswith(w) for o in options)), "")


_CHOICE = re.compile(r"invalid choice: '([^']*)' \(choose from (.*)\)", re.DOTALL)


def meant(word: str, known: Iterable[str]) -> str:
    """The question whether a similar word was meant; empty without one."""
    return question(word.partition("=")[0], known)


def parser_of(known: dict[str, Any]) -> argparse.ArgumentParser:
    """Parser of the whole command."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = CommandParser(
        prog="flea", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=raw
    )
    parser.add_argument("--version", action="version", version=f"flea_diag {__version__}")
    parts = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in known.items():
        part = parts.add_parser(
            name,
            help=module.SUMMARY,
            description=module.SUMMARY,
            epilog=_ended(getattr(module, "EXAMPLES", "")),
            formatter_class=raw,
        )
        module.add_arguments(part)
        for action in _actions(part):
            action.epilog, action.formatter_class = action.epilog or part.epilog, raw
    return parser


def _ended(examples: str) -> str:
    """Examples of a command, and how it ends where they do not say it."""
    if "exit status: 0" in examples.lower():
        return examples
    return f"{examples.rstrip()}\n\n{EXIT_STATUS}".lstrip()


def _actions(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """Parsers of the actions of a command, such as ``flea stand new``."""
    parts = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return list(parts[0].choices.values()) if parts else []


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand; 0 success, 1 partial success, 2 refused, 130 interrupted."""
    # BLAS threads only slow down matrices of this size; numpy reads the setting at its import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    search_less()
    given = sys.argv[1:] if arguments is None else arguments
    known = commands(name for name in given[:1] if name in MODULES) or commands()
    begin_command()
    parsed = _parsed(parser_of(known), given)
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


def _parsed(parser: argparse.ArgumentParser, given: Sequence[str]) -> argparse.Namespace:
    """Arguments of the command; those left over are the fault of the command that was named."""
    if COMPLETING in os.environ and find_spec("argcomplete"):
        import argcomplete

        argcomplete.autocomplete(parser)
    parsed, left = parser.parse_known_args(given)
    if left:
        for chosen in (parsed.command, getattr(parsed, "action", "")):
            parts = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
            parser = parts[0].choices[chosen] if parts and chosen else parser
        parser.error(f"unrecognized arguments: {' '.join(left)}")
    return parsed


if __name__ == "__main__":
    sys.exit(main())
