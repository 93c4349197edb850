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

"""What a browser sends over its WebSocket: short and of a known form, or the connection ends.

The packets are those of Engine.IO 4 and Socket.IO 5, with the events that NiceGUI's page sends.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from types import NoneType
from typing import Any

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]

LONGEST_MESSAGE = 1 << 16
"""Bytes. A comment has some thousand; of so few no JSON makes much."""
LONGEST_CONTROL = 10
POLICY_VIOLATION = 1008
DIGITS = "0123456789"
UNHEARD = "log"
"""Event that is dropped: what scripts in the browser print is nothing for the node's log."""

FORMS: Mapping[str, Mapping[str, tuple[type, ...]]] = {
    "handshake": {
        "client_id": (str,),
        "tab_id": (str,),
        "document_id": (str,),
        "next_message_id": (int, NoneType),
        "old_tab_id": (str, NoneType),
    },
    "event": {"client_id": (str,), "id": (int,), "listener_id": (str,), "args": (list,)},
    "javascript_response": {"client_id": (str,), "request_id": (str,)},
    "ack": {"client_id": (str,), "next_message_id": (int,)},
    UNHEARD: {},
}
"""Events with the types of what they must hold; None: may be missing."""


def bounded(receive: Receive) -> Receive:
    """Messages of a WebSocket up to the first that is none of a page of ours."""

    async def received() -> Message:
        while True:
            message = await receive()
            if message["type"] != "websocket.receive":
                return message
            name = event_of(message.get("text"))
            if name is None:
                return {"type": "websocket.disconnect", "code": POLICY_VIOLATION}
            if name != UNHEARD:
                return message

    return received


def event_of(text: str | None) -> str | None:
    """Name of the event in a packet, "" for a packet without one, None for no packet of ours."""
    if not text or len(text) > LONGEST_MESSAGE:
        return None
    if text[0] in "12356":
        return "" if len(text) <= LONGEST_CONTROL else None
    if text[:2] in ("40", "41"):
        return "" if len(text) == 2 or isinstance(_json(text[2:]), dict) else None
    if text[:2] != "42":
        return None
    call = _json(text[2:].lstrip(DIGITS))
    if not isinstance(call, list) or len(call) != 2 or not isinstance(call[0], str):
        return None
    return call[0] if _of_form(call[1], FORMS.get(call[0])) else None


def _of_form(data: Any, form: Mapping[str, tuple[type, ...]] | None) -> bool:
    if form is None or not isinstance(data, dict):
        return False
    return all(type(data.get(key)) in kinds for key, kinds in form.items()) and all(
        arg is None or (isinstance(arg, str) and _json(arg) is not _NOTHING)
        for arg in data.get("args", ())
    )


_NOTHING = object()


def _json(text: str) -> Any:
    """What a text says, ``_NOTHING`` where it is no JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return _NOTHING
