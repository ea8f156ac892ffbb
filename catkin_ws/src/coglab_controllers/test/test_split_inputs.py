"""split:=true, joint state by joint state: each valid one is answered once, an invalid one is not answered."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rospy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from coglab_msgs.msg import ControllerStatus, FinishedPtp, LwrState, ReasonCode
from coglab_msgs.srv import AddPtp
from own_master import node_path, own_master
from robot_fixture import HOME, JOINTS, wait_until
from sensor_msgs.msg import JointState

SOURCES = Path(__file__).resolve().parents[2]
PERIOD = 0.02  # s between two joint states, at least


class Arm:
    """An arm that publishes its position on request, and follows the answer."""

    def __init__(self) -> None:
        self.position = list(HOME)
        self.heard: list[JointState] = []
        self.finished: list[int] = []
        self.statuses: list[ControllerStatus] = []
        self.joints = rospy.Publisher("lwr/joint_states", JointState, queue_size=10)
        self.state = rospy.Publisher("lwr/state", LwrState, queue_size=10)
        rospy.Subscriber("lwr/target_joint_states", JointState, self.heard.append, queue_size=100)
        rospy.Subscriber("controller_manager/status", ControllerStatus, self.statuses.append)
        rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: self.finished.append(m.ptp_id))

    def send(self, change: Callable[[JointState], object] = lambda m: None, later: float = 0.0) -> rospy.Time:
        """Publishes one joint state with changes and a stamp `later` s after now. Returns its stamp."""
        time.sleep(PERIOD)
        message = JointState(name=list(JOINTS), position=list(self.position), velocity=[0.0] * 7, effort=[0.0] * 7)
        message.header.stamp = rospy.Time.now() + rospy.Duration(later)
        change(message)
        self.joints.publish(message)
        return message.header.stamp

    def answered(self, stamp: rospy.Time) -> JointState:
        """The answer to the joint state of this stamp."""

        def came() -> bool:
            return bool(self.heard) and abs((self.heard[-1].header.stamp - stamp).to_sec()) < 0.5 * PERIOD

        wait_until(came, "the answer to a joint state")
        return self.heard[-1]

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Publishes joint states until a condition is true."""
        wait_until(lambda: condition() or self.send() is None, what)

    def allow(self, epoch: int, code: int = 0) -> None:
        """Publishes that motion is allowed; with a code, that it is blocked."""
        self.state.publish(LwrState(motion_allowed=code == 0, reason_code=code, motion_epoch=epoch))
        self.until(lambda: bool(self.heard) and self.heard[-1].header.frame_id == str(epoch), f"epoch {epoch}")


