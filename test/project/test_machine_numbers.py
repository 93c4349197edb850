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

"""No number of one machine comes into core or stages without a reason.

A constant whose name ends in a unit holds for every machine: the reason stands here, one row for
each. ``MACHINE`` are those that do not, and still stand there; none is to be added. What belongs to
a machine comes from its description or its calibration.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.places import ROOT, script

SCANNER = script("docs/hooks/deciding_numbers.py")
FOLDERS = ("flea_diag/core", "flea_diag/stages")
UNITS = re.compile(r"_(M|M_S|M_S2|N|N_S_M|A|V|W|OHM|H|KG|RAD|RAD_S|DEGC|K|S|HZ|SCANS)$")

BANDS = ((5.0, 100.0), (100.0, 500.0), (500.0, 1500.0), (1500.0, 3000.0), (3000.0, 6000.0),
         (6000.0, 9500.0))  # fmt: skip
Row = tuple[str, str, object]
GENERAL: dict[Row, str] = {
    ("calibration/calibration.py", "PERIOD_S", (1e-4, 1.0)): "bounds of a file",
    ("calibration/heat_identification.py", "FAR_K", 4.0): "spikes of a thermocouple",
    ("calibration/heat_identification.py", "LEAST_EXCHANGE_PER_S", 1e-5): "a day: no exchange",
    ("calibration/heat_identification.py", "LEAST_SCANS", 500): "size of a sample",
    ("calibration/identification.py", "MINIMUM_MOVING_S", 5.0): "size of a sample",
    ("calibration/innovation_learning.py", "PIECE_SCANS", 1000): "size of a sample",
    ("calibration/noise_identification.py", "PIECE_SCANS", 300): "size of a sample",
    ("calibration/noise_identification.py", "SETTLE_SCANS", 50): "size of a sample",
    ("calibration/power_balance.py", "SMOOTHED_S", 0.2): "longer than the PWM of a drive",
    ("limits/limit_samples.py", "PIECE_S", 10.0): "size of a sample",
    ("choice/next_test.py", "FEATURE_S", 1.0): "what a test costs the operator",
    ("conditions/arrival.py", "LOOKS_BACK_S", 0.64): "bound of an excuse",
    ("conditions/contact.py", "LONGEST_S", 60.0): "bound of an excuse",
    ("conditions/contact.py", "TAKES_BACK_S", 2.0): "bound of an excuse",
    ("conditions/contact.py", "TRIED_S", 0.5): "bound of an excuse",
    ("conditions/end_of_travel.py", "MOST_SCANS", 2048): "size of a block",
    ("conditions/end_of_travel.py", "STILL_S", 0.1): "longer than a bounce off a stop",
    (
        "core/scan_counts.py",
        "SMOOTHING_S",
        0.3,
    ): "longer than the PWM of a drive, shorter than a symbol",
    ("core/scan_counts.py", "SMOOTHINGS_S", (0.01, 10.0)): "bounds of a file",
    ("core/scan_counts.py", "COUNTED_PERIOD_S", 0.01): "what older files count by",
    (
        "detection/coefficient_shift.py",
        "BIN_S",
        0.5,
    ): "the shortest window",
    ("detection/coefficient_tests.py", "BESIDE_K", 20.0): "what magnets lose by heat",
    ("detection/mean_shift.py", "GAP_S", 0.5): "a smoothing kernel, and what is withheld before it",
    ("detection/mean_shift.py", "LEAST_ALWAYS_S", 6.0): "size of a sample",
    ("detection/mean_shift.py", "SHIFT_WINDOWS_S", (2.0, 4.0)): "time to a detection",
    ("detection/symbols.py", "SLOPE_S", 2.0): "time of a symbol, after the paper",
    ("likelihood/unit_start.py", "WARM_UP_S", 6.0): "size of a sample",
    ("isolation/pair_clues.py", "BEHIND_S", 30.0): "how long single faults were followed",
    ("observer/detection_episode.py", "THAW_S", 30.0): "faster than a housing warms",
    ("isolation/goodness_of_fit.py", "BLOCK_S", 0.5): "the shortest window",
    ("wiring/candidates.py", "LONGEST_S", 0.3): "longer than a bus delays, shorter than a motion",
    ("wiring/wiring_search.py", "ENOUGH_S", 1.0): "size of a sample",
    ("wiring/wiring_watch.py", "LOOKS_S", (2.0, 4.0, 6.0)): "size of a sample",
    ("wiring/wiring_watch.py", "TAIL_S", 1.0): "what follows a motion that is late",
    ("wiring/wiring_watch.py", "PATIENCE_S", 10.0): "how long an operator waits",
    ("sizes/impact_sizes.py", "WINDOW_S", 1.0): "size of a sample",
    ("wiring/wiring_watch.py", "MOST_S", 40.0): "bound of a memory",
    ("isolation/missing_jump.py", "PIECE_S", 1.0): "size of a sample",
    ("isolation/missing_jump.py", "WATCHED_S", 4.0): "the longest window",
    ("isolator/episode_evidence.py", "MOVED_S", 0.5): "least evidence",
    ("evidence/sensor_modes.py", "MOVED_S", 0.5): "least evidence",
    ("evidence/sensor_modes.py", "SHOWN_S", 1.0): "time of a test of a sensor",
    ("recurrence/occurrence.py", "SLACK_S", 0.25): "a window, and what smoothing adds",
    ("recurrence/presence.py", "TURNS_HZ", 1.0): "a prior: a tenth or ten times costs 2.3 nats",
    ("isolator/episode_evidence.py", "STANDING_S", 0.3): "what a sample of it weighs",
    ("isolator/fault_episode.py", "BOTH_WAYS_S", 0.3): "least evidence",
    ("isolator/fault_episode.py", "CONCLUSIVE_S", 0.5): "least evidence",
    ("isolator/motion_history.py", "VISITED_S", 4.0): "the longest window",
    ("isolator/stand_status.py", "SEEN_MOVING_S", 0.5): "least evidence",
    ("judgement/ledger.py", "LEAST_S", 3.0): "least evidence",
    ("isolator/verdict_record.py", "LATE_S", 2.0): "what an operator is told",
    ("evidence/fault_evidence.py", "KEPT_S", 60.0): "a unit warms up",
    ("evidence/unit_chain.py", "KEPT_S", 20.0): "the earlier level of a shift",
    ("evidence/hypotheses.py", "OTHER_UNIT_K", 5.0): "a room, and what was used before",
    ("run_law/run_windows.py", "HEATING_S", 60.0): "windings have half a minute to two",
    ("run_law/run_windows.py", "WINDOW_S", 0.2): "the shortest delay that matters",
    ("sizes/recording_sizes.py", "PIECE_S", 4.0): "longer than the noise is coloured",
    ("sizes/recording_sizes.py", "SETTLES_S", 1.0): "three kernels of the smoothing",
    ("sizes/size_watch.py", "FROM_S", 3.0): "longer than records wait for one another",
    ("sizes/size_watch.py", "EACH_S", 20.0): "some pieces, by whose scatter its error is known",
    ("run_law/visible_sizes.py", "FOLLOWED_S", 10.0): "time to a detection",
    ("run_law/time_constant.py", "TAUS_S", (30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)): (
        "half a minute to hours"
    ),
    ("likelihood/unit_baseline.py", "EVERY_S", 0.04): "shorter than the smoothing",
    ("likelihood/unit_baseline.py", "PIECE_S", 1.0): "size of a sample",
    ("observer/block_replay.py", "WORTH_SCANS", 8): "size of a block",
    ("observers/state_observer.py", "WARMED_K", 0.5): "0.2 % of the resistance of copper",
    ("observers/thermal_filter.py", "START_K", 10.0): "spikes of a thermocouple",
    ("residuals/residual_bank.py", "START_S", 1.0): "size of a sample",
    ("residuals/residual_rows.py", "WINDOWS_S", (0.5, 1.0, 4.0)): "time to a detection",
    ("sensors/missing_alone.py", "LONG_S", 1.0): "longest loss of messages of a network",
    ("sensors/noise_test.py", "WARM_UP_SCANS", 600): "size of a sample",
    ("sensors/quality.py", "ABSENT_S", 0.5): "longest drop-out of a converter",
    ("sensors/quality.py", "SATURATED_S", 0.1): "longest spike of a converter",
    ("sensors/reading_guard.py", "HOLD_S", 0.1): "longest spike of a converter",
    ("sensors/rest_watch.py", "STUCK_S", 0.5): "longest drop-out of a converter",
    ("sensors/reading_jump.py", "WHOLE_S", 0.01): "longest a converter takes for a step",
    ("sensors/sensor_limits.py", "DROPOUT_S", 20.0): "memory of drop-outs",
    ("sensors/rest_watch.py", "REST_S", 0.03): "shorter than a drop-out",
    ("likelihood/run_parameters.py", "REST_S", 0.5): "time in which a payload is exchanged",
    ("likelihood/run_parameters.py", "EVERY_S", 0.1): "how often an estimate is looked at",
    ("sensors/sensor_limits.py", "LONGEST_REPEAT_S", 2.0): "longest wait for a test",
    ("sensors/unit_change.py", "LEAST_STEP_K", 0.3): "noise of a thermocouple",
    ("vibration/features_spectral.py", "BANDS_HZ", BANDS): "names of features, after the paper",
}
"""Constants that hold for every machine: file, name, value, and why."""
MACHINE: frozenset[Row] = frozenset(
    {
        ("choice/planned_motion.py", "ROOM_DEGC", 25.0),
        ("detection/window_limit.py", "SPEED_REGIONS_M_S", (0.025, 0.06)),
        ("isolator/motion_history.py", "IDLE_A", 0.1),
        ("residuals/thermal.py", "CORRECTION_S", 15.0),
        ("vibration/features_envelope.py", "ENVELOPE_BAND_HZ", (1500.0, 9500.0)),
        ("vibration/features_envelope.py", "SLOWEST_RAD_S", 10.0),
        ("vibration/features_motion.py", "REST_RAD_S", 10.0),
        ("vibration/features_motion.py", "MOVING_RAD_S", 30.0),
        ("vibration/features_motion.py", "SHORTEST_S", 0.01),
        ("vibration/features_motion.py", "REVERSAL_RAD_S", 2.0),
        ("vibration/features_motion.py", "REVERSAL_N", 5.0),
        ("vibration/features_motion.py", "REVERSAL_S", 0.03),
        ("vibration/features_motion.py", "LEVEL_S", 0.01),
        ("vibration/nominal_range.py", "SPEED_UNIT_RAD_S", 100.0),
        ("vibration/nominal_range.py", "LOAD_UNIT_N", 100.0),
        ("vibration/nominal_range.py", "MOVING_RAD_S", 15.0),
        ("vibration/nominal_range.py", "FAST_RAD_S", 55.0),
    }
)
"""Constants that are those of the FLEA; none is to be added."""


def numbers(source: str) -> Iterator[tuple[str, object]]:
    """Literal constants of a module whose names end in a unit, and their values."""
    for _, _, targets, value in SCANNER.literals(source):
        for target in targets:
            if isinstance(target, ast.Name) and UNITS.search(target.id):
                yield target.id, value


def found() -> set[Row]:
    return {
        (f"{path.parent.name}/{path.name}", name, value)
        for folder in FOLDERS
        for path in sorted(Path(ROOT, folder).rglob("*.py"))
        for name, value in numbers(path.read_text(encoding="utf-8"))
    }


def test_every_number_with_a_unit_is_argued_for_or_known_to_be_of_one_machine() -> None:
    assert found() == set(GENERAL) | MACHINE
    assert not set(GENERAL) & MACHINE


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("MOVING_M_S = 0.010", [("MOVING_M_S", 0.01)]),
        ("IDLE_A: float = -1.0", [("IDLE_A", -1.0)]),
        ("BANDS_HZ = ((1.0, 2.0),)", [("BANDS_HZ", ((1.0, 2.0),))]),
        ("SCANS_S = 2 * SPAN", []),
        ("GUARD = 1.25", []),
        ("def f():\n    LOCAL_M = 1.0", []),
    ],
)
def test_a_planted_number_is_found(source: str, expected: list[tuple[str, object]]) -> None:
    assert list(numbers(source)) == expected
