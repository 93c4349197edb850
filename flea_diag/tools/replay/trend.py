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

"""``flea trend``: how a fault of one actuator grows over its bags, and how long it will last."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError, FleaError, shown
from flea_diag.formats import stamped
from flea_diag.tools.argument import add_json, positive
from flea_diag.tools.extra import require
from flea_diag.tools.replay.size_estimates import WRITTEN, Estimate, estimates, measured
from flea_diag.tools.stand_option import add_calibration, add_stand, chosen_stand, given_stand
from flea_diag.tools.terminal import IN_PART, progress, say, warn, write_json, write_text

if TYPE_CHECKING:
    from flea_diag.core.prognosis.growth_law import GrowthLaw
    from flea_diag.tools.replay.unit_trend import UnitTrend

NAME = "trend"
SUMMARY = "estimate the growth of a fault and the remaining life over the bags of one actuator"
EXAMPLES = """\
examples:
  flea trend bags/2026*                            from the recorded verdicts
  flea trend bags/2026* --calibration cal.yaml     from a new diagnosis
  flea trend bags/2026* --fault winding_short      its size in every bag, detected or not
  flea trend bags/* --fault magnet_loss --new bags/day_0 bags/day_1 --limit 0.2
  flea trend bags/* --fault spall --size 'impacts at the nut line' --limit 20
  flea trend bags/* --serial EMA-007               of one actuator only
  flea trend bags/* --json trend.json --csv trend.csv --plot trend.png

The serial number is that of the channels of the test actuator in the channel table. After a
simulated stand has switched to its other unit, it is that of the faulty unit. Bags without a
serial number are listed as 'unknown'. What a unit differs by from the design moves the sizes of all
its bags alike: the trend is known by what is left. Bags of the unit as new tell the rest of it. In
the JSON file, `times` (s) and `data` of each trend have the format of progpy's SimResult; `sigmas`
are the standard errors, `own_sigmas` their part that bags do not share.
"""
ANEW = "calibration; with it, or with --stand, bags are diagnosed again, ignoring recorded verdicts"
PICTURES = (".png", ".svg", ".pdf")
LAW_NAMES = ("linear", "exponential", "Paris")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="bags of any actuators")
    parser.add_argument("--serial", help="use only the actuator with this serial number")
    parser.add_argument("--fault", help="estimate its size by the whole of every bag")
    parser.add_argument("--size", help="use only this size of the fault, by its name")
    parser.add_argument(
        "--new", nargs="+", type=Path, default=[], metavar="BAG",
        help="bags of the unit as new, without the fault; with --fault",
    )  # fmt: skip
    parser.add_argument(
        "--limit", type=positive,
        help="size at the end of life, in its unit (default: `limit` of the catalogue)",
    )  # fmt: skip
    parser.add_argument("--law", choices=LAW_NAMES, help="how it grows (default: any, weighed)")
    add_stand(parser)
    add_calibration(parser, ANEW)
    parser.add_argument(
        "--plot", type=Path, metavar="OUT",
        help="draw sizes, forecast, limit and when it is reached, as .png, .svg or .pdf (needs "
        "matplotlib)",
    )  # fmt: skip
    parser.add_argument("--csv", type=Path, metavar="OUT", help="write one line per estimate")
    add_json(parser, "estimates, trends and forecasts")


def run(arguments: argparse.Namespace) -> int:
    """Collect the estimates of all bags, print and write their trends."""
    if arguments.new and not arguments.fault:
        raise ConfigurationError("--new needs --fault: a verdict on a new unit has no size")
    if arguments.plot:
        _check_plot(arguments.plot)
    sized = _sizing(arguments)
    found, refused = _collected(arguments.bags, sized)
    new, _ = _collected(arguments.new, sized)
    kept = [entry for entry in found if _wanted(entry, arguments)]
    trends = _trends(kept, [entry for entry in new if _wanted(entry, arguments)], arguments)
    if arguments.csv:
        _write_csv(arguments.csv, [entry for each in trends for entry in each.all])
    if arguments.plot and trends:
        from flea_diag.tools.replay.trend_picture import draw_trends

        draw_trends(trends, arguments.plot)
    if arguments.json:
        written = {"trends": [each.to_mapping() for each in trends]}
        write_json(arguments.json, stamped("trend", written))
    if arguments.json != "-":
        say("\n".join(each.words() for each in trends) or _nothing(found, arguments))
    if refused == len(arguments.bags):
        return 2
    return IN_PART if refused else 0


def _check_plot(path: Path) -> None:
    require("plot", "--plot")
    if path.suffix not in PICTURES:
        raise ConfigurationError(f"--plot {shown(path)}: must end in {', '.join(PICTURES)}")


def _sizing(arguments: argparse.Namespace) -> Callable[[Path], list[Estimate]]:
    """How a bag gives its sizes."""
    if not arguments.fault:
        given = given_stand(arguments)
        return lambda bag: estimates(bag, given)
    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.knowledge import knowledge
    from flea_diag.stages.sizes.all_sizes import AllSizes

    stand, fault = chosen_stand(arguments, "calibration"), arguments.fault
    known = knowledge(stand, learned(stand))
    sizes = AllSizes(known, fault, stand.kinematics.orders())

    def sized(bag: Path) -> list[Estimate]:
        found = measured(bag, stand, sizes, fault)
        if sizes.lacks:
            warn(f"{bag}: {sizes.lacks}, so {shown(fault)} has no size by its impacts there")
        return found

    return sized


def _collected(
    bags: Sequence[Path], sized: Callable[[Path], list[Estimate]]
) -> tuple[list[Estimate], int]:
    """Estimates of all bags, and how many bags were refused."""
    found: list[Estimate] = []
    refused = 0
    for number, bag in enumerate(bags, 1):
        progress(number, len(bags), bag.name)
        try:
            found += sized(bag)
        except FleaError as error:
            refused += 1
            warn(str(error))
    return found, refused


def _wanted(entry: Estimate, arguments: argparse.Namespace) -> bool:
    return (not arguments.serial or entry.serial == arguments.serial) and (
        not arguments.size or entry.quantity == arguments.size
    )


def _trends(
    found: Sequence[Estimate], new: Sequence[Estimate], arguments: argparse.Namespace
) -> list[UnitTrend]:
    """Comparable estimates, each with its trend: one actuator, one fault, one size."""
    from flea_diag.tools.replay.unit_trend import UnitTrend

    parts = _parts(found)
    if arguments.limit is not None and len({key[1:] for key in parts}) > 1:
        names = ", ".join(dict.fromkeys(" ".join(filter(None, key[1:])) for key in parts))
        raise ConfigurationError(
            f"--limit {arguments.limit:g} is of one size, and these bags give several ({names}): "
            "choose one with --fault and --size"
        )
    of_new, laws = _parts(new), _laws(arguments.law)
    for key in parts if new else ():
        if key not in of_new:
            raise ConfigurationError(f"--new: none of these bags is of the unit {shown(key[0])}")
    return [
        UnitTrend(part, of_new.get(key, []), arguments.limit or part[0].limit, laws)
        for key, part in parts.items()
    ]


def _parts(found: Sequence[Estimate]) -> dict[tuple[str, ...], list[Estimate]]:
    parts: dict[tuple[str, ...], list[Estimate]] = {}
    for entry in sorted(found, key=lambda e: (e.serial, e.fault, e.quantity, e.unit, e.stamp_ns)):
        key = entry.serial, entry.fault, entry.quantity, entry.unit
        parts.setdefault(key, []).append(entry)
    return parts


def _laws(name: str | None) -> Sequence[GrowthLaw]:
    from flea_diag.core.prognosis.growth_law import LAWS

    return [law for law in LAWS if name in (None, law.name)]


def _nothing(found: Sequence[Estimate], arguments: argparse.Namespace) -> str:
    """Why there is no trend at all."""
    if not found:
        return "no fault size was estimated in these bags"
    serials = ", ".join(sorted({entry.serial for entry in found}))
    sizes = ", ".join(sorted({entry.quantity or entry.unit for entry in found}))
    return f"no size is left of those of {serials}, which are {sizes}: see --serial and --size"


def _write_csv(path: Path, found: Sequence[Estimate]) -> None:
    text = io.StringIO()
    rows = csv.DictWriter(text, WRITTEN, lineterminator="\n")
    rows.writeheader()
    rows.writerows(entry.row() for entry in found)
    write_text(path, text.getvalue())
