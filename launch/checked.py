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

"""What all launch files do: check every argument before a process starts, and end together.

Loaded by path, since a launch file may run in a Python that does not have our package. What a
node refuses, its executable says itself (``--check``). Whatever happens to the nodes of one launch
file touches no others of a larger launch that includes it.
"""

import difflib
import json
import math
import os
import subprocess
import sys
import time

from ament_index_python.packages import get_package_prefix
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    RegisterEventHandler,
    TimerAction,
)
from launch.event_handlers import OnShutdown
from launch.events.process import ShutdownProcess
from launch.logging import get_logger
from launch_ros.actions import Node

PACKAGE = "flea_diag"
ARGUMENT_OF = {"directory": "bag"}
"""Parameter of a node -> launch argument, where the names differ."""
TRUTHS = {"true": True, "1": True, "false": False, "0": False}
LEVELS = ("", "debug", "info", "warn", "error", "fatal")
ENDINGS = ("stand", "launch", "restart")
COMMON = (
    ("on_failure", "stand", ENDINGS, "what ends when a needed node fails: the nodes of this "
     "file (stand), the whole launch (launch), or nothing and it is started again (restart)"),
    ("respawn", "true", bool, "start a viewer, recorder or reporter again when it dies"),
    ("params_file", "", str, "YAML file of ROS parameters; arguments that are given go before it"),
    ("log_level", "", LEVELS, "log level of these nodes; empty: info"),
)  # fmt: skip
"""Arguments of every launch file."""
RESPAWN_S = 2.0
MOST_RESTARTS, WITHIN_S = 3, 60.0
"""A node that dies more often within this time is given up."""


def declared(arguments):
    """A declaration for each row of (name, default, kind, description)."""
    return [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, _, text in (*arguments, *COMMON)
    ]


def values(context, arguments, file):
    """Values of all arguments by name, of the kind of their row; ``file`` is the launch file.

    Raises RuntimeError with one line that names the argument, its value and what is allowed:
    launch ends with status 1, and no process has been started yet.
    """
    rows = (*arguments, *COMMON)
    _check_names([row[0] for row in rows], file)
    texts = context.launch_configurations
    given = {name: _value(name, kind, texts.get(name, "")) for name, _, kind, _ in rows}
    if given["params_file"] and not os.path.isfile(given["params_file"]):
        raise RuntimeError(f"params_file:={given['params_file']}: no such file")
    given["said"] = {name for name, default, *_ in rows if texts.get(name, "") != (default or "")}
    return given


def _check_names(names, file):
    """Refuse an unknown argument of the command line, if this is the file that it launches.

    In a larger launch the arguments may be those of any other file.
    """
    words = sys.argv[1:]
    own = [
        number
        for number, word in enumerate(words)
        if os.path.realpath(word) == os.path.realpath(file)
        or (word == os.path.basename(file) and words[number - 1] == PACKAGE)
    ]
    for word in words[own[0] + 1 :] if own else ():
        name, assigned, value = word.partition(":=")
        if assigned and name not in names:
            near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
            raise RuntimeError(f"{name}:={value}: there is no argument {name}, {hint}")


