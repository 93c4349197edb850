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

"""A node with a stage that is as small as can be: what the adapter does shows in its records."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.stage.ports import StagePorts
from flea_diag.nodes.stage.program import stage_program
from flea_diag.stages import Stage
from flea_diag.wire.bus import run
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Hypotheses,
    JudgedTest,
    Outcome,
    Quality,
    Record,
    Residual,
    Scan,
)


@dataclass(frozen=True)
class ToyParameters:
    limit_a: float = parameter(5.0, "Current above which", unit="A", minimum=0.0, maximum=40.0)
    fault: str = parameter("jam", "Fault that it then says", choices=("jam", "spall"))
    serial: str = parameter("x", "Set once", read_only=True)
    source: str = parameter("live", "Source", choices=("live", "replay"), read_only=True)
    busy: bool = parameter(False, "Never get ready", read_only=True)


class ToyStage:
    """Residual = scans seen since it was built; a group when the current passes the limit."""

    consumes: tuple[type, ...] = (ChannelTable, Scan)

    def __init__(self, parameters: ToyParameters) -> None:
        self._parameters = parameters
        self._seen = self._held = 0
        self._outcome: Outcome | None = None
        self._stamp_ns = NEVER_NS

    def handle(self, record: Record) -> tuple[Record, ...]:
        if isinstance(record, ChannelTable):
            return ()
        assert isinstance(record, Scan)
        self._seen += 1
        self._held += 1
        self._stamp_ns = record.stamp_ns
        current = record.value("motor_current")
        if current < 0:
            raise ConfigurationError(f"motor_current = {current} A is below 0 A")
        residual = Residual(record.stamp_ns, ("seen",), (float(self._seen),), (0.0,), (1.0,))
        outcome = Outcome.ISOLATED if current > self._parameters.limit_a else Outcome.NOMINAL
        if outcome == self._outcome:
            return (residual,)
        self._outcome = outcome
        return (self._quality(), residual, self._group(record.stamp_ns, outcome))

    def report(self) -> DataQuality | None:
        """How things stand: what was judged is another share after each scan."""
        return self._quality() if self._stamp_ns != NEVER_NS else None

    def _quality(self) -> DataQuality:
        sound = ChannelQuality("motor_current", Quality.GOOD, 1, "", (), self._stamp_ns)
        judged = JudgedTest("seen", 1.0, 1.0 / self._seen)
        return DataQuality(self._stamp_ns, (sound,), (), (judged,))

    def finish(self) -> tuple[Record, ...]:
        """Say once how many scans there were, as a stage lets go what it held back."""
        self._held, held = 0, self._held
        return (Residual(held, ("held",), (float(held),), (0.0,), (1.0,)),) if held else ()

    def reset(self) -> tuple[Record, ...]:
        self._outcome = Outcome.NOMINAL
        return (self._group(1, Outcome.NOMINAL),)

    def _group(self, stamp_ns: int, outcome: Outcome) -> AmbiguityGroup:
        fault = self._parameters.fault
        members = (Candidate(fault, f"{fault}+", 1.0, "it said so"),)
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=0,
            step=0,
            seq=0,
            members=members if outcome == Outcome.ISOLATED else (),
            dropped=(),
            detected_stamp_ns=NEVER_NS,
            words=outcome.value.lower(),
            calibration_sha256="",
            source=self._parameters.source,
        )


class Toy:
    parameters = ToyParameters

    @staticmethod
    def described(parameters: ToyParameters) -> str:
        return f"a toy that says {parameters.fault}"

    @staticmethod
    def check(parameters: ToyParameters) -> None:
        """Any parameters will do but one."""
        if parameters.serial == "bad":
            raise ConfigurationError("serial = 'bad' cannot be built")

    @staticmethod
    def warm_up(parameters: ToyParameters, begun: Callable[[str], None]) -> None:
        """Nothing is slow here, unless asked for: as a compiler, it lets no signal handler in."""
        if parameters.busy:
            signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGUSR1,))
            signal.sigwait((signal.SIGUSR1,))

    @staticmethod
    def build(parameters: ToyParameters) -> Stage:
        return ToyStage(parameters)


if __name__ == "__main__":
    ports = StagePorts(
        subscribes=(ChannelTable, Scan),
        publishes=(DataQuality, Residual, Hypotheses, AmbiguityGroup),
    )
    sys.exit(run(lambda: stage_program("toy", "A toy.", Toy, ports, ("an example",))))
