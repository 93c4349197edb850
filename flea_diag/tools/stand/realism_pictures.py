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

"""Plots of ``flea realism``: each run real and simulated, and overviews of the held-out half."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flea_diag.tools.extra import require
from flea_diag.tools.terminal import make_folder

if TYPE_CHECKING:
    from flea_sim_driver.acquisition.recording import RunSignals

SIGNALS = (("position", "mm", 1e3), ("force", "N", 1.0), ("current", "A", 1.0),
           ("voltage", "V", 1.0), ("motor_temperature", "degC", 1.0))  # fmt: skip
SPECTRA = (("current", "A"), ("force", "N"), ("voltage", "V"), ("position", "m"),
           ("motor_temperature", "K"))  # fmt: skip
LABELS = {"Nominal": "tab:blue", "Jam": "tab:red", "Spall": "tab:green"}
OFFSET_A = 0.32
Pairs = list[tuple["RunSignals", "RunSignals"]]


class Album:
    """Collects and plots pairs of a real run and its simulated counterpart.

    Raises
    ------
    ConfigurationError
        matplotlib is not installed, or the folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        require("plot", "--plots")
        import matplotlib

        matplotlib.use("Agg")
        make_folder(folder)
        self._folder = folder
        self._held_out: Pairs = []

    def add(self, real: RunSignals, simulated: RunSignals, half: str) -> None:
        """Plot one run, and keep it for the overviews if it is held out."""
        if half == "held out":
            self._held_out.append((real, simulated))
        figure, axes = _figure(len(SIGNALS), 2, sharey="row")
        for column, recording in enumerate((real, simulated)):
            _paint_run(axes[:, column], recording)
        figure.suptitle(f"{real.name} ({half})")
        self._save(figure, Path(real.name).stem)

    def finish(self) -> None:
        """Plot the overviews of the held-out half."""
        for name, paint in OVERVIEWS.items():
            self._save(paint(self._held_out), f"overview_{name}")

    def _save(self, figure: Any, name: str) -> None:
        from matplotlib import pyplot

        figure.tight_layout()
        figure.savefig(self._folder / f"{name}.png", dpi=70)
        pyplot.close(figure)


def _figure(rows: int, columns: int, **options: Any) -> tuple[Any, Any]:
    from matplotlib import pyplot

    size = (7 * columns, 1.0 + 2.6 * rows)
    return pyplot.subplots(rows, columns, figsize=size, squeeze=False, **options)


def _paint_run(axes: Any, recording: RunSignals) -> None:
    for axis, (signal, unit, scale) in zip(axes, SIGNALS, strict=True):
        values = getattr(recording, signal) * scale
        axis.plot(values, ".", markersize=1)
        axis.plot(recording.smooth[signal] * scale, linewidth=0.8)
        axis.set_ylabel(f"{signal} ({unit})")
    axes[0].set_title(_side(recording))
    axes[-1].set_xlabel("sample (100 Hz)")


def _side(recording: RunSignals) -> str:
    return "simulated" if recording.simulated else "real"


def _current(recording: RunSignals) -> Any:
    """Smoothed current without its offset, whose sign differs since the real one was flipped."""
    offset = OFFSET_A if recording.simulated else -OFFSET_A
    return recording.smooth["current"] - offset


def _by_label(pairs: Pairs) -> dict[str, Pairs]:
    return {label: [pair for pair in pairs if pair[0].label == label] for label in LABELS}


def _spectra(pairs: Pairs) -> Any:
    """Median power density over the runs of a label; real solid, simulated dashed."""
    from flea_sim_driver.realism.run_statistics import spectrum

    figure, axes = _figure(len(SPECTRA), 1, sharex=True)
    for axis, (signal, unit) in zip(axes[:, 0], SPECTRA, strict=True):
        for label, some in _by_label(pairs).items():
            for side, line in ((0, "-"), (1, "--")):
                rows = [spectrum(pair[side], signal) for pair in some]
                if rows:
                    middle = np.median([density for _, density in rows], axis=0)
                    axis.semilogy(rows[0][0], middle, line, color=LABELS[label], label=label)
        axis.set_ylabel(f"{signal} ({unit}$^2$/Hz)")
    axes[0, 0].set_title("noise spectra: real solid, simulated dashed")
    axes[0, 0].legend(ncol=3)
    axes[-1, 0].set_xlabel("Hz")
    return figure


