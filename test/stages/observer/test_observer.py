from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from support import linear_ema as ema
from support import stands

from flea_diag.wire.records import DataQuality, Detection, Quality, Residual, Scan, Symbols

S = 1_000_000_000


@lru_cache(maxsize=1)
def healthy() -> list[Scan]:
    return stands.scans(ema.noisy(ema.run(seconds=20.0), 50))


@lru_cache(maxsize=1)
def jammed() -> list[Scan]:
    """Drag from 10 s on."""
    worse = ema.changed(coulomb=200.0, viscous=1500.0)
    return stands.scans(ema.noisy(ema.run(seconds=20.0, faulty=worse, onset_s=10.0), 51))


def after(scan: Scan, **ns_and_values: float) -> Scan:
    """Same scan with some channels changed."""
    values = dict(zip(scan.channels, scan.values, strict=True)) | ns_and_values
    return Scan(scan.stamp_ns, tuple(values), tuple(values.values()))


def quality(record: DataQuality, channel: str):
    return next(row for row in record.channels if row.channel == channel)


def counters(stage, last: Scan, channel: str) -> dict[str, int]:
    """As the record at the end of the stream has them; ``last`` sent again calls for one."""
    stage.handle(last)
    (record,) = stage.finish()
    return dict(quality(record, channel).counters)


def decisions(records) -> list:
    return stands.of(Detection, records) + stands.of(Symbols, records)


def test_a_healthy_actuator_is_quiet_and_every_scan_has_its_residuals():
    out = stands.feed(stands.observer(), [stands.table(), *healthy()])
    assert decisions(out) == []
    residuals = stands.of(Residual, out)
    assert [r.stamp_ns for r in residuals] == [s.stamp_ns for s in healthy()]
    assert len(out) == len(residuals) + 2  # the first quality, and the offsets once learned
    last = residuals[-1]
    assert len(last.names) == len(last.values) == len(last.z) == len(last.thresholds)
    assert len(last.regressor_names) == len(last.regressors)
    assert last.regressor_names[-1] == "moving"


def test_a_jam_is_detected_within_a_second_and_never_before():
    out = stands.feed(stands.observer(), jammed())
    (detection,) = stands.of(Detection, out)
    delay_s = (detection.stamp_ns - jammed()[0].stamp_ns) / 1e9 - 10.0
    assert 0.0 < delay_s < 1.5
    assert detection.detected
    assert detection.residual.startswith(("parity_mechanical", "innovation_"))
    assert abs(detection.z) > detection.threshold
    symbols = stands.of(Symbols, out)
    assert symbols[0].stamp_ns >= detection.stamp_ns
    seen = {symbol.residual: symbol.magnitude for symbol in symbols[-1].symbols}
    assert seen["parity_mechanical_dn"] == "+"
    assert symbols[0].symbols[0].slope == "?"
    # Symbols never leave an episode and never change sign.
    for earlier, later in pairwise(symbols):
        for one, other in zip(earlier.symbols, later.symbols, strict=False):
            assert (one.residual, one.magnitude) == (other.residual, other.magnitude)


def test_the_same_scans_give_the_same_records():
    one, two = (stands.feed(stands.observer(), jammed()) for _ in range(2))
    assert repr(one) == repr(two)


def test_duplicates_and_late_scans_change_nothing_but_the_counters():
    disturbed = []
    for k, scan in enumerate(jammed()):
        disturbed.append(scan)
        if k % 7 == 3:
            disturbed.append(replace(scan, values=(99.0,) * len(scan.values)))
        if k % 11 == 10:
            disturbed.append(jammed()[k - 5])
    stage, plain = stands.observer(), stands.observer()
    told = [
        [r for r in stands.feed(each, run) if not isinstance(r, DataQuality)]
        for each, run in ((stage, disturbed), (plain, jammed()))
    ]
    assert repr(told[0]) == repr(told[1])
    found = counters(stage, jammed()[-1], "sensors/slow")
    # What comes again is twice, however late; so is the last scan.
    assert found["duplicate"] == 1 + sum((k % 7 == 3) + (k % 11 == 10) for k in range(2000))
    assert found["late"] == found["lost"] == 0
    assert counters(plain, jammed()[-1], "sensors/slow") == {
        "samples": 2001, "lost": 0, "late": 0, "duplicate": 1, "crowded": 0, "elsewhere": 0,
        "jumps": 0,
    }  # fmt: skip


def test_a_jump_back_in_time_starts_afresh():
    stage = stands.observer()
    stands.feed(stage, jammed())
    again = stands.feed(stage, healthy())
    assert stands.of(Detection, again) == []
    # The first nine are not yet believed.
    fresh = stands.feed(stands.observer(), healthy()[9:])
    assert repr(stands.of(Residual, again)) == repr(stands.of(Residual, fresh))


