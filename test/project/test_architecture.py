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

"""The arrows between the rooms hold, and the check that says so finds a planted violation."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from support.places import ROOT


class Room(NamedTuple):
    """Modules below ``name`` may import of ours ``ours``, and of others ``others`` (None: any).

    The standard library is free to all but the pure rooms, which may not touch ``BANNED``.
    """

    name: str
    ours: tuple[str, ...]
    others: tuple[str, ...] | None
    pure: bool = False


ROS = (
    "rclpy", "rcl_interfaces", "lifecycle_msgs", "std_srvs", "rosgraph_msgs", "builtin_interfaces",
    "launch",
)  # fmt: skip
BAGS = ("mcap", "rosbags", "zstandard", "lz4", "yaml")
TABLES = ("pyarrow", "openpyxl", "h5py", "pyulog")
PAGES = ("jinja2", "markupsafe")
BATCH = ("tqdm", "distributed", "fsspec", "aiohttp", "argcomplete")
SCIENCE = ("numpy", "scipy", "numba", "pywt")

# The first room whose name a module starts with is its room.
ROOMS = (
    Room(
        "flea_diag.core",
        (
            "flea_diag.core",
            "flea_diag.fields",
            "flea_diag.formats",
            "flea_diag.errors",
            "flea_diag.compile_cache",
        ),
        SCIENCE,
        pure=True,
    ),
    Room(
        "flea_diag.stages",
        (
            "flea_diag.stages",
            "flea_diag.core",
            "flea_diag.errors",
            "flea_diag.wire.blocks",
            "flea_diag.wire.records",
            "flea_diag.wire.parameters",
            "flea_diag.wire.topics",
        ),
        SCIENCE,
        pure=True,
    ),
    Room(
        "flea_diag.operator",
        (
            "flea_diag.operator",
            "flea_diag.errors",
            "flea_diag.wire.records",
            "flea_diag.wire.topics",
            "flea_diag.wire.wording",
        ),
        (),
        pure=True,
    ),
    Room("flea_diag.wire.bus", ("flea_diag.wire", "flea_diag.errors"), ROS),
    Room(
        "flea_diag.wire",
        ("flea_diag.wire", "flea_diag.fields", "flea_diag.errors", "flea_diag"),
        ("numpy", *BAGS),
    ),
    Room("flea_diag.errors", (), ()),
    Room("flea_diag.cache_folder", (), ()),
    Room("flea_diag.compile_cache", ("flea_diag.cache_folder",), ("numba", "llvmlite", "numpy")),
    Room("flea_diag.fields", ("flea_diag.fields", "flea_diag.errors"), (), pure=True),
    Room("flea_diag.formats", ("flea_diag.errors",), (), pure=True),
    Room(
        "flea_diag.web",
        (
            "flea_diag.web",
            "flea_diag.operator",
            "flea_diag.errors",
            "flea_diag.wire.records",
            "flea_diag.wire.wording",
            "flea_diag.wire.regular_file",
        ),
        ("numpy", "markupsafe", "nicegui", "fastapi", "uvicorn"),
    ),
    Room(
        "flea_diag.nodes",
        (
            "flea_diag",
            "flea_diag.nodes",
            "flea_diag.operator",
            "flea_diag.web",
            "flea_diag.wire",
            "flea_diag.stages",
            "flea_diag.configuration",
            "flea_diag.formats",
            "flea_diag.fields",
            "flea_diag.errors",
        ),
        (*ROS, "numpy", "textual", "rich"),
    ),
    Room(
        "flea_diag.tools",
        (
            "flea_diag",
            "flea_diag.tools",
            "flea_diag.api",
            "flea_diag.operator",
            "flea_diag.wire",
            "flea_diag.stages",
            "flea_diag.core",
            "flea_diag.configuration",
            "flea_diag.formats",
            "flea_diag.fields",
            "flea_diag.errors",
            "flea_sim_driver",
        ),
        (*SCIENCE, *BAGS, *TABLES, "matplotlib", "sklearn", "threadpoolctl", *PAGES, *BATCH),
    ),
    Room(
        "flea_diag.api",
        (
            "flea_diag.api",
            "flea_diag.tools",
            "flea_diag.wire",
            "flea_diag.stages",
            "flea_diag.core",
            "flea_diag.configuration",
            "flea_diag.errors",
            "flea_sim_driver",
        ),
        ("numpy", "pyarrow", "pandas", "xarray", "matplotlib"),
    ),
    Room(
        "flea_diag.configuration",
        (
            "flea_diag.configuration",
            "flea_diag.core",
            "flea_diag.stages",
            "flea_diag.wire",
            "flea_diag.formats",
            "flea_diag.fields",
            "flea_diag.errors",
            "flea_diag.cache_folder",
        ),
        (),
    ),
    Room("flea_diag", (), ()),
    Room(
        "flea_sim_driver",
        (
            "flea_sim_driver",
            "flea_diag.wire",
            "flea_diag.fields",
            "flea_diag.formats",
            "flea_diag.errors",
            "flea_diag.compile_cache",
        ),
        None,
    ),
)

# Within a room: package -> packages of the room that it may import. Modules of the room itself
# are free to all below it, and may themselves import whatever the row of the room says.
ARROWS = {
    "flea_diag.core": {
        "": (),
        "symbolic": (),
        "sensors": (),
        "bond_graph": ("symbolic",),
        "faults": ("bond_graph", "symbolic"),
        "causal_graph": ("faults", "bond_graph", "symbolic"),
        "residuals": ("sensors", "faults", "bond_graph", "symbolic"),
        "conditions": ("residuals",),
        "signatures": ("residuals", "causal_graph", "faults", "bond_graph", "symbolic"),
        "observers": ("residuals", "bond_graph"),
        "detection": ("residuals",),
        "likelihood": ("residuals", "symbolic", "faults"),
        "run_law": ("likelihood", "residuals", "symbolic"),
        "calibration": (
            "detection",
            "observers",
            "residuals",
            "sensors",
            "bond_graph",
            "symbolic",
            "run_law",
            "likelihood",
        ),
        "wiring": ("calibration", "detection", "likelihood", "residuals", "sensors"),
        "isolation": (
            "likelihood",
            "run_law",
            "calibration",
            "signatures",
            "causal_graph",
            "faults",
        ),
        "evidence": ("run_law", "likelihood", "isolation", "residuals", "faults", "symbolic"),
        "prognosis": ("likelihood",),
        "recurrence": ("evidence", "run_law"),
        "vibration": (),
        "choice": ("vibration", "likelihood", "residuals", "symbolic"),
        "drawing": ("residuals", "causal_graph", "bond_graph", "symbolic"),
    },
    "flea_diag.stages": {
        "": (),
        "judgement": (),
        "stream": (),
        "wiring": (),
        "observer": ("judgement", "stream", "wiring"),
        "extractor": (),
        "recurrence": (),
        "isolator": ("judgement", "recurrence"),
        "sizes": ("extractor", "isolator"),
        "baselines": ("extractor",),
        "evidence": ("observer", "isolator", "recurrence"),
    },
    "flea_diag.wire": {
        "": (),
        "messages": (),
        "sources": (),
        "bags": ("messages",),
        "bus": ("messages",),
    },
    "flea_diag.nodes": {
        "": ("stage",),
        "stage": (),
        "fleet": ("stage",),
        "operator": (),
        "recording": (),
        "run": ("operator",),
    },
    "flea_diag.tools": {
        "": (),
        "bags": (),
        "stand": (),
        "model": (),
        "tables": (),
        "recordings": ("tables",),
        "series": ("recordings", "tables"),
        "stand_check": ("recordings", "tables"),
        "stand_folder": ("recordings", "series", "stand_check", "tables"),
        "calibrate": ("recordings",),
        "features": (),
        "replay": ("recordings",),
        "export": ("replay",),
        "campaign": ("calibrate", "recordings"),
        "score": ("campaign",),
        "arena": (),
        "evaluate": ("arena", "calibrate", "campaign", "features", "replay", "score"),
        "fmea": ("campaign", "evaluate", "recordings", "score"),
    },
    "flea_diag.web": {
        "": (),
        "pages": (),
    },
    "flea_sim_driver": {
        "": ("acquisition", "machine", "plant", "scenario"),
        "plant": (),
        "machine": ("plant",),
        "scenario": ("machine", "plant"),
        "acquisition": ("machine", "plant", "scenario"),
        "realism": ("acquisition",),
    },
}
MOST_MODULES = 20

NOT_FOR_SIM = ("rclpy", *BAGS[:2], "launch")
MESSAGE_PACKAGES_ONLY_IN = "flea_diag.wire.messages.codec"
BANNED_NAMES = ("open", "input", "print", "__import__")
BANNED_MODULES = (
    "time", "datetime", "random", "os", "io", "pathlib", "socket", "subprocess", "threading",
    "tempfile", "shutil", "pickle", "secrets", "uuid", "asyncio", "multiprocessing",
)  # fmt: skip
GENERATORS = (
    "Generator",
    "default_rng",
    "SeedSequence",
    "PCG64",
    "MT19937",
    "Philox",
    "BitGenerator",
)


class Import(NamedTuple):
    """One imported module name and its line."""

    module: str
    line: int


def module_name(path: Path, root: Path) -> str:
    """Dotted name of a source file."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(tree: ast.AST, module: str, is_package: bool) -> Iterator[Import]:
    """All imports of a module, also those inside functions and behind TYPE_CHECKING."""
    package = module if is_package else module.rpartition(".")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([base] if base else [])])
            # `from flea_diag.wire import records` imports flea_diag.wire.records.
            yield from (Import(f"{base}.{alias.name}", node.lineno) for alias in node.names)
        elif isinstance(node, ast.Call) and _called(node) in ("importlib.import_module",):
            target = node.args[0]
            if isinstance(target, ast.Constant):
                yield Import(str(target.value), node.lineno)


