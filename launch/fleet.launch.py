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

"""The diagnosis of many stands, spread over processes and hosts.

    ros2 launch flea_diag fleet.launch.py stands:="bay_1 bay_2=./mine bay_3=flea@./bay_3.yaml"
    ros2 launch flea_diag fleet.launch.py hosts:=fleet.txt processes:=2 batch_ms:=20

A hosts file has a line for each host, `pc_1: bay_1 bay_2=./mine`, and is the same on all of them:
each starts the stands of its own line. A process that is killed is started again; the others go on.
"""

import os
import runpy
import socket

from launch import LaunchDescription
from launch.actions import OpaqueFunction

BESIDE = runpy.run_path(os.path.join(os.path.dirname(os.path.realpath(__file__)), "checked.py"))

ARGUMENTS = (
    ("stands", "", str, "stands of this host, apart by blanks: NAMESPACE[=STAND[@CALIBRATION]]"),
    ("hosts", "", str, "file with a line for each host, HOST: STANDS, instead of stands"),
    ("host", "", str, "whose line of that file is started; empty: this machine's name"),
    ("namespace", "", str, "namespace of the fleet, before those of its stands"),
    ("processes", "1", int, "processes that share the stands, at most as many as cores"),
    ("batch_ms", "0", int, "time for which scans are collected: 20 to 100 for many stands [ms]"),
    ("console", "true", bool, "print the verdicts in this terminal"),
)


def nodes(context):
    given = BESIDE["values"](context, ARGUMENTS, __file__)
    stands = _stands(given)
    if not 1 <= given["processes"] <= len(stands):
        raise RuntimeError(
            f"processes:={given['processes']} must be from 1 to {len(stands)}, the number of stands"
        )
    started = BESIDE["Nodes"](given)
    for number in range(given["processes"]):
        part = {"stands": stands[number :: given["processes"]], "batch_ms": given["batch_ms"]}
        started.add("fleet", part, name=f"fleet_{number + 1}", restart=True)
    if given["console"]:
        names = [entry.partition("=")[0] for entry in stands]
        started.add("console", {"stands": names}, needed=False)
    return started.actions()


def _stands(given):
    """Entries of this host's stands."""
    if bool(given["stands"]) == bool(given["hosts"]):
        raise RuntimeError('give either stands:="bay_1 bay_2" or hosts:=FILE')
    stands = (_of_host(given) if given["hosts"] else given["stands"]).split()
    if not stands:
        raise RuntimeError(f"stands:={given['stands']} names no stand")
    return stands


def _of_host(given):
    """Text of the line of this host."""
    path, host = given["hosts"], given["host"] or socket.gethostname()
    try:
        with open(path, encoding="utf-8") as file:
            rows = _rows([line.partition("#")[0].strip() for line in file], path)
    except (OSError, UnicodeDecodeError) as error:
        raise RuntimeError(f"hosts:={path} cannot be read: {error}") from None
    if host not in rows:
        known = ", ".join(rows) or "none"
        raise RuntimeError(f"hosts:={path} has no line for host {host}, but for {known}")
    return rows[host]


def _rows(lines, path):
    """Stands by host; a host has one line, and a stand one host."""
    rows, host_of = {}, {}
    for number, line in enumerate(lines, 1):
        name, colon, stands = line.partition(":")
        name, where = name.strip(), f"hosts:={path}, line {number}"
        if not line:
            continue
        if not colon or not name:
            raise RuntimeError(f"{where}: {line!r} is not HOST: STANDS")
        if name in rows:
            raise RuntimeError(f"{where}: host {name} has a line already, which takes all stands")
        rows[name] = stands
        for stand in (entry.partition("=")[0].strip("/") for entry in stands.split()):
            if host_of.setdefault(stand, name) != name:
                raise RuntimeError(f"{where}: {host_of[stand]} has the stand {stand} already")
    return rows


def generate_launch_description():
    declared = BESIDE["declared"](ARGUMENTS)
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
