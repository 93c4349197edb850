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

"""Cost and accuracy of one observer step compared with progpy 1.9 and the Kalman filter.

All filters use the same actuator (current, speed, position; current and position measured), exact
discretisation and measured record. progpy runs vectorised, on whole matrices, with its default
resampling and with the systematic one of filterpy. Its default is incorrect (it subtracts the
number of copies from the weights, not from N w), so ratios refer to systematic resampling.

The filters process the record in turns of ``BLOCK`` scans, so that other load on the machine
affects all equally; results are medians over scans, on one core. The comparison needs
``pip install progpy==1.9``.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from summary import Figure, bench_parser, write_summary
from support.models import linear_actuator
from support.models.linear_actuator import START, sharpened, simulated
from support.models.linear_model import LinearModel

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.particle_filter import ParticleFilter
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.parameters import ActuatorParameters

FLEA = compiled_relations("actuator.yaml").residuals

PERIOD_S = linear_actuator.PERIOD
STEPS = 1500
SETTLE = 100
BLOCK = 50
HAVE_NUMBA = find_spec("numba") is not None
HAVE_PROGPY = find_spec("progpy") is not None and find_spec("filterpy") is not None
BACKENDS = ("numpy", "numba") if HAVE_NUMBA else ("numpy",)

Step = Callable[[int, np.ndarray, np.ndarray], None]
Rival = tuple[Step, Callable[[], np.ndarray]]
"""Function for one scan (number, inputs, measurement), and one for the estimate (not timed)."""


def on_one_core() -> None:
    """Restrict to one core; matrices of this size do not benefit from threads."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def ours(model: LinearModel, particles: int, proposal: str, backend: str) -> Rival:
    """A particle filter of this package."""
    filtered = ParticleFilter(
        model,
        np.zeros(3),
        START,
        np.random.default_rng(1),
        particles=particles,
        proposal=proposal,
        backend=backend,
    )

    def step(number: int, u: np.ndarray, y: np.ndarray) -> None:
        filtered.predict(u)
        filtered.update(y)

    return step, lambda: filtered.mean


def kalman(model: LinearModel) -> Rival:
    """The exact filter."""
    filtered = KalmanFilter(model, np.zeros(3), START)

    def step(number: int, u: np.ndarray, y: np.ndarray) -> None:
        filtered.predict(u)
        filtered.update(y)

    return step, lambda: filtered.mean


def progpy(model: LinearModel, particles: int, systematic: bool) -> Rival:
    """The particle filter of progpy on the same model: vectorised, same noise, exact step."""
    from filterpy.monte_carlo import residual_resample, systematic_resample
    from progpy.state_estimators import ParticleFilter as ProgpyFilter
    from progpy.uncertain_data import MultivariateNormalDist

    np.random.seed(1)  # noqa: NPY002 - filterpy draws from the global generator
    prognostics = progpy_model(model)
    sigma = dict(zip(model.channels, np.sqrt(np.diag(model.R)).tolist(), strict=True))
    estimator = ProgpyFilter(
        prognostics,
        MultivariateNormalDist(list(model.states), np.zeros(3), START),
        num_particles=particles,
        measurement_noise=sigma,
        resample_fcn=systematic_resample if systematic else residual_resample,
        dt=1.0,  # no substeps: the model is exact over a scan
    )

    def step(number: int, u: np.ndarray, y: np.ndarray) -> None:
        estimator.estimate(
            PERIOD_S * (number + 1),
            prognostics.InputContainer(dict(zip(model.inputs, u, strict=True))),
            prognostics.OutputContainer(dict(zip(model.channels, y, strict=True))),
        )

    def estimate() -> np.ndarray:
        return np.asarray(estimator.particles.matrix, dtype=float).mean(axis=1)

    return step, estimate


def progpy_model(model: LinearModel) -> Any:
    """The linear model as a PrognosticsModel with the same, correlated, process noise."""
    from progpy import PrognosticsModel

    draw, root = np.random.default_rng(1), np.linalg.cholesky(model.Q)
    names = list(model.inputs), list(model.states), list(model.channels)

    class Ema(PrognosticsModel):
        """The model in progpy's terms."""

        is_vectorized = True
        inputs, states, outputs = names
        events: list[str] = []  # noqa: RUF012
        default_parameters = {"process_noise": 0, "measurement_noise": 0}  # noqa: RUF012

        def initialize(self, u: object = None, z: object = None) -> object:
            """Zero state."""
            return self.StateContainer(np.zeros((3, 1)))

        def next_state(self, x: object, u: object, dt: float) -> object:
            """State after one scan, exactly discretised."""
            return self.StateContainer(model.A @ x.matrix + model.B @ u.matrix)

        def output(self, x: object) -> object:
            """Current and position."""
            return self.OutputContainer(model.H @ x.matrix + model.h[:, None])

    def scattered(x: object, dt: float = 1) -> object:
        noise = root @ draw.standard_normal(x.matrix.shape)
        return prognostics.StateContainer(x.matrix + noise)

    prognostics = Ema()
    prognostics.apply_process_noise = scattered  # progpy's own noise has no correlation
    return prognostics


