"""An isolator that is killed and comes back in mid-run: latched topics tell it of the episode."""

from __future__ import annotations

from functools import lru_cache

import pytest
from support import stands

from flea_diag.configuration.component import DIAGNOSER, EXTRACTOR, ISOLATOR, OBSERVER
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Scan,
    Symbols,
    Truth,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

S = 1_000_000_000
ONSET_S, AWAY_S, END_S = 8.1, 2.0, 22.0
LATCHED = (ChannelTable, Symbols, DataQuality, Detection)


@lru_cache(maxsize=1)
def jammed() -> tuple[Record, ...]:
    fault = {"fault": "jam", "onset_s": ONSET_S}
    given = {"duration_s": END_S, "seed": 0, "faults": [fault]}
    stand = SimulatedStand(scenario_from_mapping(given, "jam"))
    return tuple(record for record in stand if not isinstance(record, Truth))


def returned(killed_s: float, deaf: int) -> list[AmbiguityGroup]:
    """What a second isolator says, to whom latched topics come only after ``deaf`` scans."""
    values = DIAGNOSER.parameters()
    observer, extractor = OBSERVER.build(values), EXTRACTOR.build(values)
    blind, fresh = Pipeline((observer, extractor)), ISOLATOR.build(values)
    watched = Pipeline((observer, ISOLATOR.build(values), extractor))
    again = Pipeline((observer, fresh, extractor))
    latched: dict[type, Record] = {}
    said: list[Record] = []
    start_ns, scans = jammed()[0].stamp_ns, 0
    for record in jammed():
        at_s = (record.stamp_ns - start_ns) / S
        if at_s < killed_s:
            seen = watched.handle(record)
        elif at_s < killed_s + AWAY_S:
            seen = blind.handle(record)
        else:
            if scans == deaf:
                for kind in LATCHED:
                    said += fresh.handle(latched[kind])
            scans += isinstance(record, Scan)
            seen = again.handle(record)
            said += seen
        latched |= {type(each): each for each in (record, *seen) if isinstance(each, LATCHED)}
    return stands.of(AmbiguityGroup, said)


@pytest.mark.parametrize("deaf", [0, 60])
@pytest.mark.parametrize("killed_s", [9.6, 17.0])
def test_no_verdict_is_wrong_and_the_fault_is_named_again(killed_s: float, deaf: int) -> None:
    """Symbols from before are of a motion that it has not seen, and its evidence begins anew."""
    groups = [group for group in returned(killed_s, deaf) if group.episode]
    assert groups
    for group in groups:
        assert "jam" in stands.members(group), group.words
        assert group.outcome not in (Outcome.MODEL_MISMATCH, Outcome.UNEXPLAINED), group.words
    assert stands.members(groups[-1]) <= {"jam", "ball_nut_friction"}
