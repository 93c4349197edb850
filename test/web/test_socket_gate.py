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

"""Which packets of a WebSocket come through: those of the page, in the form that it gives them."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from flea_diag.web.socket_gate import LONGEST_MESSAGE, bounded, event_of

EVENT = {"client_id": "c", "id": 5, "listener_id": "l", "args": ['"ack live 5"', None]}
SHAKE = {"client_id": "c", "tab_id": "t", "document_id": "d", "next_message_id": 0}
SOUND = {
    "2": "", "3": "", "2probe": "", "5": "", "40": "", '40{"token":"x"}': "", "41": "",
    f'42{json.dumps(["event", EVENT])}': "event",
    f'420{json.dumps(["handshake", {**SHAKE, "old_tab_id": None}])}': "handshake",
    f'42{json.dumps(["ack", {"client_id": "c", "next_message_id": 7}])}': "ack",
    f'42{json.dumps(["javascript_response", {"client_id": "c", "request_id": "r"}])}':
        "javascript_response",
}  # fmt: skip


@pytest.mark.parametrize("packet", SOUND)
def test_what_a_page_sends_comes_through(packet: str) -> None:
    assert event_of(packet) == SOUND[packet]


def event(**changes: Any) -> str:
    return f"42{json.dumps(['event', {**EVENT, **changes}])}"


WRONG = {
    "nothing": "", "no packet": "hello", "of bytes": "451-[]", "no json": "42[", "no call": "42{}",
    "a call of nothing": '42["event"]', "a call of three": '42["event",{},{}]',
    "of another program": '42["join",{"client_id":"c"}]', "a name that is none": '42[5,{}]',
    "no mapping": '42["event",[]]', "without a client": '42["event",{}]',
    "an element by name": event(id="5"), "a truth value for a number": event(id=True),
    "arguments in a text": event(args="ack"), "arguments unwrapped": event(args=[5]),
    "an argument that is no json": event(args=["ack"]), "deep": "42" + "[" * 60_000,
    "a deep argument": event(args=["[" * 50_000]), "long": event(listener_id="x" * LONGEST_MESSAGE),
    "a long ping": "2" + "x" * 100, "a handshake of numbers": '42["handshake",{"client_id":5}]',
    "an ack of a text": '42["ack",{"client_id":"c","next_message_id":"x"}]',
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_anything_else_does_not(case: str) -> None:
    assert event_of(WRONG[case]) is None


def received(*texts: str | None) -> list[str]:
    """What an application receives of these messages, up to the end."""
    waiting = [{"type": "websocket.connect"}]
    waiting += [{"type": "websocket.receive", "text": text} for text in texts]  # type: ignore[misc]

    async def receive() -> Any:
        return waiting.pop(0)

    async def all_of_them() -> list[str]:
        gate, told = bounded(receive), []
        while waiting:
            message = await gate()
            told.append(message.get("text", message["type"]))
        return told

    return asyncio.run(all_of_them())


def test_the_first_wrong_message_ends_the_connection() -> None:
    assert received("2", "hello") == ["websocket.connect", "2", "websocket.disconnect"]
    assert received("2", None) == ["websocket.connect", "2", "websocket.disconnect"]


def test_what_scripts_print_in_the_browser_is_dropped() -> None:
    log = f"42{json.dumps(['log', {'client_id': 'c', 'level': 'info', 'message': 'x'}])}"
    assert received(log, "2") == ["websocket.connect", "2"]
