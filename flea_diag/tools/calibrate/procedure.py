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

"""The calibration procedure: from nominal recordings of one stand to a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from flea_diag.configuration.description import compiled_relations, described, description_sha256
from flea_diag.core.calibration import (
    envelope_fit,
    identification,
    innovation_learning,
    nominal_trace,
    physical_values,
)
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.calibration.identification import RelationsOf
from flea_diag.core.calibration.identified import Identified
from flea_diag.core.calibration.innovation_learning import Array, ObserverStatistics
from flea_diag.core.calibration.limits import thresholds
from flea_diag.core.calibration.limits.thresholds import LimitFit
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.calibration.out_of_sample import LeftOut
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.residuals.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.sensor_limits import sensor_limits
from flea_diag.tools.calibrate.dead_sensors import dead_sensors, readings
from flea_diag.tools.calibrate.law import LawOfRecordings
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.recorded_units import folds_of, units_of, with_starts
from flea_diag.tools.calibrate.recording_checks import check_left_out, check_recordings
from flea_diag.tools.calibrate.shared_work import ALONE, RecordingWork, Sharing


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
    noisy: tuple[str, ...] = ()
    """Relations that the law leaves out of single recordings, in words."""
    unlike: Mapping[str, str] = field(default_factory=dict)
    """Recordings that all others, taken together, show to be unlike them, and why: the law is
    learned without them, the limits with them."""


def calibrate(
    recordings: list[NominalRecording],
    actuator: str | Path,
    false_alarms_per_hour: float,
    faults: str | Path | None = None,
) -> Calibration:
    """Calibration from recordings of one stand, see ``learn``."""
    return learn(recordings, actuator, false_alarms_per_hour, faults=faults).calibration


def learn(
    recordings: list[NominalRecording],
    actuator: str | Path,
    false_alarms_per_hour: float,
    sharing: Sharing = ALONE,
    faults: str | Path | None = None,
) -> CalibrationResult:
    """Calibration from recordings of one stand, with the residuals behind its limits.

    With a catalogue of ``faults`` also the law of healthy recordings, which judges all of them
    together, and what it can see.

    Raises
    ------
    CalibrationError
        Fewer than two recordings, recordings of different stands or of another actuator than
        described, no motion, or too many recordings that contradict the others.
    """
    model = described(actuator)
    check_recordings(recordings, model, actuator)
    relations_of = partial(compiled_relations, actuator, recordings[0].channels)
    result = _learn(recordings, model.name, relations_of, false_alarms_per_hour, sharing)
    odd = result.not_nominal
    if odd:
        check_left_out(recordings, odd)
        recordings = [r for r in recordings if r.run.name not in odd]
        result = _learn(recordings, model.name, relations_of, false_alarms_per_hour, sharing)
    law = LawOfRecordings.of(result.calibration, actuator, faults, recordings, sharing)
    left_out = tuple(LeftOut(name, reason) for name, reason in odd.items())
    digest = description_sha256(actuator)
    calibration = replace(result.calibration, actuator_sha256=digest, left_out=left_out)
    calibration = replace(calibration, law=law.seeing(calibration, recordings, sharing))
    return replace(
        result, calibration=calibration, not_nominal=odd, noisy=law.noisy, unlike=law.unlike
    )


def _learn(
    recordings: Sequence[NominalRecording],
    name: str,
    relations_of: RelationsOf,
    false_alarms_per_hour: float,
    sharing: Sharing,
) -> CalibrationResult:
    """Calibration from these recordings, and which of them the others show not to be nominal."""
    runs = [recording.run for recording in recordings]
    period_s, folds = recordings[0].period_s, folds_of(recordings)
    counts = ScanCounts(period_s, relations_of(True).residuals.smoothing_s)
    found = identification.identify(runs, relations_of, counts.kernel, period_s, folds)
    physical_values.check_physical(found, runs, relations_of(True).residuals.channels)
    has_encoder = found.parameters.encoder_m_per_rad != 0.0
    relations = relations_of(has_encoder)
    work = RecordingWork(relations_of, has_encoder, period_s, recordings[0].sampling or "mean")
    traces, judged = _traces(runs, found, relations, work, sharing)
    units, tolerance, alike = units_of(recordings, found, relations)
    innovations = _innovations(recordings, traces, found, relations, tolerance, work, sharing)
    traces, judged = (
        list(map(nominal_trace.with_innovations, part, innovations.residuals))
        for part in (traces, judged)
    )
    envelope = envelope_fit.envelope(traces, relations, counts, found.parameters)
    tested, judged = (
        [
            envelope_fit.loaded(
                envelope_fit.widened(trace, envelope.travel if envelope else None),
                envelope,
                relations,
                found.parameters,
                period_s,
            )
            for trace in part
        ]
        for part in (traces, judged)
    )
    terms = relations.reading_terms(found.parameters)
    limits = thresholds.fit_limits(
        tested, false_alarms_per_hour, period_s, tolerance, folds, innovations.spread, judged, terms
    )
    calibration = replace(
        _calibration(name, recordings, found, traces, innovations, limits, tolerance),
        envelope=envelope,
    )
    if units.count:
        calibration = replace(calibration, units=with_starts(units, calibration, judged))
    spread = innovations.spread
    odd = thresholds.not_nominal(
        tested, false_alarms_per_hour, period_s, tolerance, folds, spread, limits, judged, terms
    )
    odd |= dead_sensors(runs, calibration, relations)
    return CalibrationResult(calibration, tuple(traces), relations, odd, alike)


def _traces(
    runs: Sequence[NominalRun],
    found: Identified,
    relations: RelationSet,
    work: RecordingWork,
    sharing: Sharing,
) -> tuple[list[Trace], list[Trace]]:
    """Residuals of each recording, with the parameters of all and with those it is judged by."""
    by = [found] * len(runs), map(found.judging, range(len(runs)))
    items = [(run, each) for part in by for run, each in zip(runs, part, strict=True)]
    traced = [
        replace(trace, rows=relations.residuals)
        for trace in sharing.over(work.trace, items, "residuals")
    ]
    return traced[: len(runs)], traced[len(runs) :]


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


def _without_bad_voltage(run: NominalRun, trace: Trace) -> Array:
    """Rows with the voltage as NaN (not measured) where it failed its plausibility test."""
    rows = run.rows.copy()
    if trace.rows.voltage:
        rows[~trace.voltage_usable, trace.rows.channel(trace.rows.voltage)] = float("nan")
    return rows


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
