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

"""The same table in the formats of others, each written by the library of its make."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flea_diag.tools import extra
from flea_diag.tools.tables.readers import read_table

TIME = 0.01 * np.arange(80)
TABLE = {"time": TIME, "current": np.sin(TIME), "position": np.cos(TIME)}


def npz_of_columns(folder: Path) -> Path:
    np.savez(folder / "run.npz", rate=np.array(100.0), meta=np.array({"a": 1}, dtype=object),
             **{key: values[:, None] for key, values in TABLE.items()})  # fmt: skip
    return folder / "run.npz"


def npz_of_a_matrix(folder: Path) -> Path:
    np.savez(folder / "run.npz", data=np.column_stack(list(TABLE.values())), names=list(TABLE))
    return folder / "run.npz"


def mat_5(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "run.mat", TABLE)
    return folder / "run.mat"


def mat_73(folder: Path) -> Path:
    return _hdf5(folder / "run.mat")


def hdf5(folder: Path) -> Path:
    return _hdf5(folder / "run.h5")


def _hdf5(path: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for key, values in TABLE.items():
            file[key] = values[None, :]
    return path


def parquet(folder: Path) -> Path:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet as pq

    table = {**TABLE, "current": [f"{x!r}" for x in TABLE["current"].tolist()], "state": ["a"] * 80}
    pq.write_table(pyarrow.table(table), folder / "run.parquet")
    return folder / "run.parquet"


def xlsx(folder: Path) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(list(TABLE))
    for row in zip(*TABLE.values(), strict=True):
        book.active.append([float(x) for x in row])
    book.save(folder / "run.xlsx")
    return folder / "run.xlsx"


MAKES: tuple[Callable[[Path], Path], ...] = (
    npz_of_columns, npz_of_a_matrix, mat_5, mat_73, hdf5, parquet, xlsx,
)  # fmt: skip


@pytest.mark.parametrize("make", MAKES)
def test_a_format_gives_the_numbers_that_were_written(
    tmp_path: Path, make: Callable[[Path], Path]
) -> None:
    found = read_table(make(tmp_path))
    assert set(found.columns) == set(TABLE)
    for key, values in TABLE.items():
        np.testing.assert_allclose(found.columns[key], values, atol=1e-12)


def test_a_matrix_has_a_column_for_each_joint(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=TIME, q=np.column_stack([0.0 * TIME, TABLE["position"]]))
    found = read_table(tmp_path / "run.npz", ["t", "q_1"])
    np.testing.assert_array_equal(found.columns["q_1"], TABLE["position"])


@pytest.mark.parametrize("suffix", ["xlsx", "h5", "ulg", "parquet"])
def test_a_missing_package_is_named_with_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    names = {"xlsx": "excel", "h5": "hdf5", "ulg": "ulog", "parquet": "parquet"}
    monkeypatch.setitem(extra.PACKAGES, names[suffix], {"no_such_package": "no_such_package"})
    (tmp_path / f"run.{suffix}").write_bytes(b"x")
    with pytest.raises(Exception, match=r"needs no_such_package, not installed: .*pip install"):
        read_table(tmp_path / f"run.{suffix}")
