from __future__ import annotations

import math

import pytest

from flea_diag.core.residuals.thermal import CORRECTION_S, ThermalNode


def step(
    node: ThermalNode, measured: float, heating: float, ambient: float, dt_s: float, frozen: bool
) -> float:
    return node.follow([measured], [heating], [ambient], dt_s, frozen)[0][0]


def started(level: float, cooling_s: float = 800.0) -> ThermalNode:
    node = ThermalNode(cooling_s, 2)
    assert math.isnan(step(node, level - 1.0, 0.0, 24.0, 0.01, frozen=True))
    assert math.isnan(step(node, level + 1.0, 0.0, 24.0, 0.01, frozen=True))
    assert node.estimate_degc == level
    return node


def test_heating_follows_the_exponential():
    node, q, tau = started(30.0), 0.05, 800.0
    for _ in range(60_000):
        step(node, 0.0, q, 24.0, 0.01, frozen=True)
    final = 24.0 + q * tau
    assert node.estimate_degc == pytest.approx(
        final + (30.0 - final) * math.exp(-600.0 / tau), 1e-5
    )


def test_a_step_of_the_sensor_decays_with_the_correction_time():
    node = started(24.0)
    residuals = [step(node, 29.0, 0.0, 24.0, 0.01, frozen=False) for _ in range(1501)]
    assert residuals[0] == 5.0
    rate = 1.0 / CORRECTION_S + 1.0 / 800.0
    steady = 5.0 * (1.0 / 800.0) / rate
    # Rates 1/15 and 1/800 act together: 5 K decay towards what cooling leaves.
    assert residuals[-1] == pytest.approx(
        steady + (5.0 - steady) * math.exp(-15.0 * rate), rel=2e-3
    )


def test_frozen_is_blind_to_the_sensor():
    node = started(24.0)
    assert [step(node, 29.0, 0.0, 24.0, 0.01, frozen=True) for _ in range(500)] == [5.0] * 500


def test_what_is_missing_neither_heats_nor_corrects():
    node = started(30.0)
    assert math.isnan(step(node, math.nan, math.nan, math.nan, 0.01, frozen=False))
    assert node.estimate_degc == 30.0
    step(node, math.nan, 0.5, math.nan, 0.01, frozen=False)
    assert node.estimate_degc == pytest.approx(30.005)


def test_it_waits_for_its_first_readings():
    node = ThermalNode(800.0, 3)
    for value in (math.nan, 20.0, math.nan, 22.0):
        assert math.isnan(step(node, value, 1.0, 24.0, 0.01, frozen=False))
    assert math.isnan(step(node, 27.0, 1.0, 24.0, 0.01, frozen=False))
    assert step(node, 25.0, 0.0, 24.0, 0.01, frozen=False) == pytest.approx(25.0 - 23.0)
