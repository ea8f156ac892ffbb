"""RosArm without a ROS master: maximum age of messages, requests and their time limits, and the end of a motion. The
tests set the ages."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
from coglab_msgs.msg import FinishedPtp, ReasonCode, UnfinishedPtp
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, Verdict
from coglab_smach.ports.pending import Permit, PortError, Ready
from coglab_smach.ros import arm

JOINTS = ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"]


class Topic:
    """Replaces Newest."""

    every: dict[str, Topic] = {}

    def __init__(self, topic, kind, on_message=None):
        self.message, self.seconds, self.stamp, self.heard = None, 0.0, 0.0, on_message
        Topic.every[topic] = self

    def age(self):
        return self.seconds


class Robot:
    """The port, its topics, and the services that it calls: (name, wait, fields)."""

    def __init__(self, monkeypatch):
        self.now, self.asked, self.answers = 50.0, [], {}
        monkeypatch.setattr(arm, "Newest", Topic)
        monkeypatch.setattr(arm, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(arm, "call", self.call)
        monkeypatch.setattr(arm, "call_now", self.call_now)
        monkeypatch.setattr(arm.parameters, "read", lambda name, kind, default: {"joint_vel_limit": [0.7] * 7})
        self.port = arm.RosArm()
        self.topics = Topic.every
        self.say("lwr/state", motion_allowed=True, reason="", supervisor="running", reason_code=0, hold_latched=False)
        self.say_joints(JOINTS[::-1], [float(k) for k in range(7)])
        self.say("controller_manager/status", **self.status())

    @staticmethod
    def status(**fields):
        well = {"standing": True, "state": "running", "active_controller": "ptp", "speed_scale": 0.5}
        return {**well, "reason": "", "reason_code": 0, **fields}

    def say(self, topic, seconds=0.0, **fields):
        self.topics[topic].message, self.topics[topic].seconds = SimpleNamespace(**fields), seconds

    def say_joints(self, names, positions):
        header = SimpleNamespace(stamp=SimpleNamespace(to_sec=lambda: 7.5))
        self.say("lwr/joint_states", name=names, position=positions, header=header)

    def call(self, name, kind, wait=20.0, **fields):
        return Ready(self._answer(name, wait, fields))

    def call_now(self, name, kind, permit, wait=20.0, **fields):
        assert isinstance(permit, Permit)
        return self._answer(name, wait, fields)

    def _answer(self, name, wait, fields):
        self.asked.append((name, wait, fields))
        answer = self.answers.get(name, SimpleNamespace(message="done", controller_type="T", num_loaded=5, ptp_id=3))
        if isinstance(answer, PortError):
            raise answer
        return answer


@pytest.fixture
def robot(monkeypatch):
    return Robot(monkeypatch)


def ended(pending):
    """Waits for a call in its own thread."""
    end = time.monotonic() + 60.0
    while not pending.done():
        assert time.monotonic() < end
        time.sleep(0.002)
    return pending


# --- state of the arm -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ask", ["motion_allowed", "standing"])
def test_a_robot_without_messages_for_one_second_is_silent(robot, ask):
    verdict = getattr(robot.port, ask)
    assert verdict() == Verdict(True)
    robot.topics["lwr/joint_states"].seconds = 1.0
    assert verdict().ok
    robot.topics["lwr/joint_states"].seconds = 1.01
    why = verdict().why
    assert verdict() == Verdict(False, why, ReasonCode.NODE_SILENT) and "lwr/joint_states" in why and "1.0 s" in why
    robot.topics["lwr/joint_states"].seconds = 1e9
    assert "999.0 s" in verdict().why
    for topic in ("lwr/state", "controller_manager/status"):
        robot.topics[topic].message = None
    assert "never" in verdict().why and verdict().code == ReasonCode.NODE_SILENT


def test_joints_are_in_wire_order_and_expire_after_half_a_second(robot):
    assert robot.port.measured() == ((6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0), 7.5)
    robot.topics["lwr/joint_states"].seconds = 0.5
    assert robot.port.joint_positions() is not None
    robot.topics["lwr/joint_states"].seconds = 0.51
    assert robot.port.joint_positions() is None
    robot.say_joints(JOINTS[1:], [0.0] * 6)
    assert robot.port.joint_positions() is None, "one is missing"
    robot.topics["lwr/joint_states"].message = None
    assert robot.port.joint_positions() is None


def test_progress_from_before_the_start_of_a_motion_is_ignored(robot):
    feedback = {"state": "reached", "reason": "r", "primitive_id": "p", "phase": 0.2, "remaining_distance": 0.1}
    feedback |= {"reason_code": 4, "remaining_time": 0.3}
    assert robot.port.dmp_progress() == DmpProgress("idle")
    robot.say("controller_manager/dmp/feedback", **feedback)
    assert robot.port.dmp_progress() == DmpProgress("reached", "r", "p", 0.2, 0.1, 4, 0.3)
    robot.topics["controller_manager/dmp/feedback"].stamp = 49.9
    started = robot.port.execute_dmp(DmpRequest("p", "f", (1.0, 2.0, 3.0)))
    assert robot.port.dmp_progress() == DmpProgress("running")
    robot.topics["controller_manager/dmp/feedback"].stamp = 50.1
    assert robot.port.dmp_progress().state == "reached"
    robot.now = 51.0
    assert started.result() is None
    assert robot.port.dmp_progress() == DmpProgress("running"), "an accepted motion counts as running"


# --- requests ---------------------------------------------------------------------------------------------------------


# --- the end of a motion ----------------------------------------------------------------------------------------------


def cancels(robot):
    return [(name, fields["reason"]) for name, _, fields in robot.asked if name.endswith("/cancel")]


def test_both_the_active_and_the_addressed_controller_are_cancelled(robot):
    ended(robot.port.cancel_motion("x" * 300)).result()
    assert cancels(robot) == [("controller_manager/ptp/cancel", "x" * 200)]
    assert robot.asked[-1][1] == 1.0 and robot.asked[-1][2]["time_limit"] == 0.0
    robot.asked.clear()
    robot.port.switch_controller("dmp")
    assert ended(robot.port.cancel_motion("why")).result() is None
    assert sorted(cancels(robot)) == [
        ("controller_manager/dmp/cancel", "why"),
        ("controller_manager/ptp/cancel", "why"),
    ]
    robot.asked.clear()
    robot.port.switch_controller("other")
    robot.say("controller_manager/status", **robot.status(active_controller="", standing=False))
    pending = robot.port.cancel_motion("why")
    assert cancels(robot) == [] and not pending.done()
    robot.topics["controller_manager/status"].message.standing = True
    assert pending.done() and pending.result() is None


def test_cancelling_ends_when_the_arm_stands_or_immediately_on_failure(robot):
    robot.say("controller_manager/status", **robot.status(standing=False))
    pending = robot.port.cancel_motion("why")
    time.sleep(0.05)
    assert not pending.done()
    robot.topics["controller_manager/status"].message.standing = True
    ended(pending)
    robot.say("controller_manager/status", **robot.status(standing=False))
    robot.answers["controller_manager/ptp/cancel"] = PortError("no", code=ReasonCode.HELD)
    with pytest.raises(PortError, match="no"):
        ended(robot.port.cancel_motion("why")).result()


def finished(robot, ptp_id=3):
    robot.topics["controller_manager/ptp/finished_ptp"].heard(FinishedPtp(ptp_id=ptp_id))


def test_a_motion_ends_only_with_its_own_end_message(robot):
    motion = robot.port.move_ptp((0.0,) * 7, [])
    finished(robot, 2)
    assert not motion.done()
    finished(robot)
    assert motion.done() and motion.result() is None
    again = robot.port.move_ptp((0.0,) * 7, [])
    assert not again.done(), "ends of earlier motions do not count"
    told = UnfinishedPtp(ptp_id=3, reason="cancelled", reason_code=ReasonCode.CANCELLED)
    robot.topics["controller_manager/ptp/unfinished_ptp"].heard(told)
    assert again.done() and again.done()
    with pytest.raises(PortError) as error:
        again.result()
    assert (error.value.causes, error.value.code) == (("cancelled",), ReasonCode.CANCELLED)


@pytest.mark.parametrize("how", ["fault", "not allowed"])
def test_a_motion_may_end_without_an_end_message(robot, how):
    motion = robot.port.move_ptp((0.0,) * 7, [])
    assert not motion.done()
    if how == "fault":
        robot.say("controller_manager/status", **robot.status(state="fault", reason="why", reason_code=9))
    else:
        robot.say("lwr/state", motion_allowed=False, reason="why", supervisor="", reason_code=9, hold_latched=False)
    assert motion.done()
    with pytest.raises(PortError) as error:
        motion.result()
    assert (error.value.causes, error.value.code) == (("why",), 9)
    assert ("fault" in error.value.sentence) == (how == "fault")
