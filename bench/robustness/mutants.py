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

"""How many small errors in the decisions of core the tests of core and stages find.

pip install cosmic-ray==8.4.6
python bench/robustness/mutants.py --count 80 --seed 1 --json mutants.json
python bench/robustness/mutants.py --count 80 --cpu-minutes 30      as many of them as fit

cosmic-ray makes the errors: another comparison, another operation, a condition turned round, a
number one off, a loop that does not run. Each of a sample of them, drawn by the seed, is made in a
copy of the sources, and tests try to find it: first the files of its package that import its
module, then the others of the package, then the quick ones of the stage that rests on it. Survivors
are printed as diffs, to be read: some change nothing that can be observed. An error that is found
takes about 5 s of a processor, one that survives a minute.
"""

from __future__ import annotations

import argparse
import importlib
import os
import random
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from functools import cache, partial
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("hypothesis", "numba", "pywt", "scipy.optimize", "scipy.signal", "scipy.stats", "yaml")
STAGES = {"detection": "observer", "isolation": "isolator", "likelihood": "isolator",
          "evidence": "evidence", "run_law": "evidence"}  # fmt: skip
"""Packages of core that decide, and the stage whose tests run each."""
KINDS = ("ReplaceComparisonOperator", "ReplaceBinaryOperator", "AddNot", "ReplaceAndWithOr",
         "ReplaceOrWithAnd", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "NumberReplacer",
         "ZeroIterationForLoop", "ReplaceBreakWithContinue",
         "ReplaceContinueWithBreak")  # fmt: skip
UNUSED = ("_BitOr", "_Is", "Mod", "Pow", "Shift", "_BitXor", "_BitAnd", "_FloorDiv")
"""A bar is mostly that of a type and of numbers an error that any run shows, ``is`` mostly asks for
None, and the others nobody mistypes."""
COPIED = (
    "flea_diag",
    "flea_sim_driver",
    "test",
    "config",
    "bags",
    "docs",
    "bench",
    "pyproject.toml",
)
LIMIT_S = 240
"""Of a processor: an error that makes tests run for ever is found, too."""


@dataclass(frozen=True)
class Mutant:
    """The k-th place in a module where an operator of cosmic-ray can act, and its line."""

    module: Path
    operator: str
    place: int
    line: int

    def sources(self) -> tuple[str, str]:
        """As they are, and with the error."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        text = (ROOT / self.module).read_text(encoding="utf-8")
        return text, str(mutate_code(text, get_operator(self.operator)(), self.place))

    def difference(self) -> str:
        """What is another."""
        before, after = self.sources()
        old, new = before.splitlines(), after.splitlines()
        return "\n".join(unified_diff(old, new, str(self.module), n=1, lineterm=""))


def mutants(packages: Sequence[str]) -> Iterator[Mutant]:
    """All of them."""
    from cosmic_ray.ast import get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    kinds = [
        name
        for name in operator_names()
        if name.removeprefix("core/").startswith(KINDS) and not any(u in name for u in UNUSED)
    ]
    for package in packages:
        for path in sorted((ROOT / "flea_diag/core" / package).rglob("*.py")):
            nodes = list(_nodes(get_ast(path.read_text(encoding="utf-8"))))
            for kind in kinds:
                operator = get_operator(kind)()
                lines = [
                    start[0] for node in nodes for start, _ in operator.mutation_positions(node)
                ]
                for place, line in enumerate(lines):
                    yield Mutant(path.relative_to(ROOT), kind, place, line)


def _nodes(node: object) -> Iterator[object]:
    yield node
    for child in getattr(node, "children", ()):
        yield from _nodes(child)


def tests_of(module: Path) -> list[list[str]]:
    """Arguments of pytest, to try after each other; files that import the module come first."""
    package, name = module.parts[2], ".".join(module.with_suffix("").parts)
    own, stage = (
        sorted(map(str, Path(folder).rglob("test_*.py")), key=partial(_importance, name))
        for folder in (f"test/core/{package}", f"test/stages/{STAGES[package]}")
    )
    return [own, ["-m", "not slow", *stage]]


def _importance(name: str, file: str) -> tuple[bool, int, str]:
    text = Path(file).read_text(encoding="utf-8")
    return name not in text, len(text), file


def is_found(mutant: Mutant) -> bool:
    """Whether some test fails with the error, or runs for ever; in the copy."""
    before, after = mutant.sources()
    mutant.module.write_text(after, encoding="utf-8")
    try:
        tests = enumerate(tests_of(mutant.module))
        finding = next((place for place, given in tests if _fail(given)), None)
    finally:
        mutant.module.write_text(before, encoding="utf-8")
    return finding is not None and _pass_unharmed(mutant.module.parts[2], finding)


@cache
def _pass_unharmed(package: str, place: int) -> bool:
    """The same tests without any error made."""
    if _fail(tests_of(Path("flea_diag/core", package, "none.py"))[place]):
        raise SystemExit(f"{package}: tests fail without any error made")
    return True


def _fail(arguments: Sequence[str]) -> bool:
    """Run tests in a child that has read all libraries already, and nothing of ours."""
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
        os.dup2(os.open(os.devnull, os.O_RDWR), 1)
        os.dup2(1, 2)
        sys.path.insert(0, os.getcwd())
        sys.dont_write_bytecode = False  # or all tests were compiled each time
        os._exit(pytest.main(["-q", "-x", "-n", "0", *arguments]))
    return os.waitpid(child, 0)[1] != 0


def main() -> None:
    """Draw, try, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to FILE")
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--packages", nargs="+", default=[*STAGES], metavar="PACKAGE")
    parser.add_argument("--cpu-minutes", type=float, default=float("inf"), metavar="MIN")
    given = parser.parse_args()
    every = list(mutants(given.packages))
    drawn: Sequence[Mutant] = random.Random(given.seed).sample(every, given.count)
    print(f"{len(every)} errors can be made in {', '.join(given.packages)}", flush=True)
    found = tried = 0
    for library in LIBRARIES:
        importlib.import_module(library)
    os.environ.update(OMP_NUM_THREADS="1", CI="1")
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as copy:
        os.chdir(copy)
        for part in COPIED:
            (shutil.copytree if (ROOT / part).is_dir() else shutil.copy)(ROOT / part, part)
        for mutant in drawn:
            if used_s() > 60.0 * given.cpu_minutes:
                break
            begun_s, is_one = used_s(), is_found(mutant)
            tried, found = tried + 1, found + is_one
            said = f"{tried:3d} {'found' if is_one else 'SURVIVED'} {used_s() - begun_s:.0f} s"
            print(f"{said} {mutant.module}:{mutant.line} {mutant.operator}", flush=True)
            if not is_one:
                print(mutant.difference(), flush=True)
        os.chdir(here)
    sys.path[:0] = [str(ROOT), str(ROOT / "bench")]  # of ours only now: children have the copy's
    from summary import share, write_summary

    figure = share("errors found", found, tried, seed=str(given.seed))
    print(f"{figure.name}: {found} of {tried}, {used_s() / 60.0:.0f} minutes of a processor")
    write_summary("bench/robustness/mutants.py", [figure], given.json)


def used_s() -> float:
    """Time of a processor that tests took so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
