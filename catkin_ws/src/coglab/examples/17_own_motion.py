#!/usr/bin/python3
"""Your own motion in Python: the palm draws an eight, in virtual time here.

The same file moves the running robot: ./coglab controller run 17_own_motion.py width=0.1 --start
"""

import coglab
import numpy as np
from coglab.control import Motion, MotionCycle, MotionSetup, MotionStart, Reference
from example import minimum_jerk, new_figure, parser, save


class Eight(Motion):
    """Draws a lying eight in the plane y, z of the base, from rest to rest."""

    def configure(self, setup: MotionSetup) -> None:
        """Declare the arguments of a request."""
        self.width = setup.argument("width", "m", 0.12, 0.0, 0.3)
        self.duration = setup.argument("duration", "s", 5.0, 2.0, 60.0)

    def start(self, start: MotionStart) -> None:
        """Begin at the set-point."""
        self.origin, self.orientation = start.set_point.position, start.set_point.orientation
        self.size, self.all = start.arguments[self.width], start.arguments[self.duration]
        self.time = 0.0

    def place(self, time: float) -> np.ndarray:
        """Position at a time, m."""
        angle = 2.0 * np.pi * float(minimum_jerk(np.array(time / self.all)))
        shape = np.array([0.0, np.sin(angle), 0.5 * np.sin(2.0 * angle)])
        return np.asarray(self.origin + 0.5 * self.size * shape)

    def reference(self, cycle: MotionCycle) -> Reference:
        """Pose and twist of the palm for this cycle."""
        self.time = cycle.next
        now, then = self.place(cycle.time), self.place(cycle.next)
        velocity = (then - now) / (cycle.next - cycle.time)
        return Reference(position=now, orientation=self.orientation, twist=[*velocity, 0.0, 0.0, 0.0])

    def done(self) -> bool:
        """True when the eight is complete."""
        return self.time >= self.all


def main() -> None:
    """Draw two eights and their picture."""
    options = parser(__doc__).parse_args()
    figure = new_figure(7, 4)
    axes = figure.subplots()
    with coglab.World(seed=1, behaviour="absent") as world:
        world.add_motion("eight", Eight())
        for width in (0.08, 0.16):
            path: list[np.ndarray] = []
            world.after_period[:] = [lambda w, path=path: path.append(w.cell.robot.palm().position)]
            print(world.run_motion("eight", width=width))
            rows = np.array(path)
            axes.plot(rows[:, 1], rows[:, 2], label=f"width {width:g} m")
    axes.set_xlabel("y [m]")
    axes.set_ylabel("z [m]")
    axes.set_aspect("equal")
    axes.legend()
    save(figure, __file__, options.out)


if __name__ == "__main__":
    main()
