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

"""``ros2 run flea_diag isolator``: symbols and features in, the ambiguity group out."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from flea_diag.wire.bus import Program, run


def program() -> Program:
    """Description of this node; its slow imports come after the signal handlers are installed."""
    from flea_diag.configuration.component import ISOLATOR
    from flea_diag.nodes.stage.ports import StagePorts
    from flea_diag.nodes.stage.program import stage_program
    from flea_diag.wire import records as r

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


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; return the exit status."""
    return run(program, argv)


if __name__ == "__main__":
    sys.exit(main())
