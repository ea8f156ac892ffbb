"""What the robot's node tells beside its answers: refusals in its log, progress often in motion and seldom at rest,
each field of a message. On the ideal arm, in one process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest
import rospy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from coglab_msgs.msg import (
    ControllerStatus,
    DmpFeedback,
    DmpGoal,
    FeedbackState,
    FeedbackStatus,
    FingertipForces,
    IkDebug,
    MotionFeedback,
    ReasonCode,
)
from coglab_msgs.srv import (
    AddPtp,
    CancelMotion,
    DescribeController,
    ExecuteDmp,
    ExecuteDmpRequest,
    FeedbackBySignal,
    FeedbackSelect,
    LoadController,
    LoadDmps,
    LoadFeedback,
    LwrCommand,
    PredictDmp,
    PredictDmpRequest,
    SetSpeedScale,
    StartMotion,
    StartMotionRequest,
    SwitchController,
    SwitchDmp,
    SwitchDmpRequest,
    UnloadController,
)
from geometry_msgs.msg import Quaternion, TransformStamped
from own_master import own_master
from robot_fixture import JOINTS, Robot, wait_until
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

PACKAGE = Path(__file__).resolve().parent.parent
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
START = [-1.2, -0.6, 1.4, 1.7, 0.2, 0.2, 0.7]
PERIOD = 0.01  # s
MANAGER = "controller_manager/"
CIRCLE = "coglab_example_motions/Circle"
ALL = {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController", "circle": CIRCLE}


def binary() -> str:
    """Path of the node in the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "coglab_controllers" / "robot_node"
        if path.is_file():
            return str(path)
    pytest.fail("robot_node is not built: source the setup file of the workspace after ./coglab build")


class Told(Robot):
    """What the node tells, as it comes."""

    def __init__(self, log: Path) -> None:
        super().__init__()
        self._log = log
        self.told: dict[str, list] = {}
        for name, topic, kind in (
            ("status", "status", ControllerStatus),
            ("circle", "circle/motion_feedback", MotionFeedback),
            ("reach", "dmp/feedback", DmpFeedback),
            ("debug", "dmp/ik_debug", IkDebug),
            ("profile", "feedback/status", FeedbackStatus),
            ("tf", "/tf", TFMessage),
        ):
            heard = self.told[name] = []
            rospy.Subscriber(topic if topic[0] == "/" else MANAGER + topic, kind, heard.append, queue_size=1000)

    def log(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def said(self, words: str) -> str:
        """Waits until the log has these words; the line."""
        wait_until(lambda: words in self.log(), f"in the log: {words}")
        return next(line for line in self.log().splitlines() if words in line)

    def ask(self, name: str, kind: type, *arguments: object):
        """A service below the manager."""
        return self.call(MANAGER + name, kind, *arguments)

    def wait(self, name: str, condition: Callable[[object], bool], what: str) -> None:
        """Until the newest message of a topic is so."""
        heard = self.told[name]
        wait_until(lambda: bool(heard) and condition(heard[-1]), what)

    def more(self, name: str, count: int) -> list:
        """The next messages of a topic."""
        known = len(self.told[name])
        wait_until(lambda: len(self.told[name]) >= known + count, f"{count} more of {name}")
        return self.told[name][known:]


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Told, subprocess.Popen]]:
    log = tmp_path_factory.mktemp("robot") / "log"
    with own_master() as master, log.open("wb") as file:
        master.setParam("/robot_description", URDF.read_text())
        master.setParam("/lwr", {"arm": "ideal", "rt_priority": 0, "ideal_period": PERIOD, "start_position": START})
        feedback = "package://ctrl_more/config/feedback.yaml"
        manager = {"cycle_time": PERIOD, "overrun_time": 5.0, "load": ALL, "active": "ptp", "tactile": True}
        master.setParam("/controller_manager", {**manager, "feedback_file": feedback})
        rospy.init_node("told_by_robot_test", disable_signals=True)
        lines = {**os.environ, "ROSCONSOLE_STDOUT_LINE_BUFFERED": "1"}
        node = subprocess.Popen([binary()], stdout=file, stderr=file, env=lines)
        try:
            robot = Told(log)
            robot.wait("status", lambda m: m.active_controller == "ptp", "the node")
            for event in ("reset", "start"):
                answer = robot.call("lwr/command", LwrCommand, event)
                assert answer.success, answer.message
            robot.wait("status", lambda m: m.reason_code == 0 and m.standing, "an arm that may move")
            yield robot, node
        finally:
            rospy.signal_shutdown("the test is over")
            node.kill()
            node.wait(timeout=60.0)


