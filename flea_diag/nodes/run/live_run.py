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

"""Live run of ``scripts/run``: simulated stand and diagnosis, each node in its own process.

All waits are for a state of a node or for a record, never for a fixed time: the stand starts once
all nodes are active, and the nodes are ended after the last verdict.
"""

from __future__ import annotations

import argparse
import itertools
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import IO, Any

from flea_diag.configuration.files import DEFAULT_STAND, config_path
from flea_diag.errors import ConfigurationError, FleaError, RecordingError, line_of, visible
from flea_diag.nodes.operator.web import PORT
from flea_diag.nodes.run.children import Children, refuse_unsound
from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.run_summary import NOMINAL_FAULT, as_text, summarise
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.bus import Bus, Consumers, guest
from flea_diag.wire.bus.distribution import profiles_variable
from flea_diag.wire.records import (
    AmbiguityGroup,
    Detection,
    Record,
    Scan,
    Truth,
)

SEPARATE = ("observer", "isolator", "extractor", "recorder")
COMPOSED = ("diagnoser", "recorder")
"""Nodes that subscribe to the stand; with ``--composed`` the diagnosis is one process."""
READY_S = 180.0
"""Long, since numba compiles at the first start after an installation."""
LATEST_S = 60.0
ANSWER_S = 0.2


class LiveRun:
    """One run from the first process to the last verdict."""

    def __init__(
        self,
        options: argparse.Namespace,
        bus: Bus[Any],
        children: Children,
        interrupted: threading.Event,
    ) -> None:
        self._options, self._bus, self._children = options, bus, children
        self._listeners = COMPOSED if options.composed else SEPARATE
        self._interrupted = interrupted
        self._told_address = False
        self.bags = [options.bag]

    def execute(self) -> None:
        """Start the subscribers, then the stand; return when the stand has ended."""
        checked = {"recorder": self._parameters("recorder"), "daq": self._daq_parameters()}
        refuse_unsound(checked)
        say(f"starting {', '.join(self._listeners)} and console")
        for name in self._listeners:
            self._children.start(name, self._parameters(name))
        keys = not self._plain()
        given = self._parameters("console")
        self._children.start("console", given, show=True, keys=keys)
        if self._options.web:
            self._children.start("web", self._parameters("web"))
        self._until(Consumers(self._bus, self._screens(), READY_S).ready)
        say(f"all nodes are ready; the stand starts, {self._what()}")
        self._children.start("daq", self._daq_parameters())
        self._until(lambda: self._children.ended("daq"))

    def _screens(self) -> tuple[str, ...]:
        """Nodes to wait for: those that listen to the stand, and the screens."""
        return (*self._listeners, "console", *(("web",) if self._options.web else ()))

    def _until(self, predicate: Callable[[], bool]) -> None:
        def settled() -> bool:
            self._children.supervise(("daq", "console"), self._anew)
            self._tell_address()
            # Quitting the console ends the run.
            if not self._plain() and self._children.ended("console"):
                self._interrupted.set()
            return self._interrupted.is_set() or predicate()

        limit_s = READY_S + self._options.duration + LATEST_S
        if not self._bus.wait_until(settled, limit_s):
            raise ConfigurationError(f"the run did not end within {limit_s:.0f} s")

    def _tell_address(self) -> None:
        """Say where the page is, once it answers."""
        if self._options.web and not self._told_address and answers(PORT):
            self._told_address = True
            say(f"the page is at http://127.0.0.1:{PORT}/")

    def _what(self) -> str:
        fault = self._options.fault
        if fault == NOMINAL_FAULT:
            return f"healthy, for {self._options.duration:g} s"
        return f"{fault} at {self._options.at:g} s, for {self._options.duration:g} s"

    def _parameters(self, name: str) -> dict[str, str]:
        stand = {"stand": self._options.stand}
        if name == "recorder":
            return {"directory": str(self._options.bag), **stand}
        # A journal of its own: alarms of the run before are of another stand.
        journal = str(self._options.bag.with_name(f"{self._options.bag.name}.alarms.sqlite"))
        if name == "console":
            return {"style": "lines" if self._plain() else "auto", "journal": journal}
        if name == "web":
            return {"journal": journal, **stand}
        return stand

    def _plain(self) -> bool:
        """Whether the console prints lines: headless, or no terminal."""
        return self._options.headless or not (sys.stdin.isatty() and sys.stdout.isatty())

    def _anew(self, name: str) -> dict[str, str]:
        """Parameters of a restarted node: a restarted recorder writes to a new bag."""
        if name != "recorder":
            return {}
        first = self._options.bag
        named = (first.with_name(f"{first.name}_{number}") for number in itertools.count(2))
        self.bags.append(next(bag for bag in named if not bag.exists()))
        return {"directory": str(self.bags[-1]), "stand": self._options.stand}

    def _daq_parameters(self) -> dict[str, str]:
        fault, machine = self._options.fault, machine_of(self._options)
        return {
            "scenario": self._options.scenario,
            "duration_s": repr(self._options.duration),
            "wait_for": ",".join(self._listeners),
            **({"machine": machine} if machine else {}),
            **({"seed": str(self._options.seed)} if self._options.seed is not None else {}),
            **(
                {"fault": fault, "fault_onset_s": repr(self._options.at)}
                if fault != NOMINAL_FAULT
                else {}
            ),
        }


def answers(port: int) -> bool:
    """Whether a page is served at this port of this machine: its socket takes calls before that."""
    connection = HTTPConnection("127.0.0.1", port, timeout=ANSWER_S)
    try:
        connection.request("HEAD", "/favicon.ico")
        connection.getresponse()
    except (OSError, HTTPException):
        return False
    finally:
        connection.close()
    return True


