"""Effect of a sensor fault on the parity relations: one row per channel, one rule per mode.

An error e of a reading enters a relation as ``gain * e``, or through its rate as
``gain * de/dt``. The modes differ only in what e is (y' is the true signal):

bias e = b    drift e = d t    scaling e = (1 - 1/g) y    dead e = c - y'

(scaling of a temperature: e = (g - 1) times what the thermal model expects)
"""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import (
    DRIVE,
    ELECTRICAL,
    KINEMATIC,
    MECHANICAL,
    SPEED,
    FaultModel,
    Size,
    Term,
)
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import CORRECTION_S

# Scaling y = g y' with g in [0.6, 1.6]: the share of the reading that is wrong, or of the truth.
SHARES_OF_READING = (1.0 - 1.0 / 0.6, 1.0 - 1.0 / 1.6)
SHARES_OF_TRUTH = (0.6 - 1.0, 1.6 - 1.0)

DRIFT_AGES_S = (0.3, 1.0, 2.0, 4.0, 8.0, 15.0)
"""Ages that a drift may have when it is detected."""


@dataclass(frozen=True, slots=True)
class SensorErrorModel:
    """One sensor: effect of its error on the residuals, and the largest errors of its faults.

    ``gains`` and ``rates``: (residual, gain) of the error and of its rate. ``reading`` and
    ``reading_rate``: regressors of its own signal, of which a scaling adds one of ``shares``.
    ``truth``: (residual, regressor, gain), the term missing from each relation if the signal is
    dead.
    """

    channel: str
    unit: str
    largest_bias: float
    largest_drift: float
    reading: str
    gains: tuple[tuple[str, float], ...]
    truth: tuple[tuple[str, str, float], ...] = ()
    rates: tuple[tuple[str, float], ...] = ()
    reading_rate: str = ""
    shares: tuple[float, float] = SHARES_OF_READING


@dataclass(frozen=True, slots=True)
class RelationSensor:
    """A sensor beside its place in the graph: fields as of ``SensorErrorModel``."""

    channel: str
    unit: str
    largest_bias: float
    largest_drift: float
    reading: str
    truth: tuple[tuple[str, str, float], ...]
    reading_rate: str = ""


def error_models(
    p: ActuatorParameters, relations: RelationSet, commanded: bool = True
) -> tuple[SensorErrorModel, ...]:
    """Every sensor that enters a parity relation, for one calibrated actuator.

    A dead voltage loses the same true voltage in both of its relations: the ``commanded`` one,
    where known. With a separate estimate in each relation it would also explain a motor that
    draws no current at full voltage.
    """
    effects = Effects(relations, p)
    return (*(_of_relations(row, effects, p) for row in _sensors(p, commanded)), *_temperatures(p))


def _of_relations(row: RelationSensor, effects: Effects, p: ActuatorParameters) -> SensorErrorModel:
    """A sensor whose errors enter the relations as these say; an encoder's count at the nut."""
    unit = 1.0 / p.encoder_m_per_rad if row.channel == "motor_speed" else 1.0
    return SensorErrorModel(
        row.channel,
        row.unit,
        row.largest_bias,
        row.largest_drift,
        row.reading,
        effects.gains(row.channel, unit),
        tuple(term for term in row.truth if term[0] in effects.names),
        # The rate of a speed acts through the inertia, by less than the noise: no regressor.
        effects.rates(row.channel, unit) if row.reading_rate else (),
        row.reading_rate,
    )


