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

"""A user interface that needs the main thread of its process."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class Foreground(Protocol):
    """A user interface that needs the main thread while the node runs in another."""

    def run(self) -> None:
        """Run in the main thread until the operator quits or ``leave`` is called."""
        ...

    def leave(self) -> None:
        """Make ``run`` return because the node has ended; called from the other thread."""
        ...

    def close(self) -> None:
        """Release resources at the very end."""
        ...
