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
python bench/robustness/mutants.py --count 60 --seed 1 --json mutants.json

cosmic-ray makes the errors: another comparison, another operation, a condition turned round, a
number one off, a loop that does not run. Each of a sample drawn by the seed is made in a copy of
the sources; the tests of its package are run first, then those of the stages. Survivors are printed
as diffs, to be read: some change nothing that can be observed.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from summary import ROOT, bench_parser, share, write_summary

PACKAGES = ("causal_graph", "choice", "conditions", "detection", "faults", "isolation",
            "recurrence", "sensors", "signatures")  # fmt: skip
KINDS = ("ReplaceComparisonOperator", "ReplaceBinaryOperator", "AddNot", "ReplaceAndWithOr",
         "ReplaceOrWithAnd", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "NumberReplacer",
         "ZeroIterationForLoop", "ReplaceBreakWithContinue",
         "ReplaceContinueWithBreak")  # fmt: skip
UNUSED = ("_BitOr_", "_Is", "Mod", "Pow", "Shift", "_BitXor", "_BitAnd", "_FloorDiv")
"""A bar is mostly that of a type, ``is`` mostly asks for None, and the others nobody mistypes."""
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
LIMIT_S = 900.0


@dataclass(frozen=True)
class Mutant:
    """The k-th place in a module where an operator of cosmic-ray can act."""

    module: Path
    operator: str
    place: int

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


def mutants() -> Iterator[Mutant]:
    """All of them."""
    from cosmic_ray.ast import get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    kinds = [
        name
        for name in operator_names()
        if name.removeprefix("core/").startswith(KINDS) and not any(u in name for u in UNUSED)
    ]
    for package in PACKAGES:
        for path in sorted((ROOT / "flea_diag/core" / package).rglob("*.py")):
            tree = get_ast(path.read_text(encoding="utf-8"))
            for kind in kinds:
                operator = get_operator(kind)()
                places = sum(len(list(operator.mutation_positions(node))) for node in _nodes(tree))
                for place in range(places):
                    yield Mutant(path.relative_to(ROOT), kind, place)


def _nodes(node: object) -> Iterator[object]:
    yield node
    for child in getattr(node, "children", ()):
        yield from _nodes(child)


def found_by(mutant: Mutant, copy: Path) -> str:
    """Tests that fail with the error; empty where it survives."""
    before, after = mutant.sources()
    target = copy / mutant.module
    target.write_text(after, encoding="utf-8")
    try:
        package = mutant.module.parts[2]
        for tests in (f"test/core/{package}", "test/stages"):
            if _fails(copy, tests):
                return tests
    finally:
        target.write_text(before, encoding="utf-8")
    return ""


def _fails(copy: Path, tests: str) -> bool:
    environment = {**os.environ, "PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-m", "not slow", tests]
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=LIMIT_S
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode == 1


def main() -> None:
    """Draw, try, print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    every = list(mutants())
    drawn: Sequence[Mutant] = random.Random(given.seed).sample(every, given.count)
    print(f"{len(every)} errors can be made in {len(PACKAGES)} packages; {given.count} are")
    killed = 0
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name)
        for part in COPIED:
            source = ROOT / part
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / part)
        for number, mutant in enumerate(drawn, 1):
            tests = found_by(mutant, copy)
            killed += bool(tests)
            print(
                f"{number:3d} {mutant.module} {mutant.operator} {tests or 'SURVIVED'}", flush=True
            )
            if not tests:
                print(mutant.difference(), flush=True)
    figure = share("errors found", killed, len(drawn))
    print(f"{figure.name}: {killed} of {len(drawn)}")
    write_summary("bench/robustness/mutants.py", [figure], given.json)


if __name__ == "__main__":
    main()
