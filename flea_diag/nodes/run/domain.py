"""A ROS domain of one's own: two live runs on one machine must not hear each other."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from flea_diag.errors import ConfigurationError

DOMAINS = range(1, 102)
"""Those whose ports lie below the system's ephemeral ones; 0 is everybody's default."""


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Reserve a domain number that no other run on this machine holds, until the end.

    Raises
    ------
    ConfigurationError
        When all are taken.
    """
    for number in DOMAINS:
        place = os.path.join(tempfile.gettempdir(), f"flea_diag-domain-{number}.lock")
        try:
            lock = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            continue  # somebody else's file
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        try:
            yield number
        finally:
            os.close(lock)
        return
    raise ConfigurationError(f"all ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are in use here")
