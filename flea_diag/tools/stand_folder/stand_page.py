"""The page of ``flea stand check``: what is on it, as text and as a mapping."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.promise import FalseAlarmPromise
from flea_diag.core.faults.fault import Fault, of_sensors
from flea_diag.core.isolation.detectability import tested_alone
from flea_diag.core.likelihood.size_bound import SizeBound
from flea_diag.tools.calibrate.calibrate import FALSE_ALARMS_PER_HOUR
from flea_diag.tools.stand_folder.channel_check import ChannelCheck, channel_checks
from flea_diag.tools.stand_folder.fault_sizes import EPISODE_S, FaultSizes
from flea_diag.tools.stand_folder.recorded_motion import RecordedMotion

WHOLE = ("dead", "noise", "dropout")
"""Modes of a sensor fault that have no size to be found from."""
WORTH = 2.0
"""Factor by which one more sensor lowers the size of a fault, for it to be named."""


@dataclass(frozen=True)
class OneMoreSensor:
    """A sensor of the description that is not recorded, and the faults that it would show."""

    channel: str
    brings: tuple[str, ...]


@dataclass(frozen=True)
class StandPage:
    """All that recordings say of a stand.

    ``bounds`` are those of faults with a size; ``alone`` are faults of sensors that tests of their
    own readings show, ``unseen`` those that nothing here shows, and why.
    """

    stand: str
    recordings: int
    seconds: float
    period_s: float
    calibrated: bool
    channels: tuple[ChannelCheck, ...]
    relations: tuple[str, ...]
    bounds: tuple[SizeBound, ...]
    alone: tuple[str, ...]
    unseen: dict[str, str]
    sensors: tuple[OneMoreSensor, ...]
    promise: FalseAlarmPromise
    problems: tuple[str, ...]

    @property
    def missing_hours(self) -> float:
        """Of healthy running, for the stated rate of false alarms."""
        return max(self.promise.needed_hours - self.promise.hours, 0.0)

    @property
    def missing_recordings(self) -> int:
        """As many as these are long on average."""
        return math.ceil(self.missing_hours * 3600.0 / (self.seconds / self.recordings))


def stand_page(stand: Stand, motions: Sequence[RecordedMotion]) -> StandPage:
    """Everything on the page.

    Raises
    ------
    ConfigurationError
        A file of the stand is refused.
    """
    every = tuple(dict.fromkeys(row.name for motion in motions for row in motion.channels))
    whole = FaultSizes(stand, every, motions[0].period_s)
    wanted = whole.relations.residuals.channels
    checks = channel_checks(motions, wanted, whole.relations)
    usable = tuple(row.name for row in checks if not row.problem)
    sizes = FaultSizes(stand, usable, motions[0].period_s)
    known = of_sensors(faults_of(stand.actuator, stand.faults), usable)
    sized = {name for name, fault in known.items() if fault.mode not in WHOLE}
    bounds = [row for row in sizes.bounds(motions) if row.fault in sized]
    symptoms = sizes.relations.residuals.symptoms
    alone = tuple(
        name for name, row in known.items() if row.channel and tested_alone(row, symptoms)
    )
    lacking = [name for name in wanted if name not in usable]
    seconds = sum(motion.seconds for motion in motions)
    promise = FalseAlarmPromise(FALSE_ALARMS_PER_HOUR, len(motions), seconds / 3600.0)
    if sizes.calibration is not None:
        promise = sizes.calibration.promise
    return StandPage(
        stand.name,
        len(motions),
        seconds,
        motions[0].period_s,
        sizes.calibration is not None,
        checks,
        (*sizes.relations.names, *(row.name for row in sizes.relations.predictions)),
        tuple(row for row in bounds if math.isfinite(row.detected_from)),
        alone,
        dict(_unseen(known, bounds, alone)),
        tuple(_brought(sizes, sized, bounds, lacking, motions)),
        promise,
        tuple(_problems(checks)),
    )


def _unseen(
    known: Mapping[str, Fault], bounds: Sequence[SizeBound], alone: Collection[str]
) -> Iterator[tuple[str, str]]:
    seen = {row.fault for row in bounds if math.isfinite(row.detected_from)}
    moved = {row.fault for row in bounds}
    for name, fault in known.items():
        if name in seen or name in alone:
            continue
        if name in moved:
            yield name, f"not in this motion at any size; excitation: {fault.excitation}"
        elif fault.vibration:
            yield name, "by accelerometers alone"
        else:
            yield name, f"in no relation of these channels; excitation: {fault.excitation}"


def _brought(
    sizes: FaultSizes,
    known: Collection[str],
    bounds: Sequence[SizeBound],
    lacking: Sequence[str],
    motions: Sequence[RecordedMotion],
) -> Iterator[OneMoreSensor]:
    """What each sensor of the description would bring that is not recorded, or not usable."""
    for channel in lacking:
        found = sizes.with_sensor(channel, motions)
        if found is not None:
            rows = [row for row in found if row.fault in known]
            yield OneMoreSensor(channel, tuple(dict.fromkeys(_gains(bounds, rows))))


def _gains(before: Sequence[SizeBound], after: Sequence[SizeBound]) -> Iterator[str]:
    had = {(row.fault, row.size.name): row for row in before}
    for row in after:
        was = had.get((row.fault, row.size.name))
        if not math.isfinite(row.detected_from):
            continue
        size = f"{row.size.name} {_sized(row.detected_from, row)}"
        if was is None or math.isinf(was.detected_from):
            if row.fault not in {old.fault for old in before if math.isfinite(old.detected_from)}:
                yield f"detects {row.fault} from {size} on"
        elif was.group and len(row.group) < len(was.group):
            gone = [name for name in was.group if name not in row.group]
            yield f"isolates {row.fault} from {', '.join(gone)}"
        elif row.detected_from * WORTH < was.detected_from:
            yield f"detects {row.fault} from {size} on, not {_sized(was.detected_from, was)}"


def _problems(checks: Sequence[ChannelCheck]) -> Iterator[str]:
    for row in checks:
        if row.problem and row.unit:
            yield f"{row.name}: {row.problem}"


# --- the page --------------------------------------------------------------------------------


def as_mapping(page: StandPage) -> dict[str, Any]:
    """Plain mapping for JSON; what is at no size or unknown is null."""
    plain = asdict(page)
    promise = page.promise
    plain["promise"] |= {
        "supported_per_hour": promise.supported_per_hour,
        "needed_hours": promise.needed_hours,
        "missing_hours": page.missing_hours,
        "missing_recordings": page.missing_recordings,
    }
    cleaned: dict[str, Any] = _finite(plain)
    return cleaned


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_text(page: StandPage) -> str:
    """One page of text."""
    ground = (
        "with the noise and the differences of its calibration"
        if page.calibrated
        else "not calibrated yet: noise of the description, and of motors in general what healthy "
        "units differ by"
    )
    lines = [
        f"Stand {page.stand}: {page.recordings} recordings, {page.seconds:.0f} s, scans at "
        f"{1.0 / page.period_s:g} Hz; {ground}",
        "",
        *_table(_channel_rows(page.channels)),
        "",
        f"Relations: {', '.join(page.relations) or 'none: add a sensor, or correct the channels'}",
        "",
        f"Smallest faults in {EPISODE_S:g} s of this motion; no test of these channels does better",
        *_table(_bound_rows(page.bounds)),
    ]
    if page.alone:
        lines.append(f"  by readings of the sensor alone: {', '.join(_by_channel(page.alone))}")
    lines += [f"  not seen: {name}: {why}" for name, why in page.unseen.items()]
    lines += ["", "One more sensor", *_sensor_lines(page.sensors), "", *_promise_lines(page)]
    return "\n".join(lines)


def _channel_rows(channels: Sequence[ChannelCheck]) -> list[list[str]]:
    rows = [["channel", "rate", "range", "noise", "longest gap", "read by"]]
    for row in channels:
        if not row.unit:
            rows.append([row.name, row.problem, "", "", "", ""])
            continue
        gap = f"{row.longest_gap_s:.2g} s" if row.longest_gap_s else "none"
        rows.append(
            [
                row.name,
                f"{row.rate_hz:g} Hz",
                f"{row.lowest:.4g} to {row.highest:.4g} {row.unit}",
                f"{row.noise:.2g} {row.unit}",
                gap,
                row.problem or ", ".join(row.relations) or "nothing",
            ]
        )
    return rows


def _bound_rows(bounds: Sequence[SizeBound]) -> list[list[str]]:
    rows = [["fault", "size", "detected from", "isolated from", "never apart from"]]
    for row in bounds:
        others = [name for name in row.group if name != row.fault]
        isolated = _sized(row.isolated_from, row)
        rows.append(
            [
                row.fault,
                row.size.name,
                _sized(row.detected_from, row),
                isolated if not others else f"group from {isolated}",
                ", ".join(others) or "-",
            ]
        )
    return rows


def _sized(value: float, row: SizeBound) -> str:
    return f"{value:.2g}" + ("" if row.size.unit == "1" else f" {row.size.unit}")


def _by_channel(faults: Sequence[str]) -> list[str]:
    """Modes of each sensor: ``motor_current dead, noise``."""
    modes: dict[str, list[str]] = {}
    for name in faults:
        channel, _, mode = name.rpartition("_")
        modes.setdefault(channel, []).append(mode)
    return [f"{channel} {'/'.join(found)}" for channel, found in modes.items()]


def _sensor_lines(sensors: Sequence[OneMoreSensor]) -> list[str]:
    if not sensors:
        return ["  the description names none that is not recorded"]
    return [f"  {row.channel}: {'; '.join(row.brings) or 'nothing new'}" for row in sensors]


def _promise_lines(page: StandPage) -> list[str]:
    lines = [f"Recordings: {page.promise.words()}"]
    if page.missing_recordings:
        lines.append(
            f"  {page.missing_hours:.3g} h of healthy running more would support the stated rate, "
            f"{page.missing_recordings} recordings like these"
        )
    return lines


def _table(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows if row[-1]) for k in range(len(rows[0]))]
    return [
        "  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
