"""A stand-in for ``ros2 launch``, which is not on PyPI: runs a launch file with real processes.

It does what launch 3.4.3 and launch_ros 0.26.6 do with the few actions that our files use, and
raises AttributeError for any other:

- entities are visited in order; processes are started only after all have been visited;
- an exception while entities are visited is one line and status 1, and what had been visited before
  it is started all the same (launch waits only for what a visit that succeeded has returned, and
  would leave it running; here it ends with this process);
- an exception in ``on_exit`` is one line and status 1, after all processes have ended;
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
from collections.abc import Callable
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
class Shutdown:
    reason: str = "reason not given"


@dataclass
class Node:
    package: str
    executable: str
    namespace: str
    parameters: list[dict[str, Any]]
    output: str
    on_exit: Callable[[Exited, Context], list[Any] | None]
    name: str | None = None
    process: subprocess.Popen[bytes] | None = None
    ended: int = -1
    """Descriptor that becomes readable when the process ends."""

    def start(self, folder: Path) -> None:
        """Start the executable as ``ros2 run`` finds it, with its parameters in a file."""
        place = Path(get_package_prefix(self.package), "lib", self.package, self.executable)
        arguments = ["-r", f"__ns:=/{self.namespace}"] if self.namespace else []
        arguments += ["-r", f"__node:={self.name}"] if self.name else []
        for number, parameters in enumerate(self.parameters):
            path = folder / f"{self.name or self.executable}_{number}.yaml"
            path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), "utf-8")
            arguments += ["--params-file", str(path)]
        command = [str(place), "--ros-args", *arguments]
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


def say(level: str, text: str) -> None:
    sys.stderr.write(f"[{level}] [launch]: {text}\n")


class LaunchService:
    """Visits a description and runs what is in it; ``run`` returns the status."""

    def __init__(self, given: dict[str, str], folder: Path) -> None:
        self._given, self._folder = given, folder
        self._context = Context()
        self._nodes: list[Node] = []
        self._running: list[Node] = []
        self._shutdown_at = 0.0
        self._status = 0

    def run(self, description: LaunchDescription) -> int:
        try:
            self._visit(description.entities)
        except Exception as error:
            self._caught(error)
            for orphan in self._nodes:
                orphan.start(self._folder)
            return self._status
        for each in self._nodes:
            each.start(self._folder)
        self._running = list(self._nodes)
        while self._running:
            ended = [each.ended for each in self._running]
            select.select(ended, [], [], POLL_S)  # or later, when it is time for a stronger signal
            for each in list(self._running):
                self._look(each)
        return self._status

    def interrupt(self) -> None:
        say("WARNING", "user interrupted with ctrl-c (SIGINT)")
        self._shut_down()

    def _visit(self, entities: list[Any]) -> None:
        for entity in entities:
            if isinstance(entity, DeclareLaunchArgument):
                value = self._given.get(entity.name, entity.default_value)
                if value is None:
                    raise RuntimeError(f"missing required argument '{entity.name}'")
                self._context.launch_configurations[entity.name] = value
            elif isinstance(entity, OpaqueFunction):
                self._visit(entity.function(self._context) or [])
            elif isinstance(entity, Shutdown):
                self._shut_down()
            else:
                assert isinstance(entity, Node), entity
                self._nodes.append(entity)

    def _look(self, node: Node) -> None:
        assert node.process is not None
        status = node.process.poll()
        if status is None:
            self._escalate(node.process)
            return
        self._running.remove(node)
        os.close(node.ended)
        self._nodes.clear()
        say("INFO" if not status else "ERROR", f"{node.executable}: ended with code {status}")
        try:
            self._visit(node.on_exit(Exited(node.executable, status), self._context) or [])
        except Exception as error:
            self._caught(error)
        for fresh in self._nodes:
            fresh.start(self._folder)
            self._running.append(fresh)

    def _caught(self, error: Exception) -> None:
        say("ERROR", f"Caught exception in launch (see debug for traceback): {error}")
        self._status = 1
        self._shut_down()

    def _shut_down(self) -> None:
        if self._context.is_shutdown:
            return
        self._context.is_shutdown = True
        self._shutdown_at = time.monotonic()
        for each in self._running:
            assert each.process is not None
            each.process.send_signal(signal.SIGINT)

    def _escalate(self, process: subprocess.Popen[bytes]) -> None:
        if not self._context.is_shutdown:
            return
        waited_s = time.monotonic() - self._shutdown_at
        for after_s, number in ESCALATION:
            if after_s < waited_s < after_s + 2.0 * POLL_S:
                say("ERROR", f"process failed to terminate, escalating to {number.name}")
                process.send_signal(number)


MODULES: dict[str, tuple[Any, ...]] = {
    "launch": (LaunchDescription,),
    "launch.actions": (DeclareLaunchArgument, OpaqueFunction, Shutdown),
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
