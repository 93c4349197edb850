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

"""Executables of the package, called as their scripts in ``launcher``."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flea_diag.wire.bus import Program

EXECUTABLES = {
    "bridge": "flea_diag.nodes.bridge:program",
    "console": "flea_diag.nodes.operator.console:program",
    "daq": "flea_sim_driver.daq_node:program",
    "diagnoser": "flea_diag.nodes.stage_nodes:diagnoser",
    "extractor": "flea_diag.nodes.stage_nodes:extractor",
    "fault_reporter": "flea_diag.nodes.operator.fault_reporter:program",
    "fleet": "flea_diag.nodes.fleet.fleet:program",
    "isolator": "flea_diag.nodes.stage_nodes:isolator",
    "observer": "flea_diag.nodes.stage_nodes:observer",
    "player": "flea_diag.nodes.recording.player:program",
    "recorder": "flea_diag.nodes.recording.recorder:program",
    "typed_verdict": "flea_diag.nodes.operator.typed_verdict:program",
    "web": "flea_diag.nodes.operator.web:program",
}
"""Name -> module, and the function there that describes it."""


def program_of(name: str) -> Program:
    """Description of an executable; what it needs is imported here, which takes a second."""
    module, _, function = EXECUTABLES[name].partition(":")
    described: Program = getattr(import_module(module), function)()
    return described
