"""Feedback controllers with the sensors in the palm, in a handover in virtual time."""

from __future__ import annotations

import coglab
import numpy as np
import pytest


def test_palm_sensors_drive_feedback_controllers_in_a_handover() -> None:
    activities: set[str] = set()
    forces: list[np.ndarray] = []

    def look(world: coglab.World) -> None:
        robot = world.cell.robot.virtual
        if robot.report()["active"] == "dmp":
            activities.add(robot.feedback.status("attitude").activity)
        if world.truth["held_by"] == "robot":
            # Upward load of the hand, base frame: the sensor's axes are those of the palm.
            palm = world.true_pose("robot_hand")
            forces.append(palm.rotation.apply(robot.robot_signal("palm_wrench")[:3]))

    with coglab.World(seed=3, feedback="palm") as world:
        world.after_period.append(look)
        trial = world.trial("receive")
        mass = world.cell.scene.object_mass
    assert all(trial.results)
    assert "running" in activities
    assert np.median(forces, axis=0)[2] == pytest.approx(-9.81 * mass, abs=0.5)


def test_the_robot_hands_over_again_after_a_stop_in_a_corrected_reach() -> None:
    with coglab.World(seed=7, feedback="palm") as world:
        robot, virtual = world.robot, world.cell.robot.virtual
        with pytest.raises(TimeoutError, match="monitor_dmp"):
            robot.receive(limit=2.0)  # the limit stops it in the middle of the reach
        assert virtual.report()["active"] == "dmp"
        assert virtual.report()["standing"]
        assert virtual.feedback.status("attitude").waiting_for == "a motion"
        assert robot.reset()
        assert robot.receive()


def test_an_invalid_file_is_refused_with_its_line(tmp_path) -> None:
    file = tmp_path / "signals.yaml"
    file.write_text("in:\n- {topic: a, type: sensor_msgs/Imuu, field: orientation, key: a, max_age: 1}\n")
    with pytest.raises(ValueError, match=r"signals.yaml:2: .*sensor_msgs/Imuu.*'sensor_msgs/Imu'"):
        coglab.World(signals=str(file))


def test_own_signals_are_posted_in_virtual_time(tmp_path) -> None:
    file = tmp_path / "signals.yaml"
    file.write_text(
        "in:\n- {topic: person, type: geometry_msgs/PoseStamped, field: position, key: person, source: estimated, "
        "max_age: 0.1}\n"
    )
    with coglab.World(seed=3, signals=str(file)) as world:
        robot = world.cell.robot.virtual
        assert robot.robot_signal("person") is None
        assert "max_age" in robot.post_signal("person", {"position": [1.0, 2.0, 3.0]}, age=0.2)
        assert robot.post_signal("person", {"position": [1.0, 2.0, 3.0]}) == ""
        world.step()
        assert list(robot.robot_signal("person")) == [1.0, 2.0, 3.0]
        world.step(0.2)
        assert robot.robot_signal("person") is None, "its topic has stopped"
        with pytest.raises(ValueError, match="no row"):
            robot.post_signal("persons", {"position": [1.0, 2.0, 3.0]})