@pytest.fixture
def robot(system: tuple[Told, subprocess.Popen]) -> Told:
    return system[0]


def spacing(messages: list) -> float:
    """Mean s between the stamps of messages."""
    stamps = [m.header.stamp.to_sec() for m in messages]
    return (stamps[-1] - stamps[0]) / (len(stamps) - 1)


def test_each_refusal_is_logged_with_the_name_of_its_service(robot: Told) -> None:
    not_active = "controller '{0}' is not active; active is 'ptp'; call switch_controller with '{0}' first"
    for name, kind, arguments, code, words, log in (
        ("dmp/load_dmps", LoadDmps, ["/no/such.xml"], ReasonCode.BAD_FILE, "/no/such.xml", "load_dmps refused: "),
        ("dmp/execute_dmp", ExecuteDmp, [ExecuteDmpRequest()], ReasonCode.NOT_ACTIVE, not_active.format("dmp"),
         "execute_dmp refused: "),
        ("dmp/switch_dmp", SwitchDmp, [SwitchDmpRequest()], ReasonCode.NOT_ACTIVE, not_active.format("dmp"),
         "switch_dmp refused: "),
        ("circle/start_motion", StartMotion, [[], [], False], ReasonCode.NOT_ACTIVE, not_active.format("circle"),
         "start_motion rejected: "),
        ("load_controller", LoadController, ["dmp", "coglab/DmpController"], ReasonCode.INVALID_ARGUMENT,
         "controller_id 'dmp' is in use", "load_controller refused: "),
        ("unload_controller", UnloadController, ["ptp"], ReasonCode.BUSY, "ptp", "unload_controller refused: "),
        ("switch_controller", SwitchController, ["nobody"], ReasonCode.UNKNOWN_NAME, "nobody",
         "switch_controller refused: "),
        ("ptp/add_ptp", AddPtp, [[0.0, 1.0], [], []], ReasonCode.INVALID_ARGUMENT,
         "position has 2 numbers; expected 7, in the order " + " ".join(JOINTS), "add_ptp rejected: "),
    ):  # fmt: skip
        before = robot.log().count(log)
        answer = robot.ask(name, kind, *arguments)
        assert (answer.success, answer.reason_code) == (False, code), (name, answer.message)
        assert words in answer.message
        robot.said(log + answer.message)
        assert robot.log().count(log) == before + 1
        if hasattr(answer, "controller_ids"):
            listed = dict(zip(answer.controller_ids, answer.controller_types, strict=True))
            assert {name: listed[name] for name in ALL} == ALL, "names beside their types"
    looked = robot.ask("dmp/predict_dmp", PredictDmp, PredictDmpRequest())
    assert not looked.success and looked.message and not looked.path.poses
    assert looked.message not in robot.log(), "looking ahead is no news"


def test_what_is_done_is_not_logged_as_refused(robot: Told) -> None:
    before = robot.log().count(" refused: ") + robot.log().count(" rejected: ")
    loaded = robot.ask("dmp/load_dmps", LoadDmps, str(PACKAGE / "config" / "primitives.xml"))
    assert (loaded.num_loaded, loaded.success, loaded.reason_code) == (5, True, 0), loaded.message
    more = robot.ask("load_controller", LoadController, "more", "coglab/PtpController")
    assert more.success and more.controller_types[list(more.controller_ids).index("more")] == "coglab/PtpController"
    gone = robot.ask("unload_controller", UnloadController, "more")
    assert gone.success and "more" not in gone.controller_ids and gone.reason_code == 0
    robot.switch("ptp")
    assert robot.ask("speed_scale", SetSpeedScale, 1.0).success
    assert robot.log().count(" refused: ") + robot.log().count(" rejected: ") == before


