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

"""Every channel wired wrong on a healthy simulated machine, and each way of it: it is named.

A wrong wiring that differs by less than the limits of the tests shows nowhere: that is NOMINAL.
Each channel is wired in two ways of six in turn, in all of them where all examples are asked for.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from functools import partial

import pytest
from support import examples
from support.graph.wrong_wiring import Wiring, cut_off, late, scaled, swapped
from support.stand_runs import last_verdict

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.wiring.stream_wiring import WIRED_WRONG
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.replay import replay
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Record, Scan
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

SEED, LENGTH_S = 7_000, 14.0
MOTIONS = {
    "flea": {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.5, "centre_m": 0.045},
}
"""Machines, and how they move."""
TEMPERATURES = "_temperature"
TWINS = (("motor_voltage", "commanded_voltage"), ("actuator_position", "load_position"))
FACTORS = (1000.0, 1.0 / 25.4, 180.0 / math.pi)
LAGS_S = (0.1, 0.2)
LEFT = (Outcome.NOMINAL, Outcome.MODEL_MISMATCH)
"""Outcomes of what is not named."""
NAMING = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE)
READ = ("motor_", "commanded_voltage", "actuator_", "load_p", "load_f")
"""Channels that some relation reads: how the others are wired shows nowhere."""
LEAST_RIGHT, MOST_WRONG = 0.8, 0.1
"""Share of the wirings that must be named, alone or as a pair, and that may be called a component:
the others differ by little more than healthy machines do."""


def run_of(machine: str) -> list[Record]:
    """A healthy run."""
    values = {
        "machine": machine, "motion": MOTIONS[machine], "duration_s": LENGTH_S, "seed": SEED,
        "sensors": {"vibration": False},
    }  # fmt: skip
    stand = SimulatedStand(scenario_from_mapping(values, "wiring"))
    return [record for record in stand if isinstance(record, (ChannelTable, Scan))]


def of_channel(name: str, period_s: float) -> list[tuple[str, Wiring]]:
    """The ways in which one channel can be wired wrong by itself."""
    lags = ((1e3 * lag_s, round(lag_s / period_s)) for lag_s in LAGS_S)
    return [
        (f"{name}: its sign is turned", partial(scaled, name, -1.0)),
        *((f"{name}: it reads", partial(scaled, name, factor)) for factor in FACTORS),
        *((f"{name}: it comes {ms:.0f} ms late", partial(late, name, by)) for ms, by in lags),
    ]


def wirings(channels: list[str], period_s: float) -> Iterator[tuple[str, Wiring]]:
    """What is said of each wrong wiring, and what it does."""
    every = [of_channel(name, period_s) for name in channels]
    step = len(every[0]) // examples(len(every[0]))
    for number, ways in enumerate(every):
        yield from ways[number % step :: step]
    yield "commanded_voltage: it is cut off", partial(cut_off, "commanded_voltage", 0.6)
    for one, other in TWINS:
        yield f"{one} and {other} are swapped", partial(swapped, one, other)


def said_of(records: list[Record], machine: str) -> list[AmbiguityGroup]:
    """Verdicts of a replay."""
    pipeline = make_pipeline(load_stand("" if machine == "flea" else machine))
    found = replay.diagnosed(in_blocks(records), pipeline)
    return [record for record in found if isinstance(record, AmbiguityGroup)]


def is_said(words: str, said: str) -> bool:
    """Whether this is said, a lag to 20 ms: a tenth of the longest."""
    lag = re.search(r"(.*it comes) (\d+) ms late", words)
    if lag is None:
        return words in said
    channel, known_ms = lag.group(1), float(lag.group(2))
    found = re.search(rf"{channel} (\d+) ms late", said)
    return found is not None and abs(float(found.group(1)) - known_ms) <= 20.0


def result_of(words: str, said: list[AmbiguityGroup]) -> str:
    """named, pair, component or silent."""
    last, channel = said[-1], words.partition(":")[0]
    named = [v for v in said if v.outcome in NAMING and WIRED_WRONG not in v.words]
    # A channel that reads next to nothing may be called dead for a while: no component.
    if any(not c.fault.startswith(channel) for v in named for c in v.members):
        return "component"
    if WIRED_WRONG not in last.words:
        assert last.outcome in LEFT or named, (words, last.words)
        return "silent"
    assert is_said(words, last.words), (words, last.words)
    return "pair" if last.members else "named"


@pytest.mark.in_turn(2)
@pytest.mark.slow
@pytest.mark.parametrize("machine", MOTIONS)
def test_a_wrong_wiring_is_named_and_hardly_ever_called_a_component(machine: str) -> None:
    records = run_of(machine)
    table = next(record for record in records if isinstance(record, ChannelTable))
    scans = [record for record in records if isinstance(record, Scan)]
    period_s = 1e-9 * (scans[1].stamp_ns - scans[0].stamp_ns)
    channels = [n for n in scans[0].channels if n.startswith(READ) and not n.endswith(TEMPERATURES)]
    results = Counter(
        result_of(words, said_of([table, *change(scans)], machine))
        for words, change in wirings(channels, period_s)
    )
    assert results["named"] + results["pair"] >= LEAST_RIGHT * results.total(), results
    assert results["component"] <= MOST_WRONG * results.total(), results


def test_a_healthy_unit_within_every_limit_is_not_wired_wrong() -> None:
    """One whose voltage is off by little less than the limit, as if it were the command."""
    scenario = {
        "duration_s": 14.0,
        "machine": "wing",
        "seed": 1660738841,
        "unit_seed": 345,
        "ambient_degc": 21.1,
        "warm_degc": 1.4,
        "motion": {"kind": "trapezoid", "amplitude_m": 0.0216, "frequency_hz": 0.101,
                   "centre_m": 0.0452, "rise_s": 2.8},
        "load": {"constant_n": -1496.9},
    }  # fmt: skip
    assert last_verdict("wing", **scenario).outcome is Outcome.NOMINAL
