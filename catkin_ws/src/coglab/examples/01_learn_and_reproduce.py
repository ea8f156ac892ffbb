#!/usr/bin/python3
"""Learn a primitive from one demonstration, keep it in a library file, and run it to other goals."""

import tempfile
from pathlib import Path

import coglab_controllers as cc
import numpy as np
from example import minimum_jerk, new_figure, parser, save

options = parser(__doc__).parse_args()
# A demonstration: times in s and positions in m, one row each. Here a reach that is lifted on its way.
times = np.linspace(0.0, 1.2, 241)
way = minimum_jerk(times / 1.2)
demonstration = np.outer(way, [0.5, 0.0, 0.1]) + 0.08 * np.outer(np.sin(np.pi * way), [0.0, 0.0, 1.0])

primitive = cc.learn("lifted_reach", [(times, demonstration)], basis_count=20, mapping="upright")
error = np.linalg.norm(cc.reproduce(primitive, times) - demonstration, axis=1)
print(f"reproduced within {1000 * error.max():.2f} mm")

# Library files are what load_dmps reads.
with tempfile.TemporaryDirectory() as folder:
    library = cc.Library()
    library.add(primitive)
    library.save(str(Path(folder) / "my_primitives.xml"))
    library.load(str(Path(folder) / "my_primitives.xml"))

figure = new_figure(7, 5)
axes = figure.add_subplot(projection="3d")
axes.plot(*demonstration.T, "k--", label="demonstration")
for goal in ([0.5, 0.0, 0.1], [0.3, 0.4, 0.2], [-0.2, 0.4, 0.0], [0.1, -0.3, -0.1]):
    dmp = cc.Dmp(library["lifted_reach"], position=[0.0, 0.0, 0.0], goal=goal)
    _, path, _ = dmp.roll_out(goal, duration=1.5)
    axes.plot(*path.T, label=f"to {goal}")
axes.set_xlabel("x [m]")
axes.set_ylabel("y [m]")
axes.set_zlabel("z [m]")
axes.legend(fontsize=7)
save(figure, __file__, options.out)
