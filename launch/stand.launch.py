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

"""The simulated stand and its diagnosis; `ros2 launch flea_diag stand.launch.py -s` lists all.

    ros2 launch flea_diag stand.launch.py fault:=winding_short fault_onset_s:=5.0
    ros2 launch flea_diag stand.launch.py namespace:=stand_2 simulated:=false record:=false
    ros2 launch flea_diag stand.launch.py stand:=./mine simulated:=false bridge:=true

Ends when the scenario is over and the last verdict has been said. With simulated:=false the nodes
wait for the DAQ of a real stand.
"""

import os
import runpy

from launch import LaunchDescription
from launch.actions import OpaqueFunction

BESIDE = runpy.run_path(os.path.join(os.path.dirname(os.path.realpath(__file__)), "checked.py"))

ARGUMENTS = (
    ("namespace", "", str, "namespace of the stand, for example of a second stand"),
    ("stand", "flea", str, "name of a shipped stand, or the folder of one as a path (./mine)"),
    ("simulated", "true", bool, "start the simulated stand"),
    ("machine", "", str, "simulated machine; empty: that of the stand's name"),
    ("bridge", "false", bool, "bridge the topics of the stand's channels.yaml; not with simulated"),
    ("scenario", "nominal", str, "scenario of the simulated stand: name or YAML file"),
    ("fault", "", str, "fault to inject in addition to those of the scenario"),
    ("fault_onset_s", "8.0", float, "onset of that fault [s]"),
    ("duration_s", "0.0", float, "duration of the run; 0: that of the scenario [s]"),
    ("calibration", "", str, "calibration file; empty: that of the stand"),
    ("composed", "true", bool, "diagnosis in one process; false: one process per stage"),
    ("record", "true", bool, "record a bag"),
    ("bag", "", str, "bag to write; empty: bags/runs/<UTC time>"),
    ("console", "true", bool, "print the verdict in this terminal"),
)

DAQ = ("scenario", "machine", "fault", "fault_onset_s", "duration_s")
"""Arguments that are parameters of the simulated stand."""


def nodes(context):
    given = BESIDE["values"](context, ARGUMENTS, __file__)
    stand = BESIDE["stand"](given)
    diagnosis = ("diagnoser",) if given["composed"] else ("observer", "isolator", "extractor")
    started = BESIDE["Nodes"](given)
    for stage in diagnosis:
        started.add(stage, stand)
    if given["record"]:
        started.add("recorder", {"directory": given["bag"], **stand}, needed=False)
    if given["console"]:
        started.add("console", {}, needed=False)
    if given["bridge"]:
        started.add("bridge", {"stand": given["stand"]})
    if given["simulated"]:
        waits = (*diagnosis, "recorder") if given["record"] else diagnosis
        if given["stand"] != "flea" and not os.path.splitext(given["scenario"])[1]:
            given["machine"] = given["machine"] or os.path.basename(given["stand"])
        daq = {name: given[name] for name in DAQ}
        started.add("daq", {**daq, "wait_for": ",".join(waits)})
    try:
        return started.actions()
    except RuntimeError as refused:
        machine, _, why = str(refused).partition(": ")
        if not machine.startswith("machine:=") or "machine" in given["said"]:
            raise
        hint = "give machine:=, or simulated:=false for a real stand"
        raise RuntimeError(f"stand:={given['stand']}: {why}; {hint}") from None


def generate_launch_description():
    declared = BESIDE["declared"](ARGUMENTS)
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