def test_a_gap_empties_the_window_and_is_counted():
    stage = stands.observer()
    whole = healthy()
    out = stands.feed(stage, whole[:1000] + whole[1050:])
    assert counters(stage, whole[-1], "sensors/slow")["lost"] == 50
    after_gap = stands.of(Residual, out)[1000]
    assert math.isnan(after_gap.values[after_gap.names.index("parity_mechanical")])
    assert decisions(out) == []


def test_a_few_lost_scans_raise_nothing():
    out = stands.feed(stands.observer(), [s for k, s in enumerate(healthy()) if k % 40 > 2])
    assert decisions(out) == []


def test_a_channel_that_goes_missing_is_said_once():
    lacking = [
        s if k < 1000 else Scan(s.stamp_ns, s.channels[1:], s.values[1:])
        for k, s in enumerate(healthy())
    ]
    assert healthy()[0].channels[0] == "motor_current"
    out = stands.feed(stands.observer(), lacking)
    said = stands.of(DataQuality, out)
    # The second time because the offsets were learned.
    states = [quality(r, "motor_current").quality for r in said]
    assert states == [Quality.GOOD, Quality.GOOD, Quality.BAD]
    assert quality(said[-1], "motor_current").since_ns == said[-1].stamp_ns
    assert quality(said[-1], "motor_current").reason.startswith("sensor dead, other channels valid")
    assert decisions(out) == []
    last = stands.of(Residual, out)[-1]
    assert math.isnan(last.values[last.names.index("parity_mechanical")])
    assert math.isfinite(last.values[last.names.index("nut_temperature")])


@pytest.mark.parametrize("frozen", [True, False])
def test_a_dead_driver_is_neither_a_dead_sensor_nor_a_fault(frozen: bool):
    """It goes on sending, what it read last or nothing at all."""
    last = healthy()[999].values if frozen else (math.nan,) * len(healthy()[0].values)
    dead = [Scan(s.stamp_ns, s.channels, last) for s in healthy()[1000:1300]]
    stage = stands.observer()
    out = stands.feed(stage, [stands.table(), *healthy()[:1000], *dead])
    assert decisions(out) == []
    said = stands.of(DataQuality, out)[-1]
    assert quality(said, "sensors/slow").quality is Quality.BAD
    assert quality(said, "sensors/slow").reason.startswith("DAQ frozen")
    assert not any("sensor dead" in row.reason for row in said.channels)
    assert counters(stage, dead[-1], "load_force")["stale"] == 300 * frozen
    # It comes back, and all is well.
    again = stands.feed(stage, healthy()[1300:])
    assert decisions(again) == []
    assert {row.quality for row in stands.of(DataQuality, again)[-1].channels} <= {
        Quality.GOOD,
        Quality.ABSENT,
    }


def test_a_sensor_that_holds_its_reading_is_counted_as_stuck():
    at = healthy()[0].channels.index("load_force")
    held = healthy()[1000].values[at]
    stuck = [after(s, load_force=held) if k > 1000 else s for k, s in enumerate(healthy())]
    stage = stands.observer()
    stands.feed(stage, [stands.table(), *stuck])
    least = next(row.repeats for row in stands.calibration().sensors if row.channel == "load_force")
    assert counters(stage, stuck[-1], "load_force")["stuck"] == 999 - least + 1
    assert counters(stage, stuck[-1], "motor_current")["stuck"] == 0
    assert counters(stage, stuck[-1], "load_force")["stale"] == 0


def test_values_out_of_range_are_not_used():
    spoilt = [
        after(s, motor_temperature=2e4) if k % 50 == 0 else s for k, s in enumerate(healthy())
    ]
    stage = stands.observer()
    out = stands.feed(stage, [stands.table(), *spoilt])
    assert decisions(out) == []
    assert counters(stage, spoilt[-1], "motor_temperature")["out_of_range"] == 40


def test_a_bad_voltage_is_no_fault_and_is_named():
    spoilt = [
        after(s, motor_voltage=-24.0) if 800 <= k < 1000 else s for k, s in enumerate(healthy())
    ]
    out = stands.feed(stands.observer(), spoilt)
    assert decisions(out) == []
    found = [quality(r, "motor_voltage") for r in stands.of(DataQuality, out)]
    assert [row.quality for row in found] == [Quality.GOOD, Quality.GOOD, Quality.BAD]
    assert "disagrees with current and motion" in found[-1].reason
    start_s = (found[-1].since_ns - spoilt[0].stamp_ns) / 1e9
    assert start_s == pytest.approx(8.2, abs=0.3)


