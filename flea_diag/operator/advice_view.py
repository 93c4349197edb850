"""Recommended next tests that would split the group: advice, never a command to the stand."""

from __future__ import annotations

from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.state import OperatorState
from flea_diag.wire.records import NextTest, Outcome


def next_tests(state: OperatorState) -> Panel | None:
    """Tests that would split the remaining group, best gain per second first."""
    group = state.group
    if group is None or group.outcome is not Outcome.INDISTINGUISHABLE or group.summary:
        return None
    if not group.next_tests:
        return Panel("next", "NEXT TEST  no known test splits these faults")
    tests = group.next_tests
    if all(test.kind == "sensor" for test in tests):
        title = "NEXT TEST  by design no test splits these faults with the sensors of this stand"
    else:
        title = f"NEXT TEST  advice; {len(group.members)} faults remain"
    return Panel("next", title, tuple(Line(advice_text(test)) for test in tests))


def advice_text(test: NextTest) -> str:
    """One test with the expected size of the group after it and the faults that it splits."""
    left = f"expected group size {test.expected_size:.1f}"
    splits = ", ".join(test.splits)
    if test.kind == "sensor":
        return f"fit {test.what}: {left} ({splits})"
    return f"{test.kind} {test.what}: {left} after {test.seconds:.0f} s ({splits})"
