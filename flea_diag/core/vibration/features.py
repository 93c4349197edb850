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

"""The registry of features, one row per feature, and the evaluation of a feature id.

An id such as ``accelerometer_2_std`` names the accelerometer and the feature. A new feature
is a function on a `Window` and a row here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from flea_diag.core.vibration import features_envelope as envelope
from flea_diag.core.vibration import features_impacts as impacts
from flea_diag.core.vibration import features_motion as motion
from flea_diag.core.vibration import features_spectral as spectral
from flea_diag.core.vibration import features_time as time
from flea_diag.core.vibration.window import Floats, NotComputableError, Window
from flea_diag.errors import ConfigurationError, shown


class Scope(str, Enum):
    """The signals a feature uses; the value is the prefix of its id."""

    ACCELEROMETER = "accelerometer_<n>_"
    PAIR = "accelerometers_"
    SCANS = ""


@dataclass(frozen=True)
class Feature:
    """One row of the registry.

    ``cost`` is CPU time relative to ``std`` as ``flea features bench`` measures it.
    ``combine`` reduces the values of the axes to one. ``logarithmic`` features are positive
    and vary by factors: nominal ranges are fitted to their logarithm. ``needs_scans``: the
    feature uses the motion, so scans must cover the window too.
    """

    name: str
    unit: str
    function: Callable[[Window], Any]
    cost: float
    combine: Callable[[Floats], Any] = np.mean
    scope: Scope = Scope.ACCELEROMETER
    logarithmic: bool = True
    needs_scans: bool = False

    @property
    def words(self) -> str:
        """First line of the docstring of the function."""
        return (self.function.__doc__ or "").strip().splitlines()[0]


def _rms(values: Floats) -> float:
    """Root mean square over the axes: the level of the whole sensor."""
    return float(np.sqrt(np.mean(np.square(values))))


_PAIR: dict[str, Any] = {"scope": Scope.PAIR}
_SCANS: dict[str, Any] = {"scope": Scope.SCANS, "needs_scans": True, "logarithmic": False}
_LINEAR: dict[str, Any] = {"logarithmic": False}
_LEVEL: dict[str, Any] = {"combine": _rms}
_TRACKED: dict[str, Any] = {"needs_scans": True}

_ROWS: tuple[Feature, ...] = (
    Feature("std", "m/s^2", time.std, 1.0, **_LEVEL),
    Feature("rms", "m/s^2", time.rms, 0.6, **_LEVEL),
    Feature("mean", "m/s^2", time.mean, 0.6, **_LEVEL),
    Feature("peak", "m/s^2", time.peak, 0.8, np.max),
    Feature("crest", "1", time.crest, 0.9),
    Feature("skewness", "1", time.skewness, 1.2, **_LINEAR),
    Feature("kurtosis", "1", time.kurtosis, 1.7),
    Feature("impulse_factor", "1", time.impulse_factor, 1.1),
    Feature("shape_factor", "1", time.shape_factor, 0.9),
    Feature("local_kurtosis", "1", time.local_kurtosis, 1.5),
    Feature("intermittence", "1", time.intermittence, 1.8),
    *(
        Feature(f"band_{low:.0f}_{high:.0f}_rms", "m/s^2", spectral.band_rms(low, high), 3.0, _rms)
        for low, high in spectral.BANDS_HZ
    ),
    Feature("spectral_centroid", "Hz", spectral.spectral_centroid, 6.8),
    Feature("spectral_spread", "Hz", spectral.spectral_spread, 6.8),
    Feature("spectral_flatness", "1", spectral.spectral_flatness, 6.8),
    Feature("spectral_kurtosis_peak", "1", spectral.spectral_kurtosis_peak, 7.3, **_LINEAR),
    Feature("kurtogram_peak", "1", spectral.kurtogram_peak, 32.0, **_LINEAR),
    Feature("kurtogram_band", "Hz", spectral.kurtogram_band_hz, 32.0, np.median),
    *(
        Feature(f"wavelet_{node}_energy", "1", spectral.wavelet_energy(node), 3.9)
        for node in range(2**spectral.WAVELET_LEVEL)
    ),
    Feature("axis_coherence", "1", spectral.axis_coherence, 8.4),
    *(
        Feature(f"{line}_line", "1", envelope.line_ratio(line), 13.7, np.max, **_TRACKED)
        for line in ("nut", "screw", "ball", "bearing_outer", "bearing_inner", "bearing_ball")
    ),
    *(
        Feature(f"{line}_impacts", "m/s^2", impacts.line_impacts(line), 14.0, **_LINEAR, **_TRACKED)
        for line in ("nut", "screw", "ball")
    ),
    Feature("gear_mesh_line", "1", envelope.mesh_ratio, 8.0, np.max, **_TRACKED),
    Feature("order_1_amplitude", "m/s^2", envelope.order_amplitude(1.0), 4.9, **_LEVEL, **_TRACKED),
    Feature("rest_std", "m/s^2", motion.rest_std, 1.3, **_LEVEL, **_TRACKED),
    Feature("rest_moving_ratio", "1", motion.rest_moving_ratio, 1.6, **_TRACKED),
    Feature("reversal_ratio", "1", motion.reversal_ratio, 3.0, np.max, **_TRACKED),
    Feature("speed_correlation", "1", motion.speed_correlation, 1.2, **_LINEAR, **_TRACKED),
    Feature("current_correlation", "1", motion.current_correlation, 1.0, **_LINEAR, **_TRACKED),
    Feature("coherence", "1", spectral.accelerometer_coherence, 12.5, **_PAIR),
    Feature("level_correlation", "1", motion.level_correlation, 2.2, **_LINEAR, **_PAIR),
    Feature("motor_current_coulomb", "A", motion.current_coulomb, 1.2, **_SCANS),
    Feature("motor_current_viscous", "A s/rad", motion.current_viscous, 1.2, **_SCANS),
    Feature("motor_voltage_speed", "V s/rad", motion.voltage_speed, 0.2, **_SCANS),
    Feature("motor_voltage_current", "ohm", motion.voltage_current, 0.2, **_SCANS),
    Feature("motor_heating", "K/s", motion.motor_heating, 0.5, **_SCANS),
    Feature("nut_heating", "K/s", motion.nut_heating, 0.5, **_SCANS),
)

FEATURES: dict[str, Feature] = {row.name: row for row in _ROWS}


@dataclass(frozen=True)
class FeatureId:
    """A feature and its accelerometer ("" if it has none)."""

    feature: Feature
    accelerometer: str = ""

    def __str__(self) -> str:
        prefix = {
            Scope.ACCELEROMETER: f"{self.accelerometer}_",
            Scope.PAIR: Scope.PAIR.value,
            Scope.SCANS: "",
        }
        return prefix[self.feature.scope] + self.feature.name

    @classmethod
    def parse(cls, text: str) -> FeatureId:
        """Parse an id into feature and accelerometer.

        Raises
        ------
        ConfigurationError
            There is no such feature; the message names the id.
        """
        number, _, name = text.removeprefix("accelerometer_").partition("_")
        if number.isdigit() and name in FEATURES:
            found: FeatureId | None = cls(FEATURES[name], f"accelerometer_{number}")
        else:
            name = text.removeprefix(Scope.PAIR.value)
            found = cls(FEATURES[name]) if name in FEATURES else None
        if found and str(found) == text:
            return found
        raise ConfigurationError(
            f"feature {shown(text)} is unknown; ids are accelerometer_<n>_<feature>, "
            "accelerometers_<feature> or the name of a feature of the scans: "
            "see `flea features list`"
        )


def compute(text: str, window: Window) -> float:
    """Value of one feature, by id, on one window.

    Raises
    ------
    NotComputableError
        The feature cannot be computed on this window; the message is the reason.
    """
    return evaluate(FeatureId.parse(text), window)


def evaluate(wanted: FeatureId, window: Window) -> float:
    """Value of one feature on one window; as `compute`."""
    part = window.of(wanted.accelerometer) if wanted.accelerometer else window
    return _finite(wanted.feature, part)


def compute_all(texts: Iterable[str], window: Window) -> dict[str, float]:
    """Values of many features at once, sharing spectra; NaN where one is not computable."""
    parts: dict[str, Window] = {"": window}
    values: dict[str, float] = {}
    for text in texts:
        wanted = FeatureId.parse(text)
        try:
            if wanted.accelerometer not in parts:
                parts[wanted.accelerometer] = window.of(wanted.accelerometer)
            values[text] = _finite(wanted.feature, parts[wanted.accelerometer])
        except NotComputableError:
            values[text] = float("nan")
    return values


def try_out(texts: Iterable[str], rate_hz: float) -> None:
    """Compute features on one synthetic second, which loads and compiles their libraries."""
    points = 1 + round(rate_hz or 1000.0)
    wave = np.sin(np.outer(np.arange(points) ** 1.5, np.arange(1.0, 7.0)))
    axes = tuple(f"accelerometer_{number}_{axis}" for number in (1, 2) for axis in "xyz")
    compute_all(texts, Window(wave, points - 1.0, axes, wave[:, 0]))


def all_ids(axes: Iterable[str]) -> tuple[str, ...]:
    """Ids of every feature available on a stand with these axes."""
    accelerometers = tuple(dict.fromkeys(axis.rsplit("_", 1)[0] for axis in axes))
    return tuple(
        str(FeatureId(feature, name))
        for feature in FEATURES.values()
        for name in (accelerometers if feature.scope is Scope.ACCELEROMETER else ("",))
    )


def _finite(feature: Feature, window: Window) -> float:
    if feature.scope is not Scope.SCANS and not window.is_finite:
        raise NotComputableError("the window contains samples that are not finite")
    value = float(feature.combine(np.asarray(feature.function(window), dtype=np.float64)))
    if not np.isfinite(value):
        raise NotComputableError(f"{feature.name} = {shown(value)} is not finite")
    return value
