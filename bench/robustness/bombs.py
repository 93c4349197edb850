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

"""Well-formed bombs against every gate, each in a process of its own with its memory and time.

    scripts/fuzz --bombs 60              60 s per gate, in wall-clock time
    scripts/fuzz --bombs 60 YAML page    these gates only

Each input is judged: at most 500 MB and 10 s of CPU, no traceback, never silent, no control
characters, one line and exit status 2 where it is refused. Rows are in ``test/support/bombs``.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "test")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from summary import Figure, write_summary
from support.bombs.bomb import REFUSED, Bomb, imported
from support.bombs.table import BOMBS

from flea_diag.errors import visible

MOST_MB, MOST_S = 500, 10
HANGS_S = 120.0
"""Wall time without any CPU time after which an input counts as hanging. All other times are CPU
times, so that a busy machine fails nothing."""
LONGEST_LINE = 2000
LONGEST_REFUSAL = 1000
STATUSES = (0, 1, 2)


@dataclass(frozen=True)
class Judged:
    """One input: what was wrong with how it was taken, its CPU time and its peak memory."""

    faults: tuple[str, ...]
    cpu_s: float
    peak_mb: float


def judge(bomb: Bomb, seed: int) -> Judged:
    """Make one input and read it in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        child = os.fork()
        if child == 0:
            _child(bomb, seed, place)
        status = _wait(child)
        words = {name: _said(place / name) for name in ("says", "stdout", "stderr", "used")}
    used = words["used"].split()
    cpu_s, peak_mb = (float(used[0]), float(used[1])) if used else (0.0, 0.0)
    faults = [*_limits(cpu_s, peak_mb), *_ended(status, words), *_words(words)]
    return Judged(tuple(faults), cpu_s, peak_mb)


def compile_apart() -> None:
    """Fill the compile cache in a process of its own: what compiling takes would stay in this."""
    child = os.fork()
    if child == 0:
        imported()
        os._exit(0)
    os.waitpid(child, 0)


def _child(bomb: Bomb, seed: int, place: Path) -> None:
    """Read one input and end; what it used is noted in the folder."""
    status = 70
    try:
        work = place / "work"
        work.mkdir()
        found = bomb.make(work, random.Random(seed))
        (place / "says").write_text("\n".join((found.ends, *found.says)))
        data_mb = _status("VmData")
        _limit(resource.RLIMIT_CPU, int(time.process_time()) + MOST_S + 2)
        _limit(resource.RLIMIT_DATA, int((data_mb + 2 * MOST_MB) * 1e6))
        Path("/proc/self/clear_refs").write_text("5")  # peak memory from here on
        begin_s = time.process_time()
        with (place / "stdout").open("w") as out, (place / "stderr").open("w") as err:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            with redirect_stdout(out), redirect_stderr(err):
                try:
                    status = found.run()
                except SystemExit as ended:
                    status = ended.code if isinstance(ended.code, int) else 70
                except BaseException as error:
                    import traceback

                    traceback.print_exc(file=err)
                    status = 70 if not isinstance(error, KeyboardInterrupt) else 130
        (place / "used").write_text(f"{time.process_time() - begin_s} {_status('VmHWM')}")
    finally:
        os._exit(status)


def _limit(what: int, most: int) -> None:
    resource.setrlimit(what, (most, most))


