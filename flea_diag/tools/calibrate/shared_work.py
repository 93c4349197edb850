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

"""Work on single recordings of a calibration, shared among processes or a cluster."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from flea_diag.errors import CalibrationError
from flea_diag.tools.refused import Refused
from flea_diag.tools.terminal import progress
from flea_diag.tools.workers import KeptPool, in_order

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import NominalRun
    from flea_diag.core.calibration.identification import RelationsOf
    from flea_diag.core.calibration.identified import Identified
    from flea_diag.core.calibration.innovation_learning import Array
    from flea_diag.core.calibration.nominal_trace import Trace
    from flea_diag.core.observers.observer_noise import ObserverNoise
    from flea_diag.core.residuals.parameters import ActuatorParameters

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Sharing:
    """Number of processes, or the address of a Dask scheduler; results do not depend on it."""

    jobs: int = 1
    cluster: str = ""
    pool: KeptPool | None = None

    def over(
        self, work: Callable[[Item], Result], items: Sequence[Item], step: str
    ) -> Iterator[Result]:
        """Results in the order of the items; ``step`` is shown with the progress.

        Raises
        ------
        CalibrationError
            A process died.
        """
        began_s = time.monotonic()
        results = in_order(work, items, self.jobs, self.cluster, self.pool)
        for number, result in enumerate(results, 1):
            if isinstance(result, Refused):
                raise CalibrationError(f"{step}: {result.words}")
            progress(number, len(items), step, began_s)
            yield result


ALONE = Sharing()
"""In this process."""


class RecordingWork(NamedTuple):
    """Work on a recording; the relations are made where it is done: they are generated code."""

    relations_of: RelationsOf
    has_encoder: bool
    period_s: float
    sampling: str = ""
    noise: ObserverNoise | None = None

    def trace(self, item: tuple[NominalRun, Identified]) -> Trace:
        """Residuals of a recording."""
        from flea_diag.core.calibration import nominal_trace

        run, identified = item
        relations = self.relations_of(self.has_encoder)
        return nominal_trace.trace(run, identified, relations, self.period_s)

    def innovations(self, item: tuple[ActuatorParameters, Array]) -> Array:
        """Innovation residuals of the rows of a recording."""
        from flea_diag.core.calibration.innovation_learning import Observing

        assert self.noise is not None
        relations = self.relations_of(self.has_encoder)
        return Observing(relations, self.period_s, self.sampling, self.noise).trace(*item)
