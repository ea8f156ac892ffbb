"""State of the brain for observers (people and programs), as published on coglab/state."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from coglab_smach.context.context import Context


@dataclass(frozen=True)
class MasterState:
    """Fields of coglab_msgs/MasterState without its header."""

    state: str = ""
    in_hub: bool = False
    actions: tuple[str, ...] = ()
    object_id: str = ""
    why: str = ""
    reason_code: int = 0
    waits_for: str = ""
    waits_code: int = 0
    deadline: float = 0.0
    """s on the brain's clock; 0: no limit"""


class StateWatch:
    """Calls ``publish`` with each new MasterState, in order, in the thread that made the change."""

    def __init__(self, ctx: Context, publish: Callable[[MasterState], None]) -> None:
        self._ctx = ctx
        self._publish = publish
        self._lock = threading.Lock()
        self._shown: MasterState | None = None
        ctx.journal.listen_changes(self._look)
        ctx.journal.listen_waits(self._look)
        self._look()

    def _look(self) -> None:
        with self._lock:
            now = self.now()
            if now != self._shown:
                self._shown = now
                self._publish(now)

    def tell_again(self) -> None:
        """Publish the newest state again, as a sign of life."""
        with self._lock:
            if self._shown is not None:
                self._publish(self._shown)

    def now(self) -> MasterState:
        """Returns the present state."""
        ctx = self._ctx
        failure, hub = ctx.journal.newest_failure(), ctx.requests.hub()
        why = str(failure)
        if hub in ("stopped", "fault"):
            why = why or f"the machine is in {hub}"
        active = ctx.journal.active()  # of several parallel states, the one that started last is shown
        wait = ctx.journal.wait()
        return MasterState(
            active[-1] if active else "",
            bool(hub),
            ctx.requests.allowed(),
            ctx.holding,
            why,
            failure.code,
            wait.what,
            wait.code,
            wait.deadline if wait.what else 0.0,
        )