def violations(root: Path) -> list[str]:
    """Every broken rule below ``root``, one line each."""
    found = []
    for package in ("flea_diag", "flea_sim_driver"):
        for path in sorted((root / package).rglob("*.py")):
            module = module_name(path, root)
            tree = ast.parse(path.read_text(encoding="utf-8"))
            room = next(room for room in ROOMS if within(module, room.name))
            for entry in imports(tree, module, path.name == "__init__.py"):
                why = refusal(module, room, entry.module)
                if why:
                    found.append(f"{module}:{entry.line}: {why}")
            if room.pure:
                found += [f"{module}:{line}: {why}" for line, why in impurities(tree)]
    return found


def crossings(root: Path) -> list[str]:
    """Every import within a room that ``ARROWS`` does not have, and every circle of files."""
    found = []
    graph: dict[str, set[str]] = {}
    sources = {
        module_name(path, root): path
        for package in ("flea_diag", "flea_sim_driver")
        for path in sorted((root / package).rglob("*.py"))
    }
    for module, path in sources.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        reached = graph.setdefault(module, set())
        for entry in imports(tree, module, path.name == "__init__.py"):
            target = entry.module if entry.module in sources else entry.module.rpartition(".")[0]
            reached.add(target)
            for room, arrows in ARROWS.items():
                here, there = _package(module, room, arrows), _package(entry.module, room, arrows)
                if None in (here, there) or there in ("", here, *arrows[here]):
                    continue
                found.append(f"{module}:{entry.line}: {here or room} may not import {there}")
    return found + [f"a circle of files: {' -> '.join(circle)}" for circle in circles(graph)]


