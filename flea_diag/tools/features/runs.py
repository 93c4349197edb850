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

"""Labelled runs for ``flea features``: bags, or seeds of the simulated stand."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence

from flea_diag.configuration.stand import Stand
from flea_diag.errors import ConfigurationError, FleaError, shown
from flea_diag.tools.features.samples import FeatureRun, Grid, run_of_bag
from flea_diag.tools.features.stand import LARGEST_LOAD_N, SEVERITIES, stand_runs
from flea_diag.tools.planned_runs import check_planned
from flea_diag.tools.stand_option import chosen_stand
from flea_diag.tools.terminal import warn


def labelled_runs(
    arguments: argparse.Namespace,
    orders: Mapping[str, float],
    faults: Sequence[str] = tuple(SEVERITIES),
    nominal: bool = True,
) -> tuple[list[FeatureRun], str, int]:
    """Runs of bags or of the simulated stand, their source, and 1 if some could not be read.

    ``orders`` of the lines that features track.

    Raises
    ------
    ConfigurationError
        Neither bags nor seeds are given, or loads or seeds are invalid.
    """
    grid = Grid(arguments.window, arguments.hop, orders)
    if arguments.seeds:
        seeds, loads = seeds_of(arguments.seeds), _loads(arguments.loads)
        planned = len(seeds) * (len(faults) + 4 * nominal)
        check_planned(planned, "features", allow_large=arguments.allow_large)
        # Four times as many nominal runs as runs of a fault: ranges need more windows than entries.
        runs = stand_runs(seeds, faults, arguments.duration, grid, arguments.jobs, loads)
        if nominal:
            more = range(seeds.start * 10, seeds.start * 10 + 4 * len(seeds))
            runs += stand_runs(more, ["nominal"], arguments.duration, grid, arguments.jobs, loads)
        return runs, f"simulated stand, seeds {arguments.seeds}, loads {arguments.loads} N", 0
    if not arguments.bags:
        raise ConfigurationError("features: give bags, or --seeds FIRST:LAST")
    runs, failed = [], 0
    for directory in arguments.bags:
        try:
            runs.append(run_of_bag(directory, grid))
        except FleaError as error:
            warn(f"{directory}: not used: {error}")
            failed = 1
        else:
            if not runs[-1].samples:
                warn(f"{directory}: no usable window: vibration or truth is missing")
    return runs, f"{len(runs)} bags", failed


def seeds_of(text: str) -> range:
    """Seeds of ``FIRST:LAST``, without the last one.

    Raises
    ------
    ConfigurationError
        The text is not a range of seeds.
    """
    first, _, last = text.partition(":")
    if not (first.isdecimal() and last.isdecimal() and int(first) < int(last)):
        raise ConfigurationError(
            f"features: --seeds = {shown(text)} must be FIRST:LAST, such as 0:20"
        )
    return range(int(first), int(last))


def _loads(text: str) -> tuple[float, float]:
    first, _, last = text.partition(":")
    try:
        low, high = float(first), float(last)
    except ValueError:
        low, high = math.nan, math.nan
    if not 0.0 <= low < high <= LARGEST_LOAD_N:
        raise ConfigurationError(
            f"features: --loads = {shown(text)} must be LOW:HIGH within 0 to {LARGEST_LOAD_N:g} N"
        )
    return low, high


def stand_of(arguments: argparse.Namespace) -> Stand:
    """The stand of the arguments; a range of seeds is refused with the option that takes it."""
    if ":" in arguments.stand:
        raise ConfigurationError(
            f"features: --stand = {shown(arguments.stand)} is no stand; seeds of simulated runs "
            "are given by --seeds FIRST:LAST"
        )
    return chosen_stand(arguments)
