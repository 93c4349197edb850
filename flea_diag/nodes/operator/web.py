"""``ros2 run flea_diag web``: the live operator page in a browser."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.operator.desk import SAID, Desk, connect, open_journal
from flea_diag.operator.state import SHOWN
from flea_diag.wire.bus import Bus, Program, run
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import AmbiguityGroup, Detection, Hypotheses, Record

PORT = 8630
NO_NICEGUI = "the page needs NiceGUI, which is not installed: pip install 'flea_diag[web]'"


@dataclass(frozen=True)
class WebParameters:
    """Parameters of the web console."""

    address: str = parameter(
        "127.0.0.1",
        "address to serve on; any but a loopback address opens the page to the network and needs "
        "token_file",
        read_only=True,
    )
    port: int = parameter(
        PORT, "TCP port; 0: any free port", minimum=0, maximum=65535, read_only=True
    )
    token_file: str = parameter(
        "",
        "file with the access token for browsers (a file, since any node can read a parameter); "
        "empty: no token, loopback address only",
        read_only=True,
    )
    journal: str = parameter(
        "", "SQLite file for alarms, acknowledgements and comments; empty: the default file",
        read_only=True,
    )  # fmt: skip
    author: str = parameter(
        "", "name stored with acknowledgements and comments; empty: login name", read_only=True
    )
    stand: str = parameter(
        "flea",
        "stand whose causal graph and diagnosis tree are drawn: name of a shipped one, or a path",
        read_only=True,
    )


def start(bus: Bus[Any], parameters: WebParameters) -> Callable[[], None]:
    """Serve the page; return the function that ends it."""
    if find_spec("nicegui") is None:
        raise ConfigurationError(NO_NICEGUI)
    from flea_diag.configuration.screens import load_causal_map, tree_planner
    from flea_diag.configuration.stand import load_stand
    from flea_diag.web.guard import token_of
    from flea_diag.web.server import Server
    from flea_diag.web.site import Site
    from flea_diag.web.strips import StripCharts
    from flea_diag.web.view import Tools, View

    token = token_of(parameters.address, parameters.token_file)
    stand = load_stand(parameters.stand)
    tools = Tools(load_causal_map(stand.actuator), tree_planner(stand.features))
    author = parameters.author or getpass.getuser()
    desk = Desk(open_journal(parameters.journal, bus), author)
    strips = StripCharts()
    site = Site(desk, View(tools), strips, f"flea_diag · {bus.stand}", bus.warn)
    server = Server(site.title, parameters.address, parameters.port, token)

    def take(record: Record) -> None:
        strips.take(record)
        if isinstance(record, Detection | Hypotheses | AmbiguityGroup):
            site.wake()

    desk.on_record.append(take)
    connect(bus, desk)
    server.start()
    asks = ", token required" if token else ""
    bus.info(f"the page is at http://{parameters.address}:{server.port}/{asks}")

    def close() -> None:
        server.close()
        desk.close()

    return close


def program() -> Program:
    """Description of this node."""
    return Program(
        "web",
        "Serves the verdict, its evidence and the stand's signals as a page in a browser.",
        WebParameters,
        start,
        subscribes=(*SHOWN, *SAID),
        publishes=SAID,
        examples=(
            "ros2 run flea_diag web                 then open http://127.0.0.1:8630/",
            "ros2 run flea_diag web --ros-args -p address:=0.0.0.0 -p token_file:=page.token",
            "ros2 run flea_diag web --ros-args -r __ns:=/stand_2 -p port:=8631",
        ),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; return the exit status."""
    return run(program, argv)


if __name__ == "__main__":
    sys.exit(main())