@pytest.fixture(scope="module")
def arm() -> Iterator[Arm]:
    with own_master() as master:
        master.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
        master.setParam("/lwr", {"rt_priority": 0})
        # A cycle for each joint state, however fast they come.
        manager = {"cycle_time": 0.0005, "overrun_time": 5.0, "load": {"ptp": "coglab/PtpController"}, "active": "ptp"}
        master.setParam("/controller_manager", manager)
        rospy.init_node("split_inputs", disable_signals=True)
        node = subprocess.Popen(
            [node_path("controller_manager_node")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            told = Arm()
            wait_until(lambda: told.state.get_num_connections() > 0, "the node")
            told.allow(5)
            told.until(lambda: bool(told.statuses) and told.statuses[-1].active_controller == "ptp", "the controller")
            yield told
        finally:
            rospy.signal_shutdown("the test is over")
            node.kill()
            node.wait(timeout=60.0)


def test_each_joint_state_is_answered_once(arm: Arm) -> None:
    for _ in range(10):
        arm.answered(arm.send())
    before = len(arm.heard)
    for count in range(1, 6):
        answer = arm.answered(arm.send())
        assert len(arm.heard) == before + count
        assert (list(answer.name), answer.header.frame_id) == (JOINTS, "5")
        assert list(answer.velocity) == [0.0] * 7 and not answer.position
    stamp = arm.send(later=0.02)
    arm.answered(stamp)  # clocks that are synchronised differ by that much
    time.sleep(0.03)


def spoilt(field: str, joint: int, value: float) -> Callable[[JointState], object]:
    return lambda m: getattr(m, field).__setitem__(joint, value)


@pytest.mark.parametrize(
    "what",
    [
        *(lambda m, joint=joint: (m.name.pop(joint), m.position.pop(joint)) for joint in (0, 3, 6)),
        *(spoilt("position", joint, bad) for joint, bad in ((0, math.nan), (3, math.inf), (6, -math.inf))),
        lambda m: m.position.pop(),
        lambda m: m.position.clear(),
        lambda m: setattr(m.header, "stamp", m.header.stamp + rospy.Duration(0.2)),
        lambda m: setattr(m.header, "stamp", rospy.Time()),
    ],
)
def test_a_joint_state_that_cannot_count_is_not_answered(arm: Arm, what: Callable[[JointState], object]) -> None:
    arm.answered(arm.send())
    before = len(arm.heard)
    arm.send(what)
    time.sleep(0.05)  # or the next one takes its place in the queue
    arm.answered(arm.send())
    assert len(arm.heard) == before + 1


def test_a_stamp_that_is_older_than_the_last_one_does_not_count(arm: Arm) -> None:
    last = arm.send()
    arm.answered(last)
    before = len(arm.heard)
    for back in (0.1, 1.0):  # two readings of two clocks are what tells the age, a busy machine between them
        arm.send(lambda m, back=back: setattr(m.header, "stamp", last - rospy.Duration(back)))
        time.sleep(0.05)
    arm.answered(arm.send())
    assert len(arm.heard) == before + 1


@pytest.mark.parametrize(
    "told, shown",
    [
        (ReasonCode.HELD, ReasonCode.HELD),
        (ReasonCode.NO_POWER, ReasonCode.NO_POWER),
        (12345, ReasonCode.NOT_STARTED),
    ],
)
def test_why_the_arm_may_not_move_comes_through(arm: Arm, told: int, shown: int) -> None:
    epoch = int(arm.heard[-1].header.frame_id)
    arm.allow(epoch + 1, told)
    arm.until(lambda: arm.statuses[-1].reason_code == shown, f"code {shown}")
    refused = rospy.ServiceProxy("controller_manager/ptp/add_ptp", AddPtp)(HOME, [], [])
    assert not refused.success and refused.reason_code in (shown, ReasonCode.STALE_JOINT_STATE)
    arm.allow(epoch + 2)
    arm.until(lambda: arm.statuses[-1].reason_code == 0, "nothing wrong")


def test_joints_are_known_by_their_names_in_any_order_beside_others(arm: Arm) -> None:
    """Missing speeds and torques count as zero, and values of other joints are ignored."""

    def shuffled(m: JointState) -> None:
        m.name, m.position = ["finger", *m.name[::-1]], [9.0, *m.position[::-1]]
        m.velocity, m.effort = [math.nan] * 8, [0.0] * 3

    arm.answered(arm.send(shuffled))
    target = [HOME[0] + 0.06, *HOME[1:6], HOME[6] - 0.03]
    add = rospy.ServiceProxy("controller_manager/ptp/add_ptp", AddPtp)
    answers: list = []

    def accepted() -> bool:  # a joint state must not be old when the request comes
        arm.answered(arm.send(shuffled))
        answers.append(add(target, [], []))
        return answers[-1].success

    wait_until(accepted, f"add_ptp: {answers[-1:]}")
    last, fastest, moved = arm.send(shuffled), 0.0, [0.0] * 7
    for _ in range(1000):
        if answers[-1].ptp_id in arm.finished:
            break
        velocity = arm.answered(last).velocity
        fastest = max(fastest, velocity[0])
        now = arm.send(shuffled)
        passed = (now - last).to_sec()
        arm.position = [q + passed * v for q, v in zip(arm.position, velocity, strict=True)]
        moved = [abs(q - h) for q, h in zip(arm.position, HOME, strict=True)]
        last = now
    assert answers[-1].ptp_id in arm.finished and fastest > 0.02
    assert moved[0] == pytest.approx(0.06, abs=0.01) and moved[6] == pytest.approx(0.03, abs=0.01)
    assert max(moved[1:6]) < 0.005
