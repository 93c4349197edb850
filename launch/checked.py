"""What all launch files do: check every argument before a process starts, and end together.

Loaded by path, since a launch file may run in a Python that does not have our package. What a
node refuses, its executable says itself (``--check``).
"""

import json
import math
import os
import subprocess

from ament_index_python.packages import get_package_prefix
from launch.actions import DeclareLaunchArgument, Shutdown
from launch_ros.actions import Node

PACKAGE = "flea_diag"
ARGUMENT_OF = {"directory": "bag"}
"""Parameter of a node -> launch argument, where the names differ."""
TRUTHS = {"true": True, "1": True, "false": False, "0": False}


def declared(arguments):
    """A declaration for each row of (name, default, kind, description)."""
    return [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, _, text in arguments
    ]


def values(context, arguments):
    """Values of all arguments by name, of the kind of their row.

    Raises RuntimeError with one line that names the argument, its value and what is allowed:
    launch ends with status 1, and no process has been started yet.
    """
    given = context.launch_configurations
    return {name: _value(name, kind, given.get(name, "")) for name, _, kind, _ in arguments}


def _value(name, kind, text):
    if kind is bool:
        if text.lower() not in TRUTHS:
            raise RuntimeError(f"{name}:={text} is unknown, choose true or false")
        return TRUTHS[text.lower()]
    if kind is float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise RuntimeError(f"{name}:={text} is not a finite number, write for example 5.0")
        return number
    if kind is int:
        if not text.isdecimal():
            raise RuntimeError(f"{name}:={text} is not a whole number, write for example 2")
        return int(text)
    return text


def stand(given):
    """Parameters by which a node is told its stand.

    `stand` once said whether the simulated stand is started: that is refused with its new name.
    """
    if given["stand"].lower() in TRUTHS:
        raise RuntimeError(
            f"stand:={given['stand']} is no stand; to start the simulated one or not, give "
            f"simulated:={given['stand']}"
        )
    return {name: given[name] for name in ("stand", "calibration")}


class Nodes:
    """The nodes of one launch, checked together and started together.

    ``needed`` of ``add`` are those without which there is nothing left to do: launch ends with
    the first of them that ends. A node that fails ends launch with status 1 in any case, but one
    that is killed and noted with ``restart`` is started again.
    """

    def __init__(self, namespace):
        self._namespace = namespace
        self._rows = []

    def add(self, executable, parameters, needed=True, name=None, restart=False):
        """Note a node with its parameters; ``name`` is that of the node, if not the usual one."""
        self._rows.append((executable, parameters, needed, name, restart))

    def actions(self):
        """Check all nodes at once; the actions that start them."""
        checks = [(row[0], _check(*row[:2])) for row in self._rows]
        said = [check.communicate()[1].strip() for _, check in checks]
        for (name, check), text, (_, parameters, *_) in zip(checks, said, self._rows, strict=True):
            if check.returncode:
                line = text.splitlines()[-1] if text else f"{name} cannot be checked"
                raise RuntimeError(_named(line.removeprefix("flea_diag: "), parameters))
        return [self._node(*row) for row in self._rows]

    def _node(self, executable, parameters, needed, name, restart):
        def again():
            return self._node(executable, parameters, needed, name, restart)

        return Node(
            package=PACKAGE,
            executable=executable,
            namespace=self._namespace,
            name=name,
            parameters=[parameters] if parameters else [],
            output="screen",
            on_exit=_on_exit(executable, needed, again if restart else None),
        )


def _check(executable, parameters):
    """Start the check of one node; it opens no connection to others."""
    path = os.path.join(get_package_prefix(PACKAGE), "lib", PACKAGE, executable)
    given = [part for name, value in parameters.items()
             for part in ("-p", f"{name}:={json.dumps(value)}")]  # fmt: skip
    command = [path, "--check", "--ros-args", *given]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def _named(line, parameters):
    """What a node says of one of its values, with the launch argument in front."""
    texts = {name: value for name, value in parameters.items() if isinstance(value, str) and value}
    quoted = [name for name, value in texts.items() if f"'{value}'" in line]
    leading = [name for name, value in texts.items() if line.startswith(value)]
    for name in (quoted or leading)[:1]:
        return f"{ARGUMENT_OF.get(name, name)}:={texts[name]}: {line}"
    return line


def _on_exit(executable, needed, again):
    def ended(event, context):
        if context.is_shutdown:
            return None
        if again and event.returncode < 0:
            return [again()]
        if event.returncode:
            # Launch has no status of its own for this; it returns 1 after an exception, once all
            # other processes have ended.
            raise RuntimeError(f"{executable} ended with status {event.returncode}")
        return [Shutdown(reason=f"{executable} has ended")] if needed else None

    return ended
