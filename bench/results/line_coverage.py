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

"""Share of the lines that the tests run, by room: for QUALITY_DECLARATION.md.

scripts/coverage --json coverage.json                 all tests
scripts/coverage --json coverage.json test/core       some of them; other arguments go to pytest

Lines in processes that the tests start count too. What numba compiles runs unseen, and counts only
where a test runs it as Python.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench"))

from summary import Figure, bench_parser, write_summary

PACKAGES = ("flea_diag", "flea_sim_driver")


def counted(report: Path) -> tuple[Counter[str], Counter[str]]:
    """Lines of each room, and those of them that ran, from the report of coverage.py."""
    lines, ran = Counter[str](), Counter[str]()
    for name, file in json.loads(report.read_text(encoding="utf-8"))["files"].items():
        package, *rest = Path(name).parts
        room = f"{package}/{rest[0]}" if package == PACKAGES[0] and len(rest) > 1 else package
        lines[room] += file["summary"]["num_statements"]
        ran[room] += file["summary"]["covered_lines"]
    return lines, ran


def main() -> int:
    """Run the tests under coverage.py, and write; the exit status is that of pytest."""
    arguments, given = bench_parser(__doc__).parse_known_args()
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [sys.executable, "-m", "pytest", "-q", f"--cov-report=json:{report}"]
        command += [f"--cov={package}" for package in PACKAGES]
        done = subprocess.run([*command, *given], cwd=ROOT, check=False)
        if not report.exists():
            return done.returncode
        lines, ran = counted(report)
    lines["all"], ran["all"] = lines.total(), ran.total()
    figures = [Figure(room, 100.0 * ran[room] / lines[room], "%", lines[room]) for room in lines]
    for figure in figures:
        print(f"{figure.name:24}{figure.value:6.1f} % of {figure.n} lines")
    write_summary("scripts/coverage", figures, arguments.json)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
