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
from flea_diag.web.guard import COOKIE, Guard, is_loopback, token_of

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
    (tmp_path / "token").write_text(f"{TOKEN}\n")
    assert token_of("0.0.0.0", str(tmp_path / "token")) == TOKEN


@pytest.mark.parametrize("address", ["127.0.0.1", "127.8.8.8", "::1", "localhost"])
def test_the_loopback_is_this_machine(address: str) -> None:
    assert is_loopback(address)


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.168.1.2", "stand", ""])
def test_nothing_else_is_this_machine(address: str) -> None:
    assert not is_loopback(address)