def test_a_motion_of_ones_own_is_told_often_while_it_moves_and_seldom_at_rest(robot: Told) -> None:
    robot.switch("circle")
    robot.wait("circle", lambda m: m.state == "idle", "an idle motion")
    idle = robot.more("circle", 6)
    assert spacing(idle) > 0.15, "five times a second"
    assert {(m.motion_id, m.state, m.reason_code, m.reason, m.queued) for m in idle} == {(-1, "idle", 0, "", 0)}
    far = robot.ask("circle/start_motion", StartMotion, ["radius"], [9.0], False)
    assert (far.status, far.motion_id, far.success) == (StartMotionRequest.REJECTED, -1, False)
    assert far.message == "radius is 9 m; expected 0 to 0.15"
    known = len(robot.told["circle"])
    first, second = (
        robot.ask("circle/start_motion", StartMotion, ["duration"], [2.0], queue) for queue in (False, True)
    )
    assert (first.status, first.success, first.reason_code) == (StartMotionRequest.STARTED, True, 0), first.message
    assert (second.status, second.motion_id) == (StartMotionRequest.QUEUED, first.motion_id + 1)
    robot.wait("circle", lambda m: m.motion_id == second.motion_id and m.state == "reached", "both ends")
    told = robot.told["circle"][known:]
    for one, queued in ((first, 1), (second, 0)):
        own = [m for m in told if m.motion_id == one.motion_id]
        running = [m for m in own if m.state == "running"]
        assert spacing(running) < 0.12, "fifty times a second"
        times = [m.time for m in running]
        assert times == sorted(times) and times[0] < 0.5 and 1.5 < times[-1] < 2.1
        assert running[-1].queued == queued and running[-1].reason_code == 0
        assert {m.state for m in own} == {"running", "reached"}
        assert f"motion_id {one.motion_id} was not executed" not in robot.log()
    third = robot.ask("circle/start_motion", StartMotion, [], [], False)
    robot.wait("circle", lambda m: m.motion_id == third.motion_id and m.time > 0.1, "the third")
    done = robot.ask("circle/cancel", CancelMotion, 0.0, "enough")
    assert (done.success, done.was_running, done.reason_code) == (True, True, 0), done.message
    wait_until(lambda: any(m.state == "aborted" for m in robot.told["circle"]), "its end")
    last = next(m for m in robot.told["circle"] if m.state == "aborted")
    assert (last.motion_id, last.reason_code) == (third.motion_id, ReasonCode.CANCELLED) and "enough" in last.reason
    line = robot.said(f"motion_id {third.motion_id} was not executed: {last.reason}")
    assert "INFO" in line, "a cancel that was asked for is no warning"
    assert "circle/cancel: " not in robot.log()


def test_a_cancel_of_another_controller_than_the_one_that_moves_is_refused_and_logged(robot: Told) -> None:
    robot.switch("ptp")
    going = robot.ask("ptp/add_ptp", AddPtp, [START[0] + 0.5, *START[1:]], [], [])
    assert going.success, going.message
    robot.wait("status", lambda m: m.state == "running" and not m.standing, "the motion")
    other = robot.ask("dmp/cancel", CancelMotion, 1.0, "")
    assert (other.success, other.was_running, other.reason_code) == (False, False, ReasonCode.NOT_ACTIVE)
    assert "no motion of 'dmp' was running; 'ptp' moves the arm" in other.message
    robot.said("dmp/cancel: " + other.message)
    assert robot.ask("ptp/cancel", CancelMotion, 0.0, "").success
    assert "INFO" in robot.said(f"ptp_id {going.ptp_id} was not executed: ")


def broadcast(robot: Told) -> list[TransformStamped]:
    return [t for m in robot.told["tf"] for t in m.transforms if t.child_frame_id == "dmp_goal"]


