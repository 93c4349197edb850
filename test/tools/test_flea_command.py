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

"""The ``flea`` command itself: help, version, and how errors and interruptions end."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.decisions import BAGS

from flea_diag import __version__, tools
from flea_diag.errors import CalibrationError
from flea_diag.tools.main import MODULES, commands, main, parser_of
from flea_diag.tools.recordings import importer
from flea_diag.wire.bags.bag import BagWriter
from flea_diag.wire.records import Scan


def test_every_subcommand_has_its_four_names() -> None:
    known = commands()
    assert {"import", "replay", "bag", "recover"} <= known.keys()
    for name, module in known.items():
        assert name == module.NAME
        assert module.SUMMARY
        parser = argparse.ArgumentParser()
        module.add_arguments(parser)
        assert callable(module.run)


def test_every_tool_is_listed() -> None:
    folder = Path(tools.__file__).parent
    found = {
        ".".join(path.relative_to(folder).with_suffix("").parts)
        for path in folder.rglob("*.py")
        if "\nNAME = " in path.read_text(encoding="utf-8")
    }
    assert found == set(MODULES.values())


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as version:
        main(["--version"])
    assert version.value.code == 0
    assert capsys.readouterr().out == f"flea_diag {__version__}\n"
    with pytest.raises(SystemExit) as explained:
        main(["replay", "--help"])
    assert explained.value.code == 0
    assert "examples:" in capsys.readouterr().out


def loaded_by(*arguments: str, without: str = "") -> set[str]:
    """Modules that a command has imported when it ends, where another is not installed."""
    program = f"""
