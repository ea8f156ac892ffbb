"""split:=true without an arm's interface: messages with extreme stamps, sizes and numbers beside the true ones
do not end the manager, move the arm or stop a motion."""

from __future__ import annotations

import math
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rospy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from coglab_msgs.msg import FinishedPtp, LwrState, ReasonCode, UnfinishedPtp
from coglab_msgs.srv import AddPtp, AddPtpRequest, AddPtpResponse, LoadController, SwitchController
from geometry_msgs.msg import WrenchStamped
from own_master import node_path, own_master
from robot_fixture import HOME, JOINTS, wait_until
from sensor_msgs.msg import JointState

SOURCES = Path(__file__).resolve().parents[2]
PERIOD = 0.01  # s
SPEED = 0.2  # rad/s, of the motion
LIMIT = 0.24  # rad/s, of the joint with limits_profile:=t1
NOT_FINITE = (math.nan, math.inf, -math.inf)
EXTREME_STAMPS = ((0, 0), (0, 1), (1, 0), (2**32 - 1, 999_999_999), (2**32 - 1, 2**32 - 1), (2**31, 0), (0, 2**32 - 1))


class TopicArm:
    """An arm that follows target_joint_states at once, and publishes its position."""

    def __init__(self) -> None:
        self.position = list(HOME)
        self.velocity = [0.0] * 7
        self.heard: list[JointState] = []  # all that was asked of it
        self.finished: list[int] = []
        self.unfinished: list[UnfinishedPtp] = []
        self.joints = rospy.Publisher("lwr/joint_states", JointState, queue_size=10)
        self.state = rospy.Publisher("lwr/state", LwrState, queue_size=10)
        self.torques = rospy.Publisher("lwr/external_torques", JointState, queue_size=10)
        self.wrench = rospy.Publisher("lwr/tool_wrench", WrenchStamped, queue_size=10)
        rospy.Subscriber("lwr/target_joint_states", JointState, self.on_target, queue_size=10)
        rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: self.finished.append(m.ptp_id))
        rospy.Subscriber("controller_manager/ptp/unfinished_ptp", UnfinishedPtp, self.unfinished.append)
        threading.Thread(target=self.run, daemon=True).start()

    def on_target(self, message: JointState) -> None:
        self.heard.append(message)
        self.velocity = list(message.velocity)

    def true_joints(self) -> JointState:
        message = JointState(name=list(JOINTS), velocity=list(self.velocity), effort=[0.0] * 7)
        self.position = [q + PERIOD * v for q, v in zip(self.position, self.velocity, strict=True)]
        message.position = list(self.position)
        message.header.stamp = rospy.Time.now()
        return message

    def run(self) -> None:
        """Joint states every PERIOD, the permission to move every tenth."""
        begun, count = time.monotonic(), 0
        while not rospy.is_shutdown():
            try:
                self.joints.publish(self.true_joints())
                if count % 10 == 0:
                    self.state.publish(LwrState(motion_allowed=True, motion_epoch=1, supervisor="commanding"))
            except rospy.ROSException:  # the test is over
                return
            count += 1
            time.sleep(max(0.0, begun + count * PERIOD - time.monotonic()))


class Intruder:
    """Sends unexpected messages beside those of the arm."""

    def __init__(self, arm: TopicArm, seed: int) -> None:
        self.arm, self.random = arm, random.Random(seed)

    def send(self) -> None:
        """One message to each input."""
        self.arm.joints.publish(self.bad_joints())
        torques = self.bad_joints()
        self.arm.torques.publish(torques)
        wrench = WrenchStamped()
        force = wrench.wrench.force
        force.x, force.y, force.z = (self.random.choice((*NOT_FINITE, 0.0)) for _ in range(3))
        force.z = self.random.choice(NOT_FINITE)
        wrench.header.stamp = self.odd_stamp()
        self.arm.wrench.publish(wrench)
        state = LwrState(motion_allowed=True, motion_epoch=1, supervisor="x" * self.random.choice((0, 1, 65536)))
        state.header.stamp = self.odd_stamp()
        self.arm.state.publish(state)

    def odd_stamp(self) -> rospy.Time:
        stamp = rospy.Time()
        if self.random.random() < 0.4:
            now = time.time() + self.random.choice((-1e4, -1.0, 0.2, 10.0, 1e4))
            stamp.secs, stamp.nsecs = int(now), int(1e9 * (now % 1.0))
        else:
            stamp.secs, stamp.nsecs = self.random.choice(EXTREME_STAMPS)
        return stamp

    def bad_joints(self) -> JointState:
        """A message that is no valid joint state of this arm: extreme stamp, wrong size, or NaN."""
        message = JointState(name=list(JOINTS), position=[0.05] * 7, velocity=[9.0] * 7, effort=[9.0] * 7)
        message.header.stamp = rospy.Time.now()
        kind = self.random.randrange(4)
        if kind == 0:
            message.header.stamp = self.odd_stamp()
        elif kind == 1:
            count = self.random.choice((0, 1, 6))
            message.position = [0.05] * count
            message.effort = [0.0] * count
        elif kind == 2:
            message.name = self.random.choice(([], ["lwr_a1"] * 7, ["\0", "x" * 65536], [*JOINTS[:6], "☃"]))
        else:
            message.position[self.random.randrange(7)] = self.random.choice(NOT_FINITE)
            message.effort[self.random.randrange(7)] = self.random.choice(NOT_FINITE)
        return message


