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

"""Fixtures for all tests."""

from __future__ import annotations

import fcntl
import gc
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import Any, NoReturn

import hypothesis
import pytest
from support import examples, its_turn
from support.places import ROOT

from flea_diag.tools.garbage import search_less
from flea_diag.wire.records import Scan

# CI judges a change, not a draw of luck: the same examples each time there, new ones elsewhere.
hypothesis.settings.register_profile("few", max_examples=examples(100))
hypothesis.settings.register_profile(
    "ci", derandomize=True, deadline=None, max_examples=examples(100)
)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "few")

# A shell has its background jobs ignore Ctrl-C, and so would whatever the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)

HERE = Path(__file__).resolve().parent
BY_PIP = frozenset({
    "lz4", "mcap", "numba", "pywt", "rosbags", "threadpoolctl", "zstandard",
    "matplotlib", "pandas", "xarray", "pyarrow", "sklearn", "distributed", "jinja2", "tqdm",
    "nicegui", "starlette", "selenium", "textual", "faultdiagnosistoolbox", "mkdocs",
    "latex2mathml",
})  # fmt: skip
"""Modules that package.xml does not declare: no rosdep key, or an extra."""
STEERING = ("ROS_", "RCUTILS_", "FASTRTPS_", "FASTDDS_", "FLEA_", "XDG_STATE_", "COLUMNS", "LINES")
"""How variables begin that change what nodes and commands do, and where they look."""


STARTS_NODES = re.compile(r"\bdomain: int\b")
"""What a file says whose tests start nodes."""
IN_REAL_TIME = (
    "flea_sim_driver/test_daq_node.py", "nodes/recording/test_player.py",
    "system/test_fleet_launch.py", "system/test_launch.py",
    "system/test_live_run.py", "system/test_security.py", "system/test_shipped_mappings.py",
    "web/test_web_page.py",
)  # fmt: skip
"""Files whose nodes follow a stand in real time. No two stands run at once: on a small machine they
would take each other's time. The nodes of all others have a peer that waits for them."""
FIRST = ("project", "system", "tools", "stages", "core")
"""Folders that come before the rest: what does without compiled code, which the nodes are just
compiling, then the longest files, so that no worker ends much later."""


@cache
def starts_nodes(path: Path) -> bool:
    """Whether the tests of a file start nodes."""
    return bool(STARTS_NODES.search(path.read_text(encoding="utf-8")))


def _follows_a_stand(path: Path) -> bool:
    return path.relative_to(HERE).as_posix() in IN_REAL_TIME


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files that start nodes come first: they mostly wait, and a stand fills the time."""
    _leave_out_whose_turn_it_is_not(config, items)
    paths = {item.path for item in items}
    live = {path for path in paths if starts_nodes(path)}
    missed = {i.path for i in items if "domain" in getattr(i, "fixturenames", ())} - live
    if missed:
        raise pytest.UsageError(f"{min(missed)}: says nowhere 'domain: int', but starts nodes")
    items.sort(key=lambda item: (not _follows_a_stand(item.path), item.path not in live,
                                 _place(item.path)))  # fmt: skip


def _leave_out_whose_turn_it_is_not(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Of tests that are marked ``in_turn``, where folders are asked for and not they themselves."""
    if not all(Path(argument).is_dir() for argument in config.args):
        return
    left = {i for i in items if (m := i.get_closest_marker("in_turn"))
            and not its_turn(i.path.name, *m.args)}  # fmt: skip
    config.hook.pytest_deselected(items=list(left))
    items[:] = [item for item in items if item not in left]


def _place(path: Path) -> int:
    folder = path.relative_to(HERE).parts[0]
    return FIRST.index(folder) if folder in FIRST else len(FIRST)


class FileOfTests(pytest.Module):
    """A file that needs what package.xml cannot declare is skipped, by the name of what is missing.

    So ``colcon test`` runs all that can run with the packages of rosdep alone.
    """

    def _getobj(self) -> Any:
        try:
            return super()._getobj()
        except self.CollectError as error:
            found = re.search(r"No module named '(\w+)", str(error))
            _skip_without(found[1] if found else "", error)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module:
    """Files of tests of our kind."""
    return FileOfTests.from_parent(parent, path=module_path)


def _skip_without(name: str, error: Exception) -> NoReturn:
    """Skip where a package that comes by pip alone is missing; all else is an error."""
    package = name.partition(".")[0]
    if package not in BY_PIP or find_spec(package) is not None:
        raise error
    pytest.skip(f"{package} is not installed: it comes by pip alone", allow_module_level=True)


GIVES_WAY = 10
"""Niceness of tests that run beside a stand in real time: they take the time that it leaves."""


def _give_way(path: Path) -> None:
    if not _follows_a_stand(path) and os.nice(0) < GIVES_WAY:
        os.nice(GIVES_WAY)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """Fixtures import late, too."""
    _give_way(item.path)
    try:
        return (yield)
    except ModuleNotFoundError as error:
        _skip_without(error.name or "", error)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """So do tests."""
    try:
        return (yield)
    except ModuleNotFoundError as error:
        _skip_without(error.name or "", error)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Who goes to one worker: a file, for its fixtures are shared, and all that follow a stand.

    Marks of ``--dist loadgroup`` would say the same, but xdist 3.8 loses them with pytest 9.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return "stands" if _follows_a_stand(config.rootpath / file) else file

    config.option.loadscopereorder = False  # the order is that of the collection
    return ByFile(config, log)