def rivals(model: LinearModel) -> dict[str, Rival]:
    """All filters compared, by name."""
    found = {"Kalman, numpy": kalman(model)}
    if HAVE_PROGPY:
        found["progpy N=500, systematic"] = progpy(model, 500, systematic=True)
        found["progpy N=500, its default"] = progpy(model, 500, systematic=False)
    for backend in BACKENDS:
        for particles in (200, 500):
            found[f"optimal N={particles}, {backend}"] = ours(model, particles, "optimal", backend)
        found[f"bootstrap N=500, {backend}"] = ours(model, 500, "bootstrap", backend)
    return found


def compared(model: LinearModel, seed: int) -> dict[str, tuple[float, float]]:
    """Median time of a step in seconds and RMSE over Kalman's (root mean square of states)."""
    X, U, Y = simulated(model, STEPS, seed)
    field = rivals(model)
    times: dict[str, list[int]] = {name: [] for name in field}
    errors: dict[str, list[np.ndarray]] = {name: [] for name in field}
    for start in range(0, STEPS, BLOCK):
        for name, (step, estimate) in field.items():
            for k in range(start, start + BLOCK):
                begin = time.perf_counter_ns()
                step(k, U[k], Y[k])
                times[name].append(time.perf_counter_ns() - begin)
                errors[name].append(estimate() - X[k])
    rmse = {
        name: np.sqrt(np.mean(np.square(rows[SETTLE:]), axis=0)) for name, rows in errors.items()
    }
    least = rmse["Kalman, numpy"]
    return {
        name: (
            float(np.median(times[name][SETTLE:])) / 1e9,
            float(np.sqrt(np.mean((rmse[name] / least) ** 2))),
        )
        for name in field
    }


def observer_steps() -> dict[str, float]:
    """Median time of one scan of ``StateObserver`` at N = 200, all channels, in seconds."""
    draw = np.random.default_rng(0)
    rows = np.zeros((2000, len(FLEA.channels)))
    for channel, level, sigma in (
        ("motor_current", 0.0, 0.05),
        ("actuator_position", 0.05, 6e-5),
        ("motor_temperature", 25.0, 0.5),
        ("nut_temperature", 25.0, 1.0),
        ("ambient_temperature", 24.0, 0.0),
    ):
        rows[:, FLEA.index[channel]] = level + sigma * draw.normal(size=len(rows))
    found, relations = {}, compiled_relations("actuator.yaml", None, False)
    for backend in BACKENDS:
        observer = StateObserver(
            ActuatorParameters(**relations.described),
            relations,
            PERIOD_S,
            np.random.default_rng(0),
            200,
            backend,
        )
        times = []
        for row in rows:
            begin = time.perf_counter_ns()
            observer.step(row)
            times.append(time.perf_counter_ns() - begin)
        found[backend] = float(np.median(times[SETTLE:])) / 1e9
    return found


def main() -> None:
    """Print both comparisons and what is missing for more."""
    arguments, figures = bench_parser(__doc__).parse_args(), []
    on_one_core()
    if not HAVE_PROGPY:
        print("no ratios against progpy: it is not installed (pip install progpy==1.9)")
    if not HAVE_NUMBA:
        print("no figures for numba: it is not installed (pip install numba)")
    plain = linear_actuator.model()
    for title, model in (
        ("sensors as on the stand", plain),
        ("sensors five times better than the process noise", sharpened(plain, 5.0)),
    ):
        runs = [compared(model, seed) for seed in (1, 2, 3)]
        base = "progpy N=500, systematic"
        print(f"\n{title}\n{'':28s}{'us a step':>10s}{'x progpy':>10s}{'RMSE / Kalman':>15s}")
        for name in runs[0]:
            cost = float(np.median([run[name][0] for run in runs]))
            error = float(np.mean([run[name][1] for run in runs]))
            ratio = float("nan")
            if HAVE_PROGPY:
                ratio = float(np.median([run[base][0] / run[name][0] for run in runs]))
            print(f"{name:28s}{cost * 1e6:10.1f}{ratio:10.1f}{error:15.3f}")
            what, steps = f"{name}; {title}", STEPS * len(runs)
            figures.append(
                Figure(
                    f"RMSE, {what}", error, "x", steps, against="the Kalman filter's", seed="1 to 3"
                )
            )
            if HAVE_PROGPY:
                figures.append(
                    Figure(f"speed, {what}", ratio, "x", steps, against=base, seed="1 to 3")
                )
    print("\none scan of StateObserver, N = 200, all channels")
    for backend, cost in observer_steps().items():
        print(f"{backend:28s}{cost * 1e6:10.1f} us")
        figures.append(Figure(f"one scan of the state observer, {backend}", cost * 1e6, "us", 1900))
    write_summary("observer", figures, arguments.json)


if __name__ == "__main__":
    main()