@pytest.fixture(scope="module")
def system() -> Iterator[tuple[TopicArm, subprocess.Popen]]:
    with own_master() as master:
        master.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
        master.setParam("/lwr", {"rt_priority": 0})
        master.setParam("/controller_manager", {"cycle_time": PERIOD, "joint_limits_profile": "t1", "silent_time": 5.0})
        rospy.init_node("topic_arm", disable_signals=True)
        node = subprocess.Popen([node_path("controller_manager_node")])
        try:
            arm = TopicArm()
            rospy.wait_for_service("controller_manager/load_controller", 60.0)
            for name, kind, arguments in (
                ("load_controller", LoadController, ("ptp", "coglab/PtpController")),
                ("switch_controller", SwitchController, ("ptp",)),
            ):
                answer = rospy.ServiceProxy("controller_manager/" + name, kind)(*arguments)
                assert answer.success, answer.message
            yield arm, node
        finally:
            rospy.signal_shutdown("the test is over")
            node.terminate()
            node.wait(timeout=60.0)


def move(target: list[float], speed: float = SPEED) -> AddPtpResponse:
    return rospy.ServiceProxy("controller_manager/ptp/add_ptp", AddPtp)(target, [speed] * 7, [])


def test_the_manager_keeps_the_limits_of_its_profile(system):
    arm, _ = system
    wait_until(lambda: len(arm.heard) > 20, "target velocities")
    answer = move([HOME[0] + 0.3, *HOME[1:]], 0.3)
    assert (answer.status, answer.reason_code) == (AddPtpRequest.REJECTED, ReasonCode.OUT_OF_RANGE), answer.message


def test_a_standing_arm_stays_and_the_node_lives(system):
    arm, node = system
    wait_until(lambda: len(arm.heard) > 20, "target velocities")
    intruder, before, heard = Intruder(arm, 1), list(arm.position), len(arm.heard)
    for _ in range(150):
        intruder.send()
        time.sleep(0.003)
    wait_until(lambda: len(arm.heard) > heard + 50, "target velocities after it")
    assert node.poll() is None
    assert arm.position == before
    assert all(math.isfinite(v) for message in arm.heard for v in message.velocity)


def test_a_motion_beside_it_reaches_its_end_all_the_limits(system):
    arm, node = system
    target = [HOME[0] + 0.3, *HOME[1:]]
    answer = move(target)
    assert answer.status == AddPtpRequest.STARTED, answer.message
    heard, intruder, end = len(arm.heard), Intruder(arm, 2), time.monotonic() + 60.0
    while answer.ptp_id not in arm.finished and time.monotonic() < end and not arm.unfinished:
        intruder.send()
        time.sleep(0.003)
    assert answer.ptp_id in arm.finished, arm.unfinished
    assert node.poll() is None
    asked = [v for message in arm.heard[heard:] for v in message.velocity]
    # After a late joint state the motion catches up faster than SPEED, but within the limit.
    assert all(math.isfinite(v) and abs(v) <= LIMIT for v in asked), max(map(abs, asked))
    assert max(abs(a - b) for a, b in zip(arm.position, target, strict=True)) < 0.01


def test_a_start_that_fails_says_why_and_ends_with_1(system):
    """Like every program of this project with invalid settings; roslaunch shows the status."""
    command = [node_path("controller_manager_node"), "__name:=another_manager", "_arm_namespace:=7"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert ended.returncode == 1, ended.stderr
    assert "another_manager/arm_namespace" in ended.stderr
