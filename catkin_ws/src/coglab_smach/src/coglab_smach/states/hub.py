"""States that wait for the operator or the person: the trigger of the initialisation and the hubs of the master."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.holding import UNKNOWN
from coglab_smach.context.requests import Request
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState, Interrupted


class WaitForTrigger(CoglabState):
    """Wait for the operator's trigger before anything moves. ``auto_trigger`` in the configuration skips this."""

    def __init__(self, ctx: Context, action: str = "initialise") -> None:
        super().__init__(ctx)
        self.action = action

    def time_limit(self) -> float:
        return self.ctx.config.number("trigger_timeout")

    def run(self, ud: Any) -> str:
        if self.ctx.config.get("auto_trigger"):
            self.reason = "auto_trigger is set"
            return "succeeded"
        self.ctx.requests.open(self.label, [self.action])
        try:
            self.wait_for(
                lambda: self.ctx.requests.take() is not None,
                f"the operator's request '{self.action}'",
                code=ReasonCode.WAITS_FOR_OPERATOR,
            )
        finally:
            self.ctx.requests.close()
        return "succeeded"


class Hub(CoglabState):
    """wait_without_object and wait_with_object: a trigger, or (if configured) the recognition of an intention, ends the
    wait.

    Outcomes: the actions of this hub. 'stopped': STOP was pressed or the arm was blocked while waiting (hold latched at
    the robot, command mode lost); the state is shown and waits for the operator's reset. 'failed': the robot node is
    silent.
    """

    def __init__(self, ctx: Context, actions: Sequence[str], with_object: bool) -> None:
        known = ["object_entry", "grasp", "grasp_name"] if with_object else []
        super().__init__(
            ctx, outcomes=[*actions, "stopped"], output_keys=["delivery_name"], io_keys=["object_id", *known]
        )
        self.actions = tuple(actions)
        self.with_object = with_object
        self._blocked_since: float | None = None
        self._saw_rest = False
        self._code = 0

    def time_limit(self) -> float:
        # A hub waits without a time limit.
        return math.inf

    def run(self, ud: Any) -> str:
        if not self.with_object:
            self.ctx.holding = ""
        elif ud.object_id != self.ctx.holding or not ud.object_entry:
            # The object is held since before this start, so user data does not contain its entry.
            ud.object_id, ud.object_entry = self.ctx.holding, {}
        self._blocked_since, self._saw_rest = None, False
        self.ctx.journal.settle()
        while True:
            self._open(ud)
            try:
                request = self._await_request()
            finally:
                self.ctx.requests.close()
            if request is None:
                self.ctx.journal.failure(self.reason, (), self._code)
                return "stopped"
            if not self.with_object:
                ud.object_id = request.object_id or self.ctx.config.text("default_object")
                break
            refusal = self._learn_what_is_held(ud, request)
            if not refusal:
                break
            self.ctx.journal.transition(
                self.path(), self.label, "refused", self.label, refusal, (), ReasonCode.OBJECT_UNKNOWN
            )
        ud.delivery_name = request.delivery
        self.reason += f"{request.source} requested {request.action} of '{ud.object_id}'"
        return request.action

    def _open(self, ud: Any) -> None:
        unknown = self.with_object and ud.object_id == UNKNOWN
        default = "" if self.with_object else self.ctx.config.text("default_object")
        self.ctx.requests.open(self.label, self.actions, unknown, default)

    def _await_request(self) -> Request | None:
        """Returns the next trigger; None, with a reason, if the arm was stopped first."""
        while True:
            try:
                self.check()
            except Interrupted as interrupt:
                if not interrupt.stop:
                    raise
                self.reason, self._code = str(interrupt), ReasonCode.STOP_LATCHED
                return None
            if self._blocked():
                return None
            request = self.ctx.requests.take()
            if request is not None:
                return request
            self._watch_partner()
            self.ctx.clock.sleep(0.02)

    def _blocked(self) -> bool:
        """True if the arm has been blocked longer than ``hub.blocked_time``. PortError if its node is silent."""
        allowed = self.ctx.arm.motion_allowed()
        now = self.ctx.clock.now()
        if allowed.ok:
            self._blocked_since = None
            return False
        if self._blocked_since is None:
            self._blocked_since = now
        waited = now - self._blocked_since
        silent = self.ctx.arm.joint_positions() is None
        if waited > self.ctx.config.number("hub.silent_time") and silent:
            raise PortError("the robot is silent", (allowed.why,), ReasonCode.NODE_SILENT)
        if waited <= self.ctx.config.number("hub.blocked_time") or silent:
            return False
        self._code = allowed.code
        self.reason = f"the arm is blocked: {allowed.why}"
        return True

    def _learn_what_is_held(self, ud: Any, request: Request) -> str:
        """With an object in the hand, the action always concerns that object. After a restart, read its entry first.
        Returns the reason if the trigger must be refused, else ''."""
        if ud.object_id == UNKNOWN:
            self.ctx.holding = ud.object_id = request.object_id
        elif request.object_id and request.object_id != ud.object_id:
            self.reason = f"requested '{request.object_id}', but the hand holds '{ud.object_id}': this one is used. "
        if ud.object_entry:
            return ""
        try:
            entry = self.await_pending(self.ctx.database.get_object(ud.object_id), f"entry of '{ud.object_id}'", 5.0)
        except PortError as error:
            self.ctx.holding = ud.object_id = UNKNOWN
            return f"'{request.action}' refused: {error.sentence}; name its object_id"
        ud.object_entry = entry
        ud.grasp_name = entry["default_grasp"]
        ud.grasp = entry["grasps"][ud.grasp_name]
        return ""

    def _watch_partner(self) -> None:
        """A believed offer or request is a trigger like the operator's, if this hub has an action for it. The same
        belief starts a reach. Only an intention that began in this hub counts."""
        config = self.ctx.config
        if not config.get("recognition_trigger.enabled"):
            return
        ahead = self.ctx.perception.ahead()
        name, probability = max(("offer", ahead.offer), ("request", ahead.request), key=lambda each: each[1])
        if probability < config.number("recognition_trigger.belief"):
            self._saw_rest = self._saw_rest or probability < config.number("handover.doubt")
            return
        action = str(config.get("recognition_trigger.actions").get(name, ""))
        if self._saw_rest and action in self.actions:
            what = f" of '{ahead.object_id}'" if ahead.object_id else ""
            self.ctx.requests.submit(action, ahead.object_id, f"belief in an {name}{what} ({probability:.2f})")


