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

"""Runs of the LiU-ICE benchmark: the air path of a combustion engine, with its faults.

Source: Jung, Frisk, Krysander, "The LiU-ICE Benchmark: An Industrial Fault Diagnosis Case Study",
arXiv 2408.13269. Each run is a CSV named after what is wrong in it: ``wltp_NF.csv`` nothing,
``wltp_f_pim_080.csv`` a sensor that shows 0.80 of the pressure, ``wltp_f_iml_6mm.csv`` a leak.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flea_diag.api.table import Table
from flea_diag.errors import RecordingError
from flea_diag.tools.tables.readers import read_table, stem_of, suffix_of
from flea_diag.wire.regular_file import missing


class Signal(NamedTuple):
    """A column in lower case: its name in the benchmark's model, and its unit."""

    name: str
    unit: str


SIGNALS = {
    "intercooler_pressure": Signal("y_p_ic", "Pa"),
    "intercooler_temperature": Signal("y_T_ic", "K"),
    "intake_manifold_pressure": Signal("y_p_im", "Pa"),
    "air_mass_flow": Signal("y_W_af", "kg/s"),
    "engine_speed": Signal("y_omega_e", "rad/s"),
    "throttle_position": Signal("y_alpha_th", "%"),
    "wastegate_position": Signal("y_u_wg", "1"),
    "injected_fuel_mass": Signal("y_wfc", "kg/s"),
    "ambient_temperature": Signal("y_T_amb", "K"),
    "ambient_pressure": Signal("y_p_amb", "Pa"),
}
ONSET_S = 120.0
"""When the faults are injected, about."""
_NAMED = re.compile(
    r"\w+?_(?:(?P<none>NF)(?:_\d+)?|(?P<sensor>f_(?:pic|pim|waf))_(?P<factor>\d{3})"
    r"|(?P<leak>f_iml)_(?P<mm>\d+)mm)"
)


def open_liu_ice(path: str | Path) -> Table:
    """One run of the LiU-ICE benchmark, as the archive of its page holds it.

    Parameters
    ----------
    path
        CSV with a column ``time`` and the ten signals, named after its fault.

    Returns
    -------
    Table
        ``time_s`` in seconds and the signals by their names in the benchmark's model
        (``y_p_im``), shape (n,), in SI but for the throttle in per cent. ``attrs`` hold the truth:
        ``fault`` ("" for none), ``size`` with ``size_unit`` (the share by which a sensor reads too
        much, the diameter of a leak in m) and ``onset_s`` (seconds, about; infinity for none).

    Raises
    ------
    RecordingError
        The file does not exist, lacks a signal, or its name says no fault of the benchmark.
    """
    place = Path(path)
    if not place.exists():
        raise missing(place)
    truth = _truth(place)
    if not suffix_of(place):
        raise RecordingError(f"{place}: a run of LiU-ICE is a .csv file")
    read = {name.lower(): values for name, values in read_table(place).columns.items()}
    lacking = [name for name in ("time", *SIGNALS) if name not in read]
    if lacking:
        raise RecordingError(f"{place} has no column {lacking[0]}: it is no run of LiU-ICE")
    columns = {"time_s": read["time"], **{s.name: read[name] for name, s in SIGNALS.items()}}
    units = {"time_s": "s", **{signal.name: signal.unit for signal in SIGNALS.values()}}
    return Table(columns, units=units, attrs=truth)


def _truth(place: Path) -> dict[str, str | float]:
    named = _NAMED.fullmatch(stem_of(place))
    if named is None:
        raise RecordingError(
            f"{place}: its name says no fault; runs are named like wltp_NF.csv, "
            "wltp_f_pim_080.csv or wltp_f_iml_6mm.csv"
        )
    if named["none"]:
        return {"fault": "", "size": 0.0, "size_unit": "1", "onset_s": np.inf}
    if named["leak"]:
        size = float(named["mm"]) / 1e3
        return {"fault": named["leak"], "size": size, "size_unit": "m", "onset_s": ONSET_S}
    size = float(named["factor"]) / 100.0 - 1.0
    return {"fault": named["sensor"], "size": size, "size_unit": "1", "onset_s": ONSET_S}
