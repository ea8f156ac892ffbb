"""Recovery from any failure: the arm goes home and the hand is open or holds the object, unless STOP or a fault
forbids motion."""

from __future__ import annotations

from typing import Any

from coglab_msgs.msg import ReasonCode, Say

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.context.holding import UNKNOWN
from coglab_smach.ports.interfaces import Verdict
from coglab_smach.ports.pending import PortError
from coglab_smach.states.arm import HomeRobot
from coglab_smach.states.base import CoglabMachine, CoglabState
from coglab_smach.states.hand import HandTighten
from coglab_smach.states.hand_tracking import AWAY, from_palm
from coglab_smach.states.held_object import LOOK, HeldObject
from coglab_smach.states.motion import end_motion
from coglab_smach.states.reach import CAUGHT
from coglab_smach.states.weight import person_has_it, person_holds

LETS_GO = 5.0  # s, time for a person to let go of a shared object and leave after the message that the action is over


def arm_is_blocked(state: CoglabState) -> Verdict:
    """Returns whether the arm may not move (hold, command mode lost), and why. Not blocked if its node is silent."""
    allowed = state.ctx.arm.motion_allowed()
    if allowed.ok or state.ctx.arm.joint_positions() is None:
        return Verdict(False)
    return Verdict(True, allowed.why or "no reason was given", allowed.code)


class EndMotion(CoglabState):
    """First step of every recovery: end the running motion and wait until the arm stands. After STOP, or while the arm
    is blocked, it does nothing: the operator decides, and the hand keeps its object."""

    default_time_limit = 12.0
    ignores_stop = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["succeeded", "stopped"], io_keys=["grip"])

    def run(self, ud: Any) -> str:
        if self.ctx.stop.pressed():
            ud.grip.stop()
            self.reason = f"STOP: {self.ctx.stop.reason}; the hand keeps its object"
            return "stopped"
        self.ctx.contact.disarm()
        trouble = "" if arm_is_blocked(self).ok else end_motion(self.ctx, "recovery after a failure")
        blocked = arm_is_blocked(self)
        if blocked.ok:
            self.reason = f"the arm is blocked: {blocked.why}; the hand keeps its object"
            self.ctx.journal.stopped(self.reason, blocked.why, blocked.code)
            return "stopped"
        if trouble:
            raise PortError("the arm does not stand, so nothing else is done", (trouble,), ReasonCode.BUSY)
        self.await_pending(self.ctx.arm.switch_controller("ptp"), "switching to 'ptp'")
        return "succeeded"


