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

"""``flea stand``: one module per action, each with ``SUMMARY``, ``add_arguments`` and ``run``."""

from __future__ import annotations

import argparse
import importlib
from typing import Any

NAME = "stand"
SUMMARY = "make the folder of a stand of your own; check what recordings are good for"
EXAMPLES = """\
examples:
  flea stand new ./mine --from run.csv              channels, units and signs guessed from a table
  flea stand new ./mine --from bag --template wing  from a bag; the kind of actuator is given
  flea stand check ./mine recordings/healthy_*      what they show, and what is missing
"""

ACTIONS = ("new", "check")
"""Modules of the actions, in the order of ``flea stand --help``."""


def _module(action: str) -> Any:
    return importlib.import_module(f"{__package__}.{action}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name in ACTIONS:
        module = _module(name)
        module.add_arguments(
            actions.add_parser(name, help=module.SUMMARY, description=module.SUMMARY)
        )


def run(arguments: argparse.Namespace) -> int:
    """Run one action."""
    return int(_module(arguments.action).run(arguments))
