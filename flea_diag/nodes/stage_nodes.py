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

"""The executables that run a stage: what each reads, and what it publishes."""

from __future__ import annotations

from flea_diag.configuration.component import DIAGNOSER, EXTRACTOR, ISOLATOR, OBSERVER
from flea_diag.nodes.stage.inbox import Turns
from flea_diag.nodes.stage.ports import JUDGEMENTS, SOURCES, StagePorts
from flea_diag.nodes.stage.program import stage_program
from flea_diag.wire import records as r
from flea_diag.wire.bus import Program


def observer() -> Program:
    """``ros2 run flea_diag observer``: scans in, residuals, detection and symbols out."""
    return stage_program(
        "observer",
        "Computes calibrated residuals for every scan, tests them, and publishes the symbols of "
        "those that deviate.",
        OBSERVER,
        StagePorts(
            subscribes=(r.ChannelTable, r.Scan, r.AmbiguityGroup),
            publishes=(r.DataQuality, r.Residual, r.Detection, r.Symbols),
        ),
        examples=(
            "ros2 run flea_diag observer --ros-args -p use_sim_time:=true",
            "ros2 param describe /observer executor",
        ),
    )


def isolator() -> Program:
    """``ros2 run flea_diag isolator``: symbols and features in, the ambiguity group out."""
    return stage_program(
        "isolator",
        "Reduces the ambiguity group to the faults that fit the evidence, and requests the next "
        "feature.",
        ISOLATOR,
        StagePorts(
            subscribes=(
                r.ChannelTable,
                r.DataQuality,
                r.Residual,
                r.Detection,
                r.Symbols,
                r.VibrationLevel,
                r.FeatureValue,
                r.Remark,
            ),
            publishes=(
                r.FeatureRequest,
                r.Hypotheses,
                r.AmbiguityGroup,
                r.VerdictNumbers,
                r.SizeTrend,
            ),
        ),
        examples=(
            "ros2 topic echo /ambiguity_group",
            "ros2 service call /isolator/reset std_srvs/srv/Trigger",
        ),
    )


def extractor() -> Program:
    """``ros2 run flea_diag extractor``: vibration blocks in, requested features out."""
    return stage_program(
        "extractor",
        "Buffers the last seconds of vibration undecoded and computes features on request.",
        EXTRACTOR,
        StagePorts(
            subscribes=(r.ChannelTable, r.VibrationBlock, r.Scan, r.FeatureRequest),
            publishes=(r.VibrationLevel, r.FeatureValue),
        ),
        examples=("ros2 topic echo /feature",),
    )


def diagnoser(shared: Turns | None = None) -> Program:
    """``ros2 run flea_diag diagnoser``: observer, isolator and extractor in one process.

    ``shared`` are the turns of a process with several stands.
    """
    return stage_program(
        "diagnoser",
        "Runs observer, isolator and extractor in one process: scans and vibration in, ambiguity "
        "group out.",
        DIAGNOSER,
        StagePorts(
            subscribes=SOURCES,
            publishes=(r.VibrationLevel, *JUDGEMENTS),
        ),
        examples=(
            "ros2 run flea_diag diagnoser",
            "ros2 run flea_diag diagnoser --ros-args -r __ns:=/stand_2",
        ),
        shared=shared,
    )