def _current_load_speed(pairs: Pairs) -> Any:
    """Smoothed current against load and against speed."""
    figure, axes = _figure(2, 2, sharex="row", sharey=True)
    for column in (0, 1):
        for pair in pairs:
            run = pair[column]
            colour = LABELS[run.label]
            for row, (signal, scale) in enumerate((("force", 1.0), ("speed", 1e3))):
                x = run.smooth[signal][200::7] * scale
                axes[row, column].plot(
                    x, _current(run)[200::7], ".", markersize=1.5, color=colour, alpha=0.4
                )
    for axis, title in zip(axes[0], ("real", "simulated"), strict=True):
        axis.set_title(title)
        axis.set_xlabel("load (N)")
    for axis in axes[1]:
        axis.set_xlabel("speed (mm/s)")
    axes[0, 0].set_ylabel("current (A)")
    axes[1, 0].set_ylabel("current (A)")
    return figure


def _friction(pairs: Pairs) -> Any:
    """Drive force less load against speed, medians in bins of 5 mm/s."""
    from flea_sim_driver.realism.run_statistics import FORCE_CONSTANT_N_PER_A

    edges = np.arange(-110.0, 111.0, 5.0)
    figure, axes = _figure(1, 2, sharey=True)
    for column, axis in enumerate(axes[0]):
        for label, some in _by_label(pairs).items():
            runs = [pair[column] for pair in some]
            if not runs:
                continue
            drive = np.concatenate(
                [FORCE_CONSTANT_N_PER_A * _current(r) - r.smooth["force"] for r in runs]
            )
            speed = np.concatenate([r.smooth["speed"] for r in runs]) * 1e3
            bins = np.digitize(speed, edges)
            filled = [k for k in range(1, len(edges)) if np.count_nonzero(bins == k) > 50]
            middles = [np.median(drive[bins == k]) for k in filled]
            axis.plot([edges[k - 1] + 2.5 for k in filled], middles, "o-",
                      color=LABELS[label], label=label)  # fmt: skip
        axis.set_xlabel("speed (mm/s)")
        axis.set_title(("real", "simulated")[column])
        axis.grid(alpha=0.4)
    axes[0, 0].set_ylabel("drive force less load (N)")
    axes[0, 0].legend()
    return figure


def _against_each_other(name: str, unit: str, scale: float) -> Callable[[Pairs], Any]:
    """One statistic of each run: simulated over real."""

    def paint(pairs: Pairs) -> Any:
        from flea_sim_driver.realism.run_statistics import STATISTICS

        figure, axes = _figure(1, 1)
        axis = axes[0, 0]
        for label, some in _by_label(pairs).items():
            values = [[STATISTICS[name].of(run) * scale for run in pair] for pair in some]
            for (x, y), (real, _) in zip(values, some, strict=True):
                axis.plot(x, y, "o", color=LABELS[label])
                axis.annotate(real.motion, (x, y), fontsize=6)
        low, high = axis.get_xlim()
        axis.plot([low, high], [low, high], "k:", linewidth=0.8)
        axis.set_xlabel(f"{name} ({unit}), real")
        axis.set_ylabel("simulated")
        axis.set_title(", ".join(f"{label}: {colour[4:]}" for label, colour in LABELS.items()))
        return figure

    return paint


def _voltage_clusters(pairs: Pairs) -> Any:
    """Histogram of the raw voltage."""
    figure, axes = _figure(1, 2, sharey=True)
    for column, axis in enumerate(axes[0]):
        for label, some in _by_label(pairs).items():
            if some:
                # As recorded: the real voltage was flipped at import, with its offset.
                way = 1.0 if column else -1.0
                values = np.concatenate([way * pair[column].voltage for pair in some])
                axis.hist(values, bins=np.arange(-30.0, 30.5, 0.5), density=True,
                          histtype="step", color=LABELS[label], label=label)  # fmt: skip
        axis.set_yscale("log")
        axis.set_xlabel("raw motor voltage (V)")
        axis.set_title(("real", "simulated")[column])
    axes[0, 0].legend()
    return figure


OVERVIEWS: dict[str, Callable[[Pairs], Any]] = {
    "noise_spectra": _spectra,
    "current_load_speed": _current_load_speed,
    "friction": _friction,
    "stroke": _against_each_other("stroke", "mm", 1e3),
    "peak_speed": _against_each_other("peak_speed", "mm/s", 1e3),
    "heating": _against_each_other("heating_rate", "mK/s", 1e3),
    "voltage_clusters": _voltage_clusters,
}
