"""The console's text from records alone."""

from __future__ import annotations

from dataclasses import replace

from flea_diag.nodes.console_view import ConsoleState, line, update, view
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    ChannelQuality,
    DataQuality,
    FeatureValue,
    Health,
    Level,
    Outcome,
    Quality,
    Truth,
)

# 2023-11-14 22:13:20 UTC, as `date -u -d @1700000000` has it.
NOON_NS = 1_700_000_000 * 10**9

GROUP = AmbiguityGroup(
    stamp_ns=NOON_NS + 1_250_000_000,
    outcome=Outcome.INDISTINGUISHABLE,
    episode=2,
    step=3,
    seq=17,
    members=(
        Candidate(
            "jam", "mechanical_friction+", 0.75, "current high while slow", (), 1.5, 0.1, "N"
        ),
        Candidate("ball_nut_friction", "nut_friction+", 0.25, "no accelerometer says otherwise"),
    ),
    dropped=(Candidate("winding_short", "winding_resistance-", 0.0, "current is too high"),),
    detected_stamp_ns=NOON_NS + 500_000_000,
    words="friction in the mechanism",
    calibration_sha256="ab",
    source="live",
    not_observable=(("spall", "no accelerometer on this stand"),),
    features_computed=("rms",),
    features_available=14,
)


def shown(*records: object) -> ConsoleState:
    state = ConsoleState()
    for record in records:
        state = update(state, record)  # type: ignore[arg-type]
    return state


def test_before_the_first_verdict_it_says_so() -> None:
    assert "waiting for ambiguity_group" in view(ConsoleState())
    assert line(ConsoleState()) == "no verdict yet"


def test_the_verdict_its_members_and_why() -> None:
    text = view(shown(GROUP))
    assert "VERDICT  ERROR  INDISTINGUISHABLE  friction in the mechanism" in text
    assert "episode 2, step 3, number 17, evidence up to 22:13:21.250 UTC, live" in text
    assert "detected at 22:13:20.500 UTC" in text
    assert "POSSIBLE (2)" in text
    assert "75%  mechanical_friction+  size 1.5 ± 0.1 N" in text
    assert "current high while slow" in text
    assert "DROPPED (1)" in text
    assert "current is too high" in text
    assert "no accelerometer on this stand" in text
    assert "FEATURES  1 of 14 computed" in text


def test_one_line_a_change() -> None:
    first = line(shown(GROUP))
    assert first == (
        "22:13:21.250 ERROR INDISTINGUISHABLE (2 possible: jam, ball_nut_friction): "
        "friction in the mechanism"
    )
    named = replace(GROUP, words="one of jam, ball_nut_friction")
    assert line(shown(named)).endswith("INDISTINGUISHABLE (2 possible): " + named.words)
    assert line(shown(GROUP, replace(GROUP, seq=18))) == first
    assert line(shown(GROUP, replace(GROUP, step=4, members=GROUP.members[:1]))) != first


def test_stale_is_stale_and_not_an_error() -> None:
    state = shown(replace(GROUP, stale=True))
    assert "VERDICT  STALE" in view(state)
    assert "the stand sends no data" in view(state)
    assert " STALE " in line(state)


def test_a_silent_isolator_is_told() -> None:
    state = replace(shown(GROUP), silent_s=4.0)
    assert view(state).startswith("NO VERDICT for 4 s")
    assert "NO VERDICT" in line(state)
    assert update(state, GROUP).silent_s == 0.0


def test_features_of_this_episode_only() -> None:
    value = FeatureValue(NOON_NS, 2, 1, "rms", 0, 1, 3.25, "m/s^2", "+", 0.5, 1.5, "", 0.012)
    failed = replace(value, feature="kurtosis", value=float("nan"), reason="window across a gap")
    text = view(shown(GROUP, value, failed))
    assert "3.25 m/s^2" in text
    assert "nominal 0.5 to 1.5" in text
    assert "not computable: window across a gap" in text
    assert "3.25 m/s^2" not in view(shown(GROUP, value, replace(GROUP, episode=3)))


def test_bad_channels_and_nodes() -> None:
    quality = DataQuality(
        NOON_NS,
        (
            ChannelQuality("motor_current", Quality.GOOD, NOON_NS, ""),
            ChannelQuality("motor_voltage", Quality.BAD, NOON_NS, "stuck at -24 V"),
        ),
    )
    health = Health(
        NOON_NS,
        "observer",
        Level.WARN,
        "2 messages passed over",
        (
            ("sensors/slow/received", "100"),
            ("sensors/slow/late", "0"),
            ("sensors/slow/malformed", "2"),
            ("cpu_percent", "3.0"),
        ),
    )
    text = view(shown(quality, health))
    assert "CHANNELS  1 good, 1 not" in text
    assert "motor_voltage                bad since 22:13:20.000: stuck at -24 V" in text
    assert "observer             WARN  2 messages passed over" in text
    assert "sensors/slow/malformed 2" in text
    assert "late" not in text


def test_what_the_stand_says_is_marked_as_such() -> None:
    text = view(shown(GROUP, Truth(NOON_NS, "jam", NOON_NS)))
    assert "the stand says: jam from 22:13:20.000 UTC on" in text
    assert "the stand says: jam\n" in view(shown(GROUP, Truth(NOON_NS, "jam", NEVER_NS)))
