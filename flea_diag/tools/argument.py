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

"""Numeric command-line arguments with limits, checked by argparse.

Each is the ``type`` of an argument; what is refused is named with its option and its limit.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError
from pathlib import Path

MOST = 1_000_000
MOST_JOBS = 1024


def count(text: str) -> int:
    """A whole number from 1 on."""
    number = int(text) if text.isdecimal() else 0
    if not 1 <= number <= MOST:
        raise ArgumentTypeError(f"{text!r} must be a whole number from 1 to {MOST}")
    return number


def add_json(
    parser: ArgumentParser, what: str, where: str = "on standard output, or to the file OUT"
) -> None:
    """Declare ``--json``, the same in all commands: alone it prints, with a name it writes."""
    parser.add_argument(
        "--json",
        nargs="?",
        const="-",
        type=_json_target,
        metavar="OUT",
        help=f"{what} as JSON: {where}; put it after the other arguments",
    )


def _json_target(text: str) -> str:
    """Where JSON goes; what was recorded is not to be overwritten by a word in the wrong place."""
    place = Path(text)
    if place.is_file() and place.suffix != ".json":
        raise ArgumentTypeError(
            f"{text!r} exists and is no .json file: put --json after the other arguments, or name "
            "another file"
        )
    if (place / "metadata.yaml").exists():
        raise ArgumentTypeError(
            f"{text!r} is a bag: put --json after the other arguments, or name another file"
        )
    return text


def add_jobs(parser: ArgumentParser) -> None:
    """Declare ``-j``, for commands that work on one file after the other."""
    parser.add_argument(
        "-j",
        "--jobs",
        type=_jobs,
        default=1,
        metavar="N",
        help="processes that share the work; results are the same (default %(default)s)",
    )


def add_cluster(parser: ArgumentParser) -> None:
    """Declare ``--dask``, for commands whose work a cluster may share."""
    parser.add_argument(
        "--dask",
        default="",
        metavar="ADDRESS",
        help="share the work among the workers of a Dask scheduler, who see the same files; "
        "results are the same",
    )


def _jobs(text: str) -> int:
    number = int(text) if text.isdecimal() else 0
    if not 1 <= number <= MOST_JOBS:
        raise ArgumentTypeError(f"{text!r} must be a whole number from 1 to {MOST_JOBS}")
    return number


def positive(text: str) -> float:
    """A finite number above 0."""
    number = _number(text)
    if not 0.0 < number < math.inf:
        raise ArgumentTypeError(f"{text!r} must be a number above 0")
    return number


def share(text: str) -> float:
    """A number between 0 and 1, neither of them."""
    number = _number(text)
    if not 0.0 < number < 1.0:
        raise ArgumentTypeError(f"{text!r} must lie between 0 and 1")
    return number


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