COLD, READS_FIRST, READ_LIMIT_S = "NOTHING_IS_COMPILED", "gw0", 180.0
COMPILING = "compiling"
"""File beside what is generated, locked while somebody compiles: two would compile the same."""
FEW = 20
"""Files of tests that may have been read before all others are: ``scripts/check`` reads one."""


def _copy_compiled(kept: Path) -> None:
    """Let the tests have what this user has compiled already: by its content it is the same."""
    if find_spec("numba") is None:
        return
    from flea_diag.compile_cache import FOLDER, code_folder, is_private

    own, theirs = kept / FOLDER, code_folder()
    own.mkdir(mode=0o700, exist_ok=True)
    for index in theirs.glob("*.nbi") if theirs.is_dir() and is_private(theirs) else ():
        if not (own / index.name).exists():  # which comes last: it names the others
            for file in (*index.parent.glob(f"{index.stem}.*.nbc"), index):
                shutil.copy2(file, own)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Where nothing is compiled yet: what numba compiles begins beside the reading of tests."""
    if "PYTEST_XDIST_WORKER" not in os.environ and (
        cache := getattr(session.config, "cache", None)
    ):
        generated = cache.mkdir("flea_diag")
        _copy_compiled(generated)
        os.environ["FLEA_CACHE_DIR"] = str(generated)  # while tests are read, too
    compiled_files = len(list(HERE.glob("**/test_*-pytest-*.pyc")))
    is_cold = compiled_files < FEW and not sys.dont_write_bytecode
    if "PYTEST_XDIST_WORKER" in os.environ or not is_cold or find_spec("xdist") is None:
        return
    os.environ[COLD] = "1"
    is_whole = session.config.args_source is session.config.ArgsSource.TESTPATHS
    if is_whole and find_spec("numba") and (kept := getattr(session.config, "cache", None)):
        more = {"FLEA_CACHE_DIR": str(kept.mkdir("flea_diag")), "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "flea_diag.tools.main", "warm-up"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with (kept.mkdir("flea_diag") / COMPILING).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # which the child holds until it ends
            compiling = subprocess.Popen(
                command, env={**os.environ, **more}, pass_fds=[lock.fileno()], **quiet
            )
        session.config.add_cleanup(compiling.wait)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """There one worker reads all files of tests first: it compiles them, and the others need not.

    That takes 15 s of a processor, and as long again for each that does it at the same time.
    """
    worker = getattr(session.config, "workerinput", {}).get("workerid")
    if worker is None or COLD not in os.environ:  # a test may start pytest: that is no worker
        return (yield)
    read = Path(session.config.option.basetemp).parent / "read"
    if worker == READS_FIRST:
        try:
            return (yield)
        finally:
            read.touch()
    end, never = time.monotonic() + READ_LIMIT_S, Event()
    while not read.exists() and time.monotonic() < end:
        never.wait(0.1)
    return (yield)


def pytest_collection_finish() -> None:
    """What has been read is no garbage: no search need go through it again and again."""
    gc.freeze()
    search_less()


SHARED = "SHARED_BY_WORKERS"
"""Variable with the folder of one run of the tests: what one worker makes, the others need not."""


def _of_all_workers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That folder."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session", autouse=True)
def newcomer(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[None]:
    """Nobody has used the project before: no settings, verdicts or alarms of the user's own.

    Whatever is started is of this source tree, not of a copy that happens to be installed. Code
    that is generated, and what numba compiles, is kept for the next run by its content.
    """
    shared, kept = _of_all_workers(tmp_path_factory), getattr(request.config, "cache", None)
    generated = kept.mkdir("flea_diag") if kept else shared / "cache"
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith(STEERING)]:
            patch.delenv(name)
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        patch.setenv("FLEA_CACHE_DIR", str(generated))
        patch.setenv(SHARED, str(shared))
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("log")))
        patch.setenv("PYTHONPATH", str(ROOT))
        yield


@pytest.fixture(scope="session")
def compiled(newcomer: None) -> None:
    """What numba compiles is on the disk before a process is started that is waited for.

    It takes half a minute of a processor where there is nothing yet, and with other processes
    beside it longer than any test waits. One process compiles, the others load what it has made.
    """
    from flea_diag.configuration.component import DIAGNOSER
    from flea_sim_driver.scenario.library import find_scenario
    from flea_sim_driver.stand import SimulatedStand

    kept = Path(os.environ["FLEA_CACHE_DIR"])
    kept.mkdir(exist_ok=True)
    with (kept / COMPILING).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        DIAGNOSER.warm_up(DIAGNOSER.parameters())
        stand = SimulatedStand(find_scenario("nominal"))
        next(record for record in stand if isinstance(record, Scan))


@pytest.fixture
def domain(
    compiled: None, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[int]:
    """A ROS domain that nobody else on this machine uses, and in which nobody has said anything."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    from flea_diag.nodes.run.domain import reserved_domain

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    with reserved_domain() as number:
        yield number