def _package(module: str, room: str, arrows: dict[str, tuple[str, ...]]) -> str | None:
    """The package of a room that a module lies in, "" for the room itself, None outside."""
    if not within(module, room):
        return None
    name = module[len(room) + 1 :].split(".")[0]
    return name if name in arrows else ""


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Files that import one another, each circle once (depth first)."""
    done: set[str] = set()
    found: list[list[str]] = []

    def follow(module: str, path: list[str]) -> None:
        if module in path:
            found.append([*path[path.index(module) :], module])
        elif module not in done:
            for each in sorted(graph.get(module, ())):
                if each != module:
                    follow(each, [*path, module])
            done.add(module)

    for module in sorted(graph):
        follow(module, [])
    return found


def crowds(root: Path) -> list[str]:
    """Folders of ours with more modules than a reader takes in at once."""
    counts = {
        folder: len(list(folder.glob("*.py")))
        for top in ("flea_diag", "flea_sim_driver", "test", "bench")
        for folder in [root / top, *(root / top).rglob("*")]
        if folder.is_dir()
    }
    return [
        f"{folder}: {count} modules" for folder, count in counts.items() if count > MOST_MODULES
    ]


def within(module: str, room: str) -> bool:
    """Whether a module is the room or lies in it."""
    return module == room or module.startswith(room + ".")


def refusal(module: str, room: Room, imported: str) -> str:
    """Why ``module`` may not import ``imported``; empty when it may."""
    top = imported.split(".")[0]
    if top in ("flea_diag", "flea_sim_driver"):
        allowed = any(_reaches(imported, entry) for entry in room.ours)
        return "" if allowed else f"{room.name} may not import {imported}"
    if top.endswith("_msgs") and top not in ROS and module != MESSAGE_PACKAGES_ONLY_IN:
        return f"{imported}: only {MESSAGE_PACKAGES_ONLY_IN} imports message packages"
    if top in sys.stdlib_module_names or module == MESSAGE_PACKAGES_ONLY_IN:
        return ""
    if room.others is None:
        refused = top in NOT_FOR_SIM
    else:
        refused = top not in room.others
    return f"{room.name} may not import {imported}" if refused else ""


def _reaches(imported: str, entry: str) -> bool:
    """The package itself (flea_diag) allows its own names, not all that lies below it."""
    if entry == "flea_diag":
        return imported in ("flea_diag", "flea_diag.__version__")
    return within(imported, entry)


def impurities(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Files, clocks and global randomness in a module that is to have none."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                if name.split(".")[0] in BANNED_MODULES:
                    yield node.lineno, f"imports {name}: no files, clock or global randomness here"
        elif isinstance(node, ast.Call) and _called(node) in BANNED_NAMES:
            yield node.lineno, f"calls {_called(node)}(): no files or output here"
        elif isinstance(node, ast.Attribute):
            name = _dotted(node)
            if name.startswith(("np.random.", "numpy.random.")):
                if name.split(".")[2] not in GENERATORS:
                    yield node.lineno, f"{name}: randomness comes from an injected Generator"
            elif name.startswith(
                ("np.load", "np.save", "np.fromfile", "np.loadtxt", "np.genfromtxt")
            ):
                yield node.lineno, f"{name}: no files here"


def _called(node: ast.Call) -> str:
    return _dotted(node.func)


def _dotted(node: ast.AST) -> str:
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name):
        return ""
    return ".".join([node.id, *reversed(parts)])


def test_no_arrow_points_the_wrong_way() -> None:
    assert violations(ROOT) == []


def test_no_package_imports_one_above_it() -> None:
    assert crossings(ROOT) == []


def test_no_folder_is_crowded() -> None:
    assert crowds(ROOT) == []


def test_every_package_has_its_arrows() -> None:
    """No package is forgotten in ``ARROWS``, and none stands there that has gone."""
    for room, arrows in ARROWS.items():
        folder = ROOT / room.replace(".", "/")
        packages = {path.parent.name for path in folder.glob("*/__init__.py")}
        assert packages == set(arrows) - {""}, room


def test_the_architecture_page_has_these_arrows() -> None:
    """A table for each room, a row for each package, and in it just what it may import."""
    page = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    for room, arrows in ARROWS.items():
        head = f"| package of `{room.removeprefix('flea_diag.')}` | what is in it | may import |"
        table = page.partition(f"{head}\n|---|---|---|\n")[2].partition("\n\n")[0]
        rows = [[cell.strip() for cell in row.split("|")[1:4]] for row in table.splitlines()]
        said = {name.strip("`"): allowed.replace("`", "") for name, _, allowed in rows}
        expected = {name: ", ".join(found) or "nothing" for name, found in arrows.items() if name}
        assert said == expected, room


def test_every_module_is_seen() -> None:
    """The check reads what is there: all rooms have modules, and the walk does not skip."""
    modules = {
        module_name(path, ROOT)
        for package in ("flea_diag", "flea_sim_driver")
        for path in (ROOT / package).rglob("*.py")
    }
    for room in ROOMS:
        assert any(within(module, room.name) for module in modules), room.name


PLANTED = {
    "core imports a stage": ("flea_diag/core/a.py", "from flea_diag.stages import Stage"),
    "core imports records": ("flea_diag/core/a.py", "import flea_diag.wire.records"),
    "core imports ROS": ("flea_diag/core/a.py", "def f():\n    import rclpy"),
    "core imports YAML": ("flea_diag/core/a.py", "import yaml"),
    "core opens a file": ("flea_diag/core/a.py", "x = open('f')"),
    "core reads the clock": ("flea_diag/core/a.py", "import time\nnow = time.time()"),
    "core reads the date": ("flea_diag/core/a.py", "from datetime import datetime"),
    "core draws from the global generator": (
        "flea_diag/core/a.py",
        "import numpy as np\nx = np.random.normal()",
    ),
    "core seeds the global generator": (
        "flea_diag/core/a.py",
        "import numpy as np\nnp.random.seed(1)",
    ),
    "core imports the random module": ("flea_diag/core/a.py", "from random import gauss"),
    "core reads an array file": ("flea_diag/core/a.py", "import numpy as np\nnp.load('f')"),
    "core reaches out relatively": ("flea_diag/core/a.py", "from ..wire import codec"),
    "a stage knows the codec": ("flea_diag/stages/a.py", "from flea_diag.wire import codec"),
    "a stage knows a node": ("flea_diag/stages/a.py", "from flea_diag.nodes import adapter"),
    "a stage reads the clock": ("flea_diag/stages/a.py", "from time import monotonic"),
    "a screen's state knows the bus": ("flea_diag/operator/a.py", "import flea_diag.wire.bus"),
    "a screen's state reads the clock": ("flea_diag/operator/a.py", "import time"),
    "a node knows the core": ("flea_diag/nodes/a.py", "from flea_diag.core import residual"),
    "a node knows the simulator": ("flea_diag/nodes/a.py", "import flea_sim_driver"),
    "a node imports messages": ("flea_diag/nodes/a.py", "from sensor_msgs.msg import JointState"),
    "a tool needs ROS": ("flea_diag/tools/a.py", "import rclpy"),
    "the wire knows a stage": ("flea_diag/wire/a.py", "from flea_diag.stages import Stage"),
    "the wire needs ROS outside the bus": ("flea_diag/wire/a.py", "import rclpy"),
    "the wire imports messages outside the codec": (
        "flea_diag/wire/a.py",
        "from sensor_msgs.msg import JointState",
    ),
    "the simulator shares the physics": (
        "flea_sim_driver/a.py",
        "from flea_diag.core import actuator",
    ),
    "the simulator knows a stage": (
        "flea_sim_driver/a.py",
        "import flea_diag.stages.observer.observer",
    ),
    "the simulator goes around the bus": ("flea_sim_driver/a.py", "import rclpy"),
    "the formats know a kind of file": ("flea_diag/formats.py", "import flea_diag.core.frozen"),
    "the formats open a file": ("flea_diag/formats.py", "x = open('f')"),
    "configuration knows a node": (
        "flea_diag/configuration/a.py",
        "import flea_diag.nodes.stage.adapter",
    ),
}


PLANTED_WITHIN = {
    "a package of the core imports one above it": {
        "flea_diag/core/residuals/a.py": "from flea_diag.core.likelihood import b",
        "flea_diag/core/likelihood/b.py": "",
    },
    "a stage imports another": {
        "flea_diag/stages/isolator/a.py": "from flea_diag.stages.observer.b import c",
        "flea_diag/stages/observer/b.py": "c = 1",
    },
    "the root of the core imports a package": {
        "flea_diag/core/a.py": "import flea_diag.core.choice.b",
        "flea_diag/core/choice/b.py": "",
    },
    "the plant knows scenarios": {
        "flea_sim_driver/plant/a.py": "from flea_sim_driver.scenario.b import c",
        "flea_sim_driver/scenario/b.py": "c = 1",
    },
    "two files import each other, one behind TYPE_CHECKING": {
        "flea_diag/wire/a.py": "from flea_diag.wire.b import c",
        "flea_diag/wire/b.py": (
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"
            "    from flea_diag.wire.a import d\nc = 1"
        ),
    },
}


@pytest.mark.parametrize("name", PLANTED_WITHIN)
def test_a_planted_arrow_within_a_room_is_found(tmp_path: Path, name: str) -> None:
    for place, source in PLANTED_WITHIN[name].items():
        path = tmp_path / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source + "\n", encoding="utf-8")
    assert crossings(tmp_path), name


def test_a_planted_crowd_is_found(tmp_path: Path) -> None:
    folder = tmp_path / "flea_diag" / "core" / "crowded"
    folder.mkdir(parents=True)
    for number in range(MOST_MODULES + 1):
        (folder / f"m{number}.py").touch()
    assert len(crowds(tmp_path)) == 1


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_violation_is_found(tmp_path: Path, name: str) -> None:
    place, source = PLANTED[name]
    path = tmp_path / place
    path.parent.mkdir(parents=True)
    path.write_text(source + "\n", encoding="utf-8")
    assert violations(tmp_path), name


ALLOWED = {
    "core uses science": ("flea_diag/core/a.py", "import numpy as np\nfrom scipy import signal"),
    "core takes a generator": (
        "flea_diag/core/a.py",
        "import numpy as np\n\ndef f(g: np.random.Generator):\n    return g.normal()",
    ),
    "a stage uses core and records": (
        "flea_diag/stages/a.py",
        "from flea_diag.core import residual\nfrom flea_diag.wire.records import Scan",
    ),
    "the codec imports messages": (
        "flea_diag/wire/messages/codec.py",
        "from sensor_msgs.msg import JointState",
    ),
    "the bus imports rclpy": ("flea_diag/wire/bus/a.py", "import rclpy"),
    "the simulator uses the bus": ("flea_sim_driver/a.py", "from flea_diag.wire.bus import run"),
}


@pytest.mark.parametrize("name", ALLOWED)
def test_what_the_table_allows_is_allowed(tmp_path: Path, name: str) -> None:
    place, source = ALLOWED[name]
    path = tmp_path / place
    path.parent.mkdir(parents=True)
    path.write_text(source + "\n", encoding="utf-8")
    assert violations(tmp_path) == []
