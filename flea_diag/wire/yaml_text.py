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

"""YAML of others, read safely: plain values alone, of bounded size, and one kind of error.

A few hundred bytes of aliases or merge keys can stand for more values than fit into any memory.
So a document is counted as if every alias were written out, while it is composed and before
anything is made of it.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser, ParserError
from yaml.reader import Reader, ReaderError
from yaml.resolver import Resolver
from yaml.scanner import Scanner, ScannerError

from flea_diag.errors import shown

try:
    from yaml.cyaml import CParser
except ImportError:  # PyYAML was built without libyaml
    CParser = None

LARGEST_TEXT = 1 << 20
"""Characters."""
MOST_VALUES = 100_000
"""Keys and values of a document, aliases and merge keys written out."""
DEEPEST = 50
LONGEST_NUMBER = 100
"""Characters of a number, date or truth value."""
LONGEST_KEY = 80
"""Characters of a key, which messages name: all of them are such as can be shown."""
LONGEST_PROBLEM = 160

# What Python makes of a date, number or tag that is none.
_UNREADABLE = (ValueError, LookupError, AttributeError, TypeError, OverflowError)
_SYNTAX = (ScannerError, ParserError, ReaderError, UnicodeEncodeError)
_MERGE = "tag:yaml.org,2002:merge"
_TEXTS = ("tag:yaml.org,2002:str", "tag:yaml.org,2002:binary")


class _Extent(NamedTuple):
    """Of a node with its aliases written out."""

    values: int
    depth: int


_SCALAR = _Extent(1, 1)


class PythonEvents(Reader, Scanner, Parser):  # type: ignore[misc,unused-ignore]
    """Events of a text by PyYAML alone; libyaml, where it is there, is ten times as fast."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)


class _BoundedLoader(Composer, SafeConstructor, Resolver):  # type: ignore[misc,unused-ignore]
    """Composes no more than the limits of this module allow, from the events of either parser."""

    def __init__(self) -> None:
        for part in (Composer, SafeConstructor, Resolver):
            part.__init__(self)
        self._composed = self._depth = 0
        self._extents: dict[yaml.Node, _Extent] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Node of the next event, within the limits."""
        event = self.peek_event()
        self._composed += 1
        self._depth += 1
        if self._composed > MOST_VALUES or self._depth > DEEPEST:
            self._bound(_Extent(self._composed, self._depth), event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if type(event) is yaml.AliasEvent and node not in self._extents:
            raise _refusal("an alias that refers to what it stands in", event.start_mark)
        if type(event) is yaml.ScalarEvent:
            self._extents[node] = _SCALAR
            _check_number(node)
            return node
        if type(event) is not yaml.AliasEvent:
            self._extents[node] = self._extent(node)
        self._bound(self._extents[node], event.start_mark)
        return node

    def _extent(self, node: Any) -> _Extent:
        parts = node.value
        if isinstance(node, yaml.MappingNode):
            _check_keys([key for key, _ in node.value])
            parts = [part for pair in node.value for part in pair]
        inner = [self._extents[part] for part in parts]
        depth = max((each.depth for each in inner), default=0)
        return _Extent(1 + sum(each.values for each in inner), 1 + depth)

    @staticmethod
    def _bound(extent: _Extent, mark: Any) -> None:
        if extent.values > MOST_VALUES:
            raise _refusal(f"more than {MOST_VALUES} values, with its aliases written out", mark)
        if extent.depth > DEEPEST:
            raise _refusal(f"nested deeper than {DEEPEST} levels", mark)

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """Value of a node."""
        try:
            return super().construct_object(node, deep)
        except _UNREADABLE as error:
            said = shown(node.value) if isinstance(node, yaml.ScalarNode) else "this"
            kind = node.tag.rpartition(":")[2]
            raise _refusal(f"{said} is no {kind}", node.start_mark) from error


def loader_of(events: Any) -> Any:
    """Class of loaders that take the events of this parser."""

    class Loader(_BoundedLoader, events):  # type: ignore[misc,valid-type,unused-ignore]
        def __init__(self, text: str) -> None:
            events.__init__(self, text)
            _BoundedLoader.__init__(self)

    return Loader


LOADERS = tuple(loader_of(events) for events in (CParser, PythonEvents) if events)
"""The last one decides what is YAML and says why not: libyaml takes less of what is in brackets."""


def _check_keys(nodes: list[Any]) -> None:
    """Each can be shown and stands there once: of two values the later would win in silence."""
    seen = set()
    for node in nodes:
        _check_key(node)
        if isinstance(node, yaml.ScalarNode) and node.tag != _MERGE:
            if (node.tag, node.value) in seen:
                raise _refusal(f"the key {shown(node.value)} occurs twice", node.start_mark)
            seen.add((node.tag, node.value))


def _check_key(node: Any) -> None:
    text = node.value if isinstance(node, yaml.ScalarNode) else ""
    if len(text) > LONGEST_KEY or not text.isprintable():
        words = f"a key of at most {LONGEST_KEY} characters that can be shown"
        raise _refusal(f"{shown(text)} is not {words}", node.start_mark)


def _check_number(node: Any) -> None:
    if node.tag not in _TEXTS and len(node.value) > LONGEST_NUMBER:
        words = f"a number of {len(node.value)} characters, at most {LONGEST_NUMBER} are read"
        raise _refusal(words, node.start_mark)


def _refusal(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def parse_yaml(text: str) -> Any:
    """What a text says.

    Raises
    ------
    ValueError
        Where it is none or exceeds a limit of this module, in one line with the place; the text
        itself is not quoted, but for the value at that place.
    """
    if len(text) > LARGEST_TEXT:
        raise ValueError(f"{len(text)} characters, at most {LARGEST_TEXT} are read")
    try:
        for loader_type in LOADERS[:-1]:
            with suppress(*_SYNTAX):
                return _loaded(loader_type, text)
        return _loaded(LOADERS[-1], text)
    except yaml.YAMLError as error:
        raise ValueError(_words(error)) from error
    except RecursionError as error:
        raise ValueError("nested too deep") from error


def _loaded(loader_type: Any, text: str) -> Any:
    loader = loader_type(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def _words(error: yaml.YAMLError) -> str:
    """What is wrong and where, without the lines of the text that the parser would show."""
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "no YAML"
    mark = getattr(error, "problem_mark", None)
    place = f" (line {mark.line + 1}, column {mark.column + 1})" if mark else ""
    return f"{_printable(problem)}{place}"


def _printable(problem: str) -> str:
    """Words of the parser, which quote an alias or a tag as long as it is."""
    words = "".join(c if c.isprintable() else repr(c)[1:-1] for c in problem[:LONGEST_PROBLEM])
    return words if len(problem) <= LONGEST_PROBLEM else f"{words}..."
