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

"""Whatever is read is a regular file of a stated size: all readers, everything that is none."""

from __future__ import annotations

import gzip
import os
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.files import load_yaml
from flea_diag.errors import ConfigurationError, FleaError, InputError, RecordingError
from flea_diag.tools.campaign.campaign import load_campaign
from flea_diag.tools.campaign.result_log import PLAN, RESULTS, ResultLog, read_results
from flea_diag.tools.campaign.run_trace import read_trace, trace_path
from flea_diag.tools.features.bearing import read_bearing
from flea_diag.tools.features.classifier import read_classifier
from flea_diag.tools.recordings.flea_data import read_flea_data
from flea_diag.tools.score.decision import read_decisions
from flea_diag.web.guard import token_of
from flea_diag.wire.bags.bag_description import described
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.regular_file import opened, read_bytes, read_text
from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.scenario.flight import read_flight
from flea_sim_driver.scenario.scenario_file import load_scenario

LIMITS = find_machine("flea").limits
READERS: dict[str, tuple[str, Callable[[Path], object], type[InputError]]] = {
    "yaml": ("any.yaml", load_yaml, ConfigurationError),
    "calibration": ("cal.yaml", load_calibration, ConfigurationError),
    "campaign": ("campaign.yaml", load_campaign, ConfigurationError),
    "scenario": ("s.yaml", load_scenario, ConfigurationError),
    "flight": ("flight.csv", lambda path: read_flight(path, LIMITS), ConfigurationError),
    "token": ("token", lambda path: token_of("127.0.0.1", str(path)), ConfigurationError),
    "classifier": ("net.json", read_classifier, ConfigurationError),
    "data": ("run.data", read_flea_data, RecordingError),
    "results": (RESULTS, read_results, RecordingError),
    "replay": ("replay.json", read_decisions, RecordingError),
    "mcap": ("bag.mcap", BagReader, RecordingError),
    "bearing": ("drive.mat", lambda path: read_bearing(path, 12e3, 1750), RecordingError),
}


TAKE_FOLDERS = {"campaign", "results", "replay"}


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


def a_large_one(path: Path) -> None:
    """A terabyte that takes no room on the disk."""
    with path.open("wb") as file:
        file.truncate(1 << 40)


KINDS: dict[str, Callable[[Path], object]] = {
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "fifo": os.mkfifo,
    "socket": a_socket,
    "large": a_large_one,
}


# Bags are read within a budget, not within a size.
CASES = [
    (reader, kind) for reader in READERS for kind in KINDS if (reader, kind) != ("mcap", "large")
]


