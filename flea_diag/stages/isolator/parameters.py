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

"""Parameters of the isolator, and the knowledge it starts with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.out_of_sample import GroupCoverage
from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.isolation.pair_models import Death, Models, deaths
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.likelihood.plant_models import supplied
from flea_diag.core.sensors.reading_guard import stuck_scans
from flea_diag.core.signatures.signature import SignatureTable
from flea_diag.stages.recurrence.recurrence_knowledge import RecurrenceKnowledge
from flea_diag.wire.parameters import parameter


@dataclass(frozen=True)
class IsolatorParameters:
    """Parameters that a user may set on the isolator."""

    watermark_s: float = parameter(
        0.2,
        "time that records wait for those of other topics; the node diagnoser waits for the next "
        "scan only once sensors/channels says that there is no accelerometer",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    answer_budget_s: float = parameter(
        0.15,
        "delay from a feature request to the stamp of its answer",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    answer_limit_s: float = parameter(
        2.0,
        "time without an answer after which a feature request is abandoned",
        unit="s",
        minimum=0.1,
        maximum=60,
    )
    feature_window_s: float = parameter(
        1.0, "length of the vibration window of a feature", unit="s", minimum=0.1, maximum=5
    )
    feature_windows: int = parameter(
        5, "consecutive windows on which features are requested", minimum=1, maximum=100
    )
    feature_patience_s: float = parameter(
        5.0, "time to wait for a window in motion before the group is final", unit="s", minimum=0.0
    )
    onset_s: float = parameter(
        0.2,
        "time after detection in which scans are not used as evidence (smoothing transient)",
        unit="s",
        minimum=0.0,
        maximum=5.0,
    )
    settle_motion_s: float = parameter(
        2.0,
        "time in motion after detection before features are requested",
        unit="s",
        minimum=0.01,
    )
    settle_s: float = parameter(
        4.0,
        "time after detection at which features are requested in any case",
        unit="s",
        minimum=0.1,
    )
    drop_nats: float = parameter(
        3.5,
        "log-likelihood below the most likely fault at which a fault is dropped; more where the "
        "scores of the calibration ask for more for the stated coverage",
        unit="1",
        minimum=0.1,
    )
    coverage: float = parameter(
        0.95,
        "share of groups that hold the fault, if the calibration has scores of faulty runs; 0: "
        "drop_nats",
        minimum=0.0,
        maximum=0.999,
    )
    explain_nats: float = parameter(
        3.0,
        "log-likelihood gain over no fault that a fault needs to explain a deviation",
        minimum=0.0,
    )
    rest_s: float = parameter(
        60.0, "time at rest after which nothing is observable", unit="s", minimum=1.0
    )
    likelihood: bool = parameter(
        True, "isolate by likelihood as well (off: symbols and features only)"
    )
    gating: bool = parameter(
        True,
        "compare symbols with the quadrants visited only, and drop by likelihood only after "
        "motion in both directions (off: for comparisons)",
    )
    strategy: str = parameter(
        "optimal",
        "strategy that chooses the next feature",
        choices=("optimal", "information", "balanced", "paper"),
    )
    source: str = parameter("live", "source of the data", choices=("live", "replay"))

    def covering(self, known: GroupCoverage | None) -> IsolatorParameters:
        """The same with at least the limit that gives the stated coverage, where it is known.

        The scores may be of simulated runs, whose models fit better than those of a real stand:
        they widen a group, and never narrow it.
        """
        if known is None or not self.coverage:
            return self
        limit_nats = known.limit_nats(min(self.coverage, known.most))
        return replace(self, drop_nats=max(self.drop_nats, limit_nats))


@dataclass(frozen=True)
class Knowledge:
    """Knowledge before the first record; ``features``: those that may be requested.

    ``recurrence``: what tells faults that come and go; None: the calibration has no law.
    """

    calibration: Calibration
    calibration_sha256: str
    effects: EffectSet
    faults: Mapping[str, Fault]
    signatures: Mapping[Quadrant, SignatureTable]
    features: FaultFeatureTable
    recurrence: RecurrenceKnowledge | None = None

    @cached_property
    def moved(self) -> dict[str, set[str]]:
        """Fault -> residuals that it moves by its models, and those that it heats."""
        found = {name: set(heated) for name, heated in self.heated.items()}
        for model in self.effects.models:
            found[model.fault].update(effect.residual for effect in model.effects)
        return found

    @cached_property
    def heated(self) -> dict[str, frozenset[str]]:
        """Fault -> temperatures that it changes by more than any model says.

        Those that it heats, as a drag does a nut, and a lone one: by one thermocouple a unit that
        is warmer is not told from an error of it.
        """
        alone = self.effects.residuals.lone_temperature
        return {
            name: supplied(fault, self.effects.relations).union(alone)
            for name, fault in self.faults.items()
        }

    def deaths(self, models: Models) -> dict[str, Death]:
        """What each dead reading hides of these faults."""
        needed, told = self.effects.relations.stop.needed, self.effects.told
        return deaths(self.faults, models, needed, told)

    @cached_property
    def symptoms(self) -> SensorSymptoms:
        """What isolation looks up about sensors, with what their limits can show."""
        residuals = self.effects.residuals
        resolutions = residuals.sensors.resolutions
        unseen = tuple(
            limit.channel
            for limit in self.calibration.sensors
            if limit.channel in resolutions and not limit.shows_death(resolutions[limit.channel])
        )
        # The voltage of a supply is not tested by itself: it may stand still.
        period_s = self.calibration.period_s
        slow = {
            limit.channel: stuck_scans(limit, period_s) * period_s
            for limit in self.calibration.sensors
            if limit.every > 1 and limit.repeats
        }
        supplies = (band.channel for band in residuals.bands if band.channel not in resolutions)
        return replace(residuals.symptoms, death_unseen=(*unseen, *supplies), death_s=slow)