def _status(name: str) -> float:
    """One of the memory figures of this process, MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1e3


def _wait(child: int) -> int:
    """Wait status of a child; one that hangs is killed."""
    used, deadline_s = _ticks(child), time.monotonic() + HANGS_S
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status
        if (ticks := _ticks(child)) > used:
            used, deadline_s = ticks, time.monotonic() + HANGS_S
        if time.monotonic() > deadline_s:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.005)


def _ticks(process: int) -> int:
    """CPU time of a process in ticks of the system."""
    return sum(
        map(int, Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13])
    )


def _said(path: Path) -> str:
    return path.read_text("utf-8", "surrogateescape") if path.exists() else ""


def _limits(cpu_s: float, peak_mb: float) -> list[str]:
    found = [f"took {cpu_s:.0f} s"] if cpu_s > MOST_S else []
    return found + ([f"took {peak_mb:.0f} MB"] if peak_mb > MOST_MB else [])


def _ended(status: int, words: dict[str, str]) -> list[str]:
    if not words["says"]:
        return ["was not made"]
    if os.WIFSIGNALED(status):
        return [f"ended by signal {os.WTERMSIG(status)}"]
    code, ends = os.WEXITSTATUS(status), words["says"].split("\n")[0]
    if code not in STATUSES:
        return [f"exit status {code}: {words['stderr'][-300:]}"]
    if ends != REFUSED:
        return []
    lines = words["stderr"].splitlines()
    one = len(lines) == 1 and len(lines[0]) <= LONGEST_REFUSAL
    return [] if code == 2 and one else [f"not refused in one line: {code}, {lines[:2]!s:.300}"]


def _words(words: dict[str, str]) -> list[str]:
    """What is wrong with what was printed."""
    printed = words["stdout"] + words["stderr"]
    says = words["says"].split("\n")[1:]
    found = []
    if "Traceback" in printed or "Exception ignored" in printed:
        found.append(f"traceback: {printed[-300:]}")
    if not printed.strip():
        found.append("silent")
    elif says and not any(each in printed for each in says):
        found.append(f"does not name it: {printed[:300]}")
    if visible(printed) != printed:
        found.append(f"control characters: {printed!r:.200}")
    if max(map(len, printed.splitlines()), default=0) > LONGEST_LINE:
        found.append("a line of more than 2000 characters")
    return found


@dataclass
class Tally:
    """What one gate has taken so far."""

    gate: str
    rows: int
    count: int = 0
    failed: int = 0
    cpu_s: float = 0.0
    peak_mb: float = 0.0

    def figures(self) -> tuple[Figure, ...]:
        """As rows of the results."""
        n = self.count
        return (
            Figure(f"{self.gate}: inputs of {self.rows} rows", n, "inputs", n),
            Figure(f"{self.gate}: not taken as they must", self.failed, "inputs", n),
            Figure(f"{self.gate}: CPU for one, at most", round(self.cpu_s, 2), "s", n),
            Figure(f"{self.gate}: memory for one, at most", round(self.peak_mb), "MB", n),
        )


def attack(rows: list[Bomb], seconds: float, seed: int) -> tuple[Tally, Counter[str]]:
    """Rows of one gate by turns until the time is over."""
    tally, found = Tally(rows[0].gate, len(rows)), Counter[str]()
    rows[0].prepare()
    begin_s = time.monotonic()
    while time.monotonic() - begin_s < seconds:
        bomb = rows[tally.count % len(rows)]
        number = seed * 1_000_000 + tally.count
        judged = judge(bomb, number)
        tally.count += 1
        tally.failed += bool(judged.faults)
        tally.cpu_s = max(tally.cpu_s, judged.cpu_s)
        tally.peak_mb = max(tally.peak_mb, judged.peak_mb)
        for fault in judged.faults:
            found[f"{bomb.name} (seed {number}): {fault}"] += 1
    return tally, found


def main() -> int:
    """Run and print; exit status 1 if an input was not taken as it must."""
    gates = list(dict.fromkeys(bomb.gate for bomb in BOMBS))
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--bombs", action="store_true", help="well-formed bombs (this program)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--one", metavar="ROW", help="make and judge one input of a row")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("seconds", nargs="?", type=float, default=10.0, help="time per gate, s")
    parser.add_argument("gates", nargs="*", metavar="GATE", help=f"some of {', '.join(gates)}")
    given = parser.parse_intermixed_args()
    if unknown := [gate for gate in given.gates if gate not in gates]:
        parser.error(f"{unknown[0]!r} is not a gate: choose of {', '.join(gates)}")
    compile_apart()
    if given.one:
        bomb = next(bomb for bomb in BOMBS if bomb.name == given.one)
        bomb.prepare()
        print(judge(bomb, given.seed))
        return 0
    tallies = []
    for gate in given.gates or gates:
        tally, found = attack([b for b in BOMBS if b.gate == gate], given.seconds, given.seed)
        tallies.append(tally)
        print(
            f"{gate:8s} {tally.count:6d} inputs, {tally.failed} failures, at most "
            f"{tally.peak_mb:.0f} MB and {tally.cpu_s:.1f} s",
            flush=True,
        )
        for words, times in found.most_common(10):
            print(f"    {times} x {visible(words, kept='')}", flush=True)
    figures = [figure for tally in tallies for figure in tally.figures()]
    write_summary(f"scripts/fuzz --bombs {given.seconds:g}", figures, given.json)
    failed = sum(tally.failed for tally in tallies)
    print(f"{sum(tally.count for tally in tallies)} inputs, {failed} failures")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
