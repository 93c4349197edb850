"""A connection that asks for nothing is closed: a browser that is there asks at once."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 10.0
"""A request is whole within so long of its connection, or of the answer before it."""
MOST_CONNECTIONS = 100
"""More at one time are refused: a screen has three."""


class PatientProtocol(H11Protocol):
    """HTTP as uvicorn speaks it, for at most ``REQUEST_S`` without a request."""

    request_s = REQUEST_S

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait from now on."""
        super().connection_made(transport)
        self._look_again()

    def _look_again(self) -> None:
        self._last = self.cycle
        self._look = self.loop.call_later(self.request_s, self._close_if_idle)

    def _close_if_idle(self) -> None:
        transport: Any = self.transport
        if transport.is_closing() or transport.get_protocol() is not self:
            return  # gone, or a WebSocket by now
        answered = self.cycle is None or self.cycle.response_complete
        if answered and self.cycle is self._last:
            transport.abort()
        else:
            self._look_again()