def test_a_reach_tells_its_goal_and_its_progress_and_ik_debug_when_it_is_asked_for(robot: Told) -> None:
    robot.go(START)
    robot.switch("dmp")
    robot.wait("reach", lambda m: m.state == "idle", "an idle reach")
    assert spacing(robot.more("reach", 6)) > 0.15 and broadcast(robot) == [] and robot.told["debug"] == []
    rospy.set_param("/controller_manager/dmp/enable_ik_debug", True)
    hand, orientation = cc.Chain(URDF.read_text()).fk(START)
    goal = hand + [-0.05, 0.1, 0.1]
    robot.see_hand(tuple(goal))
    request = ExecuteDmpRequest(primitive_id="reach_human", dmp_ratio=2.0, goal_frame="human_hand")
    request.orientation_control, request.target_orientation = True, Quaternion(*orientation)
    time.sleep(1.2)  # the parameter is looked at once a second
    wait_until(lambda: robot.ask("dmp/execute_dmp", ExecuteDmp, request).success, "execute_dmp")
    robot.wait("reach", lambda m: m.state == "reached", "the reach")
    running = [m for m in robot.told["reach"] if m.state == "running"]
    assert spacing(running) < 0.12, "fifty times a second"
    assert {(m.header.frame_id, m.primitive_id, m.reason_code, m.reason) for m in running} == {
        ("lwr_base_link", "reach_human", 0, "")
    }
    assert 1.8 < running[0].remaining_time <= 2.41 and running[0].phase > 0.5 > running[-1].phase
    goals = broadcast(robot)
    assert {t.header.frame_id for t in goals} == {"lwr_base_link"} and 0.025 < spacing(goals) < 0.12
    place, turn = goals[-1].transform.translation, goals[-1].transform.rotation
    np.testing.assert_allclose([place.x, place.y, place.z], goal, atol=0.005)
    assert turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 == pytest.approx(1.0)
    robot.more("reach", 4)
    told = len(broadcast(robot))
    robot.more("reach", 4)
    assert len(broadcast(robot)) == told, "no motion, no goal"
    robot.see_hand(None)
    look_at(robot.told["debug"], goal)


def look_at(records: list[IkDebug], goal: np.ndarray) -> None:
    """Each field of the records of a reach against the others."""
    moving = [m for m in records if 0.05 < m.phase < 0.9]
    assert len(moving) > 40

    def vector(v: object) -> np.ndarray:
        return np.array([v.x, v.y, v.z])

    def quaternion(q: object) -> np.ndarray:
        return np.array([q.x, q.y, q.z, q.w])

    for m in moving:
        assert m.header.frame_id == "lwr_base_link" and len(m.joint_velocity_position) == 7
        error = vector(m.set_point.position) - vector(m.measured.position)
        np.testing.assert_allclose(vector(m.position_error), error, atol=1e-3)
        turned = cc.rotation_between(quaternion(m.measured.orientation), quaternion(m.set_point.orientation))
        np.testing.assert_allclose(vector(m.rotation_error), turned, atol=0.02)
        assert len(m.joint_velocity_rotation) == 7 and m.smallest_singular_value_position > 0.01
    last = moving[-1]
    np.testing.assert_allclose(vector(last.goal), goal, atol=0.005)
    fastest = max(moving, key=lambda m: float(np.linalg.norm(vector(m.set_point_velocity.linear))))
    way = vector(fastest.set_point_velocity.linear)
    assert way @ (goal - vector(fastest.measured.position)) > 0.0, "toward the goal"
    assert np.abs(fastest.joint_velocity_position).max() > 0.01


def test_a_goal_that_is_refused_is_counted(robot: Told) -> None:
    publisher = rospy.Publisher("controller_manager/dmp/dmp_goal", DmpGoal, queue_size=1)
    wait_until(lambda: publisher.get_num_connections() > 0, "connection")
    wrong = DmpGoal()
    wrong.header.frame_id = "world"
    publisher.publish(wrong)
    robot.said("; 1 refused so far")
    rospy.set_param("/controller_manager/dmp/enable_ik_debug", False)


def test_a_speed_by_the_topic_that_is_refused_is_logged(robot: Told) -> None:
    refused = robot.ask("speed_scale", SetSpeedScale, 7.0)
    assert (refused.success, refused.reason_code) == (False, ReasonCode.OUT_OF_RANGE)
    assert refused.message not in robot.log(), "the answer has it"
    topic = rospy.Publisher("controller_manager/speed_scale", Float64, queue_size=1)
    wait_until(lambda: topic.get_num_connections() > 0, "connection")
    topic.publish(7.0)
    robot.said(refused.message)


