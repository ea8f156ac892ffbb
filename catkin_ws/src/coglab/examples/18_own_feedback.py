#!/usr/bin/python3
"""Your own feedback controller in Python: the hand yields to a push like a mass on a spring and a damper.

The same file corrects the running robot: ./coglab controller run 18_own_feedback.py stiffness=200
"""

import coglab
import ctrl_more
import numpy as np
from example import new_figure, parser, save


class Spring(ctrl_more.FeedbackController):
    """Shifts the hand's reference by x, where mass x'' + damping x' + stiffness x = force."""

    def describe(self) -> ctrl_more.Description:
        """Declare inputs, correction and gains."""
        d = ctrl_more.Description("Lets the hand yield to a push.")
        d.measured("wrench", size=6, unit="N, Nm", frame="base", max_age=0.1)
        d.modifies(
            "taskSpaceReferencePose", "ee", unit="m", frame="base", limit=ctrl_more.CorrectionLimit(size=0.1, rate=0.5)
        )
        d.gain("mass", 4.0, low=1.0, high=50.0, unit="kg")
        d.gain("damping", 60.0, low=10.0, high=500.0, unit="N s/m")
        d.gain("stiffness", 300.0, low=150.0, high=5000.0, unit="N/m")
        return d

    def initialize(self, setup: ctrl_more.Setup) -> None:
        """Get the handles of inputs, correction and gains."""
        self.wrench, self.ee = setup.read("wrench"), setup.modify("ee")
        self.mass, self.damping, self.stiffness = (setup.gain(name) for name in ("mass", "damping", "stiffness"))
        self.reset()

    def reset(self) -> None:
        """Begin at rest."""
        self.shift, self.velocity = np.zeros(3), np.zeros(3)

    def update(
        self,
        cycle: ctrl_more.Cycle,
        robot: ctrl_more.RobotView,
        original: ctrl_more.ControlView,
        modified: ctrl_more.ModifiedControlStates,
    ) -> None:
        """One control cycle."""
        force = robot.view(self.wrench)[:3]
        felt = force if force @ force > 9.0 else 0.0  # N, below 3 N it is noise
        braking = self.scalar(self.damping) * self.velocity + self.scalar(self.stiffness) * self.shift
        self.velocity = self.velocity + cycle.dt * (felt - braking) / self.scalar(self.mass)
        self.shift = np.clip(self.shift + cycle.dt * self.velocity, -0.05, 0.05)
        modified[self.ee][:3] += self.shift


def main() -> None:
    """Push the hand with three stiffnesses and plot its path."""
    options = parser(__doc__).parse_args()
    figure = new_figure(7, 4)
    axes = figure.subplots()
    for stiffness in (200.0, 400.0, 1000.0):
        with coglab.World(seed=1, behaviour="absent") as world:
            world.feedback.add_controller(Spring(), "spring", enabled=True)
            world.feedback.set_gains("spring", {"stiffness": stiffness})
            world.step(0.5)
            path: list[float] = []
            world.after_period.append(lambda w, path=path: path.append(w.cell.robot.palm().position[1]))
            world.push([0.0, 10.0, 0.0], 2.0)
            world.step(4.0)
            moved = 1000.0 * (np.array(path) - path[0])
        print(f"{stiffness:g} N/m: {moved.max():.1f} mm")
        axes.plot(0.005 * np.arange(len(moved)), moved, label=f"{stiffness:g} N/m")
    axes.set_xlabel("time [s]; 10 N push it for 2 s")
    axes.set_ylabel("palm along y [mm]")
    axes.legend()
    save(figure, __file__, options.out)


if __name__ == "__main__":
    main()
