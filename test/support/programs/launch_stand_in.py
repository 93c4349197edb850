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

"""A stand-in for ``ros2 launch``, which is not on PyPI: runs a launch file with real processes.

It does what launch 3.4.3 and launch_ros 0.26.6 do with the few actions that our files use, and
raises AttributeError for any other:

- entities are visited in order; processes are started only after all have been visited;
- an exception while entities are visited is one line and status 1, and what had been visited before
  it is started all the same (launch waits only for what a visit that succeeded has returned, and
  would leave it running; here it ends with this process);
- an exception in an event handler is one line and status 1, after all processes have ended;
- without a process or a timer left it shuts down by itself, with the reason ``idle``;
- shutdown sends SIGINT, after 5 s SIGTERM, after 5 s more SIGKILL; the statuses of the processes do
  not become that of launch.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix

from flea_diag.nodes.run.children import end_with_parent

POLL_S = 0.02
ESCALATION = ((5.0, signal.SIGTERM), (10.0, signal.SIGKILL))


@dataclass
class LaunchDescription:
    entities: list[Any]


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str | None = None
    description: str = ""


@dataclass
class OpaqueFunction:
    function: Callable[[Context], list[Any] | None]


@dataclass
class PythonLaunchDescriptionSource:
    location: str


@dataclass
class IncludeLaunchDescription:
    source: PythonLaunchDescriptionSource
    launch_arguments: Iterable[tuple[str, str]] = ()


@dataclass
class Shutdown:
    """The event, with the reason of the end."""

    reason: str = "reason not given"


@dataclass
class ShutdownProcess:
    process_matcher: Callable[[Node], bool]


@dataclass
class EmitEvent:
    event: ShutdownProcess


@dataclass
class OnShutdown:
    on_shutdown: Callable[[Shutdown, Context], list[Any] | None]


@dataclass
class RegisterEventHandler:
    event_handler: OnShutdown


@dataclass
class TimerAction:
    period: float
    actions: list[Any]


@dataclass
class Node:
    package: str
    executable: str
    namespace: str
    parameters: list[dict[str, Any] | str]
    output: str
    on_exit: Callable[[Exited, Context], list[Any] | None]
    name: str | None = None
    ros_arguments: list[str] = field(default_factory=list)
    process: subprocess.Popen[bytes] | None = None
    ended: int = -1
    """Descriptor that becomes readable when the process ends."""
    told_at: float | None = None
    """Time of its SIGINT."""

    def start(self, folder: Path) -> None:
        """Start the executable as ``ros2 run`` finds it, with its parameters in a file."""
        place = Path(get_package_prefix(self.package), "lib", self.package, self.executable)
        arguments = ["-r", f"__ns:=/{self.namespace}"] if self.namespace else []
        arguments += ["-r", f"__node:={self.name}"] if self.name else []
        for number, parameters in enumerate(self.parameters):
            if isinstance(parameters, str):
                arguments += ["--params-file", parameters]
                continue
            path = folder / f"{self.name or self.executable}_{number}.yaml"
            path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), "utf-8")
            arguments += ["--params-file", str(path)]
        command = [str(place), "--ros-args", *arguments, *self.ros_arguments]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            # Whoever kills a test leaves no node behind, in a domain that then looks free.
            preexec_fn=end_with_parent,
        )
        self.ended = os.pidfd_open(self.process.pid)
        say("INFO", f"{self.executable}: process started with pid [{self.process.pid}]")


@dataclass
class Exited:
    process_name: str
    returncode: int


@dataclass
class Context:
    launch_configurations: dict[str, str] = field(default_factory=dict)
    is_shutdown: bool = False


class Logger:
    """What ``launch.logging.get_logger`` gives."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, level: str) -> Callable[[str], None]:
        if level not in ("info", "warning", "error"):
            raise AttributeError(level)
        return lambda text: say(level.upper(), text)


def get_logger(name: str) -> Logger:
    return Logger(name)


def say(level: str, text: str) -> None:
    sys.stderr.write(f"[{level}] [launch]: {text}\n")


