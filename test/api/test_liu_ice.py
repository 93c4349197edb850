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

"""A file in the format of the LiU-ICE benchmark, whose data no package of a registry holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flea_diag as fd

HEAD = (
    "time,Intercooler_pressure,intercooler_temperature,intake_manifold_pressure,air_mass_flow,"
    "engine_speed,throttle_position,wastegate_position,injected_fuel_mass,ambient_temperature,"
    "ambient_pressure"
)
ROWS = ("0.00,101e3,300,40e3,0.01,90,5,0.1,2e-4,295,100.7e3",
        "0.05,102e3,301,41e3,0.02,91,6,0.2,3e-4,295,100.7e3")  # fmt: skip


def written(folder: Path, name: str, head: str = HEAD) -> Path:
    path = folder / name
    path.write_text("\n".join((head, *ROWS)) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("wltp_NF.csv", ("", 0.0, "1", np.inf)),
        ("wltp_NF_2.csv", ("", 0.0, "1", np.inf)),
        ("wltp_f_pim_080.csv", ("f_pim", -0.2, "1", 120.0)),
        ("wltp_f_waf_110.csv", ("f_waf", 0.1, "1", 120.0)),
        ("wltp_f_iml_6mm.csv", ("f_iml", 0.006, "m", 120.0)),
    ],
)
def test_the_name_says_the_fault(name: str, truth: tuple[object, ...], tmp_path: Path) -> None:
    run = fd.open_liu_ice(written(tmp_path, name))
    assert list(run) == [
        "time_s", "y_p_ic", "y_T_ic", "y_p_im", "y_W_af", "y_omega_e", "y_alpha_th", "y_u_wg",
        "y_wfc", "y_T_amb", "y_p_amb",
    ]  # fmt: skip
    assert run["time_s"].tolist() == [0.0, 0.05]
    assert run["y_p_im"].tolist() == [40e3, 41e3]
    assert run.units["y_W_af"] == "kg/s"
    found = tuple(run.attrs[key] for key in ("fault", "size", "size_unit", "onset_s"))
    assert (found[0], found[2], found[3]) == (truth[0], truth[2], truth[3])
    assert found[1] == pytest.approx(truth[1])


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        ("engine.csv", HEAD, "its name says no fault; runs are named like wltp_NF.csv"),
        ("wltp_f_pim_080.csv", HEAD.replace("engine_speed", "rpm"), "has no column engine_speed"),
        ("wltp_f_pim_080", HEAD, "is a .csv file"),
    ],
)
def test_what_is_no_run_is_refused_in_a_line(
    name: str, head: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(fd.FleaError, match=words):
        fd.open_liu_ice(written(tmp_path, name, head))


def test_a_run_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(fd.FleaError, match="does not exist"):
        fd.open_liu_ice(tmp_path / "wltp_NF.csv")
