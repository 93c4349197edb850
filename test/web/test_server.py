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

"""The server as it runs: who is asked for what, and what a request for nothing leaves behind."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest

pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from nicegui import Client
from nicegui.testing.general import nicegui_reset_globals

from flea_diag.web.guard import COOKIE, MOST_GUESSES
from flea_diag.web.server import Server

TOKEN = "0123456789abcdef"


@pytest.fixture(scope="module")
def served() -> Iterator[int]:
    # Other pages may have been served in this process.
    with nicegui_reset_globals():
        server = Server("a stand", "127.0.0.1", 0, TOKEN)
        server.start()
        yield server.port
        server.close()


def status(port: int, path: str, **headers: str) -> int:
    """Status of one request."""
    asked = urllib.request.Request(f"http://127.0.0.1:{port}{path}", headers=headers)
    try:
        with urllib.request.urlopen(asked, timeout=60.0) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_a_request_for_nothing_builds_no_page(served: int) -> None:
    before = len(Client.instances)
    cookie = f"{COOKIE}={TOKEN}"
    assert {status(served, f"/nothing/{k}", Cookie=cookie) for k in range(40)} == {404}
    assert len(Client.instances) == before


def test_nobody_is_someone_else_by_a_header(served: int) -> None:
    """As a proxy on this machine would send it, or anybody."""
    seen = [
        status(served, f"/?token=guess{k}", **{"X-Forwarded-For": f"10.0.0.{k}"})
        for k in range(MOST_GUESSES + 3)
    ]
    assert seen == [401] * MOST_GUESSES + [429] * 3
