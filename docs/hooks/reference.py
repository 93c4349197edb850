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

"""Pages of the reference, made from the program itself when the site is built.

Commands from their argparse parsers, nodes and parameters from their frozen dataclasses, the
core from its docstrings (mkdocstrings). Nothing of it is typed by hand.
"""

from __future__ import annotations

import argparse
import os
import pkgutil
from collections.abc import Iterator

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import flea_diag.core
from flea_diag.core.bond_graph.law_table import law_lines
from flea_diag.nodes.executables import EXECUTABLES, program_of
from flea_diag.tools.main import commands, parser_of
from flea_diag.wire.bus.declared import Common
from flea_diag.wire.parameters import Descriptor, descriptors
from flea_diag.wire.topics import TOPIC_OF

HEAD = "| parameter | meaning | type | default | limits |\n|---|---|---|---|---|"
WIDTH = "88"
"""Columns of a help text; argparse reads them from the environment."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to those in docs."""
    for path, page in pages().items():
        content = "\n".join(page) + "\n"
        files.append(File.generated(config, f"reference/{path}.md", content=content))
    return files


def pages() -> dict[str, Iterator[str]]:
    """Path of each generated page, and its lines."""
    packages, modules = [], []
    for found in pkgutil.iter_modules(flea_diag.core.__path__, "flea_diag.core."):
        (packages if found.ispkg else modules).append(found.name)
    return {
        "commands": commands_page(),
        "nodes": nodes_page(),
        "python": python_page(),
        "core/index": docstrings_page("Core", *modules),
        **{f"core/{name.split('.')[-1]}": docstrings_page("", name) for name in packages},
        "laws": laws_page(),
        "stages": docstrings_page("", "flea_diag.stages"),
    }


def laws_page() -> Iterator[str]:
    """Every law that an element of a description may have."""
    yield "# Laws of elements\n"
    yield (
        "`law` of an element names its equation, `parameters` who plays each role. Units are those"
        " of the domain in the example; in another domain they follow from its effort and flow."
        " What is *assumed* keeps the value of the description; a calibration fits the others, as"
        " far as `base_parameters` names them and recordings tell them apart.\n"
    )
    yield from law_lines()


def commands_page() -> Iterator[str]:
    """Help of ``flea`` and of each of its commands and actions."""
    os.environ["COLUMNS"] = WIDTH
    yield "# Commands\n\nEvery help text as `--help` prints it.\n"
    parser = parser_of(commands())
    yield from _help("flea", parser)
    for name, command in _actions(parser).items():
        yield f"\n## flea {name}\n"
        yield from _help(f"flea {name}", command)
        for action, part in _actions(command).items():
            yield f"\n### flea {name} {action}\n"
            yield from _help(f"flea {name} {action}", part)


def _help(name: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    yield f'```text title="{name} --help"\n{parser.format_help().rstrip()}\n```'


def _actions(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def nodes_page() -> Iterator[str]:
    """Topics and parameters of each executable, in tables."""
    yield "# Nodes and parameters\n"
    yield (
        "Each node is an executable of the package: `ros2 run flea_diag NODE --ros-args -p "
        "NAME:=VALUE`. A parameter marked *fixed* is read at start; the others may be set while "
        "the node runs. A value outside its limits is refused with name, value and limit.\n"
    )
    for name in EXECUTABLES:
        program = program_of(name)
        yield f"\n## {name}\n\n{program.summary}\n"
        yield f"- subscribes: {_topics(program.subscribes)}"
        yield f"- publishes: {_topics(program.publishes)}\n"
        yield HEAD
        yield from map(_row, descriptors(program.parameters))
    yield f"\n## Every node\n\n{HEAD}"
    yield from map(_row, descriptors(Common))


def _topics(kinds: tuple[type, ...]) -> str:
    return ", ".join(f"`{TOPIC_OF[kind].name}`" for kind in kinds) or "nothing"


def _row(entry: Descriptor) -> str:
    unit = f" [{entry.unit}]" if entry.unit not in ("", "1") else ""
    kind = "list" if entry.kind is tuple else entry.kind.__name__
    limits = [f"at least {entry.minimum:g}"] if entry.minimum is not None else []
    limits += [f"at most {entry.maximum:g}"] if entry.maximum is not None else []
    limits += ["one of " + ", ".join(f"`{choice}`" for choice in entry.choices)] * bool(
        entry.choices
    )
    limits += ["fixed"] * entry.read_only
    default = list(entry.default) if entry.kind is tuple else entry.default
    doc = entry.doc.replace("|", "\\|")
    return f"| `{entry.name}` | {doc}{unit} | {kind} | `{default!r}` | {', '.join(limits)} |"


def python_page() -> Iterator[str]:
    """Every public name of ``import flea_diag as fd``, from its docstring."""
    yield "# Python\n\nEvery name of `import flea_diag as fd`."
    yield "[In Python](../python.md) shows them at work.\n"
    for name in flea_diag.__all__:
        found = getattr(flea_diag, name)
        if hasattr(found, "__module__"):
            yield f"\n## fd.{name}\n\n::: {found.__module__}.{found.__name__}"
            yield "    options: {show_root_heading: false, show_root_toc_entry: false}\n"


def docstrings_page(title: str, *modules: str) -> Iterator[str]:
    """Everything public of some modules, from their docstrings."""
    yield "---\nsearch: {boost: 0.5}\n---\n"  # pages that were written come first
    if title:
        yield f"# {title}\n\n{flea_diag.core.__doc__}\n"
        yield "Each package has its page; this one has what all of them use.\n"
    for name in modules:
        level = "" if title else "\n    options: {heading_level: 1}"
        yield f"\n::: {name}{level}\n"
