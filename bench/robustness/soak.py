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

"""Endurance test: a long simulated run through observer and isolator, in one process.

Faults appear and disappear; scans are lost, duplicated and delayed. It runs faster than real time.
Scans are passed as message bytes, in blocks as in a replay or one by one as in a live run.
Checked: no missed episode, no false alarm, exact counters, constant memory after the first hour.

scripts/soak                                 24 h of stand time
scripts/soak --hours 0.5 --singly --json -   a short run scan by scan, result as JSON

SIGINT and SIGTERM end it early, with the result so far.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.blocks import Block
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import (
    STREAM,
    AmbiguityGroup,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Scan,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

USUAL = float("nan")
FAULTS = {
    "jam": USUAL, "motor_current_bias": USUAL, "winding_short": USUAL, "load_force_bias": USUAL,
    "motor_current_dead": USUAL, "ball_nut_friction": 15.0, "motor_speed_scaling": USUAL,
    "actuator_position_bias": USUAL, "motor_current_noise": USUAL,
}  # fmt: skip
"""Fault -> size; faults detectable within 1 min without accelerometers that end when removed."""
EVERY_S, LASTS_S, QUIET_S = 600.0, 60.0, 120.0
"""Period and duration of the faults, and time after the end by which the episode must be closed."""
LATE_SCANS = 20
BLOCK_SCANS = 1000
SHARES = {"lost": 0.002, "duplicate": 0.0005, "late": 0.0005}
"""Shares of the scans. One loss in a hundred is a burst of up to eight scans."""
FLAT = 0.05
PAGE_BYTES = 4096
S = 1_000_000_000


@dataclass
class Found:
    """Results so far."""

    stand_h: float = 0.0
    cpu_s: float = 0.0
    scans: int = 0
    faults: int = 0
    missed: list[str] = field(default_factory=list)
    not_named: list[str] = field(default_factory=list)
    false_alarms: list[str] = field(default_factory=list)
    reset: list[str] = field(default_factory=list)
    injected: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SHARES, 0))
    counted: dict[str, int] = field(default_factory=dict)
    memory_mb: list[float] = field(default_factory=list)
    ended: bool = False
    """Whether the run has ended: only then are the counters final, since losses are reported with a
    delay of up to 1 s."""

    @property
    def real_time(self) -> float:
        """Stand time divided by CPU time."""
        return self.stand_h * 3600.0 / self.cpu_s

    def wrong(self) -> list[str]:
        """Descriptions of all failed checks."""
        words = [f"missed: {each}" for each in self.missed]
        words += [f"no fault, but {each}" for each in self.false_alarms]
        for name in SHARES:
            if self.ended and self.injected[name] != self.counted.get(name, 0):
                words.append(f"{self.counted.get(name, 0)} {name}, injected {self.injected[name]}")
        later = self.memory_mb[1:]
        if later and max(later) > (1.0 + FLAT) * later[0]:
            words.append(f"memory grew from {later[0]:.1f} to {max(later):.1f} MB")
        return words


class Relay:
    """Disturbs the stream between stand and diagnosis, and counts the disturbances."""

    def __init__(self, random: np.random.Generator, injected: dict[str, int]) -> None:
        self._random, self._injected = random, injected
        self._gone = 0
        self._held: list[tuple[int, Record]] = []
        self._passed = 0

    def pass_on(self, record: Record) -> Iterator[Record]:
        """Records delivered in place of a record."""
        if not isinstance(record, Scan):
            yield record
            return
        yield from self._scan(record)
        self._passed += 1
        while self._held and self._held[0][0] <= self._passed:
            yield self._held.pop(0)[1]

    def rest(self) -> list[Record]:
        """Records still held back."""
        return [record for _, record in self._held]

    def _scan(self, scan: Scan) -> Iterator[Record]:
        # No loss among the first scans: losses before the start of a stream are undetectable.
        draw = 1.0 if self._passed < 100 else self._random.random()
        if self._gone or draw < SHARES["lost"]:
            if not self._gone and self._random.random() < 0.01:
                self._gone = int(self._random.integers(1, 8))
            else:
                self._gone = max(self._gone - 1, 0)
            self._injected["lost"] += 1
        elif draw > 1.0 - SHARES["late"] and self._passed >= 100:
            self._held.append((self._passed + LATE_SCANS, scan))
            self._injected["late"] += 1
        else:
            yield scan
            if draw < SHARES["lost"] + SHARES["duplicate"]:
                self._injected["duplicate"] += 1
                yield scan


class Soak:
    """One simulated stand with relay and diagnosis."""

    def __init__(self, hours: float, seed: int, singly: bool) -> None:
        values = {
            "motion": {
                "kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5, "centre_m": 0.045
            },
            "load": {"constant_n": 20.0, "amplitude_n": 80.0, "frequency_hz": 0.2},
            "duration_s": hours * 3600.0,
            "seed": seed,
            "sensors": {"vibration": False},
        }  # fmt: skip
        self.found = Found()
        self._stand = SimulatedStand(scenario_from_mapping(values, "soak"))
        self._pipeline = make_pipeline(load_stand())
        self._relay = Relay(np.random.default_rng(seed), self.found.injected)
        self._stopped = False
        self._most = 1 if singly else BLOCK_SCANS
        self._waiting: list[bytes] = []
        self._fault, self._onset_s = "", 0.0
        self._detected = self._open = self._named = self._gone = False

    def stop(self, *_: object) -> None:
        """End early."""
        self._stopped = True

    def hours(self) -> Iterator[Found]:
        """Run to the end; yield the results after each hour of stand time and at the end."""
        begin_s, told = time.process_time(), 0
        while not (self._stand.finished or self._stopped):
            self._schedule()
            for record in self._stand.advance():
                for passed in self._relay.pass_on(record):
                    self._hand_on(passed)
            if self._stand.time_s >= 3600.0 * (told + 1):
                told += 1
                yield self._so_far(begin_s)
        self._hand_on_late()
        self._diagnose()
        self._take(self._pipeline.finish())
        self.found.ended = True
        yield self._so_far(begin_s)

    def _so_far(self, begin_s: float) -> Found:
        self.found.stand_h = self._stand.time_s / 3600.0
        self.found.cpu_s = time.process_time() - begin_s
        self.found.memory_mb.append(_resident_mb())
        return self.found

    def _hand_on_late(self) -> None:
        """Deliver the records that the relay still holds."""
        for record in self._relay.rest():
            self._hand_on(record)

    def _hand_on(self, record: Record) -> None:
        """Collect scans for a block; other records are delivered in order between blocks."""
        if isinstance(record, Scan):
            self.found.scans += 1
            self._waiting.append(encode(record))
            if len(self._waiting) >= self._most:
                self._diagnose()
        else:
            self._diagnose()
            self._take(self._pipeline.handle(record))

    def _diagnose(self) -> None:
        """Pass the collected scans to the diagnosis."""
        messages, self._waiting = self._waiting, []
        block = scan_block(messages) if self._most > 1 and messages else None
        if block is not None:
            self._take(self._pipeline.handle_block(block))
            return
        for message in messages:
            self._take(self._pipeline.handle(decode(Scan, message)))

    def _schedule(self) -> None:
        """Inject the next fault, remove it, and check that its episode ends."""
        now_s = self._stand.time_s
        number, since_s = divmod(now_s, EVERY_S)
        if since_s < 0.05 and number:
            self._diagnose()
            self._end()
            self._fault = list(FAULTS)[int(number - 1) % len(FAULTS)]
            self._onset_s, self._detected = now_s, False
            self._named = self._gone = False
            self.found.faults += 1
            self._stand.inject(self._fault, FAULTS[self._fault])
        elif self._fault and abs(since_s - LASTS_S) < 0.05:
            self._diagnose()
            self._gone = True
            self._stand.clear()
        elif self._fault and abs(since_s - LASTS_S - QUIET_S) < 0.05:
            self._diagnose()
            self._end()

    def _end(self) -> None:
        """Check the last fault; reset an episode that is still open, as an operator would."""
        if not self._fault:
            return
        words = f"{self._fault} at {self._onset_s / 3600.0:.2f} h"
        if not self._detected:
            self.found.missed.append(words)
        elif not self._named:
            self.found.not_named.append(words)
        if self._open:
            self.found.reset.append(words)
            self._take(self._pipeline.reset())
        self._fault = ""

    def _take(self, said: tuple[Record | Block, ...]) -> None:
        for record in said:
            if isinstance(record, Detection):
                self._open = record.detected
                if record.detected and self._fault and not self._gone:
                    self._detected = True
                elif record.detected:
                    self._alarm(f"detected by {record.residual}")
            elif isinstance(record, AmbiguityGroup):
                if any(member.fault == self._fault for member in record.members):
                    self._named = True
                elif record.outcome is Outcome.MODEL_MISMATCH and not record.episode:
                    self._alarm(record.words)
            elif isinstance(record, DataQuality):
                row = next(row for row in record.channels if row.channel == STREAM)
                self.found.counted = {name: dict(row.counters)[name] for name in SHARES}

    def _alarm(self, words: str) -> None:
        self.found.false_alarms.append(f"{words} at {self._stand.time_s / 3600.0:.2f} h")


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * PAGE_BYTES / 1e6


def _told(found: Found) -> str:
    return (
        f"{found.stand_h:6.2f} h of stand time, {found.real_time:.0f} x real time (CPU), "
        f"{found.memory_mb[-1]:.1f} MB, {found.faults} faults, {len(found.missed)} missed, "
        f"{len(found.not_named)} not named, {len(found.false_alarms)} false alarms, "
        f"{len(found.reset)} reset"
    )


def main() -> int:
    """Run and print; exit status 1 if any check failed."""
    parser = argparse.ArgumentParser(
        prog="scripts/soak",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--hours", type=float, default=24.0, help="stand time, h (default: 24)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--singly", action="store_true", help="scan by scan, as a live run does")
    parser.add_argument(
        "--json", metavar="FILE", help="write results as JSON every hour; - for stdout"
    )
    given = parser.parse_args()
    soak = Soak(given.hours, given.seed, given.singly)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, soak.stop)
    for found in soak.hours():
        print(_told(found), file=sys.stderr, flush=True)
        if given.json not in (None, "-"):
            _write(found, Path(given.json))
    if given.json == "-":
        print(json.dumps(asdict(soak.found) | {"wrong": soak.found.wrong()}))
    elif given.json:
        _write(soak.found, Path(given.json))
    for words in soak.found.wrong():
        print(words, file=sys.stderr)
    return int(bool(soak.found.wrong()))


def _write(found: Found, path: Path) -> None:
    path.write_text(json.dumps(asdict(found) | {"wrong": found.wrong()}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