def _value(name, kind, text):
    if isinstance(kind, tuple):
        if text not in kind:
            known = ", ".join(filter(None, kind))
            raise RuntimeError(f"{name}:={text} is unknown, choose one of {known}")
        return text
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
    """The nodes of one launch file, checked together, started together and ended together.

    ``needed`` of ``add`` are those without which there is nothing left to do: the others end with
    the first of them that ends. One that fails is what ``on_failure`` is for; any other is a
    warning, and is started again.
    """

    def __init__(self, given):
        self._given, self._namespace = given, given["namespace"].strip("/")
        self._rows, self._made, self._died = [], [], {}
        self._ending, self._failure = False, ""
        self._log = get_logger(PACKAGE)

    def add(self, executable, parameters, needed=True, name=None, restart=False):
        """Note a node with its parameters; ``name`` is that of the node, if not the usual one.

        ``restart``: it is started again when it was killed, whatever ``on_failure`` says.
        """
        self._rows.append((executable, parameters, needed, name, restart))

    def actions(self):
        """Check all nodes at once; the actions that start them."""
        checks = [(row[0], self._check(*row[:2])) for row in self._rows]
        said = [check.communicate()[1].strip() for _, check in checks]
        for (name, check), text, (_, parameters, *_) in zip(checks, said, self._rows, strict=True):
            if check.returncode:
                line = text.splitlines()[-1] if text else f"{name} cannot be checked"
                raise RuntimeError(_named(line.removeprefix("flea_diag: "), parameters))
        at_end = RegisterEventHandler(OnShutdown(on_shutdown=self._at_end))
        return [*(self._node(*row) for row in self._rows), at_end]

    def _node(self, executable, parameters, needed, name, restart):
        row = executable, parameters, needed, name, restart
        file, level = self._given["params_file"], self._given["log_level"]
        logger = ".".join(filter(None, (*self._namespace.split("/"), name or executable)))
        over = self._said(parameters) if file else {}
        made = Node(
            package=PACKAGE,
            executable=executable,
            namespace=self._namespace,
            name=name,
            parameters=[part for part in (parameters, file, over) if part],
            ros_arguments=["--log-level", f"{logger}:={level}"] if level else [],
            output="screen",
            on_exit=lambda event, context: self._ended(row, event, context),
        )
        self._made.append(made)
        return made

    def _said(self, parameters):
        """Those of the parameters that were given as arguments; they go before a file."""
        said = self._given["said"]
        return {k: v for k, v in parameters.items() if ARGUMENT_OF.get(k, k) in said}

    def _check(self, executable, parameters):
        """Start the check of one node; it opens no connection to others."""
        path = os.path.join(get_package_prefix(PACKAGE), "lib", PACKAGE, executable)
        file = self._given["params_file"]
        given = [
            *_assigned(parameters),
            *(["--params-file", file, *_assigned(self._said(parameters))] if file else []),
        ]
        place = ["-r", f"__ns:=/{self._namespace}"] if self._namespace else []
        command = [path, "--check", "--ros-args", *place, *given]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        return subprocess.Popen(command, **quiet)

    def _ended(self, row, event, context):
        """What follows the end of a node."""
        executable, _, needed, name, restart = row
        if context.is_shutdown or self._ending:
            return None
        status, who = event.returncode, name or executable
        if not status:
            return self._end(f"{who} has ended") if needed else None
        again = self._given["on_failure"] == "restart" or (restart and status < 0)
        if not needed and not self._given["respawn"]:
            self._log.warning(f"{who} ended with status {status}; the others go on")
            return None
        if (not needed or again) and self._may_restart(who):
            self._log.warning(f"{who} ended with status {status} and is started again")
            return [TimerAction(period=RESPAWN_S, actions=[self._node(*_anew(row))])]
        if not needed:
            self._log.warning(f"{who} ended with status {status} once more and is given up")
            return None
        self._failure = f"{who} ended with status {status}"
        if self._given["on_failure"] == "launch":
            # Launch has no status of its own for this; it returns 1 after an exception, once all
            # other processes have ended.
            raise RuntimeError(self._failure)
        self._log.error(f"{self._failure}, which ends the nodes of its stand")
        return self._end(self._failure)

    def _may_restart(self, who):
        now = time.monotonic()
        recent = [at for at in self._died.get(who, ()) if now - at < WITHIN_S]
        self._died[who] = [*recent, now]
        return len(recent) < MOST_RESTARTS

    def _end(self, reason):
        """End the nodes of this file, and nothing else; launch ends once it has no process left."""
        self._ending = True
        self._log.info(f"{reason}: the nodes of this stand end")
        own = self._made
        return [EmitEvent(event=ShutdownProcess(process_matcher=lambda each: each in own))]

    def _at_end(self, event, context):
        """Launch ends by itself: it returns 1 if a node of this file has failed before."""
        if self._failure and event.reason == "idle":
            raise RuntimeError(self._failure)


def _anew(row):
    """Row of a node that is started again; a recorder writes another bag."""
    executable, parameters, *more = row
    bag = parameters.get("directory", "")
    if bag and os.path.exists(bag):
        stem, _, number = bag.rpartition("_")
        stem, last = (stem, int(number)) if number.isdecimal() and stem else (bag, 1)
        while os.path.exists(f"{stem}_{last}") or last == 1:
            last += 1
        parameters = {**parameters, "directory": f"{stem}_{last}"}
    return (executable, parameters, *more)


def _assigned(parameters):
    return [part for name, value in parameters.items()
            for part in ("-p", f"{name}:={json.dumps(value)}")]  # fmt: skip


def _named(line, parameters):
    """What a node says of one of its values, with the launch argument in front."""
    texts = {name: value for name, value in parameters.items() if isinstance(value, str) and value}
    quoted = [name for name, value in texts.items() if f"'{value}'" in line]
    # A value that two arguments share is that of the one that the line names.
    spoken = [name for name in quoted if line.startswith(name)]
    leading = [
        name for name, value in texts.items() if line.startswith((value, os.path.abspath(value)))
    ]
    for name in (spoken or quoted or leading)[:1]:
        return f"{ARGUMENT_OF.get(name, name)}:={texts[name]}: {line}"
    return line
