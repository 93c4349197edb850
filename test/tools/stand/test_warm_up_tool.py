"""`flea warm-up` in processes of its own, with a cache that is empty at first."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.decisions import BAGS
from support.places import ROOT

REPLAY = (
    "import sys; from flea_diag.core.backend import compiling; "
    "from flea_diag.tools.main import main\n"
    "with compiling(lambda name: print('compiles', name)): main(sys.argv[1:])"
)


def flea(cache: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )


def test_what_is_warmed_up_is_not_compiled_again(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    command = ("-m", "flea_diag.tools.main", "warm-up")
    cold = flea(tmp_path, *command, "--check", "--json", "-")
    assert cold.returncode == 1
    assert "NUMBA_CACHE_DIR" in cold.stderr
    parts = {row["part"]: row["compiled"] for row in json.loads(cold.stdout)["parts"]}
    assert "z_test_loops" in parts["diagnosis"]
    assert parts["simulated stand"] == ["_integrate"]

    warm = flea(tmp_path, *command, "--check")
    assert warm.returncode == 0, warm.stdout + warm.stderr
    assert "diagnosis: ready after" in warm.stdout
    assert "compiling" not in warm.stdout

    replay = flea(tmp_path, "-c", REPLAY, "replay", str(BAGS / "jam"), "-q")
    assert (replay.returncode, replay.stdout) == (0, "")