@pytest.mark.parametrize(
    ("channel", "error", "residual"),
    [
        ("motor_current", 0.6, "parity_mechanical"),
        ("load_force", 120.0, "parity_mechanical"),
        ("motor_temperature", 6.0, "motor_temperature"),
        ("nut_temperature", 8.0, "nut_temperature"),
        ("ambient_temperature", 5.0, "ambient_temperature"),
        ("actuator_position", 0.005, "actuator_position"),
    ],
)
def test_a_biased_sensor_is_detected_by_its_own_residuals(channel, error, residual):
    at = healthy()[0].channels.index(channel)
    faulty = [
        after(s, **{channel: s.values[at] + error}) if k >= 1200 else s
        for k, s in enumerate(healthy())
    ]
    out = stands.feed(stands.observer(), faulty)
    (detection,) = stands.of(Detection, out)
    assert detection.residual.startswith(residual)
    assert 0.0 < (detection.stamp_ns - faulty[1200].stamp_ns) / 1e9 < 2.5


def test_the_zero_of_a_voltage_that_nothing_corroborates_is_no_symptom():
    at = healthy()[0].channels.index("motor_voltage")
    faulty = [
        after(s, motor_voltage=s.values[at] + 3.4) if k >= 1200 else s
        for k, s in enumerate(healthy())
    ]
    out = stands.feed(stands.observer(), faulty)
    assert decisions(out) == []
    # The residual itself is there for whoever looks.
    last = stands.of(Residual, out)[-1]
    assert last.values[last.names.index("parity_electrical")] == pytest.approx(3.4, abs=0.5)


def test_an_offset_that_is_there_from_the_start_is_the_units_own():
    at = healthy()[0].channels.index("motor_current")
    other = [after(s, motor_current=s.values[at] + 0.25) for s in healthy()]
    out = stands.feed(stands.observer(), other)
    assert decisions(out) == []
    last = stands.of(Residual, out)[-1]
    current = last.regressors[last.regressor_names.index("current_a")]
    plain = stands.of(Residual, stands.feed(stands.observer(), healthy()))[-1]
    assert current == pytest.approx(
        plain.regressors[plain.regressor_names.index("current_a")], abs=0.02
    )
    # Without the warm-up nothing is learned.
    untaught = stands.of(Residual, stands.feed(stands.observer(warm_up_s=0.0), other))[-1]
    assert untaught.regressors[last.regressor_names.index("current_a")] == pytest.approx(
        current + 0.25, abs=0.03
    )


def test_reset_closes_the_episode_and_arms_again():
    stage = stands.observer()
    assert stage.reset() == ()
    stands.feed(stage, jammed()[:1500])
    (closed,) = stage.reset()
    assert isinstance(closed, Detection)
    assert (closed.detected, closed.episode, closed.test) == (False, 1, "reset")
    assert stage.reset() == ()
    found = stands.of(Detection, stands.feed(stage, jammed()[1500:]))
    assert [(d.detected, d.episode) for d in found] == [(True, 2)]


def test_an_episode_ends_by_itself_once_all_is_quiet():
    columns = ema.noisy(ema.run(seconds=24.0), 52)
    biased = columns["motor_current"].copy()
    biased[1000:1300] += 1.0
    columns["motor_current"] = biased
    out = stands.feed(stands.observer(rearm_after_s=3.0), stands.scans(columns))
    found = stands.of(Detection, out)
    assert [(d.detected, d.episode) for d in found] == [(True, 1), (False, 1)]
    assert found[1].test == "quiet"
    assert found[1].stamp_ns >= stands.START_NS + 16 * S  # the bias went at 13 s
    stays = stands.of(
        Detection, stands.feed(stands.observer(rearm_after_s=0.0), stands.scans(columns))
    )
    assert [d.detected for d in stays] == [True]


def test_at_rest_nothing_is_called():
    still = ema.noisy(ema.run(seconds=12.0, reference=lambda t: 0.0), 53)
    out = stands.feed(stands.observer(), stands.scans(still))
    assert decisions(out) == []
    assert np.isnan(stands.of(Residual, out)[-1].z[0])


def test_with_encoder_and_command_a_position_fault_stays_in_its_own_residuals():
    columns = ema.noisy(ema.run(seconds=16.0), 54)
    columns["actuator_position"] = columns["actuator_position"].copy()
    columns["actuator_position"][1000:] += 0.004
    out = stands.feed(stands.observer(ema.CHANNELS), stands.scans(columns, ema.CHANNELS))
    assert len([d for d in stands.of(Detection, out) if d.detected]) == 1
    seen = {symbol.residual for symbol in stands.of(Symbols, out)[-1].symbols}
    assert "parity_kinematic" in seen
    assert seen <= {"parity_kinematic", "actuator_position", "actuator_position_noise",
                    "parity_speed"}  # fmt: skip
