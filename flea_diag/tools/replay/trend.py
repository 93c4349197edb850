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

"""``flea trend``: fault size over the episodes and bags of one actuator."""

from __future__ import annotations

import argparse
import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import FleaError
from flea_diag.formats import stamped
from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_calibration, add_stand, given_stand
from flea_diag.tools.terminal import IN_PART, progress, say, warn, write_json, write_text

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.wire.records import AmbiguityGroup, ChannelTable

NAME = "trend"
SUMMARY = "estimate the trend of a fault size over the bags of one actuator"
EXAMPLES = """\
examples:
  flea trend bags/2026*                            from the recorded verdicts
  flea trend bags/2026* --calibration cal.yaml     from a new diagnosis
  flea trend bags/* --serial EMA-007               of one actuator only
  flea trend bags/* --json trend.json --csv trend.csv

The serial number is that of the channels of the test actuator in the channel table. After a
simulated stand has switched to its other unit, it is that of the faulty unit. Bags without a
serial number are listed as 'unknown'. In the JSON file, `times` (s) and `data` of each trend have
the format of progpy's SimResult; `sigmas` are the standard errors.
"""
OF_ACTUATOR = ("motor_current", "motor_voltage", "motor_speed", "actuator_position")
"""Channels with the serial number of the test actuator; the first one given counts."""
UNKNOWN = "unknown"
DAY_S = 86400.0
ANEW = "calibration; with it, or with --stand, bags are diagnosed again, ignoring recorded verdicts"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="bags of any actuators")
    parser.add_argument("--serial", help="use only the actuator with this serial number")
    add_stand(parser)
    add_calibration(parser, ANEW)
    parser.add_argument("--csv", type=Path, metavar="OUT", help="write one line per estimate")
    add_json(parser, "estimates and trends")


@dataclass(frozen=True)
class Estimate:
    """Size of one fault by the last verdict of one episode.

    ``outcome`` says whether the fault was isolated or is one of several possible ones.
    """

    serial: str
    fault: str
    stamp_ns: int
    size: float
    size_sigma: float
    unit: str
    outcome: str
    probability: float
    bag: str
    episode: int


def run(arguments: argparse.Namespace) -> int:
    """Collect the estimates of all bags, print and write their trends."""
    stand = given_stand(arguments)
    found: list[Estimate] = []
    refused = 0
    for number, bag in enumerate(arguments.bags, 1):
        progress(number, len(arguments.bags), bag.name)
        try:
            found += estimates(bag, stand)
        except FleaError as error:
            refused += 1
            warn(str(error))
    if arguments.serial:
        found = [entry for entry in found if entry.serial == arguments.serial]
    found.sort(key=lambda entry: (entry.serial, entry.fault, entry.unit, entry.stamp_ns))
    trends = [_trend(part) for part in _parts(found)]
    if arguments.csv:
        _write_csv(arguments.csv, found)
    if arguments.json:
        write_json(arguments.json, stamped("trend", {"trends": trends}))
    if arguments.json != "-":
        say("\n".join(map(_words, trends)) or "no fault size was estimated in these bags")
    if refused == len(arguments.bags):
        return 2
    return IN_PART if refused else 0


def estimates(bag: Path, stand: Stand | None = None) -> list[Estimate]:
    """Sizes at the end of the episodes of a bag.

    Raises
    ------
    RecordingError
        There is no flea_diag bag.
    """
    from flea_diag.tools.replay.replay import diagnosis
    from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, ChannelTable, Truth

    mounted = owner = ""
    last: dict[int, tuple[AmbiguityGroup, str]] = {}
    # The truth is read for the serial number only: no stage consumes it.
    for record in diagnosis(bag, stand, (ChannelTable, Truth, AmbiguityGroup)):
        if isinstance(record, ChannelTable):
            mounted = serial_of(record)
        elif isinstance(record, Truth):
            owner = dict(record.details).get("serial", "")
        elif isinstance(record, AmbiguityGroup) and record.detected_stamp_ns != NEVER_NS:
            last[record.detected_stamp_ns] = record, owner or mounted or UNKNOWN
    return [entry for group, serial in last.values() for entry in _of_group(group, serial, bag)]


def serial_of(table: ChannelTable) -> str:
    """Serial number of the test actuator; empty if the table has none."""
    rows = map(table.info, OF_ACTUATOR)
    return next((row.serial for row in rows if row is not None and row.serial), "")


def _of_group(group: AmbiguityGroup, serial: str, bag: Path) -> Iterator[Estimate]:
    for member in group.members:
        # A size without standard error, or at a bound (error 0), is not an estimate.
        if math.isfinite(member.size) and member.size_sigma > 0.0:
            yield Estimate(
                serial,
                member.fault,
                group.stamp_ns,
                member.size,
                member.size_sigma,
                member.size_unit,
                group.outcome.value,
                member.probability,
                str(bag),
                group.episode,
            )


def _parts(found: Sequence[Estimate]) -> list[list[Estimate]]:
    """Comparable estimates: one actuator, one fault, one unit of its size."""
    parts: dict[tuple[str, str, str], list[Estimate]] = {}
    for entry in found:
        parts.setdefault((entry.serial, entry.fault, entry.unit), []).append(entry)
    return list(parts.values())


def _trend(part: Sequence[Estimate]) -> dict[str, Any]:
    from flea_diag.core.likelihood.trend import trend

    first = part[0]
    times = [(entry.stamp_ns - first.stamp_ns) / 1e9 for entry in part]
    line = trend(times, [e.size for e in part], [e.size_sigma for e in part])
    return {
        "serial": first.serial,
        "fault": first.fault,
        "unit": first.unit,
        "since_ns": first.stamp_ns,
        "times": times,
        "data": [{"size": entry.size} for entry in part],
        "sigmas": [entry.size_sigma for entry in part],
        "level": line.level,
        "level_sigma": line.level_sigma,
        "slope_per_s": _known(line.slope),
        "slope_sigma_per_s": _known(line.slope_sigma),
        "direction": line.direction,
        "estimates": [asdict(entry) for entry in part],
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _words(entry: dict[str, Any]) -> str:
    """One trend in a line."""
    unit, count = entry["unit"], len(entry["times"])
    head = f"{entry['serial']:12} {entry['fault']:26}"
    level = f"{entry['level']:.3g} ± {entry['level_sigma']:.2g} {unit}"
    if entry["slope_per_s"] is None:
        return f"{head} {level}, {count} estimate{'s' if count > 1 else ''}: no trend without time"
    slope, sigma = entry["slope_per_s"] * DAY_S, entry["slope_sigma_per_s"] * DAY_S
    return (
        f"{head} {level}, {count} estimates: {slope:+.3g} ± {sigma:.2g} {unit} a day, "
        f"{entry['direction']}"
    )


def _write_csv(path: Path, found: Sequence[Estimate]) -> None:
    text = io.StringIO()
    rows = csv.DictWriter(text, [entry.name for entry in fields(Estimate)], lineterminator="\n")
    rows.writeheader()
    rows.writerows(map(asdict, found))
    write_text(path, text.getvalue())
