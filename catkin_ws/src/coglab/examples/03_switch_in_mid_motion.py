#!/usr/bin/python3
"""Replace the running primitive, or its speed, without a step in position or velocity (switch_dmp)."""

import coglab_controllers as cc
import numpy as np
from example import PRIMITIVES, new_figure, parser, save

options = parser(__doc__).parse_args()
CYCLE = 0.005  # s
GOAL = np.array([0.4, 0.0, -0.2])  # m
library = cc.Library()
library.load(str(PRIMITIVES))

figure = new_figure(9, 4)
(left, right) = figure.subplots(1, 2)
for name, ratio in (("reach_human", 1.0), ("reach_human", 2.0), ("put_board", 1.0)):
    dmp = cc.Dmp(library["reach_human"], [0.0, 0.0, 0.0], GOAL)
    path, speeds = [], []
    for i in range(500):
        if i == 100:
            before = dmp.position, dmp.velocity
            dmp.switch_to(library[name], GOAL, ratio)
            assert np.array_equal(before, (dmp.position, dmp.velocity))
        dmp.step(CYCLE, GOAL)
        path.append(dmp.position)
        speeds.append(np.linalg.norm(dmp.velocity))
    left.plot(*np.array(path)[:, [0, 2]].T, label=f"{name}, ratio {ratio}")
    right.plot(CYCLE * np.arange(500), speeds)
left.set_xlabel("x [m]")
left.set_ylabel("z [m]")
right.set_xlabel("time [s], switched at 0.5")
right.set_ylabel("speed [m/s]")
left.legend()
save(figure, __file__, options.out)
