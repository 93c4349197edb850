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

"""The package as pip and as colcon install it: `ros2 run` finds every executable, and it runs.

`ros2` itself is not on PyPI. What it does is done here with the same means: the package's
prefix by the ament index over AMENT_PREFIX_PATH, then the executables in lib/flea_diag.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from support import in_turn
from support.live import ROOT, Process, environment
from support.places import SHIPPED_STANDS

from flea_diag import __version__
from flea_diag.nodes.executables import EXECUTABLES
from flea_diag.wire.topics import TOPICS

SOURCES = (
    "flea_diag", "flea_sim_driver", "config", "launch", "launcher", "resource", "package.xml",
    "setup.py", "pyproject.toml", "MANIFEST.in", "LICENSE", "README.md",
)  # fmt: skip


def run(command: list[str], cwd: Path) -> None:
    """Run a build to its end; its output is the message when it fails."""
    done = subprocess.run(
        command, cwd=cwd, env=environment(0, PYTHONPATH=""), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy, for a build leaves its traces in the source tree."""
    copy = tmp_path_factory.mktemp("sources") / "flea_diag"
    copy.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(
                ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.pyc")
            )
        elif (ROOT / name).exists():
            shutil.copy2(ROOT / name, copy / name)
    return copy


def pip_prefix(sources: Path, place: Path) -> Path:
    pytest.importorskip("setuptools", "70.1", reason="pip needs setuptools 70.1 for a wheel here")
    prefix = place / "pip"
    # Without --ignore-installed pip takes the copy that this very test runs from away.
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--ignore-installed"]
    command += ["--no-build-isolation", "--no-index", "--prefix", str(prefix), str(sources)]
    run(command, place)
    # Debian's Python puts a local/ in between; a virtual environment does not.
    return next(path for path in (prefix, prefix / "local") if (path / "share").is_dir())


def colcon_prefix(sources: Path, place: Path, *arguments: str) -> Path:
    colcon = Path(sys.executable).parent / "colcon"
    if not colcon.exists():
        pytest.skip("colcon is not installed beside this Python")
    workspace = place / ("colcon" + "".join(arguments))
    workspace.mkdir()
    command = [str(colcon), "build", "--base-paths", str(sources), *arguments]
    run(command, workspace)
    return workspace / "install" / "flea_diag"


