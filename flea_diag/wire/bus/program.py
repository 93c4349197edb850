"""A node as an executable: help, signals, executor and exit status, common to all nodes.

Exit status 0 after a normal end or SIGINT or SIGTERM (also repeated), 2 with a one-line message
for invalid input.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from flea_diag.errors import ConfigurationError, FleaError, line_of, visible
from flea_diag.wire.bus.declared import Common, Declared
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.ending import Deadline, end_at_once, handed_over, ignore
from flea_diag.wire.parameters import Descriptor, descriptors
from flea_diag.wire.topics import TOPIC_OF

ENDLESS_S = 1e6
"""Timeout of a wait; without one the EventsExecutor of rclpy 7.1 livelocks (overflow)."""

NO_RCLPY = (
    "ROS 2 is not installed: `pip install flea_diag` brings it on Linux x86-64, elsewhere install "
    "ROS 2 Jazzy and source its setup.bash (rclpy: {error})"
)

START_PATIENCE_S = 0.3
"""Time from a signal to the end of a node that has nothing to close."""
CLOSE_PATIENCE_S = 10.0
"""The same for a node that has a bag or a screen to close, possibly on a slow disk."""

Closing = Callable[[], None]


@runtime_checkable
class Foreground(Protocol):
    """A user interface that needs the main thread while the node runs in another."""

    def run(self) -> None:
        """Run in the main thread until the operator quits or ``leave`` is called."""
        ...

    def leave(self) -> None:
        """Make ``run`` return because the node has ended; called from the other thread."""
        ...

    def close(self) -> None:
        """Release resources at the very end."""
        ...


TRANSPORT = ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
"""Transport of Fast DDS unless the environment sets one: no shared memory. A killed reader may
never release the buffers that it received there (eProsima/Fast-DDS#5469, in 2.14). Once the
512 kB segment of a process is fragmented in this way, its verdicts of 60 kB are not delivered."""


@dataclass(frozen=True)
class Program:
    """Description of an executable, and how it starts.

    ``start`` subscribes, advertises and returns at once: a function to be called at the end, or a
    ``Foreground`` for the main thread, or None. The node spins from then on.
    """

    name: str
    summary: str
    parameters: type
    start: Callable[[Bus[Any], Any], Closing | Foreground | None]
    subscribes: tuple[type, ...] = ()
    publishes: tuple[type, ...] = ()
    examples: tuple[str, ...] = ()


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
        _refuse_unknown(program, arguments)
        return _run(program, arguments)
    except FleaError as error:
        print(f"flea_diag: {line_of(error)}", file=sys.stderr)
        return 2


def _print(text: str) -> None:
    """To standard output, whose reader may have gone (``--help | head``)."""
    try:
        print(visible(text), flush=True)
    except BrokenPipeError:
        # Python flushes once more at its exit, so that has to go where it cannot fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def usage(program: Program) -> str:
    """The text of ``--help``; needs no ROS."""
    lines = [f"ros2 run flea_diag {program.name} [--ros-args …]", "", program.summary]
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
    notes += ["read-only"] if entry.read_only else []
    unit = f" [{entry.unit}]" if entry.unit else ""
    kind = "list" if entry.kind is tuple else entry.kind.__name__
    return f"  {entry.name:20} {entry.doc}{unit}\n  {'':20} ({kind}, {', '.join(notes)})"


def _wants_help(arguments: list[str]) -> bool:
    return bool({"-h", "--help"} & set(arguments))


def _refuse_unknown(program: Program, arguments: list[str]) -> None:
    first = arguments[0] if arguments else "--ros-args"
    if first != "--ros-args":
        raise ConfigurationError(
            f"unknown argument {first!r}: nodes accept only --ros-args, "
            f"see ros2 run flea_diag {program.name} --help"
        )


def _run(program: Program, arguments: list[str]) -> int:
    try:
        import rclpy
        from rclpy.executors import ExternalShutdownException
        from rclpy.task import Future
    except ImportError as error:
        raise ConfigurationError(NO_RCLPY.format(error=error)) from None
    with handed_over():
        _init(rclpy, arguments)
    deadline = Deadline(rclpy.ok, START_PATIENCE_S)
    close: Closing | None = None
    node = None
    try:
        node = _node(rclpy, program.name)
        declared: Declared[Any] = Declared(node, program.parameters)
        executor = make_executor(declared.common.executor)
        executor.add_node(node)
        finished: Any = Future()
        started = program.start(Bus(node, executor, declared, finished), declared.value)
        close = started.close if isinstance(started, Foreground) else started
        if close is not None:
            deadline.patience_s = CLOSE_PATIENCE_S
        if isinstance(started, Foreground):
            _serve_behind(started, executor, finished)
        else:
            spin(executor, finished)
        if finished.done() and isinstance(finished.result(), FleaError):
            raise finished.result()
    except ExternalShutdownException:
        pass
    except _shutdown_errors():
        if rclpy.ok():
            raise
    finally:
        if close is not None:
            close()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
        ignore()
        deadline.met()
    return 0


def _serve_behind(screen: Foreground, executor: Any, finished: Any) -> None:
    """Spin the node in a thread while the screen runs in this one; either ends the other."""
    import rclpy

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
        rclpy.try_shutdown()
        thread.join()
    if failures and not isinstance(failures[0], _ended_errors()):
        raise failures[0]


def _ended_errors() -> tuple[type[Exception], ...]:
    from rclpy.executors import ExternalShutdownException

    return (ExternalShutdownException, *_shutdown_errors())


def _init(rclpy: Any, arguments: list[str]) -> None:
    try:
        rclpy.init(args=["flea_diag", *arguments])
    except Exception as error:
        # rcl names the argument in an error of several lines.
        first = str(error).strip().splitlines()[0]
        raise ConfigurationError(f"ROS refuses the arguments {arguments}: {first}") from None


def _node(rclpy: Any, name: str) -> Any:
    try:
        return rclpy.create_node(name, automatically_declare_parameters_from_overrides=True)
    except ValueError as error:
        raise ConfigurationError(f"node {name}: a parameter has no value: {error}") from None


def _shutdown_errors() -> tuple[type[Exception], ...]:
    """Errors that rclpy raises when its context ends during a call."""
    from rclpy.exceptions import NotInitializedException
    from rclpy.impl.implementation_singleton import rclpy_implementation as c

    return (NotInitializedException, c.InvalidHandle, c.RCLError)


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
    """Spin until the future is done or the context ends, which may also raise."""
    import rclpy

    while rclpy.ok() and not finished.done():
        executor.spin_until_future_complete(finished, timeout_sec=ENDLESS_S)
