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

"""``flea warm-up``: compiles ahead what nodes and replays need.

Compiled code is kept on disk by its content (``compile_cache``) and taken from there only if the
numeric libraries and the processor are the same: it is made where it is used, after installation.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_calibration, add_stand, chosen_stand
from flea_diag.tools.terminal import IN_PART, say, warn, write_json

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand

NAME = "warm-up"
SUMMARY = "compile ahead what nodes and replays need: the first start is then as quick as any other"
EXAMPLES = """\
examples:
  flea warm-up                 as the last step of an installation, or of an image
  flea warm-up --stand ./mine  for a stand of your own, whose relations are its own code
  flea warm-up --check         status 1 if anything still had to be compiled
  flea warm-up --json -        what was compiled, and how long it took
"""


BLOCK_SCANS = 1024
"""As many as a replay reads at once; more than the longest window, which has code of its own."""


@dataclass(frozen=True)
class WarmUpPart:
    """One part of the software: what was compiled for it, and how long that took."""

    part: str
    compiled: tuple[str, ...]
    seconds: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea warm-up``."""
    parser.add_argument(
        "--check", action="store_true", help="end with status 1 if anything had to be compiled"
    )
    add_json(parser, "the result")
    add_stand(parser)
    add_calibration(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compile part by part; return 0, or 1 with ``--check`` where something was not yet."""
    if find_spec("numba") is None:
        warn("numba is not installed: there is nothing to compile")
    quiet = arguments.json == "-"
    stand = chosen_stand(arguments, "calibration")
    steps = [_done(part, partial(work, stand), quiet) for part, work in PARTS.items()]
    names = [name for step in steps for name in step.compiled]
    if arguments.json:
        rows = [{"part": s.part, "compiled": list(s.compiled), "seconds": s.seconds} for s in steps]
        write_json(arguments.json, {"compiled": len(names), "parts": rows})
    if arguments.check and names:
        warn(
            f"{len(names)} functions were not on disk, among them {names[0]}: run flea warm-up as "
            "this user, or name a writable folder in NUMBA_CACHE_DIR"
        )
        return IN_PART
    return 0


def _done(part: str, work: Callable[[], None], quiet: bool) -> WarmUpPart:
    from flea_diag.core.backend import compiling

    names: list[str] = []

    def begun(name: str) -> None:
        names.append(name)
        if not quiet:
            say(f"{part}: compiling {name} ({len(names)})")

    begin_s = time.monotonic()
    with compiling(begun):
        work()
    step = WarmUpPart(part, tuple(names), round(time.monotonic() - begin_s, 1))
    if not quiet:
        say(f"{part}: ready after {step.seconds:.1f} s, {len(names)} functions compiled")
    return step


def _diagnosis(stand: Stand) -> None:
    from flea_diag.configuration.component import DIAGNOSER

    calibration = str(stand.calibration)
    DIAGNOSER.warm_up(DIAGNOSER.parameters(stand=str(stand.folder), calibration=calibration))


def _simulated(_: Stand) -> None:
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.stand import SimulatedStand

    SimulatedStand(find_scenario("nominal")).advance()


def _replay(diagnosed: Stand) -> None:
    """Scans of the simulated stand in a block, as a replay reads them from a bag."""
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import Scan
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.stand import SimulatedStand

    stand = SimulatedStand(find_scenario("nominal"))
    scans: list[Scan] = []
    while len(scans) < BLOCK_SCANS:
        scans += [record for record in stand.advance() if isinstance(record, Scan)]
    make_pipeline(diagnosed).handle_block(ScanBlock.of(*scans))


PARTS: dict[str, Callable[[Stand], None]] = {
    "diagnosis": _diagnosis,
    "simulated stand": _simulated,
    "replay": _replay,
}
"""Part -> what makes numba compile all of its functions."""
