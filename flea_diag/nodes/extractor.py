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

"""``ros2 run flea_diag extractor``: vibration blocks in, requested features out."""

from __future__ import annotations

from flea_diag.wire.bus import Program


def program() -> Program:
    """Description of this node; its slow imports come after the signal handlers are installed."""
    from flea_diag.configuration.component import EXTRACTOR
    from flea_diag.nodes.stage.ports import StagePorts
    from flea_diag.nodes.stage.program import stage_program
    from flea_diag.wire import records as r

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
