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

from __future__ import annotations

import pytest

from flea_diag.core.vibration.nominal_range import NominalRange, NominalRanges
from flea_diag.core.vibration.vibration_monitor import (
    BLOCKS,
    RAISED,
    SCANS,
    VibrationAlarm,
    VibrationMonitor,
)

AXIS = "accelerometer_2_z"


def monitor(limit: float = 2.0) -> VibrationMonitor:
    """A monitor with the same range in motion and at rest."""
    nominal = {AXIS: NominalRange((1.0,), -1.0, limit - 1.0)}
    watch = VibrationMonitor(NominalRanges(levels=nominal, resting_levels=nominal))
    watch.motion(100.0, 50.0)
    return watch


def alarms(watch: VibrationMonitor, levels: list[float]) -> list[str | None]:
    found = [watch.step((AXIS,), (level,)) for level in levels]
    return [alarm and alarm.axis for alarm in found]


def test_loud_blocks_raise_the_alarm_when_they_are_many():
    found = alarms(monitor(), [3.0] * RAISED)
    assert found == [None] * (RAISED - 1) + [AXIS]


def test_the_alarm_says_level_range_and_how_often():
    watch = monitor()
    alarms(watch, [1.0, *[3.0] * (RAISED - 1)])
    alarm = watch.step((AXIS,), (3.0,))
    assert alarm is not None
    assert (alarm.indicator, alarm.feature) == ("std", "accelerometer_2_std")
    assert alarm.words == (
        f"{AXIS}: level 3 m/s^2, nominal 0 to 2, outside in {RAISED} of the last 7 blocks in motion"
    )


def impulses(watch: VibrationMonitor, kurtosis: list[float]) -> list[VibrationAlarm | None]:
    """Blocks of a level that is nominal."""
    return [watch.step((AXIS,), (1.0,), (value,)) for value in kurtosis]


def test_what_strikes_is_heard_at_a_level_that_is_nominal() -> None:
    nominal = NominalRanges(
        levels={AXIS: NominalRange((1.0,), -1.0, 1.0)},
        kurtosis={AXIS: NominalRange((3.0,), -1.0, 1.0)},
    )
    watch, resting = VibrationMonitor(nominal), VibrationMonitor(nominal)
    watch.motion(100.0, 50.0)
    resting.motion(0.0, 50.0)
    found = impulses(watch, [9.0] * RAISED)
    assert found[:-1] == [None] * (RAISED - 1)
    assert found[-1] == VibrationAlarm(
        AXIS,
        "kurtosis",
        "+",
        f"{AXIS}: kurtosis 9, nominal 2 to 4, outside in {RAISED} of the last 6 blocks in motion",
    )
    assert found[-1].feature == "accelerometer_2_kurtosis"
    assert impulses(resting, [9.0] * BLOCKS) == [None] * BLOCKS


def test_one_block_in_two_with_a_knock_is_no_alarm_and_old_bags_have_no_kurtosis() -> None:
    watch = VibrationMonitor(NominalRanges(kurtosis={AXIS: NominalRange((3.0,), -1.0, 1.0)}))
    watch.motion(100.0, 50.0)
    assert impulses(watch, [30.0, 3.0] * BLOCKS) == [None] * (2 * BLOCKS)
    assert alarms(watch, [9.0] * BLOCKS) == [None] * BLOCKS


def test_a_few_loud_blocks_among_quiet_ones_do_not():
    pattern = ([3.0] * (RAISED - 1) + [1.0] * (BLOCKS - RAISED + 1)) * 5
    assert alarms(monitor(), pattern) == [None] * len(pattern)


def test_the_alarm_ends_with_the_noise():
    watch = monitor()
    alarms(watch, [3.0] * BLOCKS)
    later = alarms(watch, [1.0] * BLOCKS)
    assert later[BLOCKS - RAISED - 1] == AXIS
    assert later[BLOCKS - RAISED :] == [None] * RAISED


def test_a_sensor_that_dies_is_an_alarm_too_but_both_sides_are_not_added_up():
    loud, dead = monitor(), monitor()
    for watch, level, side in ((loud, 3.0, "+"), (dead, -1.0, "-")):
        alarms(watch, [level] * (RAISED - 1))
        alarm = watch.step((AXIS,), (level,))
        assert alarm is not None
        assert (alarm.axis, alarm.side) == (AXIS, side)
    assert alarms(monitor(), [-1.0, 3.0] * (RAISED - 1)) == [None] * (2 * RAISED - 2)


def test_what_was_never_learned_is_silent():
    watch = monitor()
    assert [watch.step(("other",), (99.0,)) for _ in range(BLOCKS)] == [None] * BLOCKS


def test_loud_blocks_count_however_long_the_actuator_rests_between_them():
    watch = monitor()
    found = []
    for _ in range(RAISED):
        found += alarms(watch, [3.0])
        for _ in range(SCANS):
            watch.motion(0.0, 50.0)
        found += alarms(watch, [1.0] * BLOCKS)
        for _ in range(SCANS):
            watch.motion(100.0, 50.0)
    assert [k for k, axis in enumerate(found) if axis] == [(RAISED - 1) * (BLOCKS + 1)]


@pytest.mark.parametrize(("speed", "alarm"), [(100.0, None), (16.0, AXIS)])
def test_the_range_follows_the_speed(speed, alarm):
    # Centre ln(0.1 + speed / 100): a level of 1.1 is nominal at full speed, loud at low speed.
    nominal = NominalRange((0.0, 1.0), -9.0, 0.2, logarithmic=True, speed_rad_s=(0.0, 200.0))
    watch = VibrationMonitor(NominalRanges(levels={AXIS: nominal}))
    for _ in range(20):
        watch.motion(speed, 50.0)
    assert alarms(watch, [1.1] * RAISED)[-1] == alarm
