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

"""Latency of feature answers over DDS, from request to answer.

The simulated stand publishes 100 scans/s and two accelerometers of three axes at 20 kHz in real
time; the extractor is a process of its own. This process takes the place of the isolator: it
requests each feature of the learned table in turn, on a window that ended ``AGE_S`` ago, as the
isolator does after ordering its records. Other load on the machine increases the times.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from summary import Figure, bench_parser, share, write_summary
from support.live import Peer, Process, node

from flea_diag.configuration.knowledge import load_features
from flea_diag.tools.interval import wilson
from flea_diag.wire.records import FeatureRequest, FeatureValue, Scan, VibrationLevel

DOMAIN = 96
RUN_S = 60.0
AGE_S, WINDOW_S = 0.2, 1.0
FULL_S = 2.0
"""Time after the first vibration level until complete windows are available."""

BUDGET_S = 0.15
SECOND_NS = 1_000_000_000


class Asker:
    """Requests one feature after another, each after the answer to the previous one."""

    def __init__(self, peer: Peer, features: tuple[str, ...]) -> None:
        self._bus = peer.bus
        self._features = features
        self._first_ns = 0
        self._asked: dict[int, tuple[str, float]] = {}
        self.waits: list[tuple[float, str, FeatureValue]] = []

    def level(self, level: VibrationLevel) -> None:
        """Note that the extractor receives vibration."""
        self._first_ns = self._first_ns or level.stamp_ns

    def scan(self, scan: Scan) -> None:
        """Request the next feature, unless an answer is pending."""
        begun = self._first_ns and scan.stamp_ns > self._first_ns + FULL_S * SECOND_NS
        if not begun or len(self._asked) > len(self.waits):
            return
        step = len(self._asked) + 1
        feature = self._features[step % len(self._features)]
        end_ns = scan.stamp_ns - round(AGE_S * SECOND_NS)
        start_ns = end_ns - round(WINDOW_S * SECOND_NS)
        self._asked[step] = feature, time.monotonic()
        self._bus.publish(FeatureRequest(scan.stamp_ns, 1, step, feature, start_ns, end_ns))

    def answer(self, value: FeatureValue) -> None:
        """Record the latency of the answer."""
        feature, asked_s = self._asked[value.step]
        self.waits.append((time.monotonic() - asked_s, feature, value))


def main() -> None:
    """Run the stand and the extractor, ask, and print what came of it."""
    arguments = bench_parser(__doc__).parse_args()
    features = load_features("feature_table.yaml").features
    stand = node("daq", "-p", f"duration_s:={RUN_S}",
                 "-p", "wait_for_subscribers:=2")  # fmt: skip
    with Peer(DOMAIN) as peer, Process(node("extractor"), DOMAIN) as extractor:
        asker = Asker(peer, features)
        peer.bus.advertise(FeatureRequest)
        peer.bus.subscribe(VibrationLevel, asker.level)
        peer.bus.subscribe(FeatureValue, asker.answer)
        peer.bus.subscribe(Scan, asker.scan)
        peer.until(lambda: peer.bus.subscribers(FeatureRequest) > 0, 60.0)
        with Process(stand, DOMAIN) as daq:
            peer.until(lambda: bool(asker.waits), 60.0)
            begun_s, spent_s = time.monotonic(), cpu_s(extractor.child.pid)
            ends_s = begun_s + RUN_S - FULL_S - 5.0
            peer.bus.wait_until(
                lambda: time.monotonic() > ends_s or daq.child.poll() is not None, RUN_S
            )
            took_s = time.monotonic() - begun_s
            used = (cpu_s(extractor.child.pid) - spent_s) / took_s
    write_summary("answer", report(asker.waits, used), arguments.json)


def report(waits: list[tuple[float, str, FeatureValue]], used: float) -> list[Figure]:
    """Quantiles of the waits, and the worst of each feature."""
    ordered = sorted(wait for wait, _, _ in waits)
    n = len(ordered)
    within = sum(wait <= BUDGET_S for wait in ordered)
    low, high = wilson(within, n)
    given = sum(value.reason == "" for _, _, value in waits)
    print(f"{n} requests, {given} with a value; extractor {used:.1%} of a core")
    print(
        f"from request to answer: median {median(ordered) * 1e3:.1f} ms, "
        f"95 % {ordered[int(0.95 * n)] * 1e3:.1f} ms, worst {ordered[-1] * 1e3:.1f} ms"
    )
    print(f"within {BUDGET_S * 1e3:.0f} ms: {within} of {n} ({low:.1%} to {high:.1%})")
    for name in dict.fromkeys(feature for _, feature, _ in waits):
        of_it = [(wait, value.cost_ms) for wait, feature, value in waits if feature == name]
        waited, cost = (median(column) for column in zip(*of_it, strict=True))
        print(f"  {name:40s}{len(of_it):5d}{waited * 1e3:8.1f} ms, computing {cost:6.2f} ms")
    spread = ordered[0] * 1e3, ordered[-1] * 1e3
    return [
        Figure("from request to answer over DDS, median", median(ordered) * 1e3, "ms", n, *spread),
        share("answered within 150 ms", within, n),
        Figure("CPU of the extractor", 100.0 * used, "% of a core"),
    ]


def cpu_s(pid: int) -> float:
    """Processor time of a running process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
