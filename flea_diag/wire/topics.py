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

"""Topic, standard message type and QoS of each record type.

Three message types: JointState for numeric data, DiagnosticArray for judgements, PointCloud2 for
waveforms. Names are relative (a second stand has a namespace); only ``/diagnostics`` is absolute,
as REP-107 requires.
"""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.wire import records as r

JOINT_STATE = "sensor_msgs/msg/JointState"
DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"


@dataclass(frozen=True)
class Topic:
    """One topic; ``rank`` orders records with equal stamps where topics are merged."""

    record: type
    name: str
    message: str
    depth: int
    latched: bool
    rank: int


TOPICS: tuple[Topic, ...] = (
    Topic(r.ChannelTable, "sensors/channels", DIAGNOSTIC_ARRAY, 1, True, 0),
    Topic(r.Truth, "truth", DIAGNOSTIC_ARRAY, 1, True, 1),
    Topic(r.VibrationBlock, "sensors/vibration", POINT_CLOUD, 50, False, 2),
    Topic(r.Scan, "sensors/slow", JOINT_STATE, 100, False, 3),
    Topic(r.DataQuality, "data_quality", DIAGNOSTIC_ARRAY, 1, True, 4),
    Topic(r.Residual, "residual", JOINT_STATE, 100, False, 5),
    Topic(r.Detection, "fault_detected", DIAGNOSTIC_ARRAY, 1, True, 6),
    Topic(r.Symbols, "symbol", DIAGNOSTIC_ARRAY, 50, True, 7),
    Topic(r.VibrationLevel, "vibration_level", JOINT_STATE, 50, False, 8),
    Topic(r.FeatureRequest, "feature_request", DIAGNOSTIC_ARRAY, 50, False, 9),
    Topic(r.FeatureValue, "feature", DIAGNOSTIC_ARRAY, 50, False, 10),
    Topic(r.Hypotheses, "hypotheses", DIAGNOSTIC_ARRAY, 1, True, 11),
    Topic(r.AmbiguityGroup, "ambiguity_group", DIAGNOSTIC_ARRAY, 1, True, 12),
    Topic(r.Health, "/diagnostics", DIAGNOSTIC_ARRAY, 10, False, 13),
    Topic(r.Remark, "remark", DIAGNOSTIC_ARRAY, 50, True, 14),
    Topic(r.VerdictNumbers, "verdict_numbers", JOINT_STATE, 1, True, 15),
    Topic(r.SizeTrend, "size_trend", DIAGNOSTIC_ARRAY, 1, True, 16),
)

TOPIC_OF: dict[type, Topic] = {topic.record: topic for topic in TOPICS}
TOPIC_NAMED: dict[str, Topic] = {topic.name.lstrip("/"): topic for topic in TOPICS}
