from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest

from flea_diag.core.flag_runs import flag_runs, longest_run


@pytest.mark.parametrize("text", ["", ".", "#", "##..#", ".###.##", "#.#.#", "....", "####"])
def test_runs_are_those_of_a_walk_from_scan_to_scan(text: str) -> None:
    flags = np.array([letter == "#" for letter in text], dtype=bool)
    expected, at = [], 0
    for letter, run in groupby(text):
        count = len(list(run))
        expected += [[at, at + count]] if letter == "#" else []
        at += count
    assert flag_runs(flags).tolist() == expected
    assert longest_run(flags) == max((end - start for start, end in expected), default=0)
