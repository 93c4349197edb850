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

"""A node as an executable: help, signals, executor and exit status, common to all nodes.

Exit status 0 after a normal end or SIGINT or SIGTERM (also repeated), 2 with a one-line message
for invalid input.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from flea_diag.errors import ConfigurationError, FleaError, line_of, visible
from flea_diag.wire.bus.declared import ONCE_CONFIGURED, Common, Declared
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.bus.life_cycle import ACTIVATE
from flea_diag.wire.bus.managed import Managed
from flea_diag.wire.bus.screen import Foreground
from flea_diag.wire.ending import Ending, end_at_once, leave
from flea_diag.wire.parameters import Descriptor, descriptors
from flea_diag.wire.topics import TOPIC_OF

ENDLESS_S = 1e6
"""Timeout of a wait; without one the EventsExecutor of rclpy 7.1 livelocks (overflow)."""

REFUSED = 2
CHECK = "--check"
"""Argument that has a node check its parameters and files, and end."""

NO_RCLPY = (
    "ROS 2 is not installed: `pip install flea_diag` brings it on Linux x86-64, elsewhere install "
    "ROS 2 Jazzy and source its setup.bash (rclpy: {error})"
)

START_PATIENCE_S = 0.3
"""Time from a signal to the end of a node that has nothing to close."""
CLOSE_PATIENCE_S = 10.0
"""The same for a node that has a bag or a screen to close, possibly on a slow disk."""

Closing = Callable[[], None]


TRANSPORT = ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
"""Transport of Fast DDS unless the environment sets one: no shared memory. A killed reader may
never release the buffers that it received there (eProsima/Fast-DDS#5469, in 2.14). Once the
512 kB segment of a process is fragmented in this way, its verdicts of 60 kB are not delivered."""


@dataclass(frozen=True)
class Program:
    """Description of an executable, and how it starts.

    ``prepare`` compiles and loads what takes long; it may run in a thread of its own and touches
    nothing of ROS but the log. ``start`` subscribes, advertises and returns at once: a function to
    be called at the end, or a ``Foreground`` for the main thread, or None. Both are "configure" of
    the life cycle; records and timers are served from "activate" on. ``check`` raises for
    parameters with which the node could not start; it touches nothing of ROS.
    """

    name: str
    summary: str
    parameters: type
    start: Callable[[Bus[Any], Any], Closing | Foreground | None]
    subscribes: tuple[type, ...] = ()
    publishes: tuple[type, ...] = ()
    examples: tuple[str, ...] = ()
    prepare: Callable[[Bus[Any], Any], None] | None = None
    check: Callable[[Any], None] | None = None


def run(make: Callable[[], Program], argv: Sequence[str] | None = None) -> int:
    """Run the program returned by ``make`` until it ends; return the exit status.

    ``make`` is called after the signal handlers are installed: slow imports of a node belong into
    it.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    # BLAS threads only slow down matrices of this size; numpy reads the setting at its import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault(*TRANSPORT)
    end_at_once()
    try:
        program = make()
        if _wants_help(arguments):
            _print(usage(program))
            return 0
        if CHECK in arguments:
            arguments.remove(CHECK)
            _refuse_unknown(program, arguments)
            _check(program, arguments)
            return 0
        _refuse_unknown(program, arguments)
        return _run(program, arguments)
    except FleaError as error:
        print(f"flea_diag: {line_of(error)}", file=sys.stderr)
        return REFUSED


def _print(text: str) -> None:
    """To standard output, whose reader may have gone (``--help | head``)."""
    try:
        print(visible(text), flush=True)
    except BrokenPipeError:
        # Python flushes once more at its exit, so that has to go where it cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def usage(program: Program) -> str:
    """The text of ``--help``; needs no ROS."""
    lines = [f"ros2 run flea_diag {program.name} [--check] [--ros-args …]", "", program.summary]
    for title, record_types in (
        ("subscribes", program.subscribes),
        ("publishes", program.publishes),
    ):
        if record_types:
            lines += ["", f"{title}:"]
            lines += [
                f"  {TOPIC_OF[kind].name:20} {TOPIC_OF[kind].message} ({kind.__name__})"
                for kind in record_types
            ]
    lines += ["", "parameters (--ros-args -p NAME:=VALUE):"]
    lines += [
        _explained(entry) for entry in (*descriptors(program.parameters), *descriptors(Common))
    ]
    lines += ["", "--check: check parameters and files, and end with status 0 or 2"]
    lines += ["", "ROS arguments: -r __ns:=/stand_2 (a second stand), -r TOPIC:=OTHER,"]
    lines += [
        "  --params-file FILE, --log-level debug, -p use_sim_time:=true, all after --ros-args"
    ]
    if program.examples:
        lines += ["", "examples:", *(f"  {example}" for example in program.examples)]
    return "\n".join(lines)


def _explained(entry: Descriptor) -> str:
    notes = [f"default {entry.default!r}"]
    notes += [f"at least {entry.minimum!r}"] if entry.minimum is not None else []
    notes += [f"at most {entry.maximum!r}"] if entry.maximum is not None else []
    notes += ["one of " + ", ".join(entry.choices)] if entry.choices else []
    notes += [ONCE_CONFIGURED] if entry.read_only else []
    unit = f" [{entry.unit}]" if entry.unit else ""
    kind = "list" if entry.kind is tuple else entry.kind.__name__
    return f"  {entry.name:20} {entry.doc}{unit}\n  {'':20} ({kind}, {', '.join(notes)})"


def _wants_help(arguments: list[str]) -> bool:
    return bool({"-h", "--help"} & set(arguments))


def _refuse_unknown(program: Program, arguments: list[str]) -> None:
    first = arguments[0] if arguments else "--ros-args"
    if first != "--ros-args":
        raise ConfigurationError(
            f"unknown argument {first!r}: nodes accept only --check and --ros-args, "
            f"see ros2 run flea_diag {program.name} --help"
        )


def _run(program: Program, arguments: list[str]) -> int:
    rclpy = _rclpy()
    from rclpy.task import Future

    ending = Ending(START_PATIENCE_S)
    _init(rclpy, arguments)
    managed: Managed | None = None
    node = None
    try:
        node = _node(program.name)
        declared: Declared[Any] = Declared(node, program.parameters)
        executor = make_executor(declared.common.executor)
        executor.add_node(node)
        finished: Any = Future()
        bus = Bus(node, executor, declared, finished)
        ending.on_signal = bus.end
        managed = made = Managed(
            program, bus, node, lambda: declared.value, declared.common.bond_heartbeat_period
        )
        declared.is_fixed = lambda: made.configured
        managed.on_open = lambda: setattr(ending, "patience_s", CLOSE_PATIENCE_S)
        bus.on(ACTIVATE, _spare_what_stays)
        if declared.common.autostart:
            managed.autostart()
        if managed.screen is not None:
            _serve_behind(managed.screen, executor, finished)
        else:
            spin(executor, finished)
        if isinstance(finished.result(), FleaError):
            raise finished.result()
    finally:
        ending.begin()
        if managed is not None:
            managed.close()
            if managed.preparing:
                leave()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
        ending.met()
    return 0


def _spare_what_stays() -> None:
    """Take what the start has made out of every later search for garbage: it stays to the end.

    A search through all of it takes 0.1 s with sixteen stands, and no message is taken meanwhile.
    """
    gc.collect()
    gc.freeze()


def _rclpy() -> Any:
    try:
        import rclpy
    except ImportError as error:
        raise ConfigurationError(NO_RCLPY.format(error=error)) from None
    return rclpy


def _check(program: Program, arguments: list[str]) -> None:
    """Refuse parameters with which the node could not start; no other node notices."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
    rclpy = _rclpy()
    _init(rclpy, arguments)
    try:
        node = _node(program.name)
        declared: Declared[Any] = Declared(node, program.parameters)
        if program.check is not None:
            program.check(declared.value)
    finally:
        rclpy.try_shutdown()


def _serve_behind(screen: Foreground, executor: Any, finished: Any) -> None:
    """Spin the node in a thread while the screen runs in this one; either ends the other."""
    failures: list[BaseException] = []

    def serve() -> None:
        try:
            spin(executor, finished)
        except Exception as error:  # raised again below, in the main thread
            failures.append(error)
        finally:
            screen.leave()

    thread = threading.Thread(target=serve, name="node")
    thread.start()
    try:
        screen.run()
    finally:
        if not finished.done():
            finished.set_result(None)
        thread.join()
    if failures:
        raise failures[0]


def _init(rclpy: Any, arguments: list[str]) -> None:
    from rclpy.signals import SignalHandlerOptions

    try:
        rclpy.init(args=["flea_diag", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        # rcl names the argument in an error of several lines.
        first = str(error).strip().splitlines()[0]
        raise ConfigurationError(f"ROS refuses the arguments {arguments}: {first}") from None


def _node(name: str) -> Any:
    from rclpy.lifecycle import LifecycleNode

    try:
        return LifecycleNode(name, automatically_declare_parameters_from_overrides=True)
    except ValueError as error:
        raise ConfigurationError(f"node {name}: a parameter has no value: {error}") from None


def make_executor(kind: str = "events") -> Any:
    """Executor of this name; the single-threaded one where rclpy has no other."""
    from rclpy.executors import SingleThreadedExecutor

    if kind == "events":
        try:
            from rclpy.experimental import EventsExecutor
        except ImportError:
            return SingleThreadedExecutor()
        return EventsExecutor()
    return SingleThreadedExecutor()


def spin(executor: Any, finished: Any) -> None:
    """Spin until the future is done."""
    while not finished.done():
        executor.spin_until_future_complete(finished, timeout_sec=ENDLESS_S)