def machine_of(options: argparse.Namespace) -> str:
    """The simulated machine: that of the stand's name where nothing else is asked for.

    A scenario that is given as a file names its own.
    """
    if options.machine or options.stand == DEFAULT_STAND or Path(options.scenario).suffix:
        return str(options.machine)
    return Path(options.stand).name


def say(text: str) -> None:
    """Report progress on standard error."""
    print(f"run: {line_of(text)}", file=sys.stderr, flush=True)


def parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(
        prog="scripts/run",
        description="Run the simulated stand with its diagnosis live and check the final verdict.",
        epilog="Exit status: 0 verdict correct, 1 verdict wrong or run interrupted, 2 run failed.",
    )
    parser.add_argument(
        "--fault", default="jam", help="fault to inject, or nominal for none (default: jam)"
    )
    parser.add_argument(
        "--at", type=_seconds, default=8.0, metavar="S", help="fault onset, s (default: 8)"
    )
    parser.add_argument(
        "--for",
        dest="duration",
        type=_seconds,
        default=30.0,
        metavar="S",
        help="duration of the run, s (default: 30)",
    )
    parser.add_argument(
        "--stand",
        default=DEFAULT_STAND,
        metavar="DIR",
        help="stand to diagnose: name of a shipped one, or a folder as a path (default: flea)",
    )
    parser.add_argument(
        "--machine",
        default="",
        metavar="NAME|YAML",
        help="machine to simulate (default: that of the stand's name)",
    )
    parser.add_argument(
        "--headless", action="store_true", help="print one line per change, no full-screen console"
    )
    parser.add_argument(
        "--composed", action="store_true", help="run the diagnosis in one process (diagnoser)"
    )
    parser.add_argument("--web", action="store_true", help="also serve the page for a browser")
    parser.add_argument(
        "--scenario", default="nominal", help="name or YAML file of a scenario (default: nominal)"
    )
    parser.add_argument("--seed", type=int, help="seed of the simulated unit and its noise")
    parser.add_argument("--bag", type=Path, help="bag to write (default: bags/runs/<UTC time>)")
    options = parser.parse_args(argv)
    if options.fault != NOMINAL_FAULT and not 0 <= options.at < options.duration:
        parser.error(
            f"--at {options.at:g}: the onset must lie before the end, --for {options.duration:g}"
        )
    if options.bag is None:
        options.bag = Path("bags/runs") / time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    return options


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid number of seconds: {text!r}") from None
    if not 0.0 <= value <= 86400.0:
        raise argparse.ArgumentTypeError(f"{text} s must lie between 0 and 86400 s")
    return value


@contextmanager
def _interruption() -> Iterator[threading.Event]:
    """Event that the signals set which end a run; also while its nodes end and it is summarised."""
    interrupted = threading.Event()
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: interrupted.set()) for number in numbers}
    try:
        yield interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _executed(
    options: argparse.Namespace, domain: int, log: IO[bytes], interrupted: threading.Event
) -> LiveRun:
    """Execute a run from its first process to its last."""
    children = Children(log, say)
    with guest("live_run", domain) as bus:
        run = LiveRun(options, bus, children, interrupted)
        try:
            run.execute()
        finally:
            children.end()
    return run


def _recorded(bags: Iterable[Path]) -> Iterator[Record]:
    for bag in bags:
        if bag.exists():
            for _, record in read_bag(bag, (Scan, Truth, Detection, AmbiguityGroup)):
                yield record


def live(options: argparse.Namespace) -> int:
    """Run, then evaluate the recorded bag; return the exit status."""
    with _interruption() as interrupted:
        run = _logged(options, interrupted)
        summary = summarise(_recorded(run.bags))
        print(visible(as_text(summary, ", ".join(map(str, run.bags)))))
        if interrupted.is_set():
            say("interrupted: the summary covers the recorded part")
        return 1 if summary.failures or interrupted.is_set() else 0


def _logged(options: argparse.Namespace, interrupted: threading.Event) -> LiveRun:
    """Execute a run in a domain of its own, with the output of its nodes in a log."""
    log_path = options.bag.with_name(options.bag.name + ".log")
    with _domain() as domain, _opened(log_path) as log:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        os.environ["PYTHONUNBUFFERED"] = "1"
        transport = discovery()
        os.environ.update(transport)
        words = " ".join(f"{name}={value}" for name, value in transport.items())
        say(f"ROS_DOMAIN_ID={domain} {words}, log: {log_path}")
        run = _executed(options, domain, log, interrupted)
    if not options.bag.exists():
        raise RecordingError(f"no bag was written: see {log_path}")
    return run


def discovery() -> dict[str, str]:
    """Environment that limits nodes to this machine: all sockets are bound to the loopback.

    Shared memory is disabled as well. The discovery range LOCALHOST would make the middleware add
    its own transports, among them shared memory, which a killed node can corrupt for the others.
    """
    return {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        profiles_variable(): str(config_path("security/loopback.xml")),
    }


def _opened(log: Path) -> IO[bytes]:
    """Open the log of a run; its folder is created if missing."""
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        return log.open("wb")
    except OSError as error:
        raise ConfigurationError(f"{log}: cannot be written: {error.strerror}") from error


@contextmanager
def _domain() -> Iterator[int]:
    """The domain of the environment, else a reserved one."""
    asked = os.environ.get("ROS_DOMAIN_ID", "")
    if asked.isdigit():
        yield int(asked)
    else:
        with reserved_domain() as number:
            yield number


def main(argv: Sequence[str] | None = None) -> int:
    """Run the stand; return the exit status."""
    options = parsed(argv)
    try:
        return live(options)
    except FleaError as error:
        say(str(error))
        return 2


if __name__ == "__main__":
    sys.exit(main())
