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

"""Which decisions on the real recordings a change alters: printed by ``scripts/check``.

    bench/results/decisions.py           compare with what is kept, and say what changed
    bench/results/decisions.py --keep    keep the decisions of now, after reading what changed

Every second nominal recording of a stand calibrates; the others and the faulty ones are diagnosed
as a user would, by the commands. A change is no error: it is there to be read.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "test" / "expected_decisions" / "real"
RECORDED = {
    "flea": ("*_Nominal_*", ("*_Low.data",)),
    "cranfield": (
        "normal_*",
        ("normal.csv.gz", "lackLubrication1.csv.gz", "backlash2.csv.gz", "spalling8.csv.gz"),
    ),
}
"""Of each stand which of its recordings are nominal, and its files."""
SHARED = ("-j", "2")
"""Two processes share the work; the results are the same."""
OF_A_RUN = ("bag", "outcome", "ambiguity_group", "decision_digest", "backend")
OF_AN_EPISODE = ("outcome", "detected_at_s", "ambiguity_group")


def flea(*words: str | Path, statuses: tuple[int, ...] = (0,)) -> str:
    """Run a command of the tree and return what it prints."""
    command = [sys.executable, "-m", "flea_diag.tools.main", *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in statuses:
        raise SystemExit(f"decisions: {' '.join(command[2:5])} ended with {done.returncode}")
    return done.stdout


def decided(stand: str, files: list[Path], folder: Path) -> list[dict[str, Any]]:
    """What is decided on the recordings of a stand, the bags named by what they hold."""
    known = ("--stand", stand, "--calibration", folder / "calibration.yaml")
    flea("import", *files, "-o", folder / "bags", "--stand", stand, *SHARED)
    bags = sorted((folder / "bags").iterdir())
    learned = [bag for bag in bags if bag.match(RECORDED[stand][0])][::2]
    flea("calibrate", *learned, "-o", known[-1], "--stand", stand, *SHARED)
    rest, out = [bag for bag in bags if bag not in learned], folder / "replays.json"
    flea("replay", *rest, *known, "-q", "--json", out, *SHARED)
    return [decision(each) for each in json.loads(out.read_text(encoding="utf-8"))]


def decision(summary: dict[str, Any]) -> dict[str, Any]:
    """The part of a summary that ``flea diff`` compares, without its wording."""
    kept = {key: summary[key] for key in OF_A_RUN} | {"bag": Path(summary["bag"]).name}
    episodes = [{key: each[key] for key in OF_AN_EPISODE} for each in summary["episodes"]]
    digest = summary["decision_digest"]  # that of the words changes with every sentence
    return {
        "schema_version": summary["schema_version"],
        **kept,
        "digest": digest,
        "episodes": episodes,
    }


def compare(decisions: list[dict[str, Any]], kept: Path, keep: bool) -> None:
    """Print how they differ from those that are kept, which they replace if they are to be."""
    text = json.dumps(decisions, indent=1, allow_nan=False) + "\n"
    with tempfile.TemporaryDirectory() as folder:
        now = Path(folder) / kept.name
        now.write_text(text, encoding="utf-8")
        if keep:
            kept.parent.mkdir(exist_ok=True)
            kept.write_text(text, encoding="utf-8")
        print(f"decisions on the real recordings of {kept.stem}, beside those that are kept:")
        print(flea("diff", kept, now, statuses=(0, 1)), end="")


def main() -> int:
    """Compare, or keep; 0 also where decisions changed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--keep", action="store_true", help="keep the decisions of now")
    keep = parser.parse_args().keep
    data = Path(os.environ.get("FLEA_DATA_DIR") or ROOT.parent / "shared" / "data")
    for stand, (_, names) in RECORDED.items():
        files = sorted(file for name in names for file in (data / stand).glob(name))
        if not files:
            print(f"decisions: {stand} not compared, no recordings in {data}: set FLEA_DATA_DIR")
            continue
        with tempfile.TemporaryDirectory() as folder:
            compare(decided(stand, files, Path(folder)), KEPT / f"{stand}.json", keep)
    return 0


if __name__ == "__main__":
    sys.exit(main())
