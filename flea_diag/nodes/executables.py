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
