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

"""Executable of the package -> module that it runs, the same as its script in ``launcher``."""

from __future__ import annotations

EXECUTABLES = {
    "bridge": "flea_diag.nodes.bridge",
    "console": "flea_diag.nodes.operator.console",
    "daq": "flea_sim_driver.daq_node",
    "diagnoser": "flea_diag.nodes.diagnoser",
    "extractor": "flea_diag.nodes.extractor",
    "fault_reporter": "flea_diag.nodes.operator.fault_reporter",
    "fleet": "flea_diag.nodes.fleet.fleet",
    "isolator": "flea_diag.nodes.isolator",
    "observer": "flea_diag.nodes.observer",
    "player": "flea_diag.nodes.recording.player",
    "recorder": "flea_diag.nodes.recording.recorder",
    "typed_verdict": "flea_diag.nodes.operator.typed_verdict",
    "web": "flea_diag.nodes.operator.web",
}
