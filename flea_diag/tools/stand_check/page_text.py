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

"""The page of ``flea stand check`` as text, and as a mapping for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from flea_diag.core.likelihood.size_bound import SizeBound
from flea_diag.tools.size_table import size_lines
from flea_diag.tools.stand_check.channel_check import ChannelCheck
from flea_diag.tools.stand_check.fault_sizes import EPISODE_S
from flea_diag.tools.stand_check.stand_page import OneMoreSensor, StandPage, sized


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
    return plain


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
    if page.lags:
        late = {True: ": correct its filter or its stamps", False: ""}
        lines += ["", "Lags between channels of one relation"]
        lines += [f"  {row.words}{late[row.is_late]}" for row in page.lags]
    if page.visible:
        lines += ["", "Sizes that half of the recordings of its calibration show"]
        lines += [f"  {line}" for line in size_lines(page.visible)]
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
        isolated = sized(row.isolated_from, row)
        rows.append(
            [
                row.fault,
                row.size.name,
                sized(row.detected_from, row),
                isolated if not others else f"group from {isolated}",
                ", ".join(others) or "-",
            ]
        )
    return rows


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
