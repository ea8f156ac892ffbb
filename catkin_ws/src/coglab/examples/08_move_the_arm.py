#!/usr/bin/python3
"""Move the arm from Python: joints, poses, a primitive, a moving goal.

With --running, the same calls move a running robot.
"""

from contextlib import ExitStack

import coglab
import numpy as np
from example import new_figure, parser, save

arguments = parser(__doc__)
arguments.add_argument("--running", action="store_true", help="the running robot (./coglab launch arm:=ideal)")
options = arguments.parse_args()

with ExitStack() as stack:
    if options.running:
        robot = stack.enter_context(coglab.connect())
        robot.reset()
    else:
        robot = stack.enter_context(coglab.World(seed=1, behaviour="absent")).robot
    arm = robot.arm
    print(arm.move_joints(arm.home))
    palm = arm.palm

    def circle(t: float) -> np.ndarray:
        """A circle of 8 cm radius in 6 s; m, base frame."""
        angle = 2.0 * np.pi * t / 6.0
        return palm.position + 0.08 * np.array([0.0, np.sin(angle), 1.0 - np.cos(angle)])

    path: list[np.ndarray] = []

    def trace(t: float) -> np.ndarray:
        path.append(np.concatenate([[t], arm.palm.position, circle(t)]))
        return circle(t)

    print(arm.move_to(coglab.Pose(palm.position + [0.1, 0.0, 0.0], palm.orientation), duration=2.0))
    print(arm.reach("reach_human", palm))
    print(arm.follow(trace, 9.0))

rows = np.array(path[1:])
figure = new_figure()
axes = figure.subplots()
axes.plot(rows[:, 5], rows[:, 6], "k--", label="goal")
axes.plot(rows[:, 2], rows[:, 3], label="palm")
axes.set_xlabel("y [m]")
axes.set_ylabel("z [m]")
axes.set_aspect("equal")
axes.legend()
save(figure, __file__, options.out)
