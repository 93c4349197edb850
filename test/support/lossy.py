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

"""A relay between a stand and the diagnoser that spoils what passes, and knows what it did."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.replay import replay
from flea_diag.wire.blocks import Block
from flea_diag.wire.records import (
    STREAM,
    AmbiguityGroup,
    ChannelQuality,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Scan,
    VibrationBlock,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

S = 1_000_000_000
HEALTHY = (Outcome.NOT_OBSERVABLE, Outcome.NOMINAL)
STARVED = (Outcome.NOT_OBSERVABLE, Outcome.DATA_UNUSABLE)
DURATION_S = 20.0
MOTION = {"kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045}
Random = np.random.Generator


@dataclass
class Spoilt:
    """What arrives, in order of arrival, and what the stream's counters have to say of it."""

    records: list[Record]
    expected: dict[str, int] = field(default_factory=dict)
    outcomes: tuple[Outcome, ...] = HEALTHY
    """What may be said; the last of them must be."""


@lru_cache(maxsize=5)
def nominal(seed: int, vibration: bool = False) -> tuple[Record, ...]:
    """A healthy run of one unit."""
    return _run(seed, vibration)


@lru_cache(maxsize=1)
def faulty(seed: int) -> tuple[Record, ...]:
    """The same with a jam from half of it on."""
    return _run(seed, faults=[{"fault": "jam", "onset_s": DURATION_S / 2}])


def _run(seed: int, vibration: bool = False, **more: Any) -> tuple[Record, ...]:
    values = {
        **more,
        "motion": MOTION,
        "duration_s": DURATION_S,
        "seed": seed,
        "sensors": {"vibration": vibration},
    }
    return tuple(SimulatedStand(scenario_from_mapping(values, "nominal")))


def scans(records: list[Record]) -> list[Scan]:
    """The scans among them."""
    return [record for record in records if isinstance(record, Scan)]


def _shifted(record: Record, ns: int) -> Record:
    return replace(record, stamp_ns=record.stamp_ns + ns)  # type: ignore[type-var]


