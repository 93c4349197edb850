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

"""Replay what a stand sent from a bag; the diagnosis is made anew.

    ros2 launch flea_diag replay.launch.py bag:=bags/jam
    ros2 launch flea_diag replay.launch.py bag:=bags/jam rate:=4.0 loop:=true

The bag starts when the diagnosis is active, and launch ends after the verdict on its last record.
`flea replay BAG` gives the same verdict without ROS and faster than real time.
"""

import os
import runpy

from launch import LaunchDescription
from launch.actions import OpaqueFunction

BESIDE = runpy.run_path(os.path.join(os.path.dirname(os.path.realpath(__file__)), "checked.py"))

ARGUMENTS = (
    ("bag", None, str, "bag to replay"),
    ("namespace", "", str, "namespace of the topics in the bag"),
    ("stand", "flea", str, "name of a shipped stand, or the folder of one as a path (./mine)"),
    ("calibration", "", str, "calibration file; empty: that of the stand"),
    ("rate", "1.0", float, "playback rate; 1: as recorded"),
    ("loop", "false", bool, "loop the bag; the diagnosis restarts with each pass"),
    ("composed", "true", bool, "diagnosis in one process; false: one process per stage"),
    ("console", "true", bool, "print the verdict in this terminal"),
)

TIME = {"use_sim_time": True}
REPLAY = {"source": "replay"}
"""Marks the verdicts as those of a replay, which raise no alarm and no status on /diagnostics."""
MEMORY = {"memory": "none"}
"""A replay does not take up where another has ended."""


def nodes(context):
    given = BESIDE["values"](context, ARGUMENTS, __file__)
    stand = {**BESIDE["stand"](given), **TIME}
    stages = dict.fromkeys(("observer", "isolator", "extractor"), REPLAY)
    stages["isolator"] = {**REPLAY, **MEMORY}
    diagnosis = {"diagnoser": {**REPLAY, **MEMORY}} if given["composed"] else stages
    started = BESIDE["Nodes"](given)
    for stage, more in diagnosis.items():
        started.add(stage, {**stand, **more})
    if given["console"]:
        started.add("console", TIME, needed=False)
    play = {name: given[name] for name in ("bag", "rate", "loop")}
    started.add("player", {**play, "wait_for": ",".join(diagnosis)})
    return started.actions()


def generate_launch_description():
    declared = BESIDE["declared"](ARGUMENTS)
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
