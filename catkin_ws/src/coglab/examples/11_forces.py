#!/usr/bin/python3
"""Forces of a handover on both hands, and external torques of the joints. Somebody pushes the arm."""

import coglab
import numpy as np
from example import new_figure, parser, save

options = parser(__doc__).parse_args()

with coglab.World(seed=5, person="accustomed", object="bottle") as world:
    pushes: list[float] = []

    def push(world: coglab.World) -> None:
        """Somebody knocks against the arm once, while it carries the bottle."""
        touched = np.linalg.norm(world.truth["human_force"]) > 0.1  # N, the person still lets go
        if not pushes and not touched and world.truth["held_by"] == "robot":
            pushes.append(world.time)
            world.push([0.0, 25.0, 0.0], seconds=0.2)

    world.after_period.append(push)
    trial = world.trial("receive", "give")

print(*trial.results, sep="\n")
print(f"largest force while both touch the bottle: {trial.peak_force:.1f} N")
figure = new_figure(8, 6)
top, middle, bottom = figure.subplots(3, sharex=True)
top.plot(trial.time, np.linalg.norm(trial.hand_force, axis=1))
top.set_ylabel("on the robot's hand [N]")
middle.plot(trial.time, trial.person_force, label=["x", "y", "z"])
middle.set_ylabel("on the person's hand [N]")
middle.legend(ncols=3)
bottom.plot(trial.time, trial.external_torque, linewidth=0.8)
bottom.set_ylabel("external torque [Nm]")
bottom.set_xlabel("time [s]; dashed: contact events, dotted: the push")
for axes in (top, middle, bottom):
    for when, *_ in trial.contacts:
        axes.axvline(when, color="0.5", linestyle="--", linewidth=0.8)
    for when in pushes:
        axes.axvline(when, color="0.2", linestyle=":")
save(figure, __file__, options.out)
