"""The stand as statuses for people's tools: the same words as on topics of its own."""

from __future__ import annotations

from dataclasses import replace

from support.verdicts import LAST, NOMINAL, START

from flea_diag.nodes.stage.stand_diagnostics import mirrored
from flea_diag.wire.records import ChannelQuality, DataQuality, Level, Quality


def test_the_verdict_with_its_level_and_members() -> None:
    status = mirrored(LAST, "isolator", START + 1)
    assert (status.node, status.level, status.message) == (
        "isolator: verdict", Level.ERROR, "ERROR: words",
    )  # fmt: skip
    assert dict(status.values)["possible/jam"] == "probability 1: fits"
    assert mirrored(NOMINAL, "isolator", START).level is Level.OK


def test_stale_is_stale_and_no_error() -> None:
    status = mirrored(replace(LAST, stale=True), "isolator", START)
    assert status.level is Level.STALE
    assert "the source has stopped" in status.message


def test_channels_are_as_bad_as_the_worst() -> None:
    rows = (
        ChannelQuality("motor_current", Quality.GOOD, START, ""),
        ChannelQuality("motor_voltage", Quality.BAD, START, "stuck at -24 V"),
    )
    status = mirrored(DataQuality(START, rows), "observer", START)
    assert (status.node, status.level) == ("observer: channels", Level.WARN)
    assert dict(status.values) == {"motor_current": "good", "motor_voltage": "bad: stuck at -24 V"}
