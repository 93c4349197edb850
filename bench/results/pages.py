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

"""Which kept result stands on which page of docs/results, and which rows the summary shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResultPage:
    """One page: its kept results in their order."""

    name: str
    title: str
    intro: str
    kept: tuple[str, ...]


@dataclass(frozen=True)
class Headline:
    """One line of the summary: a row of a kept result."""

    label: str
    kept: str
    row: str


IN_ARCHITECTURE = "path"
"""Kept result whose table stands in ARCHITECTURE.md, too."""

PAGES = (
    ResultPage(
        "real",
        "Real recordings",
        "54 public recordings of the FLEA stand: slow channels, no accelerometers. A run is right "
        "when the fault is detected after its onset with no alarm before it, the truth is in the "
        "final group, and the group holds nothing but what the campaign states beforehand. A "
        "nominal run is right when it raises no alarm. The nominal runs are dealt into two "
        "halves; each half calibrates, and the other is scored. These are development figures: "
        "thresholds and windows were chosen with these recordings in view. The last table is of a "
        "second stand.",
        ("real", "switch", "injections", "injection_ladders", "injection_recordings",
         "current_faults", "injection_bound", "left_out", "promise", "bearings", "cranfield"),
    ),
    ResultPage(
        "table4",
        "Table 4 on the simulated stand",
        "The fault scenarios of Narasimhan et al. 2010, Table 4, on simulated units that are drawn "
        "anew for each run. The paper's own results are from the hardware; real and simulated "
        "runs are never added up.",
        ("table4", "table4_fresh", "table4_wide", "table4_slow", "group_coverage", "severity",
         "nominal_10h", "travel", "live", "switches", "switches_heard"),
    ),
    ResultPage(
        "vibration",
        "Vibration",
        "Simulated accelerometers, two of three axes at 20 kHz. Units, motions, loads, resonances, "
        "damping, background and sizes of faults are drawn anew for each run. The feature table "
        "and the classifier were learned on seeds 40000 to 40079.\n\n"
        "![Share resolved against the size of the fault: the diagnosis, features alone, the "
        "classifier](../sizes.svg)",
        ("features_alone", "diagnosis_fresh", "diagnosis_study", "pits", "monitor", "weak_drags",
         "vibration_cost"),
    ),
    ResultPage(
        "realism",
        "The simulated stand against the real one",
        "Every second recording of a label tuned the simulator; the others are compared here.",
        ("realism",),
    ),
    ResultPage(
        "machines",
        "Other machines",
        "Simulated machines that are not the FLEA, each with a file of its own "
        "(`config/machines`) and a description written apart from it (`config/stands`). A run is "
        "right when the fault is detected after its onset with no alarm before it, the truth is in "
        "the final group, and the group holds nothing but what the campaign states beforehand.",
        ("machine_ema", "machine_wing", "fresh_ema", "fresh_wing", "machine_joint", "bound_ema",
         "bound_wing", "healthy", "travel_wing", "units", "jam_ladder", "rates", "sensors",
         "foreign_hoist", "foreign_arm", "foreign_hoist_payload", "foreign_arm_payload",
         "foreign_hoist_bound", "foreign_arm_bound", "switches_wing", "contacts", "contacts_20ms",
         "pairs", "long_runs"),
    ),
    ResultPage(
        "remaining_life",
        "Remaining life",
        "Faults that grow from recording to recording, and when they reach a limit "
        "([Remaining life](../remaining_life.md)). *Alpha 0.2 at lambda 0.5*: half way from the "
        "first forecast to the end, the remaining life is right to a fifth of itself. The first "
        "forecast is made as soon as growth is shown, so that it is early where a fault grows "
        "slowly at first.",
        ("remaining_life",),
    ),
    ResultPage(
        "flight",
        "Flight",
        "Twenty control surfaces in small and slow motion ([Flight](../flight.md)), healthy and "
        "with faults, with the description and calibration that this page asks for. The *bound* "
        "of a fault is what the law of the calibration holds on it in that very motion; a fault "
        "counts as found within 10 s of motion, which is a speed above 1 mm/s.",
        ("flight",),
    ),
    ResultPage(
        "baselines",
        "One statistic instead of many tests",
        "The diagnosis (`hybrid`) allows for what a unit is in five places. A baseline, "
        "`likelihood_ratio`, had one: the largest marginal likelihood ratio over faults and "
        "onsets, with the unit and a drifting level integrated out, beside the tests of single "
        "sensors. The evidence "
        "([Method](../method.md#one-evidence-by-the-law-of-healthy-recordings)) has taken its "
        "place. Both "
        "diagnose the same runs; of two numbers in a cell the first is of the baseline. A run is "
        "right when the fault is detected after its onset with no alarm before it, the truth is in "
        "the final group, and the group holds nothing but what the campaign states beforehand.",
        ("likelihood_ratio",),
    ),
    ResultPage(
        "law",
        "One law of healthy recordings",
        "What healthy recordings differ by, learned from all of them "
        "([Method](../method.md#3-calibration)): a first proof offline on the FLEA's recordings "
        "and on simulated switches of the unit, and its score by seeds that were fixed before. "
        "It is learned and reported; by it a shift is told from another unit, and what comes and "
        "goes from what stays.",
        (
            "step_0", "law_growing", "law_spoilt", "law_further", "law_machines", "law_sizes",
            "law_score",
        ),
    ),
    ResultPage(
        "evidence",
        "One evidence beside the diagnosis",
        "The diagnosis (`hybrid`) against one evidence by the law of healthy recordings "
        "(`evidence`, [Method](../method.md#one-evidence-by-the-law-of-healthy-recordings)). Both "
        "diagnose the same runs by the same calibration, without accelerometers; of two numbers "
        "in a cell the first is of the evidence. Of the product it decides whether a shift is "
        "another unit alone. A run is "
        "right when the fault is detected after its onset with no alarm before it, the truth is in "
        "the final group, and the group holds nothing but what the campaign states beforehand.",
        ("evidence", "evidence_cranfield", "evidence_second_load"),
    ),
    ResultPage(
        "performance",
        "Performance",
        "Ratios within one run travel from machine to machine; absolute times hold for the machine "
        "and its load at the time.",
        ("speed", "replay", "replay_pairs", "python", "strips", "scan", "observer", "features",
         "feature_families", "feature_costs", "filters", "chain", "processes", "path", "fleet",
         "fleet_32", "fleet_vibration", "fleet_verdict", "bridge"),
    ),
    ResultPage(
        "recordings",
        "Recordings of any make",
        "What `flea stand new` makes of files that others write: formats of other makes, files "
        "that other packages bring, and one motion in drawn dialects of tables and habits of bags, "
        "each held against its plain form.",
        ("dialects", "recordings_of_others", "published_logs"),
    ),
    ResultPage(
        "reliability",
        "Reliability",
        "Disturbed, interrupted and damaged input, full disks, killed processes and long runs, all "
        "on the simulated stand.",
        ("lossy", "missing_readings", "disk", "fuzz", "bombs", "gates", "flood", "kill", "cluster",
         "soak", "supervised", "first_launch", "shift"),
    ),
)  # fmt: skip

HEADLINES = (
    Headline(
        "Real recordings, jam: detected, final group of ball_nut_friction and jam", "real", "jam"
    ),
    Headline("Real recordings, nominal: no alarm", "real", "nominal"),
    Headline("Real recordings that switch to a jammed unit: jam found", "switch", "jam"),
    Headline("Software faults injected into real recordings: right sensor", "injections", "all"),
    Headline("Table 4 of the paper, simulated", "table4", "all"),
    Headline("Rows of Table 4 on a fresh seed, this state", "table4_fresh", "all"),
    Headline("False alarms, simulated healthy running", "table4", "false alarms, healthy running"),
    Headline("False alarms, healthy running beyond the calibration, three machines", "healthy",
             "all"),
    Headline("Vibration: the whole diagnosis of four faults", "diagnosis_fresh", "all: diagnosis"),
    Headline("Vibration: features alone, four faults", "features_alone",
             "spall, jam, ball_nut_friction, accelerometer_2_fault"),
    Headline("Replay with the particle filter, numba", "replay", "nominal, particle, numba"),
    Headline("Verdict back within 1.5 s of a killed node's return", "kill",
             "verdict back within 1.5 s of the node's return"),
    Headline("24 h with faults that come and go: none missed", "soak",
             "nine kinds of fault that come and go, in blocks: found and named"),
)  # fmt: skip
