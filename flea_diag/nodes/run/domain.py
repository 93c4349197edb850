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

"""A separate ROS domain per live run, so that two runs on one machine do not interfere."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from flea_diag.errors import ConfigurationError

DOMAINS = range(1, 102)
"""Domains with ports below the system's ephemeral range; without 0, the common default."""


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Reserve a domain number that no other run on this machine uses, for the duration of a run.

    Raises
    ------
    ConfigurationError
        All domains are in use.
    """
    for number in DOMAINS:
        place = os.path.join(tempfile.gettempdir(), f"flea_diag-domain-{number}.lock")
        try:
            lock = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            continue  # a file of another user
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
    raise ConfigurationError(
        f"all ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are in use on this machine: end another "
        "run, or set ROS_DOMAIN_ID"
    )