@pytest.fixture(scope="session")
def built(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package built by colcon, in whose workspace its tests can run."""
    return colcon_prefix(sources, tmp_path_factory.mktemp("built"))


@pytest.fixture(scope="session", params=in_turn(["pip", "colcon", "colcon --symlink-install"], 3))
def prefix(
    request: pytest.FixtureRequest, sources: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The package installed into a prefix of its own, once a session for each way."""
    place = tmp_path_factory.mktemp("installed")
    tool, *arguments = request.param.split()
    if tool == "pip":
        return pip_prefix(sources, place)
    if not arguments:
        found: Path = request.getfixturevalue("built")
        return found
    return colcon_prefix(sources, place, *arguments)


WITHOUT_PIP = """
import importlib.util, sys
MISSING = {"mcap", "rosbags", "pywt", "threadpoolctl", "numba", "matplotlib", "pandas"}
known = importlib.util.find_spec
importlib.util.find_spec = lambda n, p=None: None if n.partition(".")[0] in MISSING else known(n, p)

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Finder())
"""


@pytest.mark.in_turn(2)
def test_colcon_test_runs_without_what_pip_alone_installs(
    sources: Path, built: Path, tmp_path: Path
) -> None:
    """Tests of the rest run and pass, one that needs more is skipped by the name of it."""
    shutil.copytree(
        ROOT / "test", sources / "test", ignore=shutil.ignore_patterns("__pycache__", "web")
    )
    (tmp_path / "sitecustomize.py").write_text(WITHOUT_PIP, encoding="utf-8")
    colcon, workspace = str(Path(sys.executable).parent / "colcon"), built.parents[1]
    chosen = ("test/core/vibration/test_features.py", "test/core/symbolic", "test/fields")
    command = [colcon, "test", "--base-paths", str(sources), "--return-code-on-test-failure"]
    # Where it can, colcon writes pages of which lines ran, of all sources: most of a minute.
    uncovered = ["--no-cov"] if find_spec("pytest_cov") else []
    done = subprocess.run(
        [*command, "--pytest-args", "-p", "no:xdist", *uncovered, *chosen],
        cwd=workspace,
        env=environment(0, PYTHONPATH=str(tmp_path)),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    told = (workspace / "build" / "flea_diag" / "pytest.xml").read_text(encoding="utf-8")
    (suite,) = ElementTree.fromstring(told).iter("testsuite")
    assert int(suite.attrib["tests"]) > 50
    assert int(suite.attrib["failures"]) + int(suite.attrib["errors"]) == 0
    assert "pywt is not installed" in told


def ros2_pkg_executables(ament_prefix_path: str, package: str) -> dict[str, Path]:
    """What `ros2 pkg executables` lists: the index marker names the prefix."""
    for entry in ament_prefix_path.split(os.pathsep):
        marker = Path(entry) / "share/ament_index/resource_index/packages" / package
        if marker.is_file():
            folder = Path(entry) / "lib" / package
            return {
                path.name: path
                for path in sorted(folder.iterdir())
                if path.is_file() and os.access(path, os.X_OK)
            }
    raise LookupError(package)


def test_ros2_run_would_find_every_executable(prefix: Path) -> None:
    found = ros2_pkg_executables(f"/nowhere{os.pathsep}{prefix}", "flea_diag")
    assert sorted(found) == sorted(EXECUTABLES)


def test_every_executable_starts_from_anywhere(prefix: Path, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    more = {"PYTHONPATH": "", "AMENT_PREFIX_PATH": str(prefix), "PATH": path}
    found = ros2_pkg_executables(str(prefix), "flea_diag")
    if "colcon" in str(prefix):  # the same launchers, held to be there above: one of each room
        found = {name: found[name] for name in ("daq", "isolator")}
    running = {
        name: subprocess.Popen(
            [program, "--help"],
            cwd=tmp_path,
            env=environment(0, **more),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for name, program in found.items()
    }
    for name, child in running.items():
        output, _ = child.communicate(timeout=60)
        assert child.returncode == 0, output
        assert f"ros2 run flea_diag {name}" in output


def test_an_executable_runs_and_stops(prefix: Path, domain: int, tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    recorder = ros2_pkg_executables(str(prefix), "flea_diag")["recorder"]
    with Process([str(recorder)], domain, cwd=tmp_path, PYTHONPATH="", PATH=path) as process:
        process.wait_for(f"recording {len(TOPICS)} topics")
        status = process.signal(signal.SIGINT)
    assert status == 0


def test_an_executable_finds_the_stand_that_is_installed_with_it(
    prefix: Path, tmp_path: Path
) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    more = {"PYTHONPATH": "", "AMENT_PREFIX_PATH": str(prefix), "PATH": path}
    diagnoser = ros2_pkg_executables(str(prefix), "flea_diag")["diagnoser"]
    folder = prefix / "share" / "flea_diag" / "config" / "stands" / "flea"
    for stand, status in (("flea", 0), (str(folder), 0), ("none", 2)):
        done = subprocess.run(
            [str(diagnoser), "--check", "--ros-args", "-p", f"stand:={stand}"],
            cwd=tmp_path,
            env=environment(0, **more),
            capture_output=True,
            text=True,
        )
        assert done.returncode == status, done.stderr
    assert f"stand 'none' is not shipped, known are {', '.join(SHIPPED_STANDS)}" in done.stderr


def test_what_ros_tools_look_for_is_there(prefix: Path) -> None:
    share = prefix / "share" / "flea_diag"
    assert (share / "package.xml").is_file()
    shipped = {path.name for path in (ROOT / "launch").glob("*.py")}
    assert {path.name for path in (share / "launch").glob("*.py")} == shipped
    assert {"stand.launch.py", "replay.launch.py"} < shipped
    installed = {path.relative_to(share) for path in (share / "config").rglob("*.yaml")}
    assert installed == {path.relative_to(ROOT) for path in (ROOT / "config").rglob("*.yaml")}
    assert installed


def test_the_flea_command_is_the_only_one_in_bin(prefix: Path) -> None:
    assert [path.name for path in sorted((prefix / "bin").iterdir())] == ["flea"]


def test_versions_agree() -> None:
    """package.xml needs the number in so many words; setup.py reads it from the module."""
    import flea_diag

    root = ElementTree.parse(ROOT / "package.xml").getroot()
    assert root.findtext("version") == flea_diag.__version__
    assert root.get("format") == "3"
    assert root.findtext("export/build_type") == "ament_python"


def test_the_package_script_builds_a_wheel_that_is_whole(sources: Path, tmp_path: Path) -> None:
    """All that an installation needs is in it: stands, launchers, types, the command."""
    if not (Path(sys.prefix) / "bin" / "python3").exists() or sys.prefix == sys.base_prefix:
        pytest.skip("the script builds in a virtual environment, and the tests run in none")
    (sources / "scripts").mkdir()
    for name in ("package", "venv.sh"):
        shutil.copy2(ROOT / "scripts" / name, sources / "scripts" / name)
    (sources / ".venv").symlink_to(sys.prefix)
    command = [str(sources / "scripts" / "package"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("flea_diag-*.whl")
    assert f"python3 -m pip install {wheel}" in done.stderr
    with zipfile.ZipFile(wheel) as held:
        names = held.namelist()
        (told,) = (name for name in names if name.endswith("entry_points.txt"))
        assert "flea = flea_diag.tools.main:main" in held.read(told).decode()
    assert {"flea_diag/py.typed", "flea_diag/__init__.pyi"} <= set(names)
    for end in ("share/flea_diag/config/stands/flea/stand.yaml", "lib/flea_diag/diagnoser"):
        assert any(name.endswith(end) for name in names), end


def test_the_citation_names_this_version_and_the_paper() -> None:
    told = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert told["cff-version"] == "1.2.0"
    assert told["version"] == __version__
    assert "A Case Study on Electromechanical Actuators" in told["references"][0]["title"]
    assert told["license"] == "Apache-2.0"


def test_package_xml_declares_every_package_of_ros_that_is_imported() -> None:
    """A module of ROS has the name of its package; others are Python's own, or of pip."""
    packages = ROOT / "package.xml"
    declared = set(re.findall(r"<exec_depend>(\w+)</exec_depend>", packages.read_text("utf-8")))
    imported = set()
    for folder in ("flea_diag", "flea_sim_driver", "launch"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
                imported |= {name.partition(".")[0] for name in names}
    of_ros = {"rclpy", "launch", "launch_ros", "ament_index_python"}
    of_ros |= {name for name in imported if name.endswith(("_msgs", "_srvs", "_interfaces"))}
    carried = {topic.message.partition("/")[0] for topic in TOPICS}
    assert (imported & of_ros) | carried <= declared
    inside = {"builtin_interfaces", "std_msgs"}  # stamps and headers, in the bytes of the codec
    assert {name for name in declared if "python3" not in name} <= of_ros | carried | inside
