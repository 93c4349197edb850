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

"""A node of somebody else: it calls a jam where the current is large, on the topics alone."""

from __future__ import annotations

import os
import sys
from dataclasses import replace

from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.wire.bus import guest
from flea_diag.wire.records import AmbiguityGroup, Candidate, Outcome, Scan

LIMIT_A = 5.0

with guest("jam_node", int(os.environ["ROS_DOMAIN_ID"])) as bus:

    def judge(scan: Scan) -> None:
        """Say so where the current is above its limit."""
        if scan.value("motor_current") > LIMIT_A:
            members = (Candidate("jam", "", 1.0, "current"),)
            stamp_ns = scan.stamp_ns
            group = plain_verdict(stamp_ns, Outcome.ISOLATED, "jam", members, stamp_ns)
            bus.publish(replace(group, episode=1))

    bus.advertise(AmbiguityGroup)
    bus.subscribe(Scan, judge)
    if sys.argv[1:] != ["--end"]:
        bus.wait_until(lambda: False, 600.0)
