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

Every second nominal recording of the FLEA calibrates; the others and all faulty ones are
diagnosed as a user would, by the commands. A change is no error: it is there to be read.
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
KEPT = ROOT / "test" / "expected_decisions" / "real" / "flea.json"
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


def decided(files: list[Path], folder: Path) -> list[dict[str, Any]]:
    """What is decided on these recordings, the bags named by their files."""
    nominal = [file for file in files if "_Nominal_" in file.name]
    learned = nominal[::2]
    flea("import", *learned, "-o", folder / "learned", *SHARED)
    bags = sorted((folder / "learned").iterdir())
    flea("calibrate", *bags, "-o", folder / "calibration.yaml", *SHARED)
    rest = [file for file in files if file not in learned]
    flea("import", *rest, "-o", folder / "bags", *SHARED)
    out = folder / "replays.json"
    bags = sorted((folder / "bags").iterdir())
    known = ("--calibration", folder / "calibration.yaml")
    flea("replay", *bags, *known, "-q", "--json", out, *SHARED)
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


def main() -> int:
    """Compare, or keep; 0 also where decisions changed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--keep", action="store_true", help="keep the decisions of now")
    keep = parser.parse_args().keep
    data = Path(os.environ.get("FLEA_DATA_DIR") or ROOT.parent / "shared" / "data") / "flea"
    files = sorted(data.glob("*_Low.data"))
    if not files:
        print(f"decisions: not compared, no recordings in {data}: set FLEA_DATA_DIR")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        text = json.dumps(decided(files, Path(folder)), indent=1, allow_nan=False) + "\n"
        now = Path(folder) / "flea.json"
        now.write_text(text, encoding="utf-8")
        if keep:
            KEPT.parent.mkdir(exist_ok=True)
            KEPT.write_text(text, encoding="utf-8")
        print("decisions on the real recordings, beside those that are kept:")
        print(flea("diff", KEPT, now, statuses=(0, 1)), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
