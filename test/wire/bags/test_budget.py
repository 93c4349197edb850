"""What the files of one command share, and what each has for itself."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flea_diag.errors import RecordingError
from flea_diag.wire.bags.budget import HELD_BYTES, MEGABYTE, SMALL_BYTES, Budget, begin_command


@pytest.fixture(autouse=True)
def command() -> Iterator[None]:
    begin_command()
    yield
    begin_command()


def test_many_files_share_what_each_could_unpack_to_alone() -> None:
    for number in range(4):
        Budget(f"bag_{number}", 1000).unpack(240 * MEGABYTE)
    with pytest.raises(RecordingError, match=r"bag_4: with the files read before .* FLEA_BAG"):
        Budget("bag_4", 1000).unpack(240 * MEGABYTE)


def test_files_of_some_size_are_granted_more() -> None:
    for number in range(20):
        Budget(f"bag_{number}", MEGABYTE).unpack(900 * MEGABYTE)


def test_a_new_command_begins_anew() -> None:
    Budget("a", 0).unpack(900 * MEGABYTE)
    begin_command()
    Budget("b", 0).unpack(900 * MEGABYTE)


def test_one_file_is_refused_for_itself() -> None:
    budget = Budget("a", 0)
    budget.unpack(1000 * MEGABYTE)
    with pytest.raises(RecordingError, match="a: it unpacks to more than 1000 MB"):
        budget.unpack(1)
    with pytest.raises(RecordingError, match="overlap in time"):
        budget.hold(HELD_BYTES)
    with pytest.raises(RecordingError, match="schemas, channels and attachments"):
        budget.keep(SMALL_BYTES + 1)
