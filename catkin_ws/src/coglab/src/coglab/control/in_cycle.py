"""Runs a motion of `coglab.control` in the cycle of the virtual robot."""

from __future__ import annotations

from typing import Any

from coglab.control.motion import Motion, MotionCycle, MotionSetup, MotionStart, Reference, SetPoint, Vector, is_done


class InCycle:
    """Adapter of a motion (a `Motion`, or an object with its four methods) for `LockstepRobot.add_motion`."""

    def __init__(self, motion: Motion, robot: Any = None, cycle_time: float = 0.005) -> None:
        """``robot``: has ``chain`` and ``limits`` of the arm; ``cycle_time``: s. Raises the errors of `configure`."""
        self.motion = motion
        self.setup = MotionSetup(robot, cycle_time)
        motion.configure(self.setup)

    def arguments(self) -> list[tuple[str, str, float, float, float]]:
        """Returns name, unit, default and range of each declared argument."""
        return [(each.name, each.unit, each.default, each.low, each.high) for each in self.setup.arguments]

    def start(
        self,
        values: list[float],
        joints: Vector,
        joint_velocity: Vector,
        position: Vector,
        orientation: Vector,
        twist: Vector,
    ) -> None:
        """Begins a motion at the set-point."""
        named = {each.name: value for each, value in zip(self.setup.arguments, values, strict=True)}
        self.motion.start(MotionStart(named, SetPoint(joints, joint_velocity, position, orientation, twist)))

    def reference(self, time: float, next: float, joints: Vector) -> tuple[Any, ...] | None:
        """Returns the arrays of the motion's reference; None at rest."""
        reference = self.motion.reference(MotionCycle(time, next, joints))
        if not isinstance(reference, Reference):
            raise TypeError(f"reference(): a coglab.control.Reference is expected, {type(reference).__name__} came")
        if reference.at_rest:
            return None
        if reference.joints is not None:
            return reference.joints, reference.joint_velocity
        return reference.position, reference.orientation, reference.twist

    def done(self) -> bool:
        """Returns whether the reference has ended."""
        return is_done(self.motion)
