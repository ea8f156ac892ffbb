"""States of the arm: plug-ins and primitives, LWR interface, point-to-point motion."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.kinematics.motion_time import ptp_time
from coglab_smach.ports.pending import Polled, PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.hand_tracking import person_at, seen_at
from coglab_smach.states.held_object import LOOK, HeldObject

RESUMES = 3  # retries of a motion that did not reach its target, e.g. because a person holds on
RESUME_AFTER = 1.0  # s from the end of such a motion to the next try
FELL = 0.5  # m below the person's hand: there, an object counts as fallen


class LoadControllers(CoglabState):
    """Load the DMP and the point-to-point plug-in into the controller manager (D4.10 Figure 4)."""

    default_time_limit = 40.0

    def run(self, ud: Any) -> str:
        for controller_id, controller_type in dict(self.ctx.config.get("controllers")).items():
            self.await_pending(
                self.ctx.arm.load_controller(controller_id, controller_type),
                f"loading plug-in '{controller_id}' of type {controller_type}",
            )
        return "succeeded"


class LoadDmps(CoglabState):
    """Load the library of primitives."""

    default_time_limit = 15.0

    def run(self, ud: Any) -> str:
        filename = self.ctx.config.text("dmp_library")
        count = self.await_pending(self.ctx.arm.load_dmps(filename), f"loading primitives of {filename}")
        self.reason = f"{count} primitives loaded from {filename}"
        return "succeeded"


class ConfigureLwr(CoglabState):
    """Bring the LWR interface into command mode: control strategy, start, then wait until motion is allowed."""

    default_time_limit = 45.0

    def run(self, ud: Any) -> str:
        while not self.ctx.arm.motion_allowed()[0]:
            try:
                for command in list(self.ctx.config.get("lwr_commands")):
                    self.await_pending(self.ctx.arm.lwr_command(command), f"LWR command '{command}'")
                break
            except TimeLimit:
                raise
            except PortError:
                # The robot controller may still be starting: try again within the time limit.
                if self.left() < 2.0:
                    raise
                # Or somebody left it in command mode with another strategy, which can only be changed after a stop.
                with suppress(PortError):
                    self.await_pending(self.ctx.arm.lwr_command("stop"), "LWR command 'stop'")
                self.pause(1.0)
        try:
            self.wait_for(
                lambda: self.ctx.arm.motion_allowed()[0], "command mode of the LWR", code=ReasonCode.WAITS_FOR_ARM
            )
        except TimeLimit as limit:
            blocked = self.ctx.arm.motion_allowed()
            limit.causes, limit.code = (blocked.why,), blocked.code
            raise
        return "succeeded"


class SwitchController(CoglabState):
    """Make one plug-in the active one. A switch to 'ptp' ends a running DMP."""

    default_time_limit = 5.0
    owns_motion = True

    def __init__(self, ctx: Context, controller_id: str) -> None:
        super().__init__(ctx)
        self.controller_id = controller_id

    def run(self, ud: Any) -> str:
        self.await_pending(
            self.ctx.arm.switch_controller(self.controller_id), f"switching to controller '{self.controller_id}'"
        )
        return "succeeded"


class PtpMotion(CoglabState):
    """Point-to-point motion to a named posture of the configuration (``postures.<name>``); 'home' is
    coglab_home_robot. Time limit: ``ptp_timeout`` plus 1.5 times the duration computed from limits and path. If
    something keeps the arm from its target, the motion is repeated, RESUMES times at most."""

    default_time_limit = 20.0
    owns_motion = True

    def __init__(self, ctx: Context, posture: str = "home") -> None:
        super().__init__(ctx)
        self.posture = posture

    def run(self, ud: Any) -> str:
        target = [float(v) for v in self.ctx.config.get(f"postures.{self.posture}")]
        speed = [float(v) for v in self.ctx.config.get("ptp_velocity")]
        arm = self.ctx.arm
        self.await_pending(arm.switch_controller("ptp"), "switching to controller 'ptp'", 5.0)
        look = self._look_after(ud)
        for tries in range(RESUMES + 1):
            try:
                self._move(target, speed, look)
                break
            except PortError as error:
                if error.code != ReasonCode.TARGET_NOT_REACHED or tries == RESUMES:
                    raise
            self.allow(2.0 * RESUME_AFTER)
            self.pause(RESUME_AFTER)
        self._verify(target)
        return "succeeded"

    def _move(self, target: list[float], speed: list[float], look: Callable[[], object]) -> None:
        arm = self.ctx.arm
        here = arm.joint_positions()
        if here is not None:
            self.allow(self.ctx.config.number("ptp_timeout") + 1.5 * ptp_time(arm.motion_limits(), here, target, speed))
        motion = arm.move_ptp(target, speed)
        self.await_pending(
            Polled(lambda: bool(look()) or motion.done(), motion.result, motion.cancel),
            f"the motion to posture '{self.posture}'",
            pace=arm.speed_scale,
            code=ReasonCode.WAITS_FOR_ARM,
        )

    def _look_after(self, ud: Any) -> Callable[[], object]:
        """Returns a function that is called repeatedly during the motion; it raises an error to end the motion."""
        return lambda: None

    def _verify(self, target: list[float]) -> None:
        """Check that the measured joints agree with the reported arrival; they have 1 s to settle."""
        tolerance = self.ctx.config.number("ptp_tolerance")

        def arrived() -> bool:
            measured = self.ctx.arm.joint_positions()
            return measured is None or max(abs(m - t) for m, t in zip(measured, target, strict=False)) <= tolerance

        self.allow(1.5)
        self.wait_for(
            arrived,
            f"all measured joints within {tolerance} rad of posture '{self.posture}'",
            1.0,
            code=ReasonCode.WAITS_FOR_ARM,
        )


class HomeRobot(PtpMotion):
    """coglab_home_robot: the arm moves to its home posture. ``carries``: the hand holds the object of the action. The
    state fails if the object is lost; at home it waits until the object is seen to stay. ``gave``: the state fails if
    the object has meanwhile fallen from the person's hand."""

    def __init__(self, ctx: Context, carries: bool = False, gave: bool = False) -> None:
        super().__init__(ctx, "home")
        self.carries, self.gave = carries, gave
        self._held: HeldObject
        if carries or gave:
            self.register_input_keys(["object_id"])
        if carries:
            self.register_io_keys(["grip"])

    def run(self, ud: Any) -> str:
        outcome = super().run(ud)
        if self.carries:
            self._see_held()
        if self.gave:
            self._see_given(ud.object_id)
        return outcome

    def _look_after(self, ud: Any) -> Callable[[], object]:
        if not self.carries:
            return super()._look_after(ud)
        self._held = HeldObject(self.ctx, ud.object_id, ud.grip)
        return self._held.check

    def _see_held(self) -> None:
        """An object that falls at the end of the motion is not held. Wait until it is seen to stay, at most LOOK s. If
        it is not seen, the hand's report counts."""
        here = self.ctx.clock.now()
        self.allow(2.0 * LOOK)
        while not self._held.stays(here) and self.ctx.clock.now() < here + LOOK:
            self.pause(0.02)

    def _see_given(self, object_id: str) -> None:
        thing, hand = seen_at(self, object_id), person_at(self)
        if thing is not None and hand is not None and hand[2] - thing[2] > FELL:
            raise PortError(
                f"'{object_id}' fell as it was given",
                (f"it is seen {hand[2] - thing[2]:.2f} m below the person's hand",),
                ReasonCode.GOAL_FELL,
            )
