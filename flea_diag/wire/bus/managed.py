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

"""A program as a managed node: what is done in each transition of its life cycle.

Configure prepares (reads, compiles) and starts; the topics then exist, but nothing is taken from
them until activate. Cleanup closes and removes all that was made since configure.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from flea_diag.errors import ConfigurationError, FleaError
from flea_diag.wire.bus import life_cycle as states
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.bus.life_cycle import LifeCycle
from flea_diag.wire.bus.remote.manager_bond import ManagerBond
from flea_diag.wire.bus.screen import Foreground
from flea_diag.wire.bus.surroundings import LOOK_S as LOOK_AROUND_S
from flea_diag.wire.bus.surroundings import Surroundings
from flea_diag.wire.records import Health, Level

LOOK_S = 0.02
REPORT_S = 1.0
PROGRESS_S = 5.0
"""Period at which a node that is not ready yet says what it is doing."""
IDLE = "nothing is judged or recorded"
ENTITIES = ("publishers", "subscriptions", "timers", "services", "clients")
"""What a node of rclpy holds; each has a function that destroys one."""

SCREEN_NEEDS_AUTOSTART = (
    "the full-screen console runs from start to end: leave autostart at true, "
    "or choose style:=lines"
)


class Managed:
    """One program and the node that runs it.

    Parameters
    ----------
    program
        What runs.
    bus
        Of the node.
    node
        A ``LifecycleNode`` of rclpy.
    value
        Returns the present parameters.
    bond_s
        Period of the heartbeat to a manager of life cycles; 0: none.

    Raises
    ------
    ConfigurationError
        A bond is asked for, and its package is not installed.
    """

    def __init__(
        self,
        program: Any,
        bus: Bus[Any],
        node: Any,
        value: Callable[[], Any],
        bond_s: float = 0.0,
    ) -> None:
        self._program, self._bus, self._node, self._value = program, bus, node, value
        self._close: Callable[[], None] | None = None
        self.on_open: Callable[[], None] = lambda: None
        """Called when the program has something open that must be closed in order."""
        self.screen: Foreground | None = None
        self._worker: threading.Thread | None = None
        self._raised: BaseException | None = None
        self.reason = IDLE
        """Why nothing is done, in the report of a node that is not active."""
        self._reports = Health in program.publishes
        if self._reports:
            bus.advertise(Health)
        bus.always(REPORT_S, self._report)
        around = Surroundings(node, bus.caution, lambda: bus.working, bus.own_stamps)
        bus.always(LOOK_AROUND_S, around.look)
        self._bond = ManagerBond(node, bond_s) if bond_s else None
        if self._bond is not None:
            bus.always(bond_s, self._bond.beat)
        self._begun_s = self._told_s = time.monotonic()
        duties = {
            states.CONFIGURE: self._configure,
            states.ACTIVATE: lambda: bus.run_hooks(states.ACTIVATE),
            states.DEACTIVATE: self._pause,
            states.CLEANUP: self._cleanup,
            states.SHUTDOWN: self._shut_down,
        }
        kept = {transition: self._kept(duty) for transition, duty in duties.items()}
        self._life = LifeCycle(node, kept, self._entered)
        self._own = self._entities()

    @property
    def configured(self) -> bool:
        """Whether parameters have been taken that hold until cleanup."""
        return self._bus.state != states.UNCONFIGURED

    @property
    def preparing(self) -> bool:
        """Whether a thread is still compiling; it cannot be interrupted, only left behind."""
        return self._worker is not None and self._worker.is_alive()

    def autostart(self) -> None:
        """Configure and activate; what is slow is done in a thread, so that services answer."""
        self._life.begin(states.CONFIGURE)
        if self._program.prepare is None:
            self._start()
            self._begin_work()
            return
        self._worker = threading.Thread(target=self._prepare, name="prepare", daemon=True)
        self._worker.start()
        self._watch = self._bus.always(LOOK_S, self._look)

    def change(self, transition: str) -> None:
        """Make a whole transition.

        Raises
        ------
        FleaError
            The transition failed; the node is in its previous state.
        """
        self._life.change(transition)

    def set_aside(self) -> None:
        """Deactivate and clean up after a failure, whatever else fails meanwhile."""
        for transition, duty in (
            (states.DEACTIVATE, self._pause),
            (states.CLEANUP, self._withdraw),
        ):
            self._life.begin(transition)
            with suppress(Exception):
                duty()
            self._life.end(success=True)

    def _pause(self) -> None:
        self._bus.run_hooks(states.DEACTIVATE)

    def _kept(self, duty: Callable[[], None]) -> Callable[[], None]:
        """A duty whose unexpected failure, among other nodes in the process, fails it alone."""

        def done() -> None:
            try:
                duty()
            except Exception as error:
                if isinstance(error, FleaError) or self._bus.on_failure is None:
                    raise
                raise ConfigurationError(f"{type(error).__name__}: {error}") from error

        return done

    def close(self) -> None:
        """Close what the program has open; without effect when nothing is."""
        close, self._close, self.screen = self._close, None, None
        if close is not None:
            close()

    def _prepare(self) -> None:
        try:
            self._program.prepare(self._bus, self._value())
        except BaseException as error:
            self._raised = error

    def _look(self) -> None:
        """Go on in the thread of the executor once everything is prepared."""
        if self.preparing:
            self._tell_progress()
            return
        self._node.destroy_timer(self._watch)
        try:
            if self._raised is not None:
                raise self._raised
            self._start()
        except FleaError as error:
            self._bus.end(error)
            return
        self._begin_work()

    def _tell_progress(self) -> None:
        now_s = time.monotonic()
        if now_s - self._told_s >= PROGRESS_S:
            self._told_s = now_s
            doing = self._bus.doing or "reading files"
            self._bus.info(f"starting for {now_s - self._begun_s:.0f} s: {doing}")

    def _begin_work(self) -> None:
        self._life.end(success=True)
        self._life.change(states.ACTIVATE)

    def _start(self) -> None:
        started = self._program.start(self._bus, self._value())
        self.screen = started if isinstance(started, Foreground) else None
        self._close = started.close if isinstance(started, Foreground) else started
        if self._close is not None:
            self.on_open()

    def _configure(self) -> None:
        """On request; the executor is busy meanwhile, as with any managed node."""
        try:
            if self._program.prepare is not None:
                self._program.prepare(self._bus, self._value())
            self._start()
            if self.screen is not None:
                raise ConfigurationError(SCREEN_NEEDS_AUTOSTART)
        except FleaError:
            self._withdraw()
            raise

    def _cleanup(self) -> None:
        if self.screen is not None:
            raise ConfigurationError(SCREEN_NEEDS_AUTOSTART)
        self._withdraw()

    def _withdraw(self) -> None:
        """Close, and destroy all that was made since the node was created."""
        self.close()
        self._bus.forget()
        for kind, made in self._entities().items():
            for each in made - self._own[kind]:
                getattr(self._node, f"destroy_{kind.removesuffix('s')}")(each)

    def _shut_down(self) -> None:
        if self._bus.working:
            self._bus.run_hooks(states.DEACTIVATE)
        self.close()
        self._bus.end()

    def _entities(self) -> dict[str, set[Any]]:
        return {kind: set(getattr(self._node, kind)) for kind in ENTITIES}

    def _entered(self, state: str) -> None:
        self._bus.state = state
        if self._bond is not None:
            self._bond.enter(state)
        self._report(also_active=True)
        if state == states.ACTIVE:
            for stream in tuple(self._bus.streams.values()):
                stream.hand_over()

    def _report(self, also_active: bool = False) -> None:
        """State on /diagnostics; an active node has a report of its own, with more in it."""
        state = self._bus.state
        if not self._reports or (state == states.ACTIVE and not also_active):
            return
        # Whoever has failed has a reason of its own; who waits to be activated is no error.
        waits = Level.WARN if self.reason == IDLE else Level.ERROR
        level = Level.OK if state == states.ACTIVE or self._bus.replays else waits
        why = self._bus.doing if self.preparing and self._bus.doing else self.reason
        words = state if state == states.ACTIVE else f"{state}: {why}"
        values = (("state", state),)
        self._bus.publish(Health(self._bus.now_ns(), self._bus.name, level, words, values))
