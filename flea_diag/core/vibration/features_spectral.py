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

"""Condition indicators in the frequency and the wavelet domain.

Functions return one value per axis, shape (axes,), unless they compare axes. Bands and spectra
use the one FFT of the window; only Welch averages compute their own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.window import Floats, NotComputableError, Window, shared

BANDS_HZ = ((5.0, 100.0), (100.0, 500.0), (500.0, 1500.0), (1500.0, 3000.0),
            (3000.0, 6000.0), (6000.0, 9500.0))  # fmt: skip
"""Below the modes of the structure, around those of motor and nut, and above all of them."""

WAVELET = "db4"
WAVELET_LEVEL = 3  # eight bands, as the names of features have it
SEGMENT = 1024
"""Points of a Welch segment: 51 ms at 20 kHz."""


def band_rms(low_hz: float, high_hz: float) -> Callable[[Window], Floats]:
    """Feature: root mean square of the part of the signal inside a band, m/s^2 (Parseval)."""

    def feature(window: Window) -> Floats:
        power = window.power[:, window.band(low_hz, high_hz)]
        return np.asarray(np.sqrt(power.sum(axis=1)))

    feature.__doc__ = f"Root mean square between {low_hz:g} and {high_hz:g} Hz, m/s^2 (Parseval)."
    return feature


def spectral_centroid(window: Window) -> Floats:
    """First moment of the Welch spectrum, sum(f S) / sum(S), Hz."""
    frequency, density = welch(window)
    return np.asarray(density @ frequency / _total(density))


def spectral_spread(window: Window) -> Floats:
    """Root of the second central moment of the Welch spectrum, Hz."""
    frequency, density = welch(window)
    total = _total(density)
    centre = density @ frequency / total
    return np.asarray(np.sqrt(np.maximum(density @ frequency**2 / total - centre**2, 0.0)))


def spectral_flatness(window: Window) -> Floats:
    """Geometric over arithmetic mean of the Welch spectrum: 1 for white noise, 0 for a line.

    Sensor noise has a flat spectrum; noise transmitted by the structure shows its resonances.
    """
    density = welch(window)[1]
    _total(density)
    return np.asarray(np.exp(np.log(density).mean(axis=1)) / density.mean(axis=1))


def spectral_kurtosis_peak(window: Window) -> Floats:
    """Largest spectral kurtosis over frequency: mean|X|^4 / mean(|X|^2)^2 - 2.

    0 for stationary Gaussian noise; high where some band holds impacts (Antoni 2006).
    """
    return np.asarray(_spectral_kurtosis(window, 256)[1].max(axis=1))


def kurtogram_peak(window: Window) -> Floats:
    """Largest spectral kurtosis over frequency and resolution, 32 to 512 points (Antoni 2006)."""
    return np.asarray(np.max([level.max(axis=1) for _, level in _kurtogram(window)], axis=0))


def kurtogram_band_hz(window: Window) -> Floats:
    """Centre of the band whose spectral kurtosis is largest, Hz (Antoni 2006)."""
    maps = _kurtogram(window)
    best = np.argmax([kurtosis.max(axis=1) for _, kurtosis in maps], axis=0)
    return np.array(
        [maps[level][0][np.argmax(maps[level][1][axis])] for axis, level in enumerate(best)]
    )


def wavelet_energy(node: int) -> Callable[[Window], Floats]:
    """Feature: share of one wavelet packet (db4, level 3, in order of frequency), 0 to 1."""

    def feature(window: Window) -> Floats:
        energy = wavelet_packet_energies(window)
        return np.asarray(energy[:, node] / energy.sum(axis=1))

    feature.__doc__ = (
        f"Share of the energy in wavelet packet {node} of {2**WAVELET_LEVEL} "
        f"({WAVELET}, level {WAVELET_LEVEL}, in order of frequency), 0 to 1."
    )
    return feature


@shared
def wavelet_packet_energies(window: Window) -> Floats:
    """Energy in each wavelet packet in order of frequency, shape (axes, 2**level)."""
    try:
        import pywt
    except ImportError as error:
        raise NotComputableError("PyWavelets is not installed: pip install PyWavelets") from error
    nodes = [(window.centred, False)]
    for _ in range(WAVELET_LEVEL):
        deeper: list[tuple[Floats, bool]] = []
        for node, mirrored in nodes:
            low, high = pywt.dwt(node, WAVELET, "periodization", axis=1)
            # High-pass and decimation mirror a band, so the order of its halves alternates.
            deeper += [(high, False), (low, True)] if mirrored else [(low, False), (high, True)]
        nodes = deeper
    energy = np.stack([np.einsum("an,an->a", node, node) for node, _ in nodes], axis=1)
    _total(energy)
    return np.asarray(energy)


def accelerometer_coherence(window: Window) -> float:
    """Mean magnitude squared coherence of the like axes of the first two accelerometers.

    Welch, |S12|^2 / (S11 S22), averaged over frequency: machine vibration reaches both sensors,
    the noise of one sensor does not.
    """
    first, second = _pair(window)
    return float(np.mean(_coherence(_segments(first), _segments(second))))


def axis_coherence(window: Window) -> Floats:
    """Mean magnitude squared coherence between the axes of one accelerometer.

    One value for the sensor: structure-borne vibration is shared by the axes, electrical
    noise is not.
    """
    if len(window.axes) < 2:
        raise NotComputableError("coherence needs two axes, the window has one")
    segments = _segments(window)
    pairs = [(a, b) for a in range(len(segments)) for b in range(a)]
    return np.array([np.mean([np.mean(_coherence(segments[a], segments[b])) for a, b in pairs])])


@shared
def welch(window: Window) -> tuple[Floats, Floats]:
    """Frequencies (bins,) in Hz and one-sided density (axes, bins) in (m/s^2)^2/Hz.

    Hann segments of 1024 points, half overlapping, each without its mean (Welch 1967).
    """
    segments = _segments(window)
    density = (segments.real**2 + segments.imag**2).mean(axis=1)
    density *= 2.0 / (window.rate_hz * np.square(_hann(SEGMENT)).sum())
    density[:, [0, -1]] *= 0.5
    return np.fft.rfftfreq(SEGMENT, 1.0 / window.rate_hz), density


@shared
def _segments(window: Window) -> npt.NDArray[np.complexfloating]:
    """Spectra of the Welch segments, shape (axes, segments, bins)."""
    return _short_time_spectra(window, SEGMENT)


def _short_time_spectra(window: Window, points: int) -> npt.NDArray[np.complexfloating]:
    """Spectra of half overlapping Hann segments, shape (axes, segments, bins)."""
    from scipy import fft

    if window.count < 2 * points:
        raise NotComputableError(f"{window.count} points are too few for segments of {points}")
    frames = np.lib.stride_tricks.sliding_window_view(window.centred, points, axis=1)
    frames = frames[:, :: points // 2]
    frames = (frames - frames.mean(axis=2, keepdims=True)) * _hann(points)
    return np.asarray(fft.rfft(frames, axis=2))


def _hann(points: int) -> npt.NDArray[np.float32]:
    """Periodic Hann window."""
    return (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(points) / points)).astype(np.float32)


def _spectral_kurtosis(window: Window, points: int) -> tuple[Floats, Floats]:
    """Frequencies and spectral kurtosis (axes, bins) without the two bins at either end."""
    spectra = _short_time_spectra(window, points)[:, :, 2:-2]
    power = spectra.real**2 + spectra.imag**2
    second = power.mean(axis=1)
    _total(second)
    kurtosis = np.square(power).mean(axis=1) / np.square(second) - 2.0
    return np.fft.rfftfreq(points, 1.0 / window.rate_hz)[2:-2], kurtosis


@shared
def _kurtogram(window: Window) -> list[tuple[Floats, Floats]]:
    """Frequencies and spectral kurtosis at each resolution."""
    return [_spectral_kurtosis(window, points) for points in (32, 64, 128, 256, 512)]


def _coherence(
    first: npt.NDArray[np.complexfloating], second: npt.NDArray[np.complexfloating]
) -> Floats:
    """Magnitude squared coherence of spectra (..., segments, bins), averaged over segments."""
    cross = (first * second.conj()).mean(axis=-2)
    power = np.square(np.abs(first)).mean(axis=-2) * np.square(np.abs(second)).mean(axis=-2)
    _total(power)
    return np.asarray(np.square(np.abs(cross)) / np.maximum(power, np.finfo(np.float32).tiny))


def _pair(window: Window) -> tuple[Window, Window]:
    """Windows of the first two accelerometers, which must have the same axes."""
    names = window.accelerometers
    if len(names) < 2:
        raise NotComputableError("needs two accelerometers, the stream has one")
    first, second = window.of(names[0]), window.of(names[1])
    if len(first.axes) != len(second.axes):
        raise NotComputableError(f"{names[0]} and {names[1]} do not have the same axes")
    return first, second


def _total(values: Floats) -> Floats:
    """Sum over the last axis; refused if an axis has no power."""
    total = values.sum(axis=-1)
    if not np.all(total > 0.0):
        raise NotComputableError("an axis is constant: its spectrum is zero")
    return np.asarray(total)
