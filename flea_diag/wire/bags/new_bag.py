"""A bag that a command writes: whole, or not there at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flea_diag.errors import RecordingError
from flea_diag.wire.bags.bag_writer import BagWriter
from flea_diag.wire.whole_file import new_folder


@contextmanager
def new_bag(directory: Path, stand: str = "stand") -> Iterator[BagWriter]:
    """Write a bag, of equal bytes for equal records; whatever is raised leaves nothing of it.

    Raises
    ------
    RecordingError
        The folder is in use, or cannot be written.
    """
    try:
        with (
            new_folder(directory) as fresh,
            BagWriter(fresh, stand=stand, whole_every_s=None, called=directory) as bag,
        ):
            yield bag
    except FileExistsError:
        raise RecordingError(
            f"{directory} is not empty: a bag needs a new or empty folder"
        ) from None
    except OSError as error:
        raise RecordingError(f"cannot write bag {directory}: {error.strerror or error}") from error
