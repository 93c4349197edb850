"""A compile cache with damaged files is made anew, and that is said once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import ROOT

pytest.importorskip("numba")

PROGRAM = """
import sys
from flea_diag.core.backend import exact
sys.path.insert(0, sys.argv[1])
from doubling import double
print(exact(double)(21.0))
"""


def doubled(folder: Path) -> subprocess.CompletedProcess[str]:
    """A program that compiles one small function, with its cache in this folder."""
    (folder / "doubling.py").write_text("def double(x):\n    return 2.0 * x\n")
    os.utime(folder / "doubling.py", (1, 1))  # numba keeps the time of the source
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(folder / "cache")}
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder)],
        env=environment, cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("ending", "content"), [("nbi", b""), ("nbi", b"\x80\x05K"), ("nbc", b"garbage")]
)
def test_a_damaged_file_is_made_anew(ending: str, content: bytes, tmp_path: Path) -> None:
    assert doubled(tmp_path).stdout == "42.0\n"
    (file,) = (tmp_path / "cache").rglob(f"*.{ending}")
    file.write_bytes(content)
    done = doubled(tmp_path)
    assert (done.returncode, done.stdout) == (0, "42.0\n")
    assert done.stderr.count("damaged compile cache of double, made anew") == 1
    assert file.read_bytes() != content
    again = doubled(tmp_path)
    assert (again.stdout, again.stderr) == ("42.0\n", "")
