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

"""Who may open the page: checked on a real server application, over HTTP and WebSocket."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the page needs NiceGUI: pip install nicegui")

from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from flea_diag.errors import ConfigurationError
from flea_diag.web.guard import COOKIE, MOST_GUESSES, MOST_LOADS, Guard, is_loopback, token_of
from flea_diag.web.throttle import MOST_ASKERS, Throttle

TOKEN = "0123456789abcdef"


async def page(_: object) -> PlainTextResponse:
    return PlainTextResponse("the page")


async def socket(connection: WebSocket) -> None:
    await connection.accept()
    await connection.send_text("live")
    await connection.close()


@pytest.fixture
def client() -> Callable[..., TestClient]:
    site = Starlette(routes=[Route("/", page), WebSocketRoute("/live", socket)])

    def make(host: str = "127.0.0.1:8630", **given: object) -> TestClient:
        guarded = Guard(site, **given)  # type: ignore[arg-type]
        return TestClient(guarded, base_url=f"http://{host}", follow_redirects=False)

    return make


def listens(client: TestClient, **headers: str) -> bool:
    """Whether the WebSocket lets in, with the right Host unless another is given."""
    given = {"host": "127.0.0.1:8630", **headers}
    try:
        with client.websocket_connect("/live", headers=given) as connection:
            return connection.receive_text() == "live"
    except WebSocketDisconnect:
        return False


def test_this_machine_needs_no_token(client: Callable[..., TestClient]) -> None:
    answer = client().get("/")
    assert (answer.status_code, answer.text) == (200, "the page")
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert listens(client())


def test_a_name_that_leads_here_from_elsewhere_is_refused(
    client: Callable[..., TestClient],
) -> None:
    assert client(host="attacker.example").get("/").status_code == 403
    assert not listens(client(), host="attacker.example")


@pytest.mark.parametrize("origin", ["https://attacker.example", "http://127.0.0.1:9999", "null"])
def test_a_foreign_page_cannot_use_the_operators_browser(
    client: Callable[..., TestClient], origin: str
) -> None:
    assert client().get("/", headers={"origin": origin}).status_code == 403
    assert not listens(client(), origin=origin)
    assert listens(client(), origin="http://127.0.0.1:8630")


def test_the_network_needs_the_token_everywhere(client: Callable[..., TestClient]) -> None:
    opened = client(host="stand.example:8630", token=TOKEN, local_only=False)
    here = {"host": "stand.example:8630"}
    for path in ("/", "/?token=", "/?token=wrong", f"/?token={TOKEN}x", "/live"):
        assert opened.get(path).status_code == 401, path
        assert "the page" not in opened.get(path).text
    assert not listens(opened, **here)
    assert not listens(opened, **here, cookie=f"{COOKIE}=wrong")
    assert listens(opened, **here, cookie=f"{COOKIE}={TOKEN}")


def test_the_token_moves_from_the_address_into_a_cookie_that_scripts_cannot_read(
    client: Callable[..., TestClient],
) -> None:
    opened = client(host="stand.example", token=TOKEN, local_only=False)
    answer = opened.get(f"/?token={TOKEN}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    for part in ("HttpOnly", "SameSite=Strict"):
        assert part in answer.headers["set-cookie"]
    assert opened.get("/").text == "the page"


@pytest.mark.parametrize("header", ["host", "origin"])
@pytest.mark.parametrize("value", ["[", "http://[", "http://[::1", "[::1"])
def test_a_malformed_address_is_the_askers_fault(
    client: Callable[..., TestClient], header: str, value: str
) -> None:
    given = {"host": "127.0.0.1:8630", header: value}
    answer = client().get("/", headers=given)
    assert answer.status_code in (400, 403)
    assert "Traceback" not in answer.text
    assert not listens(client(), **{header: value})


@pytest.mark.parametrize("path", ["//evil.example/x", "///evil.example", "/\\evil.example", "//"])
def test_the_welcome_stays_on_this_host(client: Callable[..., TestClient], path: str) -> None:
    opened = client(host="stand.example", token=TOKEN, local_only=False)
    answer = opened.request("GET", f"http://stand.example{path}?token={TOKEN}")
    assert answer.status_code == 303
    target = answer.headers["location"]
    assert target.startswith("/")
    assert not target.startswith(("//", "/\\"))


def test_tokens_cannot_be_tried_without_end(client: Callable[..., TestClient]) -> None:
    opened = client(host="stand.example", token=TOKEN, local_only=False)
    seen = [opened.get(f"/x?token=guess{k}").status_code for k in range(MOST_GUESSES + 5)]
    assert seen == [401] * MOST_GUESSES + [429] * 5
    assert opened.get(f"/x?token={TOKEN}").status_code == 303, "others' guesses lock nobody out"
    assert opened.get("/x", headers={"cookie": f"{COOKIE}={TOKEN}"}).status_code == 404


def test_cookies_cannot_be_tried_without_end(client: Callable[..., TestClient]) -> None:
    """Over HTTP and WebSocket together; the right one is let in meanwhile."""
    opened = client(host="stand.example", token=TOKEN, local_only=False)
    tried = [{"cookie": f"{COOKIE}=guess{k}"} for k in range(MOST_GUESSES + 5)]
    for each in tried[:5]:
        assert not listens(opened, host="stand.example", **each)
    seen = [opened.get("/x", headers=each).status_code for each in tried[5:]]
    assert seen == [401] * (MOST_GUESSES - 5) + [429] * 5
    assert opened.get("/x", headers={"cookie": f"{COOKIE}={TOKEN}"}).status_code == 404
    assert listens(opened, host="stand.example", cookie=f"{COOKIE}={TOKEN}")


def test_whoever_has_no_token_locks_nobody_out_of_the_page(
    client: Callable[..., TestClient],
) -> None:
    opened = client(host="stand.example", token=TOKEN, local_only=False)
    assert {opened.get("/").status_code for _ in range(2 * MOST_LOADS)} == {401}
    assert opened.get("/", headers={"cookie": f"{COOKIE}={TOKEN}"}).status_code == 200


def test_the_page_cannot_be_loaded_without_end(client: Callable[..., TestClient]) -> None:
    opened = client()
    seen = [opened.get("/").status_code for _ in range(MOST_LOADS + 5)]
    assert seen == [200] * MOST_LOADS + [429] * 5
    assert opened.get("/stand/bay_1").status_code == 429, "the page of a stand is as large"
    assert opened.get("/other").status_code == 404
    assert listens(opened)


@pytest.mark.parametrize("wanted", ["image", "iframe", "script", "empty"])
def test_a_foreign_page_cannot_load_it_as_a_picture(
    client: Callable[..., TestClient], wanted: str
) -> None:
    assert client().get("/", headers={"sec-fetch-dest": wanted}).status_code == 403
    assert client().get("/", headers={"sec-fetch-dest": "document"}).status_code == 200


def test_a_throttle_forgets_and_stays_small() -> None:
    now = [0.0]
    throttle = Throttle(2, 10.0, lambda: now[0])
    assert [throttle.passes("a") for _ in range(3)] == [True, True, False]
    assert throttle.passes("b")
    now[0] = 10.5
    assert throttle.passes("a")
    for k in range(3 * MOST_ASKERS):
        throttle.passes(f"address {k}")
    assert len(throttle._times) <= MOST_ASKERS + 1
    assert not throttle.passes("one more"), "whoever asks from many addresses shares one count"


def test_an_open_address_without_a_token_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"'0\.0\.0\.0' opens the page.*token_file"):
        token_of("0.0.0.0", "")
    assert token_of("127.0.0.1", "") == ""
    with pytest.raises(ConfigurationError, match="cannot be read"):
        token_of("0.0.0.0", str(tmp_path / "absent"))
    short = tmp_path / "short"
    short.write_text("abc\n")
    with pytest.raises(ConfigurationError, match="holds 3 characters, a token has at least 16"):
        token_of("127.0.0.1", str(short))
    same = tmp_path / "same"
    same.write_text("a" * 40)
    with pytest.raises(ConfigurationError, match="holds 1 different characters"):
        token_of("127.0.0.1", str(same))
    (tmp_path / "token").write_text(f"{TOKEN}\n")
    assert token_of("0.0.0.0", str(tmp_path / "token")) == TOKEN


@pytest.mark.parametrize("address", ["127.0.0.1", "127.8.8.8", "::1", "localhost"])
def test_the_loopback_is_this_machine(address: str) -> None:
    assert is_loopback(address)


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.168.1.2", "stand", ""])
def test_nothing_else_is_this_machine(address: str) -> None:
    assert not is_loopback(address)
