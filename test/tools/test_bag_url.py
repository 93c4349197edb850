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

"""Bags at URLs: the same decisions as from disk, and one line for what cannot be fetched."""

from __future__ import annotations

import functools
import json
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from support.decisions import BAGS

pytest.importorskip("fsspec", reason="needs the extra url")
pytest.importorskip("aiohttp", reason="needs the extra url")

import fsspec

from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.errors import RecordingError
from flea_diag.tools import bag_url, web_access
from flea_diag.tools.bag_url import BagUrl, bag_place, local
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.main import main

FILES = sorted(path for path in (BAGS / "jam").iterdir() if path.is_file())


class Silent(SimpleHTTPRequestHandler):
    """Serves files, and writes no log."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def host() -> Iterator[str]:
    """Address at which the bags of the tests are served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Silent, directory=BAGS))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def in_memory() -> str:
    """The same bag in a store that lists no folders on disk."""
    for path in FILES:
        with fsspec.open(f"memory://bags/jam/{path.name}", "wb") as file:
            file.write(path.read_bytes())
    return "memory://bags/jam"


def decisions(bag: str, tmp_path: Path) -> dict[str, object]:
    """What ``flea replay`` says of a bag, but for its place."""
    out = tmp_path / "out.json"
    assert main(["replay", bag, "-q", "--json", str(out)]) == 0
    said = json.loads(out.read_text(encoding="utf-8"))
    assert said.pop("bag") == bag
    return dict(said)


def test_a_bag_is_diagnosed_alike_wherever_it_lies(host: str, tmp_path: Path) -> None:
    assert decisions(f"{host}/jam", tmp_path) == decisions(str(BAGS / "jam"), tmp_path)


def test_a_copy_has_the_bytes_of_the_bag_and_goes_with_its_reader(
    host: str, in_memory: str
) -> None:
    (mcap,) = [path for path in FILES if path.suffix == ".mcap"]
    with local(BagUrl(in_memory)) as place:
        assert {path.name: path.read_bytes() for path in place.iterdir()} == {
            path.name: path.read_bytes() for path in FILES
        }
    assert not place.exists()
    with local(BagUrl(f"{host}/jam/{mcap.name}")) as place:
        assert place.read_bytes() == mcap.read_bytes()


def test_a_calibration_reads_the_same_rows_from_a_url(host: str) -> None:
    known = compiled_relations(load_stand().actuator).residuals
    # Together the second would be refused: it is the same recording.
    ((there,), refused), ((here,), _) = (
        read_nominal([place], known) for place in (BagUrl(f"{host}/nominal"), BAGS / "nominal")
    )
    assert refused == []
    assert there.run.name == here.run.name == "nominal"
    assert there.run.rows.tobytes() == here.run.rows.tobytes()
    _, refused = read_nominal([BagUrl(f"{host}/jam")], known)
    assert refused[0].startswith(f"{host}/jam: truth is 'jam'")


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("{host}/none", "metadata.yaml: cannot be fetched (ClientResponseError: 404"),
        ("gopher://host/bag", "cannot be fetched (ValueError: Protocol not known: gopher)"),
        ("http://127.0.0.1:1/bag", "cannot be fetched (ClientConnectorError"),
        ("memory://nowhere/run.mcap", "cannot be fetched (FileNotFoundError"),
    ],
)
def test_what_cannot_be_fetched_is_one_line(
    host: str, capsys: pytest.CaptureFixture[str], url: str, words: str
) -> None:
    address = url.format(host=host)
    assert main(["replay", address, "-q"]) == 1
    (line,) = [row for row in capsys.readouterr().err.splitlines() if "cannot" in row]
    assert address in line
    assert words in line


def test_no_more_is_fetched_than_a_limit(in_memory: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_url, "MOST_BYTES", 1000)
    refused = pytest.raises(RecordingError, match="more than 1000 bytes: fetch it yourself")
    with refused, local(BagUrl(in_memory)):
        pass


def test_a_file_that_the_description_puts_elsewhere_is_taken_from_the_bag(
    tmp_path: Path,
) -> None:
    text = "rosbag2_bagfile_information: {version: 9, relative_file_paths: [../../etc/passwd]}\n"
    with fsspec.open("memory://bags/sly/metadata.yaml", "w") as file:
        file.write(text)
    refused = pytest.raises(RecordingError, match="memory://bags/sly/passwd: cannot be fetched")
    with refused, local(BagUrl("memory://bags/sly")):
        pass


class Sly(Silent):
    """Stalls, or sends on to another address."""

    def do_HEAD(self) -> None:
        """Answer by the last part of the path."""
        if self.path.startswith("/stalls"):
            self.server.stalled.wait(30.0)  # type: ignore[attr-defined]
            return
        target = "http://169.254.169.254/latest/" if "metadata" in self.path else self.path
        self.send_response(302)
        self.send_header("Location", target)
        self.end_headers()

    def do_GET(self) -> None:
        """The same."""
        self.do_HEAD()


@pytest.fixture
def sly() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Sly)
    server.stalled = threading.Event()  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"127.0.0.1:{server.server_port}"
    server.stalled.set()  # type: ignore[attr-defined]
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("stalls.mcap", "cannot be fetched (SocketTimeoutError"),
        ("bag", "redirected to '169.254.169.254', which is no public address"),
        ("loop.mcap", "cannot be fetched (TooManyRedirects"),
    ],
)
def test_no_server_holds_us_up_or_sends_us_elsewhere(
    sly: str, path: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(web_access, "SILENT_S", 0.5)
    with pytest.raises(RecordingError) as refused, local(BagUrl(f"http://me:secret@{sly}/{path}")):
        pass
    assert words in str(refused.value)
    assert f"http://***@{sly}/{path}" in str(refused.value)
    assert "secret" not in str(refused.value)


def test_credentials_are_not_printed() -> None:
    bag = BagUrl("https://me:secret@host/run?token=secret#part")
    assert f"{bag} {bag!r}" == " ".join(["https://***@host/run?***"] * 2)
    assert bag.name == "run"


@pytest.mark.parametrize("text", ["http://host/a/..", "http://host/.", "http://h/" + "a" * 2000])
def test_what_is_no_address_of_a_bag_is_one_line(text: str) -> None:
    with pytest.raises(RecordingError, match="is no address of a bag"):
        bag_place(text)


def test_a_long_name_is_fetched(in_memory: str) -> None:
    long = f"memory://bags/{'a' * 300}.mcap"
    with fsspec.open(long, "wb") as file:
        file.write(b"bag")
    with local(BagUrl(long)) as place:
        assert place.read_bytes() == b"bag"


def test_a_path_stays_a_path() -> None:
    assert bag_place("bags/jam") == Path("bags/jam")
    assert bag_place("https://host/bags/jam/") == BagUrl("https://host/bags/jam")
    assert BagUrl("s3://bucket/run 1").name == "run 1"