class LaunchService:
    """Visits a description and runs what is in it; ``run`` returns the status."""

    def __init__(self, given: dict[str, str], folder: Path) -> None:
        self._folder = folder
        self._context = Context(dict(given))
        self._nodes: list[Node] = []
        self._running: list[Node] = []
        self._timers: list[tuple[float, list[Any]]] = []
        self._handlers: list[OnShutdown] = []
        self._status = 0

    def run(self, description: LaunchDescription) -> int:
        try:
            self._visit(description.entities)
        except Exception as error:
            self._caught(error)
            for orphan in self._nodes:
                orphan.start(self._folder)
            return self._status
        self._start()
        while self._running or self._timers:
            ended = [each.ended for each in self._running]
            select.select(ended, [], [], POLL_S)  # or later, when it is time for a stronger signal
            for each in list(self._running):
                self._look(each)
            self._fire()
        self._shut_down("idle")
        return self._status

    def interrupt(self) -> None:
        say("WARNING", "user interrupted with ctrl-c (SIGINT)")
        self._shut_down("ctrl-c (SIGINT)")

    def _start(self) -> None:
        fresh, self._nodes = self._nodes, []
        for each in fresh:
            each.start(self._folder)
            self._running.append(each)

    def _visit(self, entities: list[Any]) -> None:
        known = self._context.launch_configurations
        for entity in entities:
            if isinstance(entity, DeclareLaunchArgument):
                value = known.get(entity.name, entity.default_value)
                if value is None:
                    raise RuntimeError(f"missing required argument '{entity.name}'")
                known[entity.name] = value
            elif isinstance(entity, IncludeLaunchDescription):
                known.update(entity.launch_arguments)
                self._visit(description_of(Path(entity.source.location)).entities)
            elif isinstance(entity, OpaqueFunction):
                self._visit(entity.function(self._context) or [])
            elif isinstance(entity, RegisterEventHandler):
                self._handlers.append(entity.event_handler)
            elif isinstance(entity, TimerAction):
                self._timers.append((time.monotonic() + entity.period, entity.actions))
            elif isinstance(entity, EmitEvent):
                self._interrupt([n for n in self._running if entity.event.process_matcher(n)])
            else:
                assert isinstance(entity, Node), entity
                self._nodes.append(entity)

    def _guarded(self, call: Callable[[], list[Any] | None]) -> None:
        """Visit what an event handler returns."""
        try:
            self._visit(call() or [])
        except Exception as error:
            self._caught(error)
        self._start()

    def _fire(self) -> None:
        now = time.monotonic()
        due = [actions for at, actions in self._timers if at <= now]
        self._timers = [] if self._context.is_shutdown else [t for t in self._timers if t[0] > now]
        for actions in due if not self._context.is_shutdown else ():
            self._guarded(lambda made=actions: made)

    def _look(self, node: Node) -> None:
        assert node.process is not None
        status = node.process.poll()
        if status is None:
            self._escalate(node)
            return
        self._running.remove(node)
        os.close(node.ended)
        say("INFO" if not status else "ERROR", f"{node.executable}: ended with code {status}")
        self._guarded(lambda: node.on_exit(Exited(node.executable, status), self._context))

    def _caught(self, error: Exception) -> None:
        say("ERROR", f"Caught exception in launch (see debug for traceback): {error}")
        self._status = 1
        self._shut_down(str(error))

    def _shut_down(self, reason: str) -> None:
        if self._context.is_shutdown:
            return
        self._context.is_shutdown = True
        self._interrupt(self._running)
        for handler in self._handlers:
            self._guarded(lambda asked=handler: asked.on_shutdown(Shutdown(reason), self._context))

    @staticmethod
    def _interrupt(nodes: list[Node]) -> None:
        for each in nodes:
            assert each.process is not None
            if each.told_at is None:
                each.told_at = time.monotonic()
                each.process.send_signal(signal.SIGINT)

    @staticmethod
    def _escalate(node: Node) -> None:
        if node.told_at is None:
            return
        waited_s = time.monotonic() - node.told_at
        for after_s, number in ESCALATION:
            if after_s < waited_s < after_s + 2.0 * POLL_S:
                say("ERROR", f"process failed to terminate, escalating to {number.name}")
                assert node.process is not None
                node.process.send_signal(number)


MODULES: dict[str, tuple[Any, ...]] = {
    "launch": (LaunchDescription,),
    "launch.actions": (
        DeclareLaunchArgument,
        EmitEvent,
        IncludeLaunchDescription,
        OpaqueFunction,
        RegisterEventHandler,
        TimerAction,
    ),
    "launch.event_handlers": (OnShutdown,),
    "launch.events": (Shutdown,),
    "launch.events.process": (ShutdownProcess,),
    "launch.launch_description_sources": (PythonLaunchDescriptionSource,),
    "launch.logging": (get_logger,),
    "launch_ros": (),
    "launch_ros.actions": (Node,),
}


def stand_in_modules() -> dict[str, ModuleType]:
    """Modules of the names of launch that hold what is here and nothing else."""
    made = {name: ModuleType(name) for name in MODULES}
    for name, members in MODULES.items():
        for member in members:
            setattr(made[name], member.__name__, member)
    return made


def description_of(path: Path) -> LaunchDescription:
    """What a launch file describes; loaded as launch loads it."""
    spec = spec_from_file_location("python_launch_file", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    described: LaunchDescription = module.generate_launch_description()
    return described


def main() -> int:
    sys.modules.update(stand_in_modules())
    path, *arguments = sys.argv[1:]
    given = dict(argument.split(":=", 1) for argument in arguments)
    with tempfile.TemporaryDirectory() as folder:
        service = LaunchService(given, Path(folder))
        signal.signal(signal.SIGINT, lambda *_: service.interrupt())
        return service.run(description_of(Path(path)))


if __name__ == "__main__":
    os.environ.setdefault("PYTHONUNBUFFERED", "1")
    sys.exit(main())
