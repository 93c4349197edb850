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

"""The documentation as a site: every page in the navigation, nothing loaded from elsewhere."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import yaml
from support import browser as browsers
from support.places import ROOT

CONFIGURATION = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
GENERATED = ("reference/", "project/", "notebooks/")
EXCLUDED = set(CONFIGURATION["exclude_docs"].split())
WRITTEN = {
    path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")
}  # fmt: skip

RESOURCES = {"script": "src", "link": "href", "img": "src", "source": "src", "iframe": "src"}
"""Tag -> attribute by which a browser loads something without being asked."""
FOREIGN = re.compile(r"^(https?:)?//")
IN_STYLES = re.compile(r"""url\(\s*["']?((?:https?:)?//[^)"']+)|@import\s+["']([^"']+)""")

installed = all(
    importlib.util.find_spec(name)
    for name in ("mkdocs", "material", "mkdocstrings", "latex2mathml")
)
needs_extra = pytest.mark.skipif(not installed, reason="extra `docs` is not installed")


def leaves(nav: Any) -> Iterator[str]:
    """Paths of the navigation."""
    if isinstance(nav, str):
        yield nav
    for entry in nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else ():
        yield from leaves(entry)


def test_every_page_is_in_the_navigation() -> None:
    named = list(leaves(CONFIGURATION["nav"]))
    assert len(named) == len(set(named))
    assert {name for name in named if not name.startswith(GENERATED)} == WRITTEN - EXCLUDED


def test_every_package_of_the_core_is_in_the_reference() -> None:
    packages = {path.parent.name for path in (ROOT / "flea_diag" / "core").glob("*/__init__.py")}
    named = {Path(name).stem for name in leaves(CONFIGURATION["nav"]) if "/core/" in name}
    assert named == packages | {"index"}


class Resources(HTMLParser):
    """What a page loads from another host."""

    def __init__(self) -> None:
        super().__init__()
        self.foreign: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        value = known.get(RESOURCES.get(tag, "")) or ""
        # A link to another page is followed by people; a canonical address is loaded by nobody.
        if FOREIGN.match(value) and known.get("rel") != "canonical":
            self.foreign.append(value)


def foreign(page: str) -> list[str]:
    parser = Resources()
    parser.feed(page)
    return parser.foreign


def test_what_is_loaded_from_elsewhere_is_found() -> None:
    page = (
        '<link rel="stylesheet" href="https://font.example/a.css"><script src="//cdn.example/b.js">'
        '</script><img src="c.png"><a href="https://example.org">d</a><script src="e.js"></script>'
    )
    assert foreign(page) == ["https://font.example/a.css", "//cdn.example/b.js"]
    assert IN_STYLES.search("a{background:url('https://x.example/y.woff')}")
    assert not IN_STYLES.search("a{background:url(data:image/svg+xml;charset=utf-8,x)}")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as scripts/docs does; its output must be free of warnings."""
    folder = tmp_path_factory.mktemp("site")
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "NO_MKDOCS_2_WARNING": "1",
        "DISABLE_MKDOCS_2_WARNING": "true",
        # No proxy answers there: what asks the network for anything fails.
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    assert "WARNING" not in built.stdout + built.stderr
    return folder


@needs_extra
def test_every_page_is_built(site: Path) -> None:
    named = [name.removesuffix(".md") + ".html" for name in leaves(CONFIGURATION["nav"])]
    assert [name for name in named if not (site / name).is_file()] == []


@needs_extra
def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    assert {page.name: found for page in pages if (found := foreign(page.read_text("utf-8")))} == {}
    styles = {path.name: path.read_text("utf-8") for path in site.rglob("*.css")}
    assert [name for name, text in styles.items() if IN_STYLES.search(text)] == []


@needs_extra
def test_every_equation_is_mathml(site: Path) -> None:
    page = (site / "method.html").read_text(encoding="utf-8")
    source = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    assert "arithmatex" not in page
    displayed = source.count("\n$$\n") // 2
    assert page.count('display="block"') == displayed > 10
    for equation in re.findall(r"<math.*?</math>", page, re.DOTALL):
        letters = re.sub(r"<[^>]*>", "", equation)
        assert "\\" not in letters, equation
        assert ">&<" not in equation, equation


@needs_extra
def test_the_reference_has_every_parameter_and_command(site: Path) -> None:
    from flea_diag.configuration.component import ISOLATOR
    from flea_diag.tools.main import commands
    from flea_diag.wire.parameters import descriptors

    nodes = (site / "reference" / "nodes.html").read_text(encoding="utf-8")
    known = [entry.name for entry in descriptors(ISOLATOR.parameters)]
    assert [name for name in known if f"<code>{name}</code>" not in nodes] == []
    page = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert [name for name in commands() if f'id="flea-{name}"' not in page] == []


@needs_extra
@pytest.mark.skipif(bool(browsers.missing()), reason=browsers.missing())
def test_the_search_works_on_files_and_asks_nobody(site: Path) -> None:
    with browsers.chromium() as window:
        window.open((site / "method.html").as_uri())
        window.run("document.querySelector('.md-search__input').focus()")
        window.press("causality")
        window.until("document.querySelectorAll('.md-search-result__item').length > 0")
        assert "causality" in window.text(".md-search-result__list").lower()
        assert window.foreign("") == []