@pytest.mark.parametrize(("reader", "kind"), CASES)
def test_a_reader_refuses_what_is_no_regular_file_of_its_size(
    reader: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, read, error = READERS[reader]
    monkeypatch.chdir(tmp_path)  # the address of a socket is short
    KINDS[kind](Path(name))
    with pytest.raises(error) as refused:
        read(tmp_path / name)
    assert name in str(refused.value)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("reader", sorted(set(READERS) - TAKE_FOLDERS))
def test_a_reader_refuses_a_folder_in_one_line(reader: str, tmp_path: Path) -> None:
    name, read, _ = READERS[reader]
    (tmp_path / name).mkdir()
    with pytest.raises(FleaError) as refused:
        read(tmp_path / name)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", KINDS)
def test_metadata_that_is_no_regular_file_is_said_and_done_without(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    KINDS[kind](Path("metadata.yaml"))
    losses: list[str] = []
    assert described(tmp_path, losses) is None
    assert len(losses) == 1
    assert "metadata.yaml is unreadable" in losses[0]


@pytest.mark.parametrize("kind", ["endless device", "fifo"])
def test_an_sqlite_bag_that_is_no_regular_file_is_refused(kind: str, tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
        "  relative_file_paths: [bag_0.db3]\n"
    )
    KINDS[kind](tmp_path / "bag_0.db3")
    with pytest.raises(RecordingError, match=r"bag_0\.db3: no regular file"):
        BagReader(tmp_path)


@pytest.mark.parametrize("name", [PLAN, RESULTS])
@pytest.mark.parametrize("kind", ["endless device", "fifo"])
def test_a_folder_of_results_with_a_false_file_is_refused(
    name: str, kind: str, tmp_path: Path
) -> None:
    KINDS[kind](tmp_path / name)
    with pytest.raises(ConfigurationError, match="no regular file"):
        ResultLog(tmp_path, "0" * 64)


@pytest.fixture
def little_memory() -> Iterator[None]:
    """No more than 500 MB above what the process has."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    most = pages * resource.getpagesize() + (500 << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def packed_zeros(path: Path) -> None:
    """A gigabyte in a megabyte."""
    with gzip.open(path, "wb", compresslevel=1) as file:
        for _ in range(64):
            file.write(bytes(16 << 20))


def test_a_packed_trace_is_unpacked_to_its_limit(tmp_path: Path, little_memory: None) -> None:
    packed_zeros(trace_path(tmp_path / "run.json"))
    assert read_trace(tmp_path / "run.json") is None


@pytest.mark.parametrize("kind", ["endless device", "fifo"])
def test_a_trace_that_is_no_regular_file_is_none(kind: str, tmp_path: Path) -> None:
    KINDS[kind](trace_path(tmp_path / "run.json"))
    assert read_trace(tmp_path / "run.json") is None


def matlab(path: Path, **values: Any) -> None:
    from scipy.io import savemat

    savemat(path, values, do_compression=True)


def test_a_packed_matlab_file_is_counted_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import numpy as np

    from flea_diag.tools.features import bearing

    monkeypatch.setattr(bearing, "MOST_SAMPLES", 1000)
    matlab(tmp_path / "a.mat", X_DE_time=np.zeros(1001), other=np.zeros(9))
    with pytest.raises(RecordingError, match="1001 samples, above the limit of 1000"):
        read_bearing(tmp_path / "a.mat", 12e3, 1750)
    matlab(tmp_path / "b.mat", X_DE_time=np.ones((1000, 1)), other=np.zeros(2000))
    assert read_bearing(tmp_path / "b.mat", 12e3, 1750).samples == pytest.approx([9.80665] * 1000)


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "growing"
    file.write_bytes(b"12345678")
    assert read_bytes(file, 8) == b"12345678"
    with opened(file, 8) as stream:
        file.write_bytes(b"1234567890")
        assert stream.read(9) == b"123456789"
    with pytest.raises(RecordingError, match="10 bytes, above the limit of 8 bytes"):
        read_bytes(file, 8)


def test_a_file_without_a_size_is_read_to_its_limit() -> None:
    """Files of /proc say that they hold nothing."""
    with pytest.raises(RecordingError, match="above the limit of 8 bytes"):
        read_bytes(Path("/proc/self/status"), 8)


def test_text_has_one_kind_of_line_end(tmp_path: Path) -> None:
    (tmp_path / "t").write_bytes("ä\r\nb\rc\n".encode())
    assert read_text(tmp_path / "t", 100) == "ä\nb\nc\n"


def test_what_is_no_text_is_refused_by_the_error_of_the_caller(tmp_path: Path) -> None:
    (tmp_path / "t").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigurationError, match="not a text file"):
        read_text(tmp_path / "t", 100, ConfigurationError)


def test_a_link_to_a_regular_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    (tmp_path / "link").symlink_to("file")
    assert read_bytes(tmp_path / "link", 1) == b"x"


def test_no_descriptor_stays_open(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(10):
        with pytest.raises(RecordingError):
            opened(tmp_path / "fifo")
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    ("status", "arguments"),
    [
        (2, ["diff", "/dev/zero", "/dev/zero"]),
        (1, ["replay", "/dev/zero"]),  # one of several bags may be refused
        (2, ["model", "show", "--actuator", "/dev/zero"]),
    ],
)
def test_a_command_says_it_in_one_line(status: int, arguments: list[str]) -> None:
    command = [sys.executable, "-m", "flea_diag.tools.main", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == status
    assert done.stderr.count("\n") == 1
    assert "/dev/zero: no regular file" in done.stderr
