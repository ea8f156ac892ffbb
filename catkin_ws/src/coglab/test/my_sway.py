"""A motion for the tests: one joint sways out and back."""

import numpy as np
from coglab.control import Motion, MotionCycle, MotionSetup, MotionStart, Reference


class Sway(Motion):
    """Sways the sixth joint by `size` and comes back."""

    def configure(self, setup: MotionSetup) -> None:
        """Declare size and duration."""
        self.size = setup.argument("size", "rad", 0.3, 0.0, 0.5)
        self.duration = setup.argument("duration", "s", 2.0, 0.5, 10.0)

    def start(self, start: MotionStart) -> None:
        """Begin at the set-point."""
        self.joints = start.set_point.joints
        self.far, self.all = start.arguments[self.size], start.arguments[self.duration]
        self.time = 0.0

    def reference(self, cycle: MotionCycle) -> Reference:
        """Return the joints on a smooth path out and back."""
        self.time = min(cycle.time, self.all)
        turned = 2.0 * np.pi * self.time / self.all
        joints, velocity = self.joints.copy(), np.zeros(7)
        joints[5] += 0.5 * self.far * (1.0 - np.cos(turned))
        if self.time < self.all:
            velocity[5] = np.pi * self.far / self.all * np.sin(turned)
        return Reference(joints=joints, joint_velocity=velocity)

    def done(self) -> bool:
        """Return true at the end."""
        return self.time >= self.all
