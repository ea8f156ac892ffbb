"""`./coglab controller new --python [--motion] NAME`: makes one file with a controller, its test and its plot."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

MOTION = '''"""A motion of the arm: the wrist sways out and back.

Test it:          ./coglab shell python3 -m pytest -q @FILE@
Plot it:          ./coglab shell python3 @FILE@
Move the robot:   ./coglab controller run @FILE@ size=0.2 --start
"""

import numpy as np
from coglab.control import Motion, MotionCycle, MotionSetup, MotionStart, Reference, simulate


class @TYPE@(Motion):
    """Sways the sixth joint by `size` within `duration`, from rest to rest."""

    def configure(self, setup: MotionSetup) -> None:
        """Declare the arguments of a request: name, unit, default, smallest and largest value."""
        self.size = setup.argument("size", "rad", 0.3, 0.0, 0.5)
        self.duration = setup.argument("duration", "s", 3.0, 1.0, 20.0)

    def start(self, start: MotionStart) -> None:
        """Begin where the arm is."""
        self.joints = start.set_point.joints
        self.far, self.all = start.arguments[self.size], start.arguments[self.duration]
        self.time = 0.0

    def reference(self, cycle: MotionCycle) -> Reference:
        """Return joints (rad) and their velocity (rad/s) for this cycle."""
        self.time = min(cycle.time, self.all)
        angle = 2.0 * np.pi * self.time / self.all
        joints, velocity = self.joints.copy(), np.zeros(7)
        joints[5] += 0.5 * self.far * (1.0 - np.cos(angle))
        velocity[5] = np.pi * self.far / self.all * np.sin(angle)
        return Reference(joints=joints, joint_velocity=velocity)

    def done(self) -> bool:
        """Return true when the reference has ended."""
        return self.time >= self.all


def test_it_sways_out_and_comes_back() -> None:
    run = simulate(@TYPE@(), {"size": 0.2, "duration": 2.0})
    way = run.joints[:, 5] - run.joints[0, 5]
    assert abs(way.max() - 0.2) < 1e-3
    assert abs(way[-1]) < 1e-6
    assert np.abs(run.velocity).max() < 0.5  # rad/s
    assert run.jump < 1e-4


if __name__ == "__main__":
    from matplotlib import pyplot

    motion = simulate(@TYPE@())
    figure, (above, below) = pyplot.subplots(2, sharex=True)
    above.plot(motion.time, motion.joints - motion.joints[0])
    above.set_ylabel("joints - start (rad)")
    below.plot(motion.time, motion.velocity)
    below.set_ylabel("velocity (rad/s)")
    below.set_xlabel("time (s)")
    figure.savefig("@NAME@.png")
    print("wrote @NAME@.png")
'''

FEEDBACK = '''"""A feedback controller: the hand yields to a push like a spring with a damper.