import contextlib, sys
if {without!r}: sys.modules[{without!r}] = None
from flea_diag.tools.main import main
with contextlib.suppress(SystemExit): assert main({list(arguments)}) == 0
print(*(name for name, module in sys.modules.items() if module))
"""
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def test_help_imports_nothing_slow() -> None:
    loaded = loaded_by("--help")
    assert "flea_diag.tools.replay.replay" in loaded
    slow = {"numpy", "scipy", "yaml", "matplotlib", "rclpy", "flea_diag.wire.records"}
    assert not slow & loaded


@pytest.mark.slow
def test_a_healthy_replay_imports_no_scipy_and_no_extra() -> None:
    """Each takes longer than the recording; what is derived from a stand is kept from before."""
    loaded_by("replay", str(BAGS / "nominal"), "-q", without="numba")
    loaded = loaded_by("replay", str(BAGS / "nominal"), "-q", without="numba")
    assert "flea_diag.stages.observer.observer" in loaded
    assert not {"scipy", "numba", "pandas", "matplotlib", "rclpy", "sklearn"} & loaded
    # Whether a shift is another unit is asked with its functions.
    assert "scipy.special" in loaded_by("replay", str(BAGS / "jam"), "-q", without="numba")


@pytest.mark.slow
def test_compiled_a_healthy_replay_imports_of_scipy_what_numba_does() -> None:
    pytest.importorskip("numba")
    loaded_by("replay", str(BAGS / "nominal"), "-q")
    loaded = loaded_by("replay", str(BAGS / "nominal"), "-q")
    assert "numba" in loaded
    assert not {"scipy.special", "scipy.optimize", "scipy.signal", "pandas", "rclpy"} & loaded


@pytest.mark.parametrize("arguments", [[], ["dance"], ["import"], ["replay", "--colour"]])
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        main(arguments)
    assert refused.value.code == 2


@pytest.mark.parametrize(
    ("raised", "status", "words"),
    [
        (CalibrationError("run.bag: no motion"), 2, "flea: run.bag: no motion\n"),
        (KeyboardInterrupt(), 130, "flea: interrupted\n"),
    ],
)
def test_how_errors_end(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    raised: BaseException,
    status: int,
    words: str,
) -> None:
    def fail(_: argparse.Namespace) -> int:
        raise raised

    monkeypatch.setattr(importer, "run", fail)
    assert main(["import", "x", "-o", "y"]) == status
    assert capsys.readouterr().err == words


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    """``flea bag check ... | head -1`` ends quietly."""
    with BagWriter(tmp_path / "run") as bag:
        bag.write(Scan(10**18, ("a",), (1.0,)))
    command = [sys.executable, "-m", "flea_diag.tools.main", "bag", "check"]
    process = subprocess.Popen(
        [*command, *[str(tmp_path / "run")] * 3000],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 0


def test_ctrl_c_in_mid_work_ends_with_130(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as bag:
        bag.write(Scan(10**18, ("a",), (1.0,)))
    command = [sys.executable, "-m", "flea_diag.tools.main", "bag", "check"]
    process = subprocess.Popen(
        [*command, *[str(tmp_path / "run")] * 3000],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    assert process.returncode == 130
    assert errors == b"flea: interrupted\n"


def without_privileges() -> list[str]:
    """Before a command: root without its capabilities is refused like anybody else."""
    if os.geteuid() != 0:
        return []
    if shutil.which("setpriv") is None:
        pytest.skip("root may read everything, and there is no setpriv (util-linux)")
    return ["setpriv", "--bounding-set=-all", "--inh-caps=-all"]


def test_a_folder_that_is_closed_is_said_to_be_so(tmp_path: Path) -> None:
    """To most of what Python asks of a folder it looks like an empty one."""
    closed = tmp_path / "closed"
    with BagWriter(closed) as bag:
        bag.write(Scan(10**18, ("a",), (1.0,)))
    closed.chmod(0)
    asked = [
        ["replay", str(closed)],
        ["trend", str(closed)],
        ["recover", str(closed)],
        ["bag", "check", str(closed)],
        ["diff", str(closed), str(closed)],
        ["evaluate", str(closed), "-o", str(tmp_path / "out")],
    ]
    code = f"from flea_diag.tools.main import main; print([main(a) for a in {asked!r}][-1])"
    done = subprocess.run(
        [*without_privileges(), sys.executable, "-c", code],
        capture_output=True,
        text=True,
    )
    closed.chmod(0o700)
    assert done.returncode == 0, done.stderr
    said = (done.stdout + done.stderr).splitlines()
    refusals = [line for line in said if line.endswith(f"cannot read {closed}: Permission denied")]
    assert len(refusals) == len(asked), said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["repaly", "bags/jam"], "'recover'; did you mean replay?"),
        (["replay", "bags/jam", "--jsn"], "unknown argument '--jsn'; did you mean --json?"),
        (
            ["stand", "new", "./x", "--form", "a.csv"],
            "unknown argument '--form'; did you mean --from",
        ),
        (["stand", "nwe"], "'nwe' is unknown, choose from 'new', 'check'; did you mean new?"),
        (["diff", "a", "b", "c"], "flea diff: error: unknown argument 'c'"),
    ],
)
def test_a_typo_is_blamed_on_the_word_that_is_wrong(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["replay", str(BAGS / "jma")], str(BAGS / "jam")),
        (["export", str(BAGS / "nominl"), "-o", "x.csv"], str(BAGS / "nominal")),
        (["replay", str(BAGS / "jam"), "--stand", "jiont"], "joint"),
        (["simulate", "nominal", "--fault", "winding_shot", "-o", "x"], "winding_short"),
    ],
)
def test_a_name_that_is_not_there_comes_with_a_like_one(
    capsys: pytest.CaptureFixture[str], arguments: list[str], word: str
) -> None:
    assert main(arguments) in (1, 2)  # one of several, or the only one
    assert f", did you mean {word}" in capsys.readouterr().err.replace(";", ",")


def test_the_shell_is_told_what_may_come_next(tmp_path: Path) -> None:
    answer = tmp_path / "answer"
    asked = {"COMP_LINE": "flea repl", "COMP_POINT": "9", "_ARGCOMPLETE": "1"}
    where = {"_ARGCOMPLETE_STDOUT_FILENAME": str(answer)}
    command = [sys.executable, "-m", "flea_diag.tools.main"]
    subprocess.run(command, env={**os.environ, **asked, **where}, check=True)
    assert answer.read_text(encoding="utf-8").strip() == "replay"


def test_json_is_one_switch(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Alone it prints nothing but JSON, with a name it writes the same."""
    assert main(["replay", str(BAGS / "nominal"), "--json", "-q"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert main(["replay", str(BAGS / "nominal"), "--json", str(tmp_path / "x.json")]) == 0
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == printed


def test_every_command_that_tells_something_has_the_switch() -> None:
    """What is told on standard output is told as JSON, too, everywhere by the same words."""
    for parser in _parsers():
        options = {option: a for a in parser._actions for option in a.option_strings}
        assert "--json" in options, parser.prog
        assert (options["--json"].nargs, options["--json"].const) == ("?", "-")


def test_json_written_elsewhere_leaves_the_words(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "drawn.json"
    given = ["scenarios", "table4", "-o", str(tmp_path / "t"), "--json", str(target)]
    assert main(given) == 0
    rows = json.loads(target.read_text(encoding="utf-8"))
    names = {path.stem for path in (tmp_path / "t").glob("*.yaml")}
    assert {row["scenario"] for row in rows} == names
    assert any(row["faults"] for row in rows)
    assert "320 scenarios" in capsys.readouterr().err


def test_a_recording_behind_json_is_not_overwritten(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """An option whose value may be left out takes the next word."""
    table = tmp_path / "run.csv"
    table.write_text("time_s\n", encoding="utf-8")
    for given in (
        ["import", "--json", str(table), str(table), "-o", str(tmp_path / "bags")],
        ["replay", "--json", str(BAGS / "jam"), str(BAGS / "nominal")],
    ):
        with pytest.raises(SystemExit) as ended:
            main(given)
        assert ended.value.code == 2
        assert "put --json after the other arguments" in capsys.readouterr().err
    assert table.read_text(encoding="utf-8") == "time_s\n"


def _parsers() -> Iterator[argparse.ArgumentParser]:
    """Of each command, or of each of its actions."""
    (parts,) = (
        a for a in parser_of(commands())._actions if isinstance(a, argparse._SubParsersAction)
    )
    for command in parts.choices.values():
        actions = [a for a in command._actions if isinstance(a, argparse._SubParsersAction)]
        yield from actions[0].choices.values() if actions else (command,)


def test_every_help_has_examples_and_says_how_the_command_ends() -> None:
    parser = parser_of(commands())
    (parts,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    for name, command in parts.choices.items():
        actions = [a for a in command._actions if isinstance(a, argparse._SubParsersAction)]
        inner = list(actions[0].choices.values()) if actions else []
        for each in (command, *inner):
            said = each.format_help()
            assert f"  flea {name}" in said, each.prog
            assert "exit status: 0 " in said.lower(), each.prog
