"""``flea calibrate``: identifies parameters, offsets and limits from nominal recordings."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.core.calibration.promise import FALSE_ALARMS_PER_HOUR
from flea_diag.errors import CalibrationError, ConfigurationError, shown
from flea_diag.tools.argument import add_cluster, add_jobs
from flea_diag.tools.bag_url import bag_place
from flea_diag.tools.calibrate import report as calibration_report
from flea_diag.tools.calibrate.dead_sensors import dead_sensors, readings
from flea_diag.tools.calibrate.nominal_recording import (
    NominalRecording,
    check_alike,
    check_signs,
    read_nominal,
)
from flea_diag.tools.calibrate.shared_work import ALONE, RecordingWork, Sharing
from flea_diag.tools.extra import require
from flea_diag.tools.stand_option import absolute, add_stand, chosen_stand
from flea_diag.tools.terminal import IN_PART, make_folder, say, warn, write_text
from flea_diag.tools.workers import KeptPool

if TYPE_CHECKING:
    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.core.calibration.calibration import Calibration, NominalRun
    from flea_diag.core.calibration.identification import Identified, RelationsOf
    from flea_diag.core.calibration.innovation_learning import Array, ObserverStatistics
    from flea_diag.core.calibration.nominal_trace import Trace
    from flea_diag.core.calibration.thresholds import LimitFit
    from flea_diag.core.observers.observer_noise import ObserverNoise
    from flea_diag.core.residuals.parameters import ActuatorParameters, UnitSpread, UnitTolerance
    from flea_diag.core.residuals.relation_set import RelationSet

NAME = "calibrate"
SUMMARY = "identify parameters and limits from nominal bags"
EXAMPLES = """\
examples:
  flea calibrate bags/*Nominal* -o calibration.yaml
  flea calibrate bags/nominal_* -o calibration.yaml --false-alarms 0.01
  flea calibrate bags/nominal_* --stand ./mine -o mine/calibration.yaml
  flea calibrate bags/nominal_* -o calibration.yaml --plots pictures/
"""

MOST_LEFT_OUT = 0.25
"""Largest share of the recordings that is left out as not nominal."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "bags",
        nargs="+",
        type=bag_place,
        metavar="BAG",
        help="nominal recordings of one stand, 2 or more: paths, or URLs (needs the extra url)",
    )
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE", help="calibration to write"
    )
    parser.add_argument(
        "--false-alarms",
        type=float,
        default=FALSE_ALARMS_PER_HOUR,
        metavar="RATE",
        help="false alarms per hour of nominal operation, all tests together (default %(default)s)",
    )
    parser.add_argument(
        "--plots",
        type=Path,
        metavar="DIR",
        help="plot the residuals of each recording with their limits to DIR (needs matplotlib)",
    )
    parser.add_argument(
        "--plot-format", choices=("png", "svg"), default="png", help="format of the plots"
    )
    add_stand(parser)
    add_jobs(parser)
    add_cluster(parser)
    parser.add_argument(
        "--actuator", metavar="FILE", help="actuator description (default: that of the stand)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Read the bags, calibrate, write the file and print the report."""
    if not arguments.false_alarms > 0.0:
        raise ConfigurationError(
            f"--false-alarms = {arguments.false_alarms} must be above 0 per hour"
        )
    from flea_diag.configuration.description import compiled_relations

    if arguments.output.exists() and not arguments.force:
        raise ConfigurationError(f"{arguments.output} exists: use --force to overwrite it")
    if arguments.plots is not None:
        require("plot", "--plots")
    stand = chosen_stand(arguments, "actuator")
    known = compiled_relations(stand.actuator).residuals
    actuator = absolute(stand).actuator if arguments.dask else stand.actuator
    with KeptPool(arguments.jobs) as pool:
        sharing = Sharing(arguments.jobs, arguments.dask, pool)
        recordings, refused = read_nominal(arguments.bags, known, sharing)
        check_signs(recordings, known)
        found = learn(recordings, actuator, arguments.false_alarms, sharing)
    calibration = found.calibration
    for row in calibration.left_out:
        warn(f"{row.recording}: left out: {row.reason}")
    if found.alike:
        warn(
            f"serial numbers {', '.join(found.alike)}: their recordings differ by less than "
            "healthy units do: counted as one unit, tolerances are those of the description"
        )
    refused += [row.recording for row in calibration.left_out]
    write_calibration(arguments.output, calibration)
    if arguments.plots is not None:
        _draw(found, arguments.plots, arguments.plot_format)
    report = json.dumps(calibration.to_mapping(), indent=2) if arguments.json else None
    say(report or calibration_report.words(calibration, found.relations))
    if refused:
        warn(f"{len(refused)} of {len(arguments.bags)} bags not used")
    return IN_PART if refused else 0


def _draw(found: CalibrationResult, folder: Path, kind: str) -> None:
    """One picture of each recording, and one of the envelope where there is one."""
    from flea_diag.tools.calibrate import envelope_picture, plots

    plots.draw(found.calibration, found.traces, folder, kind)
    if found.calibration.envelope is not None:
        envelope_picture.draw_envelope(
            found.calibration, found.traces, found.relations, folder, kind
        )


@dataclass(frozen=True)
class CalibrationResult:
    """A calibration, and the residuals of each recording from which its limits were computed."""

    calibration: Calibration
    traces: tuple[Trace, ...]
    relations: RelationSet
    not_nominal: Mapping[str, str]
    """Recordings that the others show not to be nominal, and why."""
    alike: tuple[str, ...] = ()
    """Serial numbers of what behaves as one unit."""


def calibrate(
    recordings: list[NominalRecording], actuator: str | Path, false_alarms_per_hour: float
) -> Calibration:
    """Calibration from recordings of one stand, see ``learn``."""
    return learn(recordings, actuator, false_alarms_per_hour).calibration


def learn(
    recordings: list[NominalRecording],
    actuator: str | Path,
    false_alarms_per_hour: float,
    sharing: Sharing = ALONE,
) -> CalibrationResult:
    """Calibration from recordings of one stand, with the residuals behind its limits.

    Raises
    ------
    CalibrationError
        Fewer than two recordings, recordings of different stands or of another actuator than
        described, no motion, or too many recordings that contradict the others.
    """
    from flea_diag.configuration.description import (
        compiled_relations,
        described,
        description_sha256,
    )
    from flea_diag.core.calibration.out_of_sample import LeftOut

    model = described(actuator)
    _check_recordings(recordings, model, actuator)
    relations_of = partial(compiled_relations, actuator, recordings[0].channels)
    result = _learn(recordings, model.name, relations_of, false_alarms_per_hour, sharing)
    kept = [r for r in recordings if r.run.name not in result.not_nominal]
    if result.not_nominal:
        _check_left_out(recordings, result.not_nominal)
        nominal = _learn(kept, model.name, relations_of, false_alarms_per_hour, sharing)
        result = replace(nominal, not_nominal=result.not_nominal)
    left_out = tuple(LeftOut(name, reason) for name, reason in result.not_nominal.items())
    digest = description_sha256(actuator)
    calibration = replace(result.calibration, actuator_sha256=digest, left_out=left_out)
    return replace(result, calibration=calibration)


def _learn(
    recordings: Sequence[NominalRecording],
    name: str,
    relations_of: RelationsOf,
    false_alarms_per_hour: float,
    sharing: Sharing,
) -> CalibrationResult:
    """Calibration from these recordings, and which of them the others show not to be nominal."""
    from flea_diag.core.calibration import envelope_fit, identification, nominal_trace, thresholds
    from flea_diag.core.scan_counts import ScanCounts

    runs = [recording.run for recording in recordings]
    period_s, folds = recordings[0].period_s, folds_of(recordings)
    counts = ScanCounts(period_s, relations_of(True).residuals.smoothing_s)
    found = identification.identify(runs, relations_of, counts.kernel, period_s, folds)
    has_encoder = found.parameters.encoder_m_per_rad != 0.0
    relations = relations_of(has_encoder)
    work = RecordingWork(relations_of, has_encoder, period_s, recordings[0].sampling or "mean")
    by = [found] * len(runs), map(found.judging, range(len(runs)))
    items = [(run, each) for part in by for run, each in zip(runs, part, strict=True)]
    traced = [
        replace(trace, rows=relations.residuals)
        for trace in sharing.over(work.trace, items, "residuals")
    ]
    traces, judged = traced[: len(runs)], traced[len(runs) :]
    units, tolerance, alike = _units(recordings, found, relations)
    innovations = _innovations(recordings, traces, found, relations, tolerance, work, sharing)
    traces, judged = (
        list(map(nominal_trace.with_innovations, part, innovations.residuals))
        for part in (traces, judged)
    )
    envelope = envelope_fit.envelope(traces, relations, counts, found.parameters)
    tested, judged = (
        [envelope_fit.widened(trace, envelope.travel if envelope else None) for trace in part]
        for part in (traces, judged)
    )
    limits = thresholds.fit_limits(
        tested, false_alarms_per_hour, period_s, tolerance, folds, innovations.spread, judged
    )
    calibration = replace(
        _calibration(name, recordings, found, traces, innovations, limits, tolerance),
        envelope=envelope,
        units=units if units.count else None,
    )
    spread = innovations.spread
    odd = thresholds.not_nominal(
        tested, false_alarms_per_hour, period_s, tolerance, folds, spread, limits, judged
    )
    odd |= dead_sensors(runs, calibration, relations)
    return CalibrationResult(calibration, tuple(traces), relations, odd, alike)


def _units(
    recordings: Sequence[NominalRecording], found: Identified, relations: RelationSet
) -> tuple[UnitSpread, UnitTolerance, tuple[str, ...]]:
    """Measured spread, tolerance of healthy units, and serial numbers that are of one unit."""
    from flea_diag.core.calibration.run_spread import (
        are_one,
        joined,
        measured_spread,
        recorded_spread,
        tolerance_of,
    )

    stated = tolerance_of(found.parameters, relations)
    units = measured_spread(found.folds if _known_units(recordings) else (), stated)
    serials = sorted({recording.serial for recording in recordings} - {""})
    alike = tuple(serials) if are_one(units, stated) else ()
    if alike or len(serials) == 1:
        units = recorded_spread(found.sigmas, len(recordings))
    return units, joined(stated, units), alike


def _check_left_out(recordings: Sequence[NominalRecording], odd: Mapping[str, str]) -> None:
    """Refuse where it is not clear any more which recordings are the nominal ones.

    Raises
    ------
    CalibrationError
        More than a quarter of the recordings, or all but one, would be left out.
    """
    if len(odd) <= MOST_LEFT_OUT * len(recordings) and len(recordings) - len(odd) >= 2:
        return
    name, reason = next(iter(odd.items()))
    raise CalibrationError(
        f"{len(odd)} of {len(recordings)} recordings contradict the others, at most "
        f"{MOST_LEFT_OUT:.0%} may be left out; the first is {name}: {reason}: record the actuator "
        "anew without a fault, or leave out what is not nominal"
    )


def folds_of(recordings: Sequence[NominalRecording]) -> tuple[str, ...]:
    """What each recording is left out with: its unit where there are enough, else itself."""
    if _known_units(recordings):
        return tuple(recording.serial for recording in recordings)
    return tuple(recording.run.name for recording in recordings)


def _known_units(recordings: Sequence[NominalRecording]) -> bool:
    """Whether all units are known by their serial numbers, and enough of them."""
    from flea_diag.core.calibration.run_spread import LEAST_UNITS

    units = {recording.serial for recording in recordings}
    return "" not in units and len(units) >= LEAST_UNITS


def _check_recordings(
    recordings: Sequence[NominalRecording], model: Actuator, actuator: str | Path
) -> None:
    """Two recordings or more, all of one stand, and of the described actuator."""
    if len(recordings) < 2:
        raise CalibrationError(
            f"{len(recordings)} usable recordings, at least 2 are needed to estimate the scatter"
        )
    first = recordings[0]
    _check_described(first, model, actuator)
    for other in recordings[1:]:
        check_alike(first, other)


def _innovations(
    recordings: Sequence[NominalRecording],
    traces: Sequence[Trace],
    found: Identified,
    relations: RelationSet,
    tolerance: UnitTolerance,
    work: RecordingWork,
    sharing: Sharing,
) -> ObserverStatistics:
    """Innovation residuals of the state observer, with its noise, from the usable voltage."""
    from flea_diag.core.calibration import innovation_learning
    from flea_diag.core.calibration.calibration import NominalRun

    def followed(
        noise: ObserverNoise, judged: Sequence[tuple[ActuatorParameters, Array]]
    ) -> Iterator[Array]:
        return sharing.over(work._replace(noise=noise).innovations, judged, "innovations")

    runs = [
        NominalRun(recording.run.name, _without_bad_voltage(recording.run, trace))
        for recording, trace in zip(recordings, traces, strict=True)
    ]
    return innovation_learning.learn(
        runs,
        found.parameters,
        relations,
        tolerance,
        work.period_s,
        work.sampling,
        [found.judging(k).parameters for k in range(len(runs))],
        followed,
    )


def _calibration(
    name: str,
    recordings: Sequence[NominalRecording],
    found: Identified,
    traces: Sequence[Trace],
    innovations: ObserverStatistics,
    limits: LimitFit,
    tolerance: UnitTolerance,
) -> Calibration:
    """Calibration file content: identified parameters, and limits for the false-alarm rate."""
    from flea_diag.core.calibration import nominal_trace
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.sensors.sensor_limits import sensor_limits

    first, runs = recordings[0], [recording.run for recording in recordings]
    period_s = first.period_s
    return Calibration(
        actuator=name,
        period_s=period_s,
        channels=first.channels,
        voltage_sampling=first.sampling,
        parameters=found.parameters,
        sigmas=found.sigmas,
        not_identified=found.not_identified,
        tolerance=tolerance,
        limits=limits.limits(),
        false_alarms_per_hour=limits.rate_per_hour,
        voltage_limit_v=found.voltage_limit_v,
        nominal_s=sum(len(run.rows) for run in runs) * period_s,
        sources=tuple(run.name for run in runs),
        bad_stretches=tuple(
            stretch for trace in traces for stretch in nominal_trace.stretches(trace, period_s)
        ),
        observer_noise=innovations.noise,
        sensors=sensor_limits(
            readings(runs, traces[0].rows),
            traces[0].rows.sensors,
            limits.rate_per_hour,
            period_s,
        ),
        covariance=tuple(found.covariance),
        shifts=limits.shift_limits(),
        out_of_sample=limits.out_of_sample(),
        counted_period_s=period_s,
        smoothing_s=traces[0].rows.smoothing_s,
    )


def _without_bad_voltage(run: NominalRun, trace: Trace) -> Any:
    """Rows with the voltage as NaN (not measured) where it failed its plausibility test."""
    rows = run.rows.copy()
    if trace.rows.voltage:
        rows[~trace.voltage_usable, trace.rows.channel(trace.rows.voltage)] = float("nan")
    return rows


def _check_described(first: NominalRecording, model: Actuator, actuator: str | Path) -> None:
    """Check that all channels are sensors or inputs of the described actuator."""
    known = {*model.sensors, *model.inputs}
    strange = [channel for channel in first.channels if channel not in known]
    if strange:
        raise CalibrationError(
            f"{first.run.name}: channel {strange[0]} is not a sensor of actuator "
            f"{shown(model.name)} ({actuator}): choose the matching stand "
            "with --stand, or its description with --actuator"
        )


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write a calibration file; its folder is created if missing.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    import yaml

    make_folder(path.parent)
    write_text(path, yaml.safe_dump(calibration.to_mapping(), sort_keys=False, width=100))