class Stopped(CoglabState):
    """After STOP: nothing moves until the operator requests 'reset'. Then the arm is enabled again; the hand keeps its
    object. A 'reset' sent directly to the robot is not enough: the arm would go home without a request from the
    operator."""

    ignores_stop = True

    def time_limit(self) -> float:
        return math.inf

    def run(self, ud: Any) -> str:
        await_operator(self, "reset")
        # The operator has confirmed the failure: it is no longer shown, and later failures do not follow from it.
        self.ctx.journal.settle(forget=True)
        self.await_pending(self.ctx.arm.lwr_command("reset"), "LWR command 'reset'", 5.0)
        self.ctx.stop.reset()
        if not self.ctx.arm.motion_allowed().ok:
            # Command mode was lost too. The operator's reset is the explicit start that it needs.
            self.pause(0.3)
            if not self.ctx.arm.motion_allowed().ok:
                self.await_pending(self.ctx.arm.lwr_command("start"), "LWR command 'start'", 20.0)
            self.wait_for(
                lambda: self.ctx.arm.motion_allowed().ok, "command mode of the LWR", 10.0, code=ReasonCode.WAITS_FOR_ARM
            )
        return "succeeded"


class Fault(CoglabState):
    """A fault that the recovery could not remove. Reports the reason and waits for 'initialise'. Nothing moves by
    itself."""

    ignores_stop = True

    def time_limit(self) -> float:
        return math.inf

    def run(self, ud: Any) -> str:
        self.reason = self.ctx.journal.why()
        await_operator(self, "initialise")
        self.ctx.journal.settle(forget=True)
        if self.ctx.stop.pressed() or not self.ctx.arm.motion_allowed().ok:
            # A hold that is latched at the robot would make the new initialisation fail too.
            try:
                self.await_pending(self.ctx.arm.lwr_command("reset"), "LWR command 'reset'", 5.0)
            except PortError:
                pass  # the robot may not be running yet; if it stays silent, the initialisation reports it
            self.ctx.stop.reset()
        self.reason = "the operator requested a new initialisation"
        return "succeeded"


def await_operator(state: CoglabState, action: str) -> None:
    """Wait, without a time limit, until the operator requests this one action."""
    state.ctx.requests.open(state.label, [action])
    try:
        while state.ctx.requests.take() is None:
            state.check()
            state.ctx.clock.sleep(0.05)
    finally:
        state.ctx.requests.close()