def _middle(records: list[Record], random: Random) -> int:
    """Somewhere after the warm-up and well before the end."""
    return int(random.integers(len(records) * 4 // 10, len(records) * 7 // 10))


def _chosen(records: list[Record], random: Random, share: float) -> list[bool]:
    """Scans that are hit; never the first or the last, whose loss nobody can notice."""
    hit = [isinstance(r, Scan) and random.random() < share for r in records]
    places = [k for k, record in enumerate(records) if isinstance(record, Scan)]
    hit[places[0]] = hit[places[-1]] = False
    return hit


def dropped(records: list[Record], random: Random) -> Spoilt:
    """Each fifth message is lost, at random."""
    hit = _chosen(records, random, 0.2)
    left = [r for r, lost in zip(records, hit, strict=True) if not lost]
    return Spoilt(left, {"lost": sum(hit)})


def duplicated(records: list[Record], random: Random) -> Spoilt:
    """A tenth comes twice."""
    hit = _chosen(records, random, 0.1)
    out = [r for r, twice in zip(records, hit, strict=True) for _ in range(1 + twice)]
    return Spoilt(out, {"duplicate": sum(hit)})


def _delayed(records: list[Record], random: Random, share: float, most_ns: int) -> Spoilt:
    hit = _chosen(records, random, share)
    delay = [int(random.integers(most_ns)) if late else 0 for late in hit]
    order = sorted(range(len(records)), key=lambda k: (records[k].stamp_ns + delay[k], k))
    out = [records[k] for k in order]
    newest, late = -1, 0
    for scan in scans(out):
        late += scan.stamp_ns < newest
        newest = max(newest, scan.stamp_ns)
    return Spoilt(out, {"late": late})


def delayed(records: list[Record], random: Random) -> Spoilt:
    """A tenth of the messages is held up, by up to half a second."""
    return _delayed(records, random, 0.1, S // 2)


def all_delayed(records: list[Record], random: Random) -> Spoilt:
    """Every message is held up, each by up to half a second: most are overtaken."""
    late = _delayed(records, random, 1.0, S // 2)
    return Spoilt(late.records, late.expected, STARVED)


def reordered(records: list[Record], random: Random) -> Spoilt:
    """A third changes places with its neighbours."""
    return _delayed(records, random, 0.3, 25_000_000)


def everything(records: list[Record], random: Random) -> Spoilt:
    """Losses, delays and duplicates at once."""
    lost = dropped(records, random)
    late = _delayed(lost.records, random, 0.1, S // 2)
    twice = duplicated(late.records, random)
    return Spoilt(twice.records, lost.expected | late.expected | twice.expected)


def set_back(records: list[Record], random: Random) -> Spoilt:
    """The clock is set back by 10 s."""
    at = _middle(records, random)
    out = [_shifted(r, -10 * S) if k >= at else r for k, r in enumerate(records)]
    return Spoilt(out, {"jumps": 1, "elsewhere": 9})


def set_forward(records: list[Record], random: Random) -> Spoilt:
    """The clock is set forward by an hour."""
    at = _middle(records, random)
    out = [_shifted(r, 3600 * S) if k >= at else r for k, r in enumerate(records)]
    return Spoilt(out, {"jumps": 1, "elsewhere": 9})


def wrong_stamps(records: list[Record], random: Random) -> Spoilt:
    """Single stamps are nonsense."""
    hit = _chosen(records, random, 0.01)
    out = [replace(r, stamp_ns=7) if k else r for r, k in zip(records, hit, strict=True)]  # type: ignore[type-var]
    return Spoilt(out, {"lost": sum(hit), "elsewhere": sum(hit)})


def not_a_number(records: list[Record], random: Random) -> Spoilt:
    """Bursts without a value, in any of the channels."""
    out, channels = list(records), len(scans(records)[0].values)
    for at in random.integers(0, len(records) - 30, 20).tolist():
        column = int(random.integers(channels))
        for k in range(at, at + int(random.integers(1, 30))):
            record = out[k]
            if isinstance(record, Scan):
                values = list(record.values)
                values[column] = float("nan")
                out[k] = replace(record, values=tuple(values))
    return Spoilt(out)


def interrupted(records: list[Record], random: Random) -> Spoilt:
    """The source stops for some seconds and comes back."""
    at, length = _middle(records, random), int(random.integers(50, 500))
    gone = scans(list(records[at : at + length]))
    return Spoilt([*records[:at], *records[at + length :]], {"lost": len(gone)})


def two_sources(records: list[Record], random: Random) -> Spoilt:
    """Another unit's readings under stamps some milliseconds beside, on the same topic."""
    offset = int(random.integers(500_000, 4_500_000))
    return _mixed(records, nominal(991), offset, "crowded")


def two_clocks(records: list[Record], random: Random) -> Spoilt:
    """Another source whose clock is days off, and which has half of the channels."""
    other = [replace(r, channels=r.channels[::2], values=r.values[::2]) for r in nominal(992)
             if isinstance(r, Scan)]  # fmt: skip
    return _mixed(records, other, int(random.integers(-(10**15), -(10**14))), "elsewhere")


def _mixed(records: list[Record], other, offset_ns: int, counter: str) -> Spoilt:
    out: list[Record] = []
    for first, second in zip(scans(records), scans(list(other)), strict=True):
        out += [first, _shifted(replace(second, stamp_ns=first.stamp_ns), offset_ns)]
    tables = [r for r in records if not isinstance(r, Scan)]
    return Spoilt([*tables, *out], {counter: len(out) // 2})


def vibration_gaps(records: list[Record], random: Random) -> Spoilt:
    """Blocks of vibration get lost; a stretch of them is sampled at another rate."""
    out: list[Record] = []
    for record in records:
        if isinstance(record, VibrationBlock):
            if random.random() < 0.2:
                continue
            if random.random() < 0.2:
                offsets, samples = record.points()
                record = VibrationBlock.pack(
                    record.stamp_ns, record.axes, offsets[::2], samples[::2]
                )
        out.append(record)
    return Spoilt(out)


DISTURBANCES: dict[str, Callable[[list[Record], Random], Spoilt]] = {
    each.__name__: each
    for each in (
        dropped, duplicated, delayed, all_delayed, reordered, everything, set_back, set_forward,
        wrong_stamps, not_a_number, interrupted, two_sources, two_clocks, vibration_gaps,
    )
}  # fmt: skip
COUNTED = ("lost", "late", "duplicate", "crowded", "elsewhere", "jumps")


@dataclass(frozen=True)
class Passed:
    """What became of one run: nothing in either tuple is as it should be."""

    name: str
    seed: int
    called: tuple[str, ...]
    miscounted: tuple[str, ...]


def diagnosed(records: Iterable[Record]) -> list[Record | Block]:
    """These records, with all that the diagnoser says to them."""
    return list(replay.diagnosed(in_blocks(records), make_pipeline(load_stand())))


def passed(name: str, seed: int) -> Passed:
    """Spoil a healthy run and diagnose it; errors come through."""
    spoilt = spoilt_run(name, seed)
    return judged(name, seed, spoilt, diagnosed(spoilt.records))


def spoilt_run(name: str, seed: int) -> Spoilt:
    """A healthy run, spoilt in this way."""
    records = list(nominal(seed, name == "vibration_gaps"))
    return DISTURBANCES[name](records, np.random.default_rng((seed, len(name))))


def judged(name: str, seed: int, spoilt: Spoilt, said: list[Any]) -> Passed:
    """What was said to a spoilt run, held against what was done to it."""
    counted = dict(stream(said).counters)
    wanted = dict.fromkeys(COUNTED, 0) | spoilt.expected
    wrong = [f"{k} {counted[k]} for {n}" for k, n in wanted.items() if counted[k] != n]
    return Passed(name, seed, called(said, spoilt.outcomes), tuple(wrong))


def called(said: Iterable[Record], outcomes: tuple[Outcome, ...] = HEALTHY) -> tuple[str, ...]:
    """Every fault that was called, in words, and what of ``outcomes`` was due and not said."""
    said = list(said)
    words = [f"detected by {r.residual}" for r in said if isinstance(r, Detection) and r.detected]
    verdicts = [record for record in said if isinstance(record, AmbiguityGroup)]
    words += [verdict.words for verdict in verdicts if verdict.outcome not in outcomes]
    if outcomes[-1] not in {verdict.outcome for verdict in verdicts}:
        words.append(f"never said {outcomes[-1].value}")
    return tuple(dict.fromkeys(words))


def stream(said: list[Record]) -> ChannelQuality:
    """What was last said of the scans."""
    last = [record for record in said if isinstance(record, DataQuality)][-1]
    return next(row for row in last.channels if row.channel == STREAM)