class SecureHand(CoglabState):
    """Decide whether the hand keeps holding or opens: it keeps holding if it closed on an object. After a STOP, a half
    open hand may report a false grip. Therefore, an object that is seen away from the palm is not held.

    The arm does not move with an object that the person may also hold. The person is informed that the action is over.
    If their hand is not seen to leave within LETS_GO, the outcome is stopped, until the operator has looked and
    requests 'reset'. ``operator``: this is the recovery after that 'reset'.
    """

    default_time_limit = 10.0

    def __init__(self, ctx: Context, operator: bool = False) -> None:
        super().__init__(ctx, outcomes=["succeeded", "stopped"], io_keys=["grip"])
        self.operator, self._said, self._grip = operator, False, Grip()

    def run(self, ud: Any) -> str:
        self._said, self._grip = self.operator, ud.grip
        outcome = self._secure()
        if outcome == "succeeded":
            self._say_given_up()
        return outcome

    def _say_given_up(self) -> None:
        """Inform the person once that the action is over."""
        if not self._said:
            self._said = True
            self.ctx.say(Say.GIVEN_UP, "That did not work; I stop here.")

    def _secure(self) -> str:
        self._closed_on_the_way()
        if self.ctx.holding and self.ctx.hand.state().holding:
            self._look_for_it()
        if self.ctx.holding and self._grip.shared and not self.operator:
            self._await_letting_go()
        if self.ctx.holding and (self.operator or not self._grip.shared):
            self._grip.shared = False
            self.reason = f"the hand keeps '{self.ctx.holding}'"
            return "succeeded"
        if self.ctx.holding:
            return self._stay(f"the person may still hold '{self.ctx.holding}', which is in the robot's fingers")
        try:
            self.await_pending(
                self.ctx.hand.open(self.ctx.config.get("hand.open_speed")),
                "opening of the empty hand",
                8.0,
                code=ReasonCode.WAITS_FOR_HAND,
            )
        except PortError as error:
            if self._grip.shared:
                return self._stay(
                    f"the hand could not be opened, and the person may hold its object ({error.sentence})"
                )
            # A dead hand must not keep the arm from going home. Its object is unknown, so the hand is not forced.
            self.reason = f"the hand could not be opened: {error.sentence}"
        self._grip.release()
        return "succeeded"

    def _closed_on_the_way(self) -> None:
        """Fingers that closed during a failed reach may have caught the object. A person who still holds it gets it
        back. If the person let go at the first touch, the robot keeps it, wherever the person's hand is."""
        grip = self._grip
        closing = grip.take_closing()
        if closing is None or not grip.shared or self.ctx.holding:
            return
        end = self.ctx.clock.now() + CAUGHT
        while not (closing.done() and self.ctx.hand.state().holding) and self.ctx.clock.now() < end:
            self.pause(0.02)
        if not self.ctx.hand.state().holding:
            return
        if not person_has_it(self, grip.hand, self._weighed()):
            away = from_palm(self, grip.hand, 0.3)
            self.ctx.holding, grip.shared = grip.object_id, not self._is_away(away)

    def _is_away(self, away: float | None) -> bool:
        """True if the person's hand was tracked without a gap to ``away`` m from the palm, too far to hold it."""
        return away is not None and away > AWAY and self._grip.hand.is_sure

    def _weighed(self) -> dict[str, float]:
        """Returns the settings of the load measurement."""
        return {"mass": self._grip.mass, "load_share": self.ctx.config.number("hand.load_share")}

    def _await_letting_go(self) -> None:
        """Wait until the person's hand is seen away from the object: then only the robot holds it. If the hand was not
        tracked on its whole way, it may be another hand. Then the arm measures whether the person holds the object."""
        self._say_given_up()
        self.allow(LETS_GO + 10.0)
        end, felt = self.ctx.clock.now() + LETS_GO, False
        while self.ctx.clock.now() < end:
            away = from_palm(self, self._grip.hand)
            asks = away is not None and away > AWAY and not felt
            if self._is_away(away) or (asks and person_holds(self, self._weighed()) is False):
                self._grip.shared = False
                self._look_for_it()
                return
            felt = felt or asks
            self.pause(0.05)

    def _look_for_it(self) -> None:
        """Set the hand to empty if the object is seen elsewhere. If it is not seen, the hand's report counts."""
        held, end = HeldObject(self.ctx, self.ctx.holding, self._grip), self.ctx.clock.now() + LOOK
        try:
            while not held.seen_with_the_hand() and self.ctx.clock.now() < end:
                held.check()
                self.pause(0.02)
        except PortError as error:
            self.reason = "; ".join((error.sentence, *error.causes))

    def _stay(self, why: str) -> str:
        self.reason = f"the arm stays where it is: {why}; free the object"
        self.ctx.journal.stopped(self.reason, self.reason, ReasonCode.NOT_RELEASED)
        return "stopped"


