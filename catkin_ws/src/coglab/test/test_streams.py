"""Streams of velocities on the whole robot in virtual time: opening, silence, other motions, bad commands."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_trials.world import Robot

UP = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]  # m/s and rad/s


class Arm:
    """A robot in command mode. run() advances it."""

    def __init__(self):
        self.robot = Robot(seed=1)
        self.virtual = self.robot.virtual
        self.run(0.6)

    def run(self, seconds):
        for _ in range(round(seconds / 0.005)):
            self.robot.step()
        return self.robot.report

    def start(self):
        self.virtual.submit("start")
        self.run(0.5)
        assert self.robot.report["motion_allowed"]

    def up(self, seconds):
        for _ in range(round(seconds / 0.05)):
            good, why = self.virtual.stream_twist(UP)
            assert good, why
            self.run(0.05)

    def height(self):
        return float(self.robot.palm().position[2])


@pytest.fixture
def arm():
    made = Arm()
    made.start()
    return made


def test_the_palm_follows_and_stands_after_a_tenth_of_a_second_of_silence(arm):
    assert arm.virtual.open_stream("twist_stream")[0]
    before = arm.height()
    arm.up(0.6)
    assert arm.height() - before == pytest.approx(0.10, abs=0.025)  # 0.2 m/s, after it has sped up
    report = arm.run(0.6)
    assert report["standing"] and report["state"] == "holding" and report["reason"]
    there = arm.height()
    arm.up(0.3)  # the stream is still open
    assert arm.height() > there + 0.03
    assert arm.robot.limit_violations == 0


def test_a_stream_yields_to_another_motion_and_takes_over_again(arm):
    assert arm.virtual.load_controller("ptp", "coglab/PtpController")[0]
    assert arm.virtual.open_stream("twist_stream")[0]
    arm.up(0.3)
    assert arm.virtual.switch_controller("ptp")[0]
    refused, why = arm.virtual.stream_twist(UP)
    assert not refused and "open" in why and arm.virtual.reason_code == ReasonCode.NOT_ACTIVE
    goal = np.asarray(arm.robot.report["position"]) + [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert arm.virtual.add_ptp(list(goal))[0] == 0
    arm.run(0.5)
    assert arm.virtual.open_stream("joint_velocity_stream")[0]
    for _ in range(10):
        assert arm.virtual.stream_joint_velocity([0.0] * 6 + [0.2])[0]
        arm.run(0.05)
    speed = np.asarray(arm.robot.report["measured_velocity"])
    assert speed[6] == pytest.approx(0.2, abs=0.03) and np.abs(speed[:6]).max() < 0.02
    assert arm.robot.limit_violations == 0


def test_invalid_commands_are_refused_with_a_reason(arm):
    with pytest.raises(ValueError, match="'twist_stream'"):
        arm.virtual.stream_twist(UP)
    assert "'wave'" in arm.virtual.open_stream("wave")[1]
    assert arm.virtual.open_stream("twist_stream")[0]
    for bad, words in (([np.nan, *UP[1:]], "vx"), (UP[:5], "6")):
        good, why = arm.virtual.stream_twist(bad)
        assert not good and words in why


def test_a_blocked_arm_opens_no_stream():
    good, why = Arm().virtual.open_stream("twist_stream")
    assert not good and "start" in why
