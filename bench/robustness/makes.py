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

"""Files of other makes and of other people's packages, and what ``flea stand new`` makes of each.

python bench/robustness/makes.py            a line for each
python bench/robustness/makes.py --keep     and docs/results/kept/recordings_of_others.json
python bench/robustness/makes.py --logs FILE...   recordings that others have published, one by one
"""

from __future__ import annotations

import contextlib
import io
import site
import subprocess
import sys
import tempfile
from collections import Counter
from datetime import date
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "results"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import yaml
from kept import FOLDER, KeptResult, KeptRow, Origin, write_kept
from summary import bench_parser
from support.foreign.other_makes import CHANNELS, MAKES, Make, write

from flea_diag.tools.main import main as flea

ENDINGS = (".mat", ".h5", ".csv", ".npz", ".npy", ".parquet", ".csv.gz", ".bag", ".mcap", ".db3")
MOST_SHOWN = 60
"""Letters of a cell of a table."""
MOST_OF_A_FOLDER, LARGEST_BYTES = 45, 8_000_000


def main() -> int:
    """1 where a file of a make is not right, or a traceback came."""
    parser = bench_parser(__doc__)
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--logs", nargs="+", type=Path, default=[], metavar="FILE")
    args = parser.parse_args()
    if args.logs:
        return of_logs(args.logs, args.keep)
    rows, wrong = [], 0
    for name, make in MAKES.items():
        text, is_right = made(name, make)
        wrong += not is_right
        rows.append(KeptRow(name, text=text))
        print(f"{'right' if is_right else 'WRONG'}  {name}: {text}", flush=True)
    packages = of_packages()
    wrong += sum(int(row.cells.get("neither", "0")) for row in packages)
    if args.keep:
        keep([*rows, *packages])
    return min(wrong, 1)


def new(folder: Path, file: Path, *options: str) -> tuple[int, str, str]:
    """Exit status, output and errors of ``flea stand new``."""
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = flea(["stand", "new", str(folder), "--from", str(file), *options])
    return status, out.getvalue(), errors.getvalue()


def made(name: str, make: Make) -> tuple[str, bool]:
    """What came of a file of one make, in words, and whether that is right."""
    with tempfile.TemporaryDirectory() as place:
        file = write(Path(place), name, make)
        status, out, errors = new(Path(place) / "mine", file, *make.options)
        if status:
            line = errors.replace(f"{file}: ", "").removeprefix("flea: ").strip()
            said = f"refused: {line.partition(',')[0]}"[:MOST_SHOWN]
            return said, bool(make.says) and make.says in errors
        text = (Path(place) / "mine" / "channels.yaml").read_text(encoding="utf-8")
    rows = yaml.safe_load(text)["channels"]
    joint = out.splitlines()[0].partition(", joint ")[2].partition(" ")[0]
    wanted = [source.format(joint) for source in make.sources]
    found = [str(rows.get(channel, {}).get("column")) for channel in CHANNELS]
    return ", ".join(found)[:MOST_SHOWN], found == wanted


def of_logs(files: list[Path], kept: bool) -> int:
    """What comes of each file; 1 where it is neither a stand nor one line."""
    rows, wrong = [], 0
    for file in files:
        with tempfile.TemporaryDirectory() as place:
            status, out, errors = new(Path(place) / "mine", file)
        lines = errors.strip().splitlines()
        line = lines[0].replace(f"{file}: ", "").removeprefix("flea: ") if lines else ""
        good = status == 0 or len(lines) == 1
        wrong += not good
        marks = out.count("(check)")
        taken = f"{out.splitlines()[0].partition(': ')[2]}, {marks} cells to check" if out else ""
        rows.append(KeptRow(file.name, text=line[:MOST_SHOWN] if status else taken))
        print(f"{'right' if good else 'WRONG'}  {file.name}: {rows[-1].text}", flush=True)
    if kept:
        keep_logs(rows)
    return min(wrong, 1)


def keep_logs(rows: list[KeptRow]) -> None:
    """Write the kept result of published recordings."""
    write_kept(
        FOLDER / "published_logs.json",
        KeptResult(
            "Published flight logs",
            "python bench/robustness/makes.py --keep --logs FILE...",
            Origin(date=str(date.today()), commit=_commit()),
            tuple(rows),
            notes=(
                "Logs of PX4 (ULog) that the sources of pyulog 1.2.1 bring. None is of an actuator "
                "with its load: the right end is one line that says what is missing, or a stand "
                "whose doubts are marked.",
            ),
        ),
    )


def _commit() -> str:
    command = ["git", "rev-parse", "--short=9", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def of_packages() -> list[KeptRow]:
    """Files that packages beside this one bring for their own tests: none is of an actuator."""
    found: Counter[tuple[str, str]] = Counter()
    of_folder: Counter[Path] = Counter()
    for path in sorted(Path(site.getsitepackages()[0]).rglob("*")):
        name = path.name.lower()
        if not name.endswith(ENDINGS) or not path.is_file():
            continue
        of_folder[path.parent] += 1
        if of_folder[path.parent] > MOST_OF_A_FOLDER or path.stat().st_size > LARGEST_BYTES:
            continue
        ending = next(each for each in ENDINGS if name.endswith(each))
        with tempfile.TemporaryDirectory() as place:
            try:
                status, _, errors = new(Path(place) / "mine", path)
                outcome = "line" if status and errors.count("\n") == 1 else "guess"
                outcome = "many" if status and errors.count("\n") != 1 else outcome
            except Exception as error:  # what is looked for
                outcome, errors = "traceback", ""
                print(f"WRONG  {path}: {type(error).__name__}: {error}", flush=True)
        if outcome in ("guess", "many"):
            print(f"{outcome}  {path}: {errors}", flush=True)
        found[ending, outcome] += 1
    rows = []
    for ending in ENDINGS:
        count = sum(n for (e, _), n in found.items() if e == ending)
        if count:
            right, guessed = found[ending, "line"], found[ending, "guess"]
            name = f"files {ending} of other packages: refused in one line"
            neither = count - right - guessed
            said = {"taken, with marks": guessed, "neither": neither}
            cells = {key: str(value) for key, value in said.items() if value}
            rows.append(KeptRow(name, right=right, count=count, cells=cells))
            print(f"{name}: {right} of {count}, taken with marks: {guessed}", flush=True)
    return rows


def keep(rows: list[KeptRow]) -> None:
    """Write the kept result."""
    result = KeptResult(
        "Files of other makes",
        "python bench/robustness/makes.py --keep",
        Origin(date=str(date.today()), commit=_commit()),
        tuple(rows),
        notes=(
            "The result is what was taken for current, speed and position.",
            "The files of other makes are written by generators of their formats, of one drawn "
            "motion for each joint: no recordings of these makes.",
            "The files of other packages are what scipy, numpy, pyarrow and others bring for their "
            "own tests; none is of an actuator, so the right end is one line that says what is "
            "missing.",
        ),
    )
    write_kept(FOLDER / "recordings_of_others.json", result)


if __name__ == "__main__":
    sys.exit(main())
