"""Runs beside a reach: replaces its primitive if another reaching pattern is recognised."""

from __future__ import annotations

from functools import partial
from typing import Any

from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.states.base import CoglabState, Interrupted
from coglab_smach.states.reach import dmp_request


class MonitorDmp(CoglabState):
    """Runs beside the motion. If another reaching pattern is recognised, it substitutes its primitive (switch_dmp).

    It only replaces primitives in ``monitor.primitives``, not those of giving or of the board. A pattern counts from
    ``monitor.confidence`` on. Runs until preempted. If it fails, the reach goes on."""

    default_time_limit = 600.0
    essential = False

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["goal"])

    def run(self, ud: Any) -> str:
        if not self.ctx.config.get("monitor.enabled"):
            self.wait_for(lambda: False, "the end of the motion", code=ReasonCode.WAITS_FOR_ARM, looks=True)
        running = ud.goal["primitive"]
        family = dict(self.ctx.config.get("monitor.primitives"))
        if running not in family.values():
            family = {}
        switches = 0
        while True:
            try:
                other = partial(self._other_pattern, family, running)
                self.wait_for(other, "another reaching pattern", code=ReasonCode.WAITS_FOR_SIGHT, looks=True)
            except Interrupted as end:
                if end.stop:
                    raise
                self.reason = f"motion over, {switches} switches"
                return "preempted"
            seen = self.ctx.perception.recognition()
            target = family[seen.pattern]
            self.await_pending(
                self.ctx.arm.switch_dmp(dmp_request(ud.goal, primitive=target)), f"switch to primitive '{target}'", 1.0
            )
            self.ctx.journal.mark("switch_dmp")
            self.ctx.journal.transition(
                self.path(),
                self.label,
                "switched",
                self.label,
                f"pattern '{seen.pattern}' recognised with confidence {seen.confidence:.2f}: "
                f"primitive '{running}' replaced by '{target}'",
            )
            running = target
            switches += 1

    def _other_pattern(self, family: dict[str, str], running: str) -> bool:
        # After arrival there is nothing left to substitute, and the arm must stand still.
        if self.ctx.arm.dmp_progress().state not in ("running", "holding"):
            return False
        seen = self.ctx.perception.recognition()
        sure = seen.decided and seen.confidence >= self.ctx.config.number("monitor.confidence")
        return sure and seen.pattern in family and family[seen.pattern] != running