class WhatIsHeld(CoglabState):
    """Choose the hub. The hand reports whether it holds an object; the memory only gives the object's name.

    After a restart, the machine knows no object but the hand may hold one. Then the name comes from the file on disk,
    or is unknown. If the hand reports that it is empty, because somebody took the object meanwhile, that counts too.
    """

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["empty", "holding"], io_keys=["grip"])

    def run(self, ud: Any) -> str:
        held = self._seen_by_the_hand()
        if held is None:
            self.reason = (
                f"the hand does not report its grip; according to the last note, "
                f"{f'it holds {self.ctx.holding!r}' if self.ctx.holding else 'it is empty'}"
            )
        elif held and not self.ctx.holding:
            self.ctx.holding = self.ctx.memory.recall() or UNKNOWN
            ud.grip.firm = 0
            self.reason = f"the hand holds an object since before this start: {self.ctx.holding}"
        elif not held and self.ctx.holding:
            self.reason = f"'{self.ctx.holding}' is not in the hand any more"
            self.ctx.holding = ""
        return "holding" if self.ctx.holding else "empty"

    def _seen_by_the_hand(self) -> bool | None:
        """Returns whether the hand reports a grip; None if it does not answer. A newly started hand node reports a grip
        until a poll of the motors shows that the hand is empty; it gets ``hand.settle_after_start`` s for that."""
        end = self.ctx.clock.now() + self.ctx.config.number("hand.settle_after_start")
        while True:
            state = self.ctx.hand.state()
            if not state.connected:
                return None
            if not state.holding or self.ctx.holding or self.ctx.clock.now() >= end:
                return state.holding
            self.pause(0.1)


def build_recovery(ctx: Context, operator: bool = False) -> CoglabMachine:
    """Outcomes: empty or holding (arm at home), stopped (STOP is latched, the arm is blocked, or a person may also hold
    the object), fault (arm or controller does not obey). ``operator``: recovery after a 'reset'."""
    machine = CoglabMachine(ctx, "recover", ["empty", "holding", "stopped", "fault", "preempted"], io_keys=["grip"])
    failed = {"failed": "check_stop", "preempted": "preempted"}
    with machine:
        machine.add_state("end_motion", EndMotion(ctx), {"succeeded": "secure_hand", "stopped": "stopped", **failed})
        machine.add_state(
            "secure_hand", SecureHand(ctx, operator), {"succeeded": "coglab_home_robot", "stopped": "stopped", **failed}
        )
        machine.add_state("coglab_home_robot", HomeRobot(ctx), {"succeeded": "tighten_at_home", **failed})
        # The object is already held before the hand tightens, so a refusal of the hand does not end the recovery.
        machine.add_state(
            "tighten_at_home",
            HandTighten(ctx, at_home=True),
            {"succeeded": "what_is_held", "failed": "what_is_held", "preempted": "preempted"},
        )
        machine.add_state(
            "what_is_held",
            WhatIsHeld(ctx),
            {"empty": "empty", "holding": "holding", "failed": "check_stop", "preempted": "preempted"},
        )
        machine.add_state(
            "check_stop",
            CheckStop(ctx),
            {"stopped": "stopped", "fault": "fault", "failed": "fault", "preempted": "preempted"},
        )
    return machine


class CheckStop(CoglabState):
    """A recovery step failed. Outcome stopped: because of STOP or a blocked arm. Outcome fault: something is broken."""

    ignores_stop = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["stopped", "fault"])

    def run(self, ud: Any) -> str:
        return "stopped" if self.ctx.stop.pressed() or arm_is_blocked(self).ok else "fault"


ACTION_OUTCOMES = ["succeeded", "failed_empty", "failed_holding", "stopped", "fault", "preempted"]
"""Outcomes of every action machine. The master's transitions depend only on these."""

RECOVERY_TRANSITIONS = {
    "empty": "failed_empty",
    "holding": "failed_holding",
    "stopped": "stopped",
    "fault": "fault",
    "preempted": "preempted",
}
"""Maps the outcomes of 'recover' to those of an action."""


def to_recovery(**transitions: str) -> dict[str, str]:
    """Transitions of a state inside an action: the given ones, and 'failed' to recovery."""
    return {**transitions, "failed": "recover", "preempted": "preempted"}