def test_touch_sensors_are_heard_in_the_tools_frame_alone(robot: Told) -> None:
    topic = rospy.Publisher("/ih2_hand/fingertip_forces", FingertipForces, queue_size=1)
    wait_until(lambda: topic.get_num_connections() > 0, "connection")
    message = FingertipForces()
    message.header.frame_id, message.header.stamp = "world", rospy.Time.now()
    topic.publish(message)
    robot.said("/ih2_hand/fingertip_forces ignored: expected forces in the frame ih2_palm, got 'world'")


def entry(robot: Told, name: str):
    return next(c for c in robot.told["profile"][-1].controllers if c.name == name)


def test_feedback_requests_have_whole_answers_and_their_status(robot: Told) -> None:
    def ask(verb: str, kind: type, *arguments: object) -> tuple[bool, int, str]:
        answer = robot.ask("feedback/" + verb, kind, *arguments)
        return answer.success, answer.reason_code, answer.message

    wrong = ReasonCode.INVALID_ARGUMENT
    for names in ([], ["dmp", "ptp"]):
        words = f"got {len(names)}"
        assert ask("apply_profile", FeedbackSelect, names, "") == (
            False,
            wrong,
            "names: expected one profile, " + words,
        )
        assert ask("unload", FeedbackSelect, names, "") == (False, wrong, "names: expected one controller, " + words)
    used = "'dmp' is in use; choose another name, or unload it first"
    assert ask("load", LoadFeedback, "dmp", "EeAdmittance", "", "") == (False, ReasonCode.BUSY, used)
    success, code, words = ask("load", LoadFeedback, "x", "NoSuchType", "", "")
    assert (success, code) == (False, ReasonCode.BAD_FILE) and words.startswith("'x' was not loaded: ")
    unknown = robot.ask("feedback/describe", DescribeController, "nobody")
    assert (unknown.success, unknown.reason_code) == (False, ReasonCode.UNKNOWN_NAME) and "nobody" in unknown.text
    assert ask("enable", FeedbackSelect, ["ee_admittance"], "") == (True, 0, "")
    wait_until(lambda: entry(robot, "ee_admittance").enabled, "enabled")
    assert ask("pause", FeedbackSelect, ["ee_admittance"], "lunch") == (True, 0, "")
    wait_until(lambda: entry(robot, "ee_admittance").paused, "paused")
    own = entry(robot, "ee_admittance")
    assert (list(own.pause_reasons), list(own.pause_codes)) == (["lunch"], [ReasonCode.PAUSED_BY_USER])
    assert (own.type, own.fault, own.fault_code, own.faults, own.safety) == ("EeAdmittance", "", 0, 0, False)
    assert not entry(robot, "joint_limits").paused
    both = robot.ask("feedback/pause_by_signal", FeedbackBySignal, "wrench", False)
    assert both.success and list(both.affected) == ["ee_admittance"], "paused once more, for another reason"
    again = robot.ask("feedback/pause_by_signal", FeedbackBySignal, "wrench", False)
    assert list(again.affected) == [], "nothing changed"
    wait_until(lambda: len(entry(robot, "ee_admittance").pause_codes) == 2, "both reasons")
    assert entry(robot, "ee_admittance").pause_codes[1] == ReasonCode.PAUSED_BY_SIGNAL
    robot.more("status", 4)
    known_statuses = len(robot.told["profile"])
    robot.more("status", 5)
    assert len(robot.told["profile"]) == known_statuses, "told on a change alone"
    assert ask("disable", FeedbackSelect, ["ee_admittance"], "") == (True, 0, "")


def test_states_of_feedback_controllers_are_told_with_names_and_units(robot: Told) -> None:
    shown: list[FeedbackState] = []
    heard = rospy.Subscriber("controller_manager/feedback/state", FeedbackState, shown.append)
    wait_until(lambda: len(shown) > 2, "states")
    stamps = [m.header.stamp for m in shown]
    assert stamps == sorted(stamps) and stamps[-1] > stamps[0]
    for m in shown:
        assert all(len(s.names) == len(s.units) == len(s.values) for s in m.states)
    heard.unregister()


def test_it_ends_in_order_by_the_other_signal_too(system: tuple[Told, subprocess.Popen]) -> None:
    _, node = system
    node.send_signal(signal.SIGTERM)
    assert node.wait(timeout=60.0) == 0
