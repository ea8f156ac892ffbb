"""Recovery: whatever failed, the arm ends at home and the hand is open or holding, unless STOP or a fault
forbids motion."""
from __future__ import annotations

from typing import Any

from ..context import Context
from ..pending import PortError
from ..states.arm import HomeRobot
from ..states.base import CoglabMachine, CoglabState


class EndMotion(CoglabState):
    """First step of every recovery: end the running motion. After STOP nothing is touched at all."""

    default_time_limit = 5.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["succeeded", "stopped"])

    def run(self, ud: Any) -> str:
        if self.ctx.stop.pressed():
            self.reason = f"STOP: {self.ctx.stop.reason}; the hand keeps what it holds"
            return "stopped"
        self.ctx.contact.disarm()
        self.await_pending(self.ctx.arm.switch_controller("ptp"), "end of the motion by switching to 'ptp'")
        return "succeeded"


class SecureHand(CoglabState):
    """Decide what the hand does during recovery: keep holding if it closed on an object, else open."""

    default_time_limit = 10.0

    def run(self, ud: Any) -> str:
        if self.ctx.holding:
            self.reason = f"the hand keeps '{self.ctx.holding}'"
            return "succeeded"
        try:
            self.await_pending(self.ctx.hand.open(int(self.ctx.config.get("hand.open_speed", 400))),
                               "opening of the empty hand")
        except PortError as error:
            # A dead hand must not keep the arm from going home; what it may hold is unknown, so it is not forced.
            self.reason = f"the hand could not be opened: {error.sentence}"
        return "succeeded"


class WhatIsHeld(CoglabState):
    """Which hub is the right one now."""

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["empty", "holding"])

    def run(self, ud: Any) -> str:
        return "holding" if self.ctx.holding else "empty"


def build_recovery(ctx: Context) -> CoglabMachine:
    """Outcomes: empty, holding (arm at home), stopped (STOP is latched), fault (arm or controller does not obey)."""
    machine = CoglabMachine(ctx, "recover", ["empty", "holding", "stopped", "fault", "preempted"])
    failed = {"failed": "check_stop", "preempted": "preempted"}
    with machine:
        machine.add_state("end_motion", EndMotion(ctx), {"succeeded": "secure_hand", "stopped": "stopped", **failed})
        machine.add_state("secure_hand", SecureHand(ctx), {"succeeded": "coglab_home_robot", **failed})
        machine.add_state("coglab_home_robot", HomeRobot(ctx), {"succeeded": "what_is_held", **failed})
        machine.add_state("what_is_held", WhatIsHeld(ctx),
                          {"empty": "empty", "holding": "holding", "failed": "fault", "preempted": "preempted"})
        machine.add_state("check_stop", CheckStop(ctx),
                          {"stopped": "stopped", "fault": "fault", "failed": "fault", "preempted": "preempted"})
    return machine


class CheckStop(CoglabState):
    """A step of recovery failed: because of STOP, or because something is broken?"""

    ignores_stop = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["stopped", "fault"])

    def run(self, ud: Any) -> str:
        return "stopped" if self.ctx.stop.pressed() else "fault"


ACTION_OUTCOMES = ["succeeded", "failed_empty", "failed_holding", "stopped", "fault", "preempted"]
"""Outcomes of every action machine; the master's transitions depend on nothing else."""

RECOVERY_TRANSITIONS = {"empty": "failed_empty", "holding": "failed_holding", "stopped": "stopped", "fault": "fault",
                        "preempted": "preempted"}
"""How the outcomes of 'recover' end an action."""


def to_recovery(**transitions: str) -> dict[str, str]:
    """Transitions of a state inside an action: its own, and failure to recovery."""
    return {**transitions, "failed": "recover", "preempted": "preempted"}
