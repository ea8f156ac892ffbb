#!/usr/bin/python3
"""Speed and separation (ISO/TS 15066): a visitor walks up to the moving arm, which slows down and stops."""

from pathlib import Path

import coglab
import numpy as np
import yaml
from coglab_py.packages import package_path
from example import new_figure, parser, save

options = parser(__doc__).parse_args()


def files(folder: Path) -> str:
    """Copy the shipped files into the folder, with two changes: a visitor receives no object, so nobody may touch the
    palm; and the arm is not slow when nobody is in sight."""
    folder.mkdir(parents=True, exist_ok=True)
    config = package_path("coglab_controllers", "config")
    central = yaml.safe_load((config / "safe_distance.yaml").read_text())
    central["safe_distance"] |= {"absent_speed": 1.0, "touch": []}
    central["signals"] = str(config / "safe_distance_signals.yaml")
    (folder / "safe_distance.yaml").write_text(yaml.safe_dump(central))
    return str((folder / "safe_distance.yaml").resolve())


def distance_at(time: float) -> float:
    """Distance (m) of the visitor from the hand: from 3 m at 1 m/s to 0.3 m, 2 s there, and back."""
    return float(np.interp(time, [0.0, 2.7, 4.7, 7.4], [3.0, 0.3, 0.3, 3.0]))


def from_arm(world: coglab.World, person: np.ndarray) -> float:
    """Distance (m) of the person from the lines elbow - wrist - palm, as measured by the robot."""
    points = world.cell.robot.virtual.robot_signal("arm_points").reshape(3, 3)
    share = np.linspace(0.0, 1.0, 101)[:, None]
    lines = np.concatenate([a + share * (b - a) for a, b in zip(points, points[1:], strict=False)])
    return float(np.linalg.norm(lines - person, axis=1).min())


rows: list[tuple[float, float, float]] = []
with coglab.World(seed=3, managers=files(options.out)) as world:
    start = world.time + 1.0
    before = world.true_pose("robot_hand").position

    def visit(world: coglab.World) -> None:
        """The tracker of the lab sees the visitor behind the hand, away from the robot's base."""
        global before
        hand = world.true_pose("robot_hand").position
        distance = distance_at(world.time - start)
        person = hand + distance * np.array([0.0, -1.0, 0.0])
        world.cell.robot.virtual.post_signal("person/human_hand", {"position": person}, frame="lwr_base_link")
        rows.append((world.time - start, from_arm(world, person), float(np.linalg.norm(hand - before)) / 0.005))
        before = hand

    world.cell.blind.add("human_hand")  # the simulated tracker sees only the visitor
    world.after_period.append(visit)
    home = np.asarray(world.robot.arm.home)
    other = home + [0.5, 0.3, 0.0, -0.4, 0.0, 0.0, 0.0]
    while world.time < start + 9.0:
        for goal in (other, home):
            world.robot.arm.move_joints(goal, duration=1.5)

time, distance, speed = np.array(rows).T
fast, reaction, brake, kept = 1.6, 0.1, 2.0, 0.12 + 0.05 + 0.01 + 0.1  # of safe_distance.yaml
b = reaction + fast / brake
free = np.maximum(0.0, distance - fast * reaction - kept)
allowed = brake * (np.sqrt(b * b + 2.0 * free / brake) - b)
print(f"largest speed above what the distance allows: {np.max(speed[1:] - allowed[1:]):.3f} m/s")
print(f"nearest: {distance.min():.2f} m, the arm stood for {0.005 * np.sum((speed < 1e-3) & (distance < 1.0)):.1f} s")

figure = new_figure(8, 5)
top, bottom = figure.subplots(2, sharex=True)
top.plot(time, distance)
top.set_ylabel("distance [m]")
bottom.plot(time[1:], speed[1:], label="hand")
bottom.plot(time, allowed, "--", color="0.4", label="allowed")
bottom.set_ylim(0.0, 1.0)
bottom.set_ylabel("speed [m/s]")
bottom.set_xlabel("time [s]")
bottom.legend()
save(figure, __file__, options.out)
