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

"""Everything that users hold on to by name, one line each; ``surface.txt`` keeps the list.

``python test/support/programs/surface.py`` renews it. A line that is gone is something that
users lose: CHANGELOG.md then says what to write instead.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[3]
KEPT = ROOT / "test/project/surface.txt"
SHIPPED = (
    "config/campaigns/*.yaml", "config/languages/*.yaml", "config/machines/*.yaml",
    "config/scenarios/**/*.yaml", "config/stands/*/*.yaml", "config/templates/*.yaml",
    "docs/**/*.md", "docs/notebooks/*.ipynb", "launch/*.py", "launcher/*", "scripts/*",
)  # fmt: skip
"""Files that are named by users: on a command line, in an address, in a list of their own."""


def surface() -> list[str]:
    """Commands with their options, the Python interface, nodes, topics, outcomes, files."""
    return sorted({*_commands(), *_nodes(), *_names(), *_files()})


def _commands() -> Iterator[str]:
    from flea_diag.tools.main import commands, parser_of

    return _options(parser_of(commands()), "flea")


def _options(parser: argparse.ArgumentParser, command: str) -> Iterator[str]:
    yield f"command {command}"
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, part in action.choices.items():
                yield from _options(part, f"{command} {name}")
            continue
        for name in action.option_strings or (action.dest,):
            yield f"command {command}: {name}"
            yield from (f"command {command}: {name} {choice}" for choice in action.choices or ())


def _nodes() -> Iterator[str]:
    from flea_diag.nodes.executables import EXECUTABLES, program_of
    from flea_diag.wire.bus.declared import Common
    from flea_diag.wire.parameters import descriptors
    from flea_diag.wire.topics import TOPIC_OF

    for parameter in descriptors(Common):
        yield f"node: {parameter.name}"
    for name in EXECUTABLES:
        program = program_of(name)
        yield f"node {name}"
        for parameter in descriptors(program.parameters):
            yield f"node {name}: {parameter.name}"
            yield from (f"node {name}: {parameter.name} {c}" for c in parameter.choices)
        yield from (f"node {name} reads {TOPIC_OF[kind].name}" for kind in program.subscribes)
        yield from (f"node {name} writes {TOPIC_OF[kind].name}" for kind in program.publishes)


def _names() -> Iterator[str]:
    import flea_diag
    from flea_diag.formats import FORMATS
    from flea_diag.tools.tables.readers import READERS
    from flea_diag.wire.topics import TOPICS
    from flea_diag.wire.vocabulary import Outcome

    for topic in TOPICS:
        yield f"topic {topic.name} {topic.message} {topic.record.__name__}"
    yield from (f"outcome {outcome.value}" for outcome in Outcome)
    for kind, known in FORMATS.items():
        yield f"format {kind} {known.oldest} to {known.version}"
    yield from (f"table {ending}" for ending in READERS)
    yield from (f"python flea_diag.{name}" for name in flea_diag.__all__)


def _files() -> Iterator[str]:
    for pattern in SHIPPED:
        for path in ROOT.glob(pattern):
            if path.is_file():
                yield f"file {path.relative_to(ROOT).as_posix()}"


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    KEPT.write_text("\n".join(surface()) + "\n", encoding="utf-8")