def _sensors(p: ActuatorParameters, commanded: bool) -> tuple[RelationSensor, ...]:
    """Sensors in the relations, and what tells the truth where one of them is dead."""
    applied = "commanded_voltage_v" if commanded else "emf_and_drop_v"
    lost_current = (
        (MECHANICAL, "resisting_force_n", -1.0),
        (ELECTRICAL, "driving_voltage_v", 1.0),
    )
    lost_load = ((MECHANICAL, "motor_force_n", 1.0),)
    lost_voltage = ((ELECTRICAL, applied, -1.0), (DRIVE, applied, -1.0))
    lost_position = ((KINEMATIC, "load_position_m", -1.0), (SPEED, "encoder_m_s", 1.0))
    lost_load_position = ((KINEMATIC, "position_m", 1.0),)
    lost_speed = (
        (SPEED, "position_rate_m_s", -1.0),
        (ELECTRICAL, "position_rate_m_s", p.back_emf_v_s_per_m),
        (MECHANICAL, "position_rate_m_s", p.viscous_friction_n_s_per_m),
        (MECHANICAL, "rate_direction", p.coulomb_friction_n),
    )
    encoder = RelationSensor("motor_speed", "m/s", 0.1, 0.05, "encoder_m_s", lost_speed)
    # Without an encoder the speed is the slope of the position, and takes over its error.
    drift_m_s = 0.01 if p.encoder_m_per_rad else 0.005
    return (
        RelationSensor("motor_current", "A", 3.0, 0.5, "motor_current_a", lost_current),
        RelationSensor("load_force", "N", 600.0, 100.0, "load_n", lost_load),
        RelationSensor("motor_voltage", "V", 24.0, 3.0, "motor_voltage_v", lost_voltage),
        *((encoder,) if p.encoder_m_per_rad else ()),
        RelationSensor(
            "actuator_position",
            "m",
            0.1,
            drift_m_s,
            "position_m",
            lost_position,
            "position_rate_m_s",
        ),
        RelationSensor("load_position", "m", 0.1, 0.01, "load_position_m", lost_load_position),
    )


def _temperatures(p: ActuatorParameters) -> tuple[SensorErrorModel, ...]:
    # An error of the air moves the models of motor and nut by CORRECTION_S over their cooling time.
    air = (
        ("ambient_temperature", 1.0),
        ("motor_temperature", -CORRECTION_S / p.motor_cooling_s),
        ("nut_temperature", -CORRECTION_S / p.nut_cooling_s),
    )
    own = {
        "motor_temperature": (("motor_temperature", 1.0),),
        "nut_temperature": (("nut_temperature", 1.0),),
        "ambient_temperature": air,
    }
    return tuple(
        SensorErrorModel(name, "K", 60.0, 2.0, f"{name}_degc", gains, shares=SHARES_OF_TRUTH)
        for name, gains in own.items()
    )


def sensor_models(
    p: ActuatorParameters, relations: RelationSet, commanded: bool = True
) -> tuple[FaultModel, ...]:
    """Bias, scaling, drift and dead of every sensor; a drift has one model for each age."""
    return tuple(
        model
        for row in error_models(p, relations, commanded)
        for model in (_bias(row), _scaling(row), *_drifts(row), _dead(row))
    )


def _level(row: SensorErrorModel, regressor: str, index: int = 0) -> tuple[Term, ...]:
    return tuple(Term(residual, regressor, gain, index) for residual, gain in row.gains)


def _rate(row: SensorErrorModel, regressor: str) -> tuple[Term, ...]:
    return tuple(Term(residual, regressor, gain) for residual, gain in row.rates)


def _bias(row: SensorErrorModel) -> FaultModel:
    size = Size("bias", row.unit, -row.largest_bias, row.largest_bias)
    return FaultModel(f"{row.channel}_bias", (size,), _level(row, "one"))


def _scaling(row: SensorErrorModel) -> FaultModel:
    size = Size("scaling share", "1", *row.shares)
    terms = _level(row, row.reading) + _rate(row, row.reading_rate)
    return FaultModel(f"{row.channel}_scaling", (size,), terms)


def _drifts(row: SensorErrorModel) -> tuple[FaultModel, ...]:
    """One model per age: the offset at detection is the rate times the age.

    With a free offset beside the rate, every bias would fit as a drift that has just stopped.
    """
    rate = Size("drift", f"{row.unit}/s", -row.largest_drift, row.largest_drift)
    fault = f"{row.channel}_drift"
    return tuple(
        FaultModel(fault, (rate,), _level(row, "elapsed_s") + _aged(row, age_s) + _rate(row, "one"))
        for age_s in DRIFT_AGES_S
    )


def _aged(row: SensorErrorModel, age_s: float) -> tuple[Term, ...]:
    return tuple(Term(residual, "one", gain * age_s) for residual, gain in row.gains)


def _dead(row: SensorErrorModel) -> FaultModel:
    level = Size("level", row.unit, -row.largest_bias, row.largest_bias)
    if not row.truth:
        # No other signal gives the true value: a constant, like a bias.
        return FaultModel(f"{row.channel}_dead", (level,), _level(row, "one"))
    lost = Size("lost share", "1", 0.9, 1.1)
    gone = tuple(Term(residual, source, gain) for residual, source, gain in row.truth)
    return FaultModel(f"{row.channel}_dead", (lost, level), gone + _level(row, "one", 1))
