"""``flea calibrate``: parameters, offsets and limits from nominal recordings."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import CalibrationError, ConfigurationError, FleaError
from flea_diag.tools import calibration_plots, calibration_report
from flea_diag.tools.terminal import make_folder, write_text

if TYPE_CHECKING:
    from flea_diag.core.calibration import Calibration, Run
    from flea_diag.core.thresholds import Trace

NAME = "calibrate"
SUMMARY = "learn parameters and thresholds from nominal bags"
EXAMPLES = """\
examples:
  flea calibrate bags/*Nominal* -o calibration.yaml
  flea calibrate bags/nominal_* -o calibration.yaml --false-alarms 0.01
  flea calibrate bags/nominal_* -o calibration.yaml --plots pictures/
"""

FALSE_ALARMS_PER_HOUR = 0.1
NOMINAL = ("", "nominal")


@dataclass(frozen=True)
class _Recording:
    """What was read of one bag."""

    run: Run
    stand: str
    channels: tuple[str, ...]
    sampling: str
    period_s: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="nominal recordings")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE", help="calibration to write"
    )
    parser.add_argument(
        "--false-alarms",
        type=float,
        default=FALSE_ALARMS_PER_HOUR,
        metavar="RATE",
        help="false alarms per hour of nominal running, all tests together (default %(default)s)",
    )
    parser.add_argument(
        "--plots",
        type=Path,
        metavar="DIR",
        help="draw the residuals of each recording against their limits (needs matplotlib)",
    )
    parser.add_argument(
        "--plot-format", choices=("png", "svg"), default="png", help="of the pictures"
    )
    parser.add_argument("--actuator", default="actuator.yaml", help="actuator description")
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    parser.add_argument("--json", action="store_true", help="report as JSON on standard output")


def run(arguments: argparse.Namespace) -> int:
    """Read the bags, fit, write the file and say what was found."""
    if not arguments.false_alarms > 0.0:
        raise ConfigurationError(
            f"--false-alarms = {arguments.false_alarms}: must be above 0 per hour"
        )
    if arguments.output.exists() and not arguments.force:
        raise ConfigurationError(f"{arguments.output}: exists already, use --force to replace it")
    if arguments.plots is not None:
        calibration_plots.require()
    recordings, refused = _read_all(arguments.bags)
    found = learn(recordings, arguments.actuator, arguments.false_alarms)
    calibration = found.calibration
    _write(arguments.output, calibration)
    if arguments.plots is not None:
        calibration_plots.draw(calibration, found.traces, arguments.plots, arguments.plot_format)
    report = json.dumps(calibration.to_mapping(), indent=2) if arguments.json else None
    print(report or calibration_report.words(calibration))
    if refused:
        print(f"flea: {len(refused)} of {len(arguments.bags)} bags left out", file=sys.stderr)
    return 1 if refused else 0


def _read_all(bags: list[Path]) -> tuple[list[_Recording], list[str]]:
    recordings, refused = [], []
    for number, bag in enumerate(bags, 1):
        if sys.stderr.isatty():
            print(f"\r\033[Kreading {number} of {len(bags)}: {bag.name}", end="", file=sys.stderr)
        try:
            recordings.append(_read(bag))
        except FleaError as error:
            refused.append(str(error))
            print(f"flea: {error}", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    return recordings, refused


def _read(bag: Path) -> _Recording:
    """Rows, channels and period of one bag; a bag with a fault in it is refused."""
    import numpy as np

    from flea_diag.core.calibration import Run
    from flea_diag.core.residual_bank import CHANNELS, INDEX
    from flea_diag.wire.bag import read_bag
    from flea_diag.wire.records import ChannelTable, Scan, Truth

    rows: list[Any] = []
    stamps: list[int] = []
    table: ChannelTable | None = None
    for _, record in read_bag(bag, (ChannelTable, Scan, Truth)):
        if isinstance(record, ChannelTable):
            table = record
        elif isinstance(record, Truth) and record.fault not in NOMINAL:
            raise CalibrationError(
                f"{bag}: its truth says {record.fault!r}, calibration needs nominal runs"
            )
        elif isinstance(record, Scan):
            row = np.full(len(CHANNELS), np.nan)
            for name, value in zip(record.channels, record.values, strict=True):
                if name in INDEX:
                    row[INDEX[name]] = value
            rows.append(row)
            stamps.append(record.stamp_ns)
    if len(rows) < 2 or table is None:
        missing = "channel table" if table is None else "scans"
        raise CalibrationError(f"{bag}: no {missing} in it, {len(rows)} scans")
    measured = np.array(rows)
    present = tuple(c for c in CHANNELS if np.isfinite(measured[:, INDEX[c]]).any())
    voltage = table.info("motor_voltage")
    _check_units(bag, table)
    return _Recording(
        Run(bag.name, measured),
        table.stand,
        present,
        voltage.sampling if voltage is not None else "",
        float(np.median(np.diff(stamps))) / 1e9,
    )


UNITS = {
    "motor_current": "A",
    "motor_voltage": "V",
    "commanded_voltage": "V",
    "motor_speed": "rad/s",
    "actuator_position": "m",
    "load_position": "m",
    "load_force": "N",
    "motor_temperature": "degC",
    "nut_temperature": "degC",
    "ambient_temperature": "degC",
}


def _check_units(bag: Path, table: Any) -> None:
    for channel, unit in UNITS.items():
        info = table.info(channel)
        if info is not None and info.unit != unit:
            raise CalibrationError(
                f"{bag}: {channel} is in {info.unit!r}, it must be in {unit!r}: import it anew"
            )


@dataclass(frozen=True)
class Learned:
    """A calibration, and the residuals of each recording that its limits were fitted to."""

    calibration: Calibration
    traces: tuple[Trace, ...]


def calibrate(
    recordings: list[_Recording], actuator: str, false_alarms_per_hour: float
) -> Calibration:
    """Calibration from recordings of one stand, see ``learn``."""
    return learn(recordings, actuator, false_alarms_per_hour).calibration


def learn(recordings: list[_Recording], actuator: str, false_alarms_per_hour: float) -> Learned:
    """Calibration from recordings of one stand, with what its limits were fitted to.

    Raises
    ------
    CalibrationError
        Fewer than two recordings, recordings of different stands, or of an actuator that the
        description does not fit, no motion.
    """
    from flea_diag.configuration import load_yaml
    from flea_diag.core import identification, innovation_residual, thresholds
    from flea_diag.core.calibration import Calibration, Run
    from flea_diag.core.parameters import UnitTolerance
    from flea_diag.core.residual_bank import INDEX
    from flea_diag.core.sensor_limits import RESOLUTIONS, sensor_limits
    from flea_diag.core.smoothing import KERNEL_LENGTH

    if len(recordings) < 2:
        raise CalibrationError(
            f"{len(recordings)} usable recordings, at least 2 are needed to tell scatter from fault"
        )
    first = recordings[0]
    described = load_yaml(actuator)
    _check_described(first, described, actuator)
    for other in recordings[1:]:
        _check_alike(first, other)
    runs = [recording.run for recording in recordings]
    found = identification.identify(runs, KERNEL_LENGTH, first.period_s)
    traces = [thresholds.trace(run, found, KERNEL_LENGTH, first.period_s) for run in runs]
    watched = innovation_residual.learn(
        [Run(run.name, _trusted(run, seen)) for run, seen in zip(runs, traces, strict=True)],
        found.parameters,
        UnitTolerance(),
        first.period_s,
        first.sampling or "mean",
    )
    traces = list(map(thresholds.with_innovations, traces, watched.residuals))
    calibration = Calibration(
        actuator=str(described["name"]),
        period_s=first.period_s,
        channels=first.channels,
        voltage_sampling=first.sampling,
        parameters=found.parameters,
        sigmas=found.sigmas,
        not_identified=found.not_identified,
        tolerance=UnitTolerance(),
        limits=thresholds.limits(traces, false_alarms_per_hour, first.period_s, watched.spread),
        false_alarms_per_hour=false_alarms_per_hour,
        voltage_limit_v=found.voltage_limit_v,
        nominal_s=sum(len(run.rows) for run in runs) * first.period_s,
        sources=tuple(run.name for run in runs),
        bad_stretches=tuple(
            stretch for traced in traces for stretch in thresholds.stretches(traced, first.period_s)
        ),
        observer_noise=watched.noise,
        sensors=sensor_limits(
            [{name: run.rows[:, INDEX[name]] for name in RESOLUTIONS} for run in runs],
            false_alarms_per_hour,
            first.period_s,
        ),
        covariance=tuple(found.covariance),
        shifts=thresholds.shift_limits(traces, false_alarms_per_hour, first.period_s),
    )
    return Learned(calibration, tuple(traces))


def _trusted(run: Run, seen: Trace) -> Any:
    """Rows without the voltage where it is not to be trusted: not measured there."""
    from flea_diag.core.residual_bank import INDEX

    rows = run.rows.copy()
    rows[~seen.voltage_usable, INDEX["motor_voltage"]] = float("nan")
    return rows


def _check_described(first: _Recording, described: Any, actuator: str) -> None:
    """Channels that the diagnosis reads must be sensors or inputs of the described actuator."""
    if not isinstance(described, dict) or "name" not in described:
        raise ConfigurationError(f"{actuator}: no actuator description: it has no 'name'")
    known = {*described.get("sensors", ()), *described.get("inputs", ())}
    strange = [channel for channel in first.channels if channel not in known]
    if strange:
        raise CalibrationError(
            f"{first.run.name}: {strange[0]} is no sensor of actuator {described['name']!r} "
            f"({actuator}): the recordings are of another actuator, or --actuator is to name theirs"
        )


def _check_alike(first: _Recording, other: _Recording) -> None:
    if other.stand != first.stand:
        raise CalibrationError(
            f"{other.run.name}: recorded on stand {other.stand!r}, {first.run.name} on "
            f"{first.stand!r}: one calibration is of one actuator, calibrate each on its own"
        )
    if abs(other.period_s - first.period_s) > 0.01 * first.period_s:
        raise CalibrationError(
            f"{other.run.name}: scans every {other.period_s} s, {first.run.name} every "
            f"{first.period_s} s: calibrate from recordings of one stand"
        )
    if other.sampling != first.sampling:
        raise CalibrationError(
            f"{other.run.name}: motor_voltage sampled as {other.sampling!r}, {first.run.name} as "
            f"{first.sampling!r}: calibrate from recordings of one stand"
        )
    if other.channels != first.channels:
        odd = sorted(set(first.channels) ^ set(other.channels))
        raise CalibrationError(
            f"{other.run.name}: {odd[0]} is not in both it and {first.run.name}: "
            "calibrate from recordings of one stand"
        )


def _write(path: Path, calibration: Calibration) -> None:
    import yaml

    make_folder(path.parent)
    write_text(path, yaml.safe_dump(calibration.to_mapping(), sort_keys=False, width=100))
