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

"""Python functions generated from expressions: ``name(p, x)`` of parameters and signals.

``p`` has the parameters as attributes (a dataclass, or a record for numba), ``x`` is any sequence
of signals: numbers of one scan, or columns of many. numba compiles the same source. Tracebacks and
profilers find its lines in the file that a keeper names, or without one in memory.
"""

from __future__ import annotations

import hashlib
import inspect
import linecache
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FunctionType, MappingProxyType
from typing import Any

from flea_diag.core.symbolic.expression import Constant, Expression, symbols, text

SCOPE = {"fabs": abs, "__builtins__": {}}
"""Functions that generated code may call on numbers and columns alike, to the same bits.

Others, such as tanh, numpy and the mathematics library round differently."""

Keeper = Callable[[str, str], str]
"""Takes digest and text of a source, and returns the name of the file that now holds it."""
Results = Sequence[Expression] | Sequence[Sequence[Expression]]


def function_source(
    name: str,
    doc: str,
    signals: Sequence[str],
    results: Results,
    first: Mapping[str, Expression] = MappingProxyType({}),
) -> str:
    """Source of ``name(p, x)``, which returns a tuple of the results, or a tuple of tuples.

    Names that are no signals are parameters. ``first`` are computed once, under names of their own.
    """
    flat = [e for r in results for e in ((r,) if isinstance(r, Expression) else r)]
    flat += first.values()
    used = list(dict.fromkeys(n for expression in flat for n in symbols(expression)))
    used = [n for n in used if n not in first]
    lines = [f"def {name}(p, x):", f'    """{doc}"""']
    lines += [f"    {n} = x[{signals.index(n)}]" for n in used if n in signals]
    lines += [f"    {n} = p.{n}" for n in used if n not in signals]
    lines += [f"    {n} = {text(expression)}" for n, expression in first.items()]
    lines += ["    return (", *(f"        {_entry(result)}," for result in results), "    )"]
    return "\n".join([*lines, "", ""])


def _entry(result: Expression | Sequence[Expression]) -> str:
    if isinstance(result, Constant):
        return repr(result.value)  # a float, so that all entries have one type
    if isinstance(result, Expression):
        return text(result)
    return "(" + " ".join(f"{_entry(expression)}," for expression in result) + ")"


def in_memory(digest: str, source: str) -> str:
    """The keeper without files."""
    place = f"<generated {digest}>"
    # Without a modification time the entry stays in the cache.
    linecache.cache[place] = (len(source), None, source.splitlines(keepends=True), place)
    return place


_keepers: list[Keeper] = [in_memory]


def keep_with(keeper: Keeper) -> None:
    """Have this keeper name the files of all generated code."""
    _keepers[:] = [keeper]


def compiled(
    source: str, known: Mapping[str, Any] = MappingProxyType({})
) -> Mapping[str, FunctionType]:
    """Functions of a generated source; each carries its part of it as the attribute ``source``.

    ``known`` are functions that it may call beside those of ``SCOPE``. A part is the function with
    those that it calls: what is compiled of them is the same whatever else stands in the source.
    """
    place = _keepers[0](hashlib.sha256(source.encode()).hexdigest(), source)
    scope: dict[str, Any] = {**SCOPE, **known}
    exec(compile(source, place, "exec"), scope)  # text of our own expressions
    own = (name for name in scope if name not in known)
    made = {name: scope[name] for name in own if isinstance(scope[name], FunctionType)}
    for name, part in made.items():
        part.source = "".join(_texts(source, name, made))
    return made


def _texts(source: str, name: str, made: Mapping[str, FunctionType]) -> Iterator[str]:
    """The lines of a function, and of those of the same source that it calls."""
    lines, called = source.splitlines(keepends=True), [name]
    for each in called:
        yield "".join(inspect.getblock(lines[made[each].__code__.co_firstlineno - 1 :]))
        called += [n for n in made[each].__code__.co_names if n in made and n not in called]
