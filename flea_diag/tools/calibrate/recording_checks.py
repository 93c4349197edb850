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

"""Recordings that no calibration is made from: of another actuator, unlike one another, too few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import CalibrationError, shown

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.core.residuals.residual_rows import ResidualSet
    from flea_diag.tools.calibrate.nominal_recording import NominalRecording

MOST_LEFT_OUT = 0.25
"""Largest share of the recordings that is left out as not nominal."""


def check_recordings(
    recordings: Sequence[NominalRecording], model: Actuator, actuator: str | Path
) -> None:
    """Check that there are two or more, all of one stand, and of the described actuator.

    Raises
    ------
    CalibrationError
        Names the recording and the difference.
    """
    if len(recordings) < 2:
        raise CalibrationError(
            f"{len(recordings)} usable recordings, at least 2 are needed to estimate the scatter: "
            "record the actuator again, under another motion or load"
        )
    first = recordings[0]
    _check_described(first, model, actuator)
    for other in recordings[1:]:
        _check_alike(first, other)


def _check_described(first: NominalRecording, model: Actuator, actuator: str | Path) -> None:
    """Check that all channels are sensors or inputs of the described actuator."""
    known = set(model.units)
    strange = [channel for channel in first.channels if channel not in known]
    if strange:
        raise CalibrationError(
            f"{first.run.name}: channel {strange[0]} is not a sensor of actuator "
            f"{shown(model.name)} ({actuator}): choose the matching stand "
            "with --stand, or its description with --actuator"
        )


def _check_alike(first: NominalRecording, other: NominalRecording) -> None:
    """Check that two recordings are of one stand."""
    if other.stand != first.stand:
        raise CalibrationError(
            f"{other.run.name}: recorded on stand {shown(other.stand)}, {first.run.name} on "
            f"{shown(first.stand)}: calibrate each stand separately"
        )
    if abs(other.period_s - first.period_s) > 0.01 * first.period_s:
        raise CalibrationError(
            f"{other.run.name}: scans every {other.period_s} s, {first.run.name} every "
            f"{first.period_s} s: calibrate from recordings of one stand"
        )
    if other.sampling != first.sampling:
        raise CalibrationError(
            f"{other.run.name}: motor_voltage sampled as {shown(other.sampling)}, "
            f"{first.run.name} as "
            f"{shown(first.sampling)}: calibrate from recordings of one stand"
        )
    if other.channels != first.channels:
        odd = sorted(set(first.channels) ^ set(other.channels))
        raise CalibrationError(
            f"{other.run.name}: channel {odd[0]} is missing here or in {first.run.name}: "
            "calibrate from recordings of one stand"
        )


def check_signs(recordings: Sequence[NominalRecording], known: ResidualSet) -> None:
    """Refuse recordings whose signs the balance of power contradicts, all of them together.

    Raises
    ------
    CalibrationError
        Names the channel, the coefficient, its limit and the remedy.
    """
    from flea_diag.core.calibration.sign_check import sign_contradiction

    if not recordings:
        return
    units, values = _together(recordings, known)
    words = sign_contradiction(units, values, recordings[0].period_s)
    if words:
        raise CalibrationError(
            f"{len(recordings)} recordings: {words} where they are imported, and import them again"
        )


def lag_words(recordings: Sequence[NominalRecording], known: ResidualSet) -> list[str]:
    """Words on each channel that comes later than another one of the same relation."""
    from flea_diag.tools.recordings.channel_lag import channel_lags

    if not recordings:
        return []
    units, values = _together(recordings, known)
    lags = channel_lags(units, values, recordings[0].period_s)
    return [
        f"{lag.words}: the relations of both take it for a fault where motion changes; correct its "
        "filter or its stamps"
        for lag in lags
        if lag.is_late
    ]


def _together(
    recordings: Sequence[NominalRecording], known: ResidualSet
) -> tuple[dict[str, str], npt.NDArray[np.float64]]:
    """Units of the channels of the first recording, and all readings with a gap after each."""
    import numpy as np

    present = [name for name in known.channels if name in recordings[0].channels]
    rows = [r.run.rows[:, [known.index[name] for name in present]] for r in recordings]
    gap = np.full((1, len(present)), np.nan)
    values = np.concatenate([part for each in rows for part in (each, gap)])
    return {name: known.units[name] for name in present}, values


def check_modes(recordings: Sequence[NominalRecording], known: ResidualSet) -> list[str]:
    """Words on each mode of the machine that no recording shows.

    Raises
    ------
    CalibrationError
        Its channel is in none, or relations hold in this mode alone.
    """
    from flea_diag.core.machine_modes import never_seen, never_seen_words

    said = []
    for mode in never_seen(known.modes, [each.run.rows for each in recordings]):
        channel = known.channels[mode.channel]
        if not any(channel in each.channels for each in recordings):
            raise CalibrationError(
                f"mode {mode.name}: no recording has the channel {channel} that tells it: record it"
                " (channels.yaml), or take the mode out of the description"
            )
        words = never_seen_words(mode, channel)
        if mode.only:
            names = ", ".join(known.rows[j].name for j in mode.only)
            raise CalibrationError(
                f"{words}, and {names} holds in it alone: record it in this mode"
            )
        said.append(f"{words}; record the machine in it, too, if it is used so")
    return said


def check_bands(recordings: Sequence[NominalRecording], known: ResidualSet) -> None:
    """Refuse healthy recordings of a supply that is not within its band.

    Raises
    ------
    CalibrationError
        Names the recording, the channel, its mean, the band and the remedy.
    """
    import numpy as np

    for band in known.bands:
        for each in recordings:
            read = each.run.rows[:, known.index[band.channel]]
            read = read[np.isfinite(read)]
            mean = float(np.mean(read)) if len(read) else band.low
            if not band.low <= mean <= band.high:
                raise CalibrationError(
                    f"{each.run.name}: {band.channel} reads {mean:.4g} {known.units[band.channel]} "
                    f"in the mean, supply {band.name} is healthy from {band.low:g} to "
                    f"{band.high:g}: correct its band, or leave the recording out"
                )


def check_left_out(recordings: Sequence[NominalRecording], odd: Mapping[str, str]) -> None:
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
