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

"""What a diagnoser at the scan rate sees, against integration of equations written by hand."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.models import ema_oracle as oracle

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import Actuator, actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant, operating_values
from flea_diag.core.faults.fault import Fault, FaultHypothesis, hypothesis
from flea_diag.core.signatures.sampled_response import SCANS, SampledColumns
from flea_diag.core.signatures.signature import signature_table

PERIOD = 0.01
P = {name: float(text) for name, text in oracle.PARAMETERS.items()}

# Direction of current, speed, load position and force ten milliseconds after the onset while
# motoring outward, with the voltage as an input, as published for this class of actuator.
PUBLISHED = {
    "winding_resistance+": "- - - -",
    "winding_resistance-": "+ + + +",
    "winding_resistance- torque_constant- back_emf_constant- winding_inductance-": "+ + + +",
    "torque_constant- back_emf_constant-": "+ + + +",
    "torque_constant-": "+ - - -",
    "screw_viscous_friction+": "+ - - -",
    "screw_coulomb_friction+": "+ - - -",
    "commanded_load+": "+ - - +",
    "load_friction+": "+ - - +",
    "drive_gain-": "- - - -",
}
COLUMNS = ("motor_current", "motor_speed", "load_position", "load_force")


@pytest.fixture(scope="module")
def stand() -> Actuator:
    made = actuator(load_yaml("actuator.yaml"))
    whole = {
        name: dataclasses.replace(spec, model="stand") if spec.model else spec
        for name, spec in made.residuals.items()
    }
    return dataclasses.replace(made, residuals=whole)


def fault(words: str, size: float = 0.2, onset: str = "abrupt") -> Fault:
    group = tuple(hypothesis(word) for word in words.split())
    return Fault(words, "", (group,), "physics", onset, size, False, "")


@pytest.mark.parametrize("words", PUBLISHED)
def test_directions_are_the_published_ones(stand: Actuator, words: str) -> None:
    table = signature_table(stand, {words: fault(words)}, COLUMNS, QUADRANTS[0], PERIOD)
    assert " ".join(table[words][c].direction for c in COLUMNS) == PUBLISHED[words]


def test_field_fault_turns_the_sign_of_speed_between_the_two_tables(stand: Actuator) -> None:
    """The textbook sign lasts a few milliseconds; at 100 Hz nobody sees it."""
    words = "torque_constant- back_emf_constant-"
    rows = {words: fault(words)}
    textbook = signature_table(stand, rows, ["motor_speed"], QUADRANTS[0])
    at_100_hz = signature_table(stand, rows, ["motor_speed"], QUADRANTS[0], PERIOD)
    values = operating_values(stand, QUADRANTS[0])
    weaker = {name: 0.8 * P[name] for name in ("torque_constant", "back_emf_constant")}
    after_1_ms = SampledColumns(stand, values, 1e-3).view("stand").response("motor_speed", weaker)
    assert after_1_ms[0] < 0
    assert textbook[words]["motor_speed"].direction == "-"
    assert at_100_hz[words]["motor_speed"].direction == "+"


def integrated(quadrant: Quadrant, changed: dict[str, float]) -> np.ndarray:
    """Deviation of all channels at the first three SCANS, shape (3, channels)."""
    exact = oracle.exact()
    x0, u = oracle.steady(Fraction(quadrant.current), 60 * Fraction(quadrant.speed), exact)
    start = np.array([float(x0[s]) for s in oracle.STATES])
    given = {name: float(v) for name, v in u.items()}
    times = [scans * PERIOD for scans in SCANS[:3]]

    def run(p: dict[str, float]) -> np.ndarray:
        def slope(_: float, x: np.ndarray) -> list[float]:
            state = dict(zip(oracle.STATES, x, strict=True))
            found = oracle.rates(state, given, p, oracle.smooth_friction(state["omega"], p))
            return [found[s] for s in oracle.STATES]

        scale = np.array([1, 60, 2e-5, 0.03, 30, 30, 30, 0.05, 0.05])
        done = solve_ivp(
            slope, (0, times[-1]), start, "LSODA", t_eval=times, rtol=1e-9, atol=1e-11 * scale
        )
        rows = [dict(zip(oracle.STATES, column, strict=True)) for column in done.y.T]
        return np.array([[oracle.readings(r, p)[c] for c in oracle.CHANNELS] for r in rows])

    return run({**P, **changed}) - run(P)


@pytest.mark.parametrize("quadrant", QUADRANTS, ids=str)
@pytest.mark.parametrize(
    "name", ["winding_resistance", "torque_constant", "screw_coulomb_friction", "drive_gain"]
)
def test_step_response_is_that_of_the_nonlinear_plant(
    stand: Actuator, quadrant: Quadrant, name: str
) -> None:
    columns = SampledColumns(stand, operating_values(stand, quadrant), PERIOD)
    changed = {name: P[name] * 1.02}
    wanted = integrated(quadrant, changed)
    for k, channel in enumerate(oracle.CHANNELS):
        found = columns.view("stand").response(channel, changed)[:3]
        size = np.max(np.abs(wanted[:, k]))
        np.testing.assert_allclose(found, wanted[:, k], atol=0.03 * size + 1e-9, err_msg=channel)


def test_large_fault_is_not_extrapolated_from_a_small_one(stand: Actuator) -> None:
    """A little more resistance heats the motor; an open winding lets it cool."""
    columns = ["motor_temperature"]
    small, open_ = fault("winding_resistance+", 0.1), fault("winding_resistance+", 1000.0)
    rows = {"small": small, "open": open_}
    table = signature_table(stand, rows, columns, QUADRANTS[0], PERIOD)
    assert table["small"]["motor_temperature"].direction == "+"
    assert table["open"]["motor_temperature"].direction == "-"


def test_direction_does_not_depend_on_the_size_of_a_fault(stand: Actuator) -> None:
    names = list(oracle.CHANNELS)
    rows = {size: fault("screw_coulomb_friction+", float(size)) for size in ("0.02", "0.2", "1.5")}
    table = signature_table(stand, rows, names, QUADRANTS[0], PERIOD)
    for name in names:
        assert len({table[size][name].direction for size in rows}) == 1, name


def test_growing_fault_has_no_jump_and_strength_is_in_sigmas(stand: Actuator) -> None:
    rows = {"slow": fault("screw_coulomb_friction+", 0.5, "incipient")}
    cell = signature_table(stand, rows, ["motor_speed"], QUADRANTS[0], PERIOD)["slow"][
        "motor_speed"
    ]
    assert cell.symbols == "0-"
    # Quasi-static: speed falls by R/K^2 times half of 0.02375 N m, less what the load friction
    # gives back: 4.4 rad/s at most, of which the sensor's sigma is 0.5 rad/s.
    assert 0.5 * 8.8 < cell.strength <= 8.8


@pytest.mark.parametrize(
    ("mode", "symbols"), [("scaling+", "+*"), ("scaling-", "-*"), ("bias+", "+0"), ("drift+", "0+")]
)
def test_a_share_of_a_voltage_comes_and_goes_with_it(
    stand: Actuator, mode: str, symbols: str
) -> None:
    cause = FaultHypothesis("motor_voltage", {"+": 1, "-": -1}[mode[-1]], mode[:-1])
    error = Fault("error", "", ((cause,),), "physics", "abrupt", 0.2, False, "")
    table = signature_table(stand, {"error": error}, ["parity_drive"], QUADRANTS[0], PERIOD)
    assert table["error"]["parity_drive"].symbols == symbols
