"""Speed and separation with the distance of the simulated person, in virtual time."""

from __future__ import annotations

from collections.abc import Callable

import coglab
import numpy as np

DT = 0.005  # s


def fastest_hand(world: coglab.World, when: Callable[[], bool]) -> list[float]:
    """Speeds (m/s) of the robot's hand in the periods in which ``when`` is true; the list grows while time passes."""
    last, speeds = [world.true_pose("robot_hand").position], []

    def look(world: coglab.World) -> None:
        now = world.true_pose("robot_hand").position
        if when():
            speeds.append(float(np.linalg.norm(now - last[0])) / DT)
        last[0] = now

    world.after_period.append(look)
    return speeds


def distance(world: coglab.World) -> float:
    """Distance (m) of the person's hand from the palm."""
    gap = world.true_pose("human_hand").position - world.true_pose("robot_hand").position
    return float(np.linalg.norm(gap))


def test_a_handover_ends_and_the_arm_is_slow_near_the_hand() -> None:
    durations = {}
    for managers in ("", "safe_distance"):
        with coglab.World(seed=3, managers=managers) as world:
            near = fastest_hand(world, lambda world=world: distance(world) < 0.4)
            begin = world.time
            assert all(world.trial("receive", "give").results)
            durations[managers] = world.time - begin
            if managers:
                assert max(near) < 0.3, "touch_speed is 0.25 m/s"
    assert durations["safe_distance"] > durations[""]


def test_a_plain_motion_stands_while_a_hand_is_at_the_elbow() -> None:
    with coglab.World(seed=3, managers="safe_distance") as world:
        home = np.asarray(world.robot.arm.home)
        world.cell.blind.add("human_hand")
        begin = world.time

        def visit(world: coglab.World) -> None:
            if 1.0 < world.time - begin < 4.0:
                elbow = world.cell.robot.virtual.robot_signal("arm_points")[:3]
                place = {"position": list(elbow + [0.0, 0.0, 0.2]), "orientation": [0.0, 0.0, 0.0, 1.0]}
                world.cell.robot.virtual.post_signal("person/human_hand", place, frame="lwr_base_link")

        world.after_period.append(visit)
        stands = fastest_hand(world, lambda: 2.0 < world.time - begin < 4.0)
        world.robot.arm.move_joints(home + [0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], duration=3.0)
        assert max(stands) < 1e-3
        assert world.time - begin > 5.0
