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

"""Links of the pages to the rest of the project, which the site does not hold as it is.

On a disk, or where the repository is browsed, a page links a source file and a document of the root
by relative path. In the site the same link leads to the reference of that module, or to the page
that was made of that document; a link to anything else becomes its text.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ("ARCHITECTURE", "CONTRIBUTING", "CHANGELOG", "QUALITY_DECLARATION")
"""Documents of the root that become pages below ``project``."""

LINK = re.compile(r"(?P<mark>!?)\[(?P<text>[^\]\[]*)\]\((?P<path>[^)#:\s]+)(?P<anchor>#[^)\s]*)?\)")
CORE, STAGES = "flea_diag/core/", "flea_diag/stages/"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the documents of the root."""
    for name in DOCUMENTS:
        text = (ROOT / f"{name}.md").read_text(encoding="utf-8")
        files.append(File.generated(config, f"project/{name.lower()}.md", content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Resolve the links of one page."""
    at = page.file.src_uri
    folder = "" if at.startswith("project/") else posixpath.join("docs", posixpath.dirname(at))
    if at.startswith("reference/"):
        return markdown

    def resolved(found: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join(folder, found["path"]))
        target = place(path)
        if target is None:
            return found["text"]
        page_path, _, own = target.partition("#")
        relative = posixpath.relpath(page_path, posixpath.dirname(at) or ".")
        anchor = f"#{own}" if own else found["anchor"] or ""
        return f"{found['mark']}[{found['text']}]({relative}{anchor})"

    return LINK.sub(resolved, markdown)


def place(path: str) -> str | None:
    """Where the site has a file of the project; None where it has not."""
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    if path == "README.md":
        return "index.md"
    if path.removesuffix(".md") in DOCUMENTS:
        return f"project/{path.lower()}"
    if not path.endswith(".py") or not path.startswith((CORE, STAGES)):
        return None
    dotted = path.removesuffix(".py").replace("/", ".")
    if path.startswith(STAGES):
        return f"reference/stages.md#{dotted}"
    package, _, module = path.removeprefix(CORE).partition("/")
    return f"reference/core/{package if module else 'index'}.md#{dotted}"
