"""The console as a process, in a pipe, beside a verdict that was there before it."""

from __future__ import annotations

import signal

from live import Peer, Process, node, toy

from flea_diag.wire.records import AmbiguityGroup, Outcome, Scan


def test_a_console_that_comes_late_shows_the_verdict_and_its_end(domain: int) -> None:
    with Process(toy(), domain) as stage, Peer(domain) as peer:
        peer.listen(AmbiguityGroup)
        assert peer.bus.wait_for_subscribers(Scan)
        peer.bus.publish(Scan(1_700_000_000 * 10**9, ("motor_current",), (9.0,)))
        peer.find(lambda r: r.outcome == Outcome.ISOLATED)
        with Process(node("flea_diag.nodes.console"), domain) as console:
            console.wait_for("ISOLATED (1 possible: jam): isolated")
            console.wait_for("STALE")
            stage.signal(signal.SIGKILL)
            console.wait_for("NO VERDICT")
            assert console.signal(signal.SIGINT)[0] == 0
    lines = [line for line in console.output.splitlines() if "ISOLATED" in line]
    assert len(lines) == len(set(lines)), "a line that repeats is no change"
    assert "\x1b" not in console.output
