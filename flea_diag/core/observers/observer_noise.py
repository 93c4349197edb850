"""Noise model of the state observer, learned from nominal runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ObserverNoise:
    """Standard deviations of process and measurement noise.

    ``voltage_v`` is of the measured voltage as an input, ``voltage_sample_v`` of one raw PWM
    sample, ``voltage_walk_v`` how far the mean voltage wanders in one scan where nothing
    measures it, ``force_n`` what the model leaves out of the balance of forces in one scan,
    ``unmeasured_force_n`` what comes on top without a load cell. Temperatures wander by
    ``temperature_walk_k`` in a scan. The rest is of single readings. The defaults are the
    FLEA's, as fitted to its nominal recordings.
    """

    voltage_v: float = 0.5
    voltage_sample_v: float = 8.3
    voltage_walk_v: float = 2.0
    force_n: float = 160.0
    unmeasured_force_n: float = 100.0
    temperature_walk_k: float = 0.0003
    motor_current_a: float = 0.26
    motor_speed_rad_s: float = 1.0
    actuator_position_m: float = 6.0e-5
    load_position_m: float = 6.0e-5
    motor_temperature_k: float = 0.57
    nut_temperature_k: float = 1.1

    def readings(self) -> Array:
        """Of the channels of ``DrivenModel``, in their order, shape (5,)."""
        return np.array(
            [
                self.motor_current_a,
                self.voltage_sample_v,
                self.motor_speed_rad_s,
                self.actuator_position_m,
                self.load_position_m,
            ]
        )
