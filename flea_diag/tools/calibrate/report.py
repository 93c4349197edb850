"""Report of ``flea calibrate``: parameters with errors, parameters not identified, limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration

STRONG = 0.7
"""Correlation above which two parameters are reported as hard to separate."""


def words(calibration: Calibration) -> str:
    """The whole report."""
    c = calibration
    lines = [f"{len(c.sources)} nominal recordings, {c.nominal_s:.0f} s", ""]
    lines += _parameters(c)
    lines += _correlations(c)
    lines += ["", f"limits for {c.false_alarms_per_hour} false alarms per hour, all tests together"]
    lines += _promise(c)
    lines += _limits(c)
    if c.bad_stretches:
        lines += ["", "stretches excluded as implausible"]
    for bad in c.bad_stretches:
        lines.append(f"{bad.run}: {bad.channel} from {bad.start_s:.2f} to {bad.end_s:.2f} s")
    return "\n".join(lines)


def _promise(c: Calibration) -> Iterator[str]:
    """The rate that the recordings support, and what would support the stated one."""
    yield c.promise.words()
    needed = c.promise.needed_hours
    if c.promise.supported_per_hour > c.promise.stated_per_hour:
        yield f"{needed:.3g} h without a false alarm would support the stated rate"


def _parameters(c: Calibration) -> Iterator[str]:
    yield "parameter                       value        standard error"
    for entry in fields(c.parameters):
        name = entry.name
        value = getattr(c.parameters, name)
        error = c.sigmas.get(name)
        said = c.not_identified.get(name, "" if error is None else f"{error:.2g}")
        yield f"{name:30s}  {value:<11.5g}  {said}"


def _correlations(c: Calibration) -> list[str]:
    """Pairs of parameters whose errors compensate each other."""
    pairs = []
    for block in c.covariance:
        for i, one in enumerate(block.parameters):
            for j, other in enumerate(block.parameters[:i]):
                scale = (block.matrix[i][i] * block.matrix[j][j]) ** 0.5
                share = block.matrix[i][j] / scale if scale > 0.0 else 0.0
                if abs(share) >= STRONG:
                    pairs.append(f"{other} and {one}: {share:+.2f}")
    return ["", "strongly correlated errors", *pairs] if pairs else []


def _limits(c: Calibration) -> Iterator[str]:
    yield "residual                         window     sigma     limit of |z|"
    for limit in c.limits:
        for window in limit.windows:
            yield f"{limit.name:31s}  {window.window:6d}  {window.sigma[0]:9.3g}  {window.k:6.1f}"
