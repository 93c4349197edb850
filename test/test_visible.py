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

"""Control and direction characters come out as escapes wherever people read what others wrote."""

from __future__ import annotations

import ast
import io
import sys
import unicodedata
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.live import Peer
from support.places import ROOT
from support.verdicts import FIRST, FLAG

from flea_diag.errors import line_of, visible
from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.console import Plain
from flea_diag.nodes.operator.desk import Desk
from flea_diag.nodes.run.live_run import say as say_of_run
from flea_diag.tools.main import main
from flea_diag.tools.terminal import progress, say, warn
from flea_diag.web.markup import Markup, joined, tag, text

NASTY = {
    "esc": ("\x1b]0;owned\x07", r"\x1b]0;owned\x07"),
    "bell": ("a\x07b", r"a\x07b"),
    "backspace": ("jam\b\b\bok ", r"jam\x08\x08\x08ok "),
    "carriage return": ("jam\rok ", r"jam\rok "),
    "delete": ("a\x7fb", r"a\x7fb"),
    "c1": ("a\x9b2Jb", r"a\x9b2Jb"),
    "override": ("a\u202egpj.b", r"a\u202egpj.b"),
    "isolate": ("a\u2066b\u2069", r"a\u2066b\u2069"),
    "mark": ("a\u200fb\u200e", r"a\u200fb\u200e"),
    "zero width": ("ja\u200bm", r"ja\u200bm"),
    "line separator": ("a\u2028b", r"a\u2028b"),
    "tag": ("a\U000e0041b", r"a\U000e0041b"),
    "surrogate": ("a\udc9bb", r"a\udc9bb"),
    "null": ("a\x00b", r"a\x00b"),
}
ALL = "".join(raw for raw, _ in NASTY.values())
RAW = {c for c in ALL if not c.isprintable()}

each = pytest.mark.parametrize(("raw", "escaped"), NASTY.values(), ids=NASTY)


def clean(out: str) -> bool:
    return not RAW & set(out)


@each
def test_a_character_that_is_not_seen_becomes_its_escape(raw: str, escaped: str) -> None:
    assert visible(raw) == escaped
    assert line_of(raw) == escaped


def test_of_all_characters_just_these_are_escaped() -> None:
    for code in range(sys.maxunicode + 1):
        char = chr(code)
        hidden = unicodedata.category(char) in ("Cc", "Cf", "Cs", "Zl", "Zp")
        assert (visible(char) != char) == (hidden and char not in "\n\t")


def test_what_is_meant_stays() -> None:
    for words in ("µ °C – 漢字 עברית", "two\n\tlines", "a\u00a0b", "", "\\x1b"):
        assert visible(words) == words
    assert line_of("two\n\tlines") == r"two\n\tlines"


@each
def test_the_terminal_of_a_command(raw: str, escaped: str, capsys: Any) -> None:
    warn(f"{raw}: refused")
    say(f"{raw}: sound")
    say(raw, file=sys.stderr)
    told = capsys.readouterr()
    assert told.err == f"flea: {escaped}: refused\n{escaped}\n"
    assert told.out == f"{escaped}: sound\n"


@each
def test_the_progress_of_a_command(
    raw: str, escaped: str, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    progress(1, 2, raw)
    assert capsys.readouterr().err == f"\r\x1b[K[1/2] {escaped}"


@each
def test_the_error_line_of_a_command(raw: str, escaped: str, capsys: Any) -> None:
    name = raw.replace("\x00", "")  # no file has that in its name
    assert main(["diff", f"/no/{name}", "/no"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert clean(told.rstrip("\n"))
    assert escaped.replace(r"\x00", "") in told


@each
def test_the_lines_of_a_live_run(raw: str, escaped: str, capsys: Any) -> None:
    say_of_run(raw)
    assert capsys.readouterr().err == f"run: {escaped}\n"


def test_the_log_of_a_node(domain: int, capfd: Any) -> None:
    name = ALL.replace("\udc9b", "").replace("\x00", "")
    with Peer(domain, name="writer") as writer:
        for log in (writer.bus.info, writer.bus.caution, writer.bus.warn, writer.bus.error):
            log(name)
    told = capfd.readouterr().err
    assert told.count(line_of(name)) == 4
    assert clean(told)


@pytest.fixture
def nasty_desk(tmp_path: Path) -> Desk:
    desk = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Ada")
    member = replace(FIRST.members[0], fault=f"jam{ALL}")
    desk.take(replace(FLAG, residual=f"parity{ALL}"))
    desk.take(replace(FIRST, words=f"words{ALL}", members=(member, *FIRST.members[1:])))
    return desk


def test_the_lines_and_the_page_of_the_console(nasty_desk: Desk) -> None:
    out = io.StringIO()
    plain = Plain(nasty_desk, out)
    plain.line()
    plain.page()
    assert clean(out.getvalue().replace("\x1b[H\x1b[2J", ""))
    assert out.getvalue().count(line_of(ALL)) >= 3


def test_the_screen_of_the_console(nasty_desk: Desk) -> None:
    import asyncio

    pytest.importorskip("textual", reason="the screen needs Textual: pip install textual")
    from textual.widgets import OptionList, Static

    from flea_diag.nodes.operator.console_app import ConsoleApp

    async def play() -> None:
        app = ConsoleApp(nasty_desk)
        async with app.run_test(size=(240, 60)) as pilot:
            await pilot.pause()
            screen = app.screen_stack[0]
            screen._tell(f"marked: [/{ALL}")  # brackets are no markup, either
            screen.redraw()
            await pilot.pause()
            drawn = [str(part.render()) for part in screen.query(Static)]
            for options in screen.query(OptionList):
                drawn += [str(option.prompt) for option in options.options]
            assert all(map(clean, drawn))
            assert f"marked: [/{visible(ALL)}" in drawn
            assert sum(visible(ALL) in words for words in drawn) >= 4

    asyncio.run(play())


@each
def test_the_markup_of_the_page(raw: str, escaped: str) -> None:
    assert tag("b", raw, title=raw) == f'<b title="{escaped}">{escaped}</b>'
    assert joined(raw, Markup("<br>")) == f"{escaped}<br>"
    assert f">{escaped}</text>" in text(0.0, 0.0, raw)


def test_the_report_of_an_evaluation() -> None:
    pytest.importorskip("jinja2", reason="the report needs jinja2")
    from flea_diag.tools.score.report import _template
    from flea_diag.tools.score.report_charts import group_steps

    group = {"at_s": 1.0, "outcome": "DETECTED", "episode": 1, "dropped": {}, "words": ALL}
    group["members"] = [[f"jam{ALL}", 1.0]]
    drawn = group_steps([group], 20.0, [(1.0, f"mark{ALL}", "truth")])
    assert clean(drawn)
    environment = _template("report.html").environment
    made = environment.from_string("{{ a }} {{ b }} {{ [a, a] | join(', ') }}").render(
        a=f"<{ALL}", b=Markup("<br>")
    )
    assert made == "&lt;{0} <br> &lt;{0}, &lt;{0}".format(visible(ALL))


def test_no_command_prints_past_the_terminal() -> None:
    """Commands print through ``terminal``; its few peers are known."""
    known = {
        "tools/terminal.py",
        "tools/main.py",
        "nodes/main.py",
        "nodes/recording/recorder.py",
        "nodes/run/live_run.py",
        "wire/bus/program.py",
    }
    package = ROOT / "flea_diag"
    found = {
        str(path.relative_to(package))
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print"
    }
    assert found == known