Test it:          ./coglab shell python3 -m pytest -q @FILE@
Plot it:          ./coglab shell python3 @FILE@
On the robot:     ./coglab controller run @FILE@ stiffness=400
"""

import coglab
import ctrl_more
import numpy as np


class @TYPE@(ctrl_more.FeedbackController):
    """Shifts the hand's reference along the measured force, by force / stiffness."""

    def describe(self) -> ctrl_more.Description:
        """Declare inputs, correction and gains: name, value, smallest and largest, unit."""
        d = ctrl_more.Description(
            "Lets the hand yield to a push.",
            use="Enable it, then push the hand.",
            when="A person may move the hand a little.",
            limitations="It takes the weight of an unknown object for a push.",
            law=r"T \\dot c = F / k - c",
            source="A spring and a damper.",
        )
        d.measured("wrench", size=6, unit="N, Nm", frame="base", max_age=0.1, text="force at the hand")
        bounds = ctrl_more.CorrectionLimit(size=0.06, rate=0.3)  # m, m/s
        d.modifies("taskSpaceReferencePose", "ee", unit="m", frame="base", limit=bounds, text="the shift is added")
        d.gain("stiffness", 300.0, low=100.0, high=5000.0, unit="N/m", text="force for one metre of shift")
        d.gain("time_constant", 0.3, low=0.05, high=5.0, unit="s", text="of the shift")
        d.gain("dead_band", 3.0, low=0.0, high=50.0, unit="N", text="a smaller force counts as none")
        return d

    def initialize(self, setup: ctrl_more.Setup) -> None:
        """Get the handles of inputs, correction and gains."""
        self.wrench, self.ee = setup.read("wrench"), setup.modify("ee")
        self.stiffness, self.time_constant = setup.gain("stiffness"), setup.gain("time_constant")
        self.dead_band = setup.gain("dead_band")
        self.reset()

    def reset(self) -> None:
        """Begin without a shift."""
        self.shift = np.zeros(3)

    def update(
        self,
        cycle: ctrl_more.Cycle,
        robot: ctrl_more.RobotView,
        original: ctrl_more.ControlView,
        modified: ctrl_more.ModifiedControlStates,
    ) -> None:
        """Run once a control cycle (5 ms)."""
        force = robot.view(self.wrench)[:3]
        size = float(np.linalg.norm(force))
        felt = force * (max(0.0, size - self.scalar(self.dead_band)) / size) if size > 0.0 else force
        wanted = felt / self.scalar(self.stiffness)
        length = float(np.linalg.norm(wanted))
        if length > 0.05:
            wanted = wanted * (0.05 / length)  # m, below the limit of describe()
        self.shift += (wanted - self.shift) * min(1.0, cycle.dt / self.scalar(self.time_constant))
        modified[self.ee][:3] += self.shift


def push(enabled: bool = True) -> np.ndarray:
    """Positions of the palm (m, one row each 5 ms) in virtual time, while 15 N push it along y for 1 s."""
    with coglab.World(seed=1, person="patient") as world:
        world.feedback.add_controller(@TYPE@(), "@NAME@", enabled=enabled)
        world.step(0.5)
        path: list[np.ndarray] = []
        world.after_period.append(lambda w: path.append(w.cell.robot.palm().position))
        world.push([0.0, 15.0, 0.0], 1.0)
        world.step(2.5)
        assert not world.feedback.status("@NAME@").faults
    return np.array(path)


def test_hand_yields_to_a_push_and_comes_back() -> None:
    stiff, yields = push(enabled=False), push()
    moved = (yields - stiff)[:, 1]
    assert 0.015 < moved.max() < 0.06  # m
    assert abs(moved[-1]) < 0.005


if __name__ == "__main__":
    from matplotlib import pyplot

    figure, axes = pyplot.subplots()
    for label, row in (("without", push(enabled=False)), ("with @TYPE@", push())):
        axes.plot(0.005 * np.arange(len(row)), 1000.0 * (row[:, 1] - row[0, 1]), label=label)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("palm along y (mm)")
    axes.legend()
    figure.savefig("@NAME@.png")
    print("wrote @NAME@.png")
'''


def make(name: str, into: Path, motion: bool = False) -> Path:
    """Write the file of a motion or of a feedback controller and return its path.

    Raises ValueError or OSError that names the expected value.
    """
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*[a-z][A-Za-z0-9]*", name):
        raise ValueError(f"a controller's name is CamelCase, letters and digits, like WristSway; got '{name}'")
    if not into.is_dir():
        raise FileNotFoundError(f"there is no folder {into}; make it first")
    snake = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    target = into / f"{snake}.py"
    text = (
        (MOTION if motion else FEEDBACK).replace("@TYPE@", name).replace("@NAME@", snake).replace("@FILE@", str(target))
    )
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise FileExistsError(f"{target} exists already; choose another name or remove it") from None
    return target


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="./coglab controller new --python", description=__doc__)
    parser.add_argument("name", help="class of the controller in CamelCase, for example WristSway")
    parser.add_argument("--into", type=Path, default=Path("."), help="folder of the new file")
    parser.add_argument("--motion", action="store_true", help="a motion of the arm, instead of a feedback controller")
    parser.add_argument("--python", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    try:
        target = make(options.name, options.into, options.motion)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"made {target}; its first lines have the commands that test, plot and run it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
