#!/usr/bin/python3
"""Faults and their reported reasons: hidden hands, lost datagrams, a robot controller that stops."""

from collections.abc import Callable

import coglab
from example import new_figure, parser, save

options = parser(__doc__).parse_args()

TROUBLE: dict[str, Callable[[coglab.World], None]] = {
    "none": lambda world: None,
    "5 % of datagrams lost": lambda world: world.lose(0.05, 0.05),
    "object hidden": lambda world: world.hide("object_mug"),
    "command mode lost": lambda world: world.leave_command_mode(),
}
rows = []
for name, begin in TROUBLE.items():
    with coglab.World(seed=4, person="accustomed") as world:
        reached = world.robot.arm.palm.position[0] + 0.1  # m
        done: list[float] = []

        def once(world: coglab.World, begin=begin, reached=reached, done=done) -> None:
            """In the middle of the reach."""
            if not done and world.true_pose("robot_hand").position[0] > reached:
                done.append(world.time)
                begin(world)

        world.after_period.append(once)
        result = world.robot.receive()
        print(f"{name}: {result}")
        world.after_period.clear()
        if "reset" in world.robot.state.actions:
            print(f"  {world.robot.reset()}")
        rows.append((name, result))

figure = new_figure(8, 3)
axes = figure.subplots()
for k, (_, result) in enumerate(rows):
    axes.barh(k, result.duration, color="tab:blue" if result.ok else "tab:orange")
    axes.text(0.1, k, "succeeded" if result.ok else f"{result.outcome}: {result.reason}", va="center")
axes.set_yticks(range(len(rows)), [name for name, _ in rows])
axes.set_xlabel("duration [s]")
save(figure, __file__, options.out)
