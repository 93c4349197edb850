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

"""``ros2 run flea_diag web``: the live operator page in a browser."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from flea_diag import __version__
from flea_diag.configuration.languages import catalogue
from flea_diag.errors import ConfigurationError
from flea_diag.nodes.operator.desk import SAID, Desk, connect, open_journal
from flea_diag.nodes.operator.hall import Hall
from flea_diag.operator.state import SHOWN
from flea_diag.operator.words import speak, tr
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.parameters import parameter

PORT = 8630
PAGE_NEEDS = "the page needs NiceGUI, which is not installed"
NO_NICEGUI = f"{PAGE_NEEDS}: {sys.executable} -m pip install 'nicegui>=3.0'"


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
    stands: tuple[str, ...] = parameter(
        (),
        "NAMESPACE[=STAND] of the stands to list, worst first, or * for all that are found; what "
        "is drawn of them is that of STAND or of stand; empty: the stand of the node's own "
        "namespace",
        read_only=True,
    )
    language: str = parameter(
        "en", "language of the page: en, de, or the path of a file of texts", read_only=True
    )


def start(bus: Bus[Any], parameters: WebParameters) -> Callable[[], None]:
    """Serve the page; return the function that ends it."""
    if find_spec("nicegui") is None:
        raise ConfigurationError(NO_NICEGUI)
    from flea_diag.web.guard import token_of
    from flea_diag.web.pages.site import Site
    from flea_diag.web.server import Server

    token = token_of(parameters.address, parameters.token_file)
    speak(*catalogue(parameters.language))
    site = Site(bus.warn)
    title = f"flea_diag · {tr('all stands') if parameters.stands else bus.stand}"
    serve = _serve_hall if parameters.stands else _serve_stand
    end = serve(site, bus, parameters, title)
    server = Server(title, parameters.address, parameters.port, token)
    server.start()
    asks = ", token required" if token else ""
    bus.info(f"the page is at http://{parameters.address}:{server.port}/{asks}")

    def close() -> None:
        server.close()
        end()

    return close


def _serve_stand(
    site: Any, bus: Bus[Any], parameters: WebParameters, title: str
) -> Callable[[], None]:
    tools = picture_tools(parameters.stand)
    desk = Desk(open_journal(parameters.journal, bus), _author(parameters))
    site.serve_stand(desk, tools, title, (("flea_diag", __version__),))
    connect(bus, desk)
    return desk.close


def _serve_hall(
    site: Any, bus: Bus[Any], parameters: WebParameters, title: str
) -> Callable[[], None]:
    given = [entry.partition("=") for entry in parameters.stands]
    drawn = {name.strip("/"): stand for name, _, stand in given if stand}
    tools = {stand: picture_tools(stand) for stand in {parameters.stand, *drawn.values()}}
    names = [name for name, _, _ in given]
    hall = Hall(bus, names, parameters.journal, _author(parameters))
    site.serve_hall(
        hall,
        lambda name: tools[drawn.get(name, parameters.stand)],
        title,
        (("flea_diag", __version__),),
    )
    return hall.end


def picture_tools(stand: str) -> Any:
    """What the pictures need of the description of a stand."""
    from flea_diag.configuration.screens import load_causal_map, tree_planner
    from flea_diag.configuration.stand import load_stand
    from flea_diag.web.view import Tools

    found = load_stand(stand)
    return Tools(load_causal_map(found.actuator), tree_planner(found.features))


def _author(parameters: WebParameters) -> str:
    return parameters.author or getpass.getuser()


def program() -> Program:
    """Description of this node."""
    return Program(
        "web",
        "Serves the verdict, its evidence and the stand's signals as a page in a browser.",
        WebParameters,
        start,
        subscribes=(*SHOWN, *SAID),
        publishes=SAID,
        check=lambda parameters: catalogue(parameters.language),
        examples=(
            "ros2 run flea_diag web                 then open http://127.0.0.1:8630/",
            "ros2 run flea_diag web --ros-args -p address:=0.0.0.0 -p token_file:=page.token",
            "ros2 run flea_diag web --ros-args -r __ns:=/stand_2 -p port:=8631",
            "ros2 run flea_diag web --ros-args -p stands:=\"['bay_1', 'bay_2=./mine']\"",
            "ros2 run flea_diag web --ros-args -p stands:=\"['*']\"",
            "ros2 run flea_diag web --ros-args -p language:=de",
        ),
    )
