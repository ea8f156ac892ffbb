"""`./coglab controller new --python --motion NAME`: makes a file with a motion, its test and its plot."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

TEMPLATE = '''"""A motion of the arm: the wrist sways out and back.

Test it:          ./coglab shell python3 -m pytest -q @FILE@
Plot it:          ./coglab shell python3 @FILE@
Move the robot:   ./coglab controller run @FILE@ size=0.2 --start
"""

import numpy as np
from coglab.control import Motion, MotionCycle, MotionSetup, MotionStart, Reference, simulate


class @TYPE@(Motion):
    """Sways the sixth joint by `size` within `duration`, from rest to rest."""

    def configure(self, setup: MotionSetup) -> None:
        """Declare what a request may give: name, unit, default, smallest and largest value."""
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


def make(name: str, into: Path) -> Path:
    """Write the file and return its path. Raises ValueError or OSError with what was expected."""
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*[a-z][A-Za-z0-9]*", name):
        raise ValueError(f"a controller's name is CamelCase, letters and digits, like WristSway; got '{name}'")
    if not into.is_dir():
        raise FileNotFoundError(f"there is no folder {into}; make it first")
    snake = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    target = into / f"{snake}.py"
    text = TEMPLATE.replace("@TYPE@", name).replace("@NAME@", snake).replace("@FILE@", str(target))
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise FileExistsError(f"{target} exists already; choose another name or remove it") from None
    return target


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="./coglab controller new --python", description=__doc__)
    parser.add_argument("name", help="class of the motion in CamelCase, for example WristSway")
    parser.add_argument("--into", type=Path, default=Path("."), help="folder to make it in")
    parser.add_argument("--motion", action="store_true", help="a motion of the arm")
    parser.add_argument("--python", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    try:
        if not options.motion:
            raise ValueError(
                "--python makes motions: add --motion; feedback controllers are made in C++, without --python"
            )
        target = make(options.name, options.into)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"made {target}; its first lines have the commands that test, plot and run it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
