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

"""Work on an existing Dask cluster, whose workers see the same files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any, TypeVar

from flea_diag.errors import ConfigurationError, FleaError
from flea_diag.tools.extra import require
from flea_diag.tools.refused import DIED, Refused

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_WAITING = 1000
"""Items that a cluster is given ahead."""
TRIES = 3
"""Workers that may die over an item before the item itself is blamed."""


def on_cluster(
    work: Callable[[Item], Result], items: Iterable[Item], address: str, timeout_s: float = 10.0
) -> Iterator[tuple[int, Item, Result | Refused]]:
    """Number, item and result of each item, in the order of completion.

    An item whose workers die one after another is refused; a ``FleaError`` is raised here.

    Raises
    ------
    ConfigurationError
        Dask is not installed, or no scheduler answers at the address.
    """
    require("dask", "--dask")
    import distributed

    try:
        client = distributed.Client(address, timeout=timeout_s)
    except (OSError, ValueError, TimeoutError) as error:
        raise ConfigurationError(
            f"--dask {address}: no scheduler answers ({error}); start one with "
            "`dask scheduler` and workers with `dask worker ADDRESS --nthreads 1`"
        ) from error
    with client:
        running: dict[str, tuple[int, Item]] = {}
        rest = enumerate(items)

        def submitted(most: int) -> list[Any]:
            """The next items, handed to the cluster."""
            part = {f"flea-{id(running)}-{number}": (number, item)
                    for number, item in islice(rest, most)}  # fmt: skip
            running.update(part)
            return [
                client.submit(work, item, key=key, pure=False, retries=TRIES)
                for key, (_, item) in part.items()
            ]

        futures = distributed.as_completed(submitted(MOST_WAITING))
        for future in futures:
            error = future.exception()
            number, item = running.pop(future.key)
            if isinstance(error, FleaError):
                raise error
            lost = Refused(f"{item}: {DIED} ({error!r:.200})")
            yield number, item, lost if error else future.result()
            future.release()
            futures.update(submitted(1))
