"""Periods outside a joint limit are counted by how the arm was told to move and by how it moved."""

import numpy as np
from coglab_trials import world as virtual_world


class Arm:
    """In the place of the robot in virtual time: it goes as it is told here, whatever was commanded."""

    def __init__(self) -> None:
        self.cell = self
        self.position, self.fastest, self.commanded = np.zeros(7), np.zeros(7), np.zeros(7)

    def tick(self) -> None:
        pass

    def report(self):
        """What bridge and controllers know: the arm as they command it."""
        return {
            "fri_period": 0.005,
            "position": self.position,
            "commanded_position": self.commanded,
            "motion_allowed": True,
        }


def watched():
    """A robot of the world with that arm in it."""
    robot = virtual_world.Robot(1)
    robot.virtual = robot.cell = Arm()
    robot.outside = dict.fromkeys(robot.outside, 0)
    robot._commanded = None
    return robot


def test_a_joint_that_moves_too_fast_is_counted_whatever_was_commanded():
    robot = watched()
    arm = robot.virtual
    # rad/s, as published: the KRC's file rsidef7.dat, the same in the robot description.
    limit = np.radians([110.0, 110.0, 112.5, 112.5, 130.0, 112.5, 112.5])
    for joint in range(7):
        arm.fastest = np.eye(7)[joint] * limit * 0.9999
        robot.step()
        assert robot.outside == {"commanded": 0, "measured": joint, "over_command": 2 * joint + 1}
        arm.fastest = np.eye(7)[joint] * limit * 1.0001
        robot.step()
        assert robot.outside == {"commanded": 0, "measured": joint + 1, "over_command": 2 * joint + 2}
        assert robot.limit_violations == joint + 1
    assert robot.measured_share > 1.0 and robot.peak_share == 0.0


def test_a_joint_beyond_its_range_is_counted_whatever_was_commanded():
    robot = watched()
    robot.virtual.position = np.array(robot.limits.upper_position) + np.eye(7)[3] * 1e-6
    robot.step()
    assert robot.outside == {"commanded": 0, "measured": 1, "over_command": 0}


def test_what_is_commanded_too_fast_is_counted_though_the_arm_stands():
    robot = watched()
    robot.step()
    robot.virtual.commanded = np.array(robot.limits.velocity) * 1.01 * virtual_world.DT
    robot.step()
    assert robot.outside == {"commanded": 1, "measured": 0, "over_command": 0}
