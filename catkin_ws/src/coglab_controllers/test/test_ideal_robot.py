"""The ideal arm and the manager on ROS, in one process: topics, services, states and shutdown of docs/reference.md."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rosgraph
import rospy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from coglab_msgs.msg import (
    ControllerStatus,
    DmpFeedback,
    FeedbackStatus,
    FinishedPtp,
    LwrState,
    ReasonCode,
    UnfinishedPtp,
)
from coglab_msgs.srv import (
    AddPtp,
    CancelMotion,
    FeedbackSelect,
    GetActiveController,
    ListControllers,
    LoadController,
    LwrCommand,
    SwitchController,
    UnloadController,
)
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from own_master import built, own_master
from robot_fixture import JOINTS, wait_until
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray, String

SOURCES = Path(__file__).resolve().parents[2]
START = [-1.2, -0.6, 1.4, 1.7, 0.2, 0.2, 0.7]
PERIOD = 0.01  # s


def parameters(master: rosgraph.Master) -> None:
    """An arm with its own start posture, two controllers loaded at the start, and one that stalls."""
    master.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
    arm = {"arm": "ideal", "rt_priority": 0, "ideal_period": PERIOD, "start_position": START, "joint_states_rate": 50.0}
    master.setParam("/lwr", arm)
    manager = {
        "cycle_time": PERIOD,
        "load": {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController"},
        "active": "ptp",
        "speed_scale": 0.75,
        "types": {"test": {"Misbehaving": "libcoglab_test_misbehaving.so"}},
        "plugin_paths": [str(built("lib"))],
        "odd": {"fault": "stall", "after": 0},
        "bad": {"fault": "throw", "after": 0},
        "overrun_time": 5.0,
        "silent_time": 5.0,  # a late computer ends no motion
        "feedback_file": "palm",
    }
    master.setParam("/controller_manager", manager)


class Robot:
    """The messages of the node, in order of arrival."""

    def __init__(self) -> None:
        self.joints: list[JointState] = []
        self.states: list[LwrState] = []
        self.statuses: list[ControllerStatus] = []
        self.feedbacks: list[DmpFeedback] = []
        self.targets: list[JointState] = []
        self.finished: list[int] = []
        self.unfinished: list[UnfinishedPtp] = []
        self.diagnostics: list[DiagnosticStatus] = []
        self.log: list[Log] = []
        rospy.Subscriber("lwr/joint_states", JointState, self.joints.append)
        rospy.Subscriber("lwr/target_joint_states", JointState, self.targets.append)
        rospy.Subscriber("lwr/state", LwrState, self.states.append)
        rospy.Subscriber("controller_manager/status", ControllerStatus, self.statuses.append)
        rospy.Subscriber("controller_manager/dmp/feedback", DmpFeedback, self.feedbacks.append)
        rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: self.finished.append(m.ptp_id))
        rospy.Subscriber("controller_manager/ptp/unfinished_ptp", UnfinishedPtp, self.unfinished.append)
        rospy.Subscriber("/rosout", Log, self.log.append)
        rospy.Subscriber("/diagnostics", DiagnosticArray, lambda m: self.diagnostics.extend(m.status))

    @staticmethod
    def call(name: str, kind: type, *arguments: object):
        rospy.wait_for_service(name, 60.0)
        return rospy.ServiceProxy(name, kind)(*arguments)

    def command(self, event: str):
        return self.call("lwr/command", LwrCommand, event)

    def manager(self, name: str, kind: type, *arguments: object):
        return self.call("controller_manager/" + name, kind, *arguments)

    def until(self, condition: Callable[[LwrState, ControllerStatus], bool], what: str) -> None:
        """Waits until the newest state and status satisfy a condition."""
        wait_until(lambda: condition(self.states[-1], self.statuses[-1]), what)

    def started(self) -> None:
        assert self.command("reset").success and self.command("start").success
        self.until(lambda state, _: state.motion_allowed, "motion allowed")

    def cycle(self) -> DiagnosticStatus:
        return next(s for s in reversed(self.diagnostics) if s.name.endswith("control cycle"))


@pytest.fixture(scope="module")
def system() -> Iterator[tuple[Robot, subprocess.Popen]]:
    with own_master() as master:
        parameters(master)
        rospy.init_node("ideal_robot_test", disable_signals=True)
        node = subprocess.Popen([str(built("lib", "coglab_controllers", "robot_node"))])
        try:
            robot = Robot()
            wait_until(lambda: bool(robot.joints and robot.states and robot.statuses), "the node's topics")
            yield robot, node
        finally:
            rospy.signal_shutdown("the test is over")
            node.kill()
            node.wait(timeout=60.0)


@pytest.fixture
def robot(system: tuple[Robot, subprocess.Popen]) -> Robot:
    return system[0]


def test_it_stands_at_its_start_and_says_so(robot: Robot) -> None:
    wait_until(lambda: len(robot.joints) > 30, "joint states")
    newest = robot.joints[-1]
    assert list(newest.name) == JOINTS
    assert list(newest.position) == START and list(newest.velocity) == [0.0] * 7 and list(newest.effort) == [0.0] * 7
    told = [m.header.stamp.to_sec() for m in robot.joints[5:30]]
    assert all(a < b for a, b in zip(told, told[1:], strict=False))
    assert (told[-1] - told[0]) / (len(told) - 1) > 0.019, "50 Hz are asked for"
    assert abs(time.time() - robot.joints[-1].header.stamp.to_sec()) < 5.0
    state = robot.states[-1]
    assert (state.supervisor, state.fri_state, state.quality, state.control_mode) == (
        "monitor",
        "MON",
        "PERFECT",
        "POSITION",
    )
    assert (state.power, state.motion_allowed, state.hold_latched, state.motion_epoch) == (0x7F, False, False, 0)
    assert state.reason_code == ReasonCode.NOT_IN_COMMAND_MODE and state.cycle_time == PERIOD
    assert state.reason and state.next_event == "start"
    known = len(robot.states)
    wait_until(lambda: len(robot.states) > known + 4, "the state that is told again")
    again = [s.header.stamp.to_sec() for s in robot.states[-4:]]
    assert (again[-1] - again[0]) / 3 > 0.2, "four times a second without a change"


def test_what_the_parameters_name_is_loaded_and_active(robot: Robot) -> None:
    listed = robot.manager("list_controllers", ListControllers)
    assert sorted(listed.controller_ids) == ["attitude", "dmp", "ee_admittance", "joint_limits", "ptp"]
    active = robot.manager("get_active_controller", GetActiveController)
    assert (active.controller_id, active.controller_type) == ("ptp", "coglab/PtpController")
    robot.until(lambda _, status: status.active_controller == "ptp" and status.standing, "the status of ptp")
    status = robot.statuses[-1]
    assert (status.active_type, status.state, status.speed_scale) == ("coglab/PtpController", "idle", 0.75)
    assert status.reason_code == ReasonCode.NOT_IN_COMMAND_MODE and status.plan_generation >= 1
    known = len(robot.statuses)
    wait_until(lambda: len(robot.statuses) > known + 4, "the status that is told again")
    again = [s.header.stamp.to_sec() for s in robot.statuses[-4:]]
    assert 0.2 < (again[-1] - again[0]) / 3, "four times a second without a change"
    wait_until(lambda: any(s.name.endswith("control cycle") for s in robot.diagnostics), "/diagnostics")
    values = {v.key: v.value for v in robot.cycle().values}
    assert values["active controller"] == "ptp" and values["reason_code"] == str(ReasonCode.NOT_IN_COMMAND_MODE)
    assert robot.cycle().level == DiagnosticStatus.WARN and values["guard"] == "not limited"
    assert float(values["guard scale"]) == 1.0 and float(values["speed scale"]) == 0.75
    assert 0.0 < float(values["longest cycle (us)"]) < 6e7 and values["state"] == "idle"
    assert int(values["cycles"]) >= int(values["cycles with a joint state"]) > 0
    assert values["cycles with an unusable joint state"] == "0" and values["transforms refused"] == "0"
    refused = robot.call("controller_manager/ptp/add_ptp", AddPtp, START, [], [])
    assert (refused.status, refused.ptp_id, refused.reason_code) == (2, -1, ReasonCode.NOT_IN_COMMAND_MODE)


def test_commands_have_their_answers(robot: Robot) -> None:
    for event, code in (
        ("joint_impedance stiffness 500", ReasonCode.NOT_SUPPORTED),
        ("jump", ReasonCode.INVALID_ARGUMENT),
    ):
        answer = robot.command(event)
        assert (answer.success, answer.reason_code) == (False, code) and answer.message
    assert robot.command("position").success
    robot.started()
    state = robot.states[-1]
    assert (state.supervisor, state.fri_state, state.reason_code, state.motion_epoch) == ("command", "CMD", 0, 1)
    events = rospy.Publisher("lwr/ros_events", String, queue_size=10)
    wait_until(lambda: events.get_num_connections() > 0, "connection")
    events.publish("hold")
    robot.until(lambda state, _: state.hold_latched, "hold by the topic")
    state = robot.states[-1]
    assert (state.supervisor, state.reason_code, state.next_event) == ("holding", ReasonCode.HELD, "reset")
    assert robot.command("start").reason_code == ReasonCode.HELD
    robot.started()
    robot.until(lambda state, _: state.motion_epoch == 3 and not state.hold_latched, "two changes more")


def test_a_topic_becomes_a_signal_and_its_stop_makes_the_controller_wait(robot: Robot) -> None:
    statuses: list[FeedbackStatus] = []
    corrections: list[Float64MultiArray] = []
    rospy.Subscriber("controller_manager/feedback/status", FeedbackStatus, statuses.append)
    rospy.Subscriber("feedback/attitude_correction", Float64MultiArray, corrections.append)
    assert robot.manager("feedback/enable", FeedbackSelect, ["attitude"], "").success

    def attitude() -> tuple[str, str]:
        known = [c for s in statuses[-1:] for c in s.controllers if c.name == "attitude"]
        return (known[0].activity, known[0].waiting_for) if known else ("", "")

    waits = ("waiting", "measuredData/palm_imu")
    wait_until(lambda: attitude() == waits, "waiting for the signal")
    imu = rospy.Publisher("coglab_sim/palm_imu", Imu, queue_size=1)
    message = Imu()
    message.orientation.w = 1.0

    def publish(frame: str) -> None:
        message.header.stamp, message.header.frame_id = rospy.Time.now(), frame
        imu.publish(message)

    def heard(words: str) -> bool:
        return any(words in line.msg for line in robot.log)

    wait_until(lambda: publish("world") or heard("expected frame ih2_palm, got 'world'"), "the refusal in words")
    assert attitude() == waits
    wait_until(lambda: publish("ih2_palm") or attitude()[0] == "running", "running by the topic")
    wait_until(lambda: publish("ih2_palm") or bool(corrections), "the correction on its topic")
    assert len(corrections[-1].data) == 7
    wait_until(lambda: attitude() == waits, "waiting after the topic has stopped")
    wait_until(
        lambda: heard("signal measuredData/palm_imu is absent: nothing new on /coglab_sim/palm_imu"), "its words"
    )
    assert robot.manager("feedback/disable", FeedbackSelect, ["attitude"], "").success


def test_a_motion_is_made_shown_and_cancelled(robot: Robot) -> None:
    robot.started()
    robot.until(lambda _, status: status.reason_code == 0, "nothing wrong")
    there = [START[0] + 0.3, *START[1:]]
    answer = robot.call("controller_manager/ptp/add_ptp", AddPtp, there, [], [])
    assert (answer.status, answer.success, answer.reason_code) == (0, True, 0), answer.message
    robot.until(lambda _, status: status.state == "running" and not status.standing, "running")
    wait_until(lambda: any(m.velocity[0] > 0.1 for m in robot.targets), "target velocities")
    assert list(robot.targets[-1].name) == JOINTS and len(robot.targets[-1].velocity) == 7
    wait_until(lambda: answer.ptp_id in robot.finished, "finished_ptp")
    wait_until(lambda: abs(robot.joints[-1].position[0] - there[0]) < 3e-3, "the arm there")
    assert max(abs(a - b) for a, b in zip(robot.joints[-1].position, there, strict=True)) < 3e-3
    far = robot.call("controller_manager/ptp/add_ptp", AddPtp, [START[0] - 0.6, *START[1:]], [], [])
    robot.until(lambda _, status: status.state == "running", "running again")
    done = robot.call("controller_manager/ptp/cancel", CancelMotion, 0.0, "a test")
    assert done.success and done.was_running and done.reason_code == 0, done.message
    wait_until(lambda: bool(robot.unfinished), "unfinished_ptp")
    assert (robot.unfinished[-1].ptp_id, robot.unfinished[-1].reason_code) == (far.ptp_id, ReasonCode.CANCELLED)
    assert "a test" in robot.unfinished[-1].reason
    ended = f"ptp_id {far.ptp_id} was not executed"
    wait_until(lambda: any(ended in m.msg for m in robot.log), "its end in the log")
    assert next(m for m in robot.log if ended in m.msg).level == Log.INFO, "it was asked for"
    none = robot.call("controller_manager/ptp/cancel", CancelMotion, 1.0, "")
    assert none.success and not none.was_running and "'ptp'" in none.message


def test_the_end_of_the_last_motion_reaches_a_late_subscriber(robot: Robot) -> None:
    """A motion to where the arm stands ends at once, often before the subscriber of a new controller is connected."""
    robot.started()
    here = list(robot.joints[-1].position)
    answer = robot.call("controller_manager/ptp/add_ptp", AddPtp, here, [], [])
    wait_until(lambda: answer.ptp_id in robot.finished, "finished_ptp")
    late = ["rostopic", "echo", "-n1", "/controller_manager/ptp/finished_ptp/ptp_id"]
    heard = subprocess.run(late, capture_output=True, text=True, timeout=600, check=True).stdout
    assert heard.split()[0] == str(answer.ptp_id)


def test_gains_change_by_dynamic_reconfigure(robot: Robot) -> None:
    dmp = Client("/controller_manager/dmp", timeout=120.0)
    described = {each["name"]: each for each in dmp.get_parameter_descriptions(timeout=120.0)}
    assert described["pos_clik_gain"]["min"] == 0.0 and described["pos_clik_gain"]["max"] == 0.5 / PERIOD
    assert "eq. (6)" in described["pos_clik_gain"]["description"]
    assert dmp.update_configuration({"pos_clik_gain": 12, "goal_max_speed": 0.2})["pos_clik_gain"] == 12.0
    wait_until(lambda: dmp.get_configuration()["goal_max_speed"] == 0.2, "the update")
    asked = Config(doubles=[DoubleParameter("correction_speed", 0.5), DoubleParameter("pos_clik_gain", 60.0)])
    answer = robot.manager("dmp/set_parameters", Reconfigure, asked)
    in_force = {each.name: each.value for each in answer.config.doubles}
    assert (in_force["correction_speed"], in_force["pos_clik_gain"]) == (0.3, 12.0), "all or nothing, and told"
    assert dmp.update_configuration({"pos_clik_gain": -1.0})["pos_clik_gain"] == 12.0
    assert robot.manager("load_controller", LoadController, "soft", "EeAdmittance").success
    soft = Client("/controller_manager/feedback/soft", timeout=120.0)
    gain = next(name for name in soft.get_configuration(timeout=120.0) if name.startswith("damping"))
    changed = soft.update_configuration({gain: 70.0})
    assert changed[gain] == 70.0
    assert soft.update_configuration({gain: -1.0})[gain] == 70.0
    assert robot.manager("unload_controller", UnloadController, "soft").success


def services(name: str) -> list[str]:
    return [s for s, _ in rosgraph.Master("/test").getSystemState()[2] if f"/controller_manager/{name}/" in s]


def test_a_controller_comes_and_goes_with_its_services_and_no_others(robot: Robot) -> None:
    loaded = robot.manager("load_controller", LoadController, "more", "coglab/PtpController")
    assert loaded.success and "more" in loaded.controller_ids
    offered = ["add_ptp", "cancel", "set_parameters"]
    assert sorted(services("more")) == [f"/controller_manager/more/{name}" for name in offered]
    again = robot.manager("load_controller", LoadController, "more", "coglab/PtpController")
    assert (again.success, again.reason_code) == (False, ReasonCode.INVALID_ARGUMENT) and "in use" in again.message
    gone = robot.manager("unload_controller", UnloadController, "more")
    assert gone.success and "more" not in gone.controller_ids and services("more") == []
    feedback = robot.manager("load_controller", LoadController, "extra_limits", "JointLimits")
    assert feedback.success, feedback.message
    assert services("extra_limits") == [], "a feedback controller has no motion to cancel"
    refused = robot.manager("unload_controller", UnloadController, "ptp")
    assert (refused.success, refused.reason_code) == (False, ReasonCode.BUSY)


def test_a_controller_that_stalls_or_throws_is_told_and_left_again(robot: Robot) -> None:
    for name in ("odd", "bad"):
        assert robot.manager("load_controller", LoadController, name, "test/Misbehaving").success
    robot.started()
    seen = len(robot.statuses)
    robot.manager("switch_controller", SwitchController, "odd")
    wait_until(lambda: any(s.reason_code == ReasonCode.CYCLE_STALLED for s in robot.statuses[seen:]), "the stall")
    stalled = next(s for s in robot.statuses[seen:] if s.reason_code == ReasonCode.CYCLE_STALLED)
    assert (stalled.state, stalled.standing) == ("fault", False)
    assert "'odd'" in stalled.reason
    wait_until(lambda: robot.manager("switch_controller", SwitchController, "bad").success, "a switch away")
    robot.until(lambda _, status: status.state == "fault" and status.active_controller == "bad", "the fault")
    assert robot.statuses[-1].reason_code == ReasonCode.CONTROLLER_FAULT
    assert "computeReference: told to throw" in robot.statuses[-1].reason
    wait_until(lambda: robot.cycle().level == DiagnosticStatus.ERROR, "the fault on /diagnostics")
    assert robot.manager("switch_controller", SwitchController, "ptp").success
    robot.until(lambda _, status: status.state == "idle" and status.reason_code == 0, "all is well")
    wait_until(lambda: robot.cycle().level == DiagnosticStatus.OK, "that on /diagnostics")
    assert robot.cycle().message == "idle"


def test_it_ends_in_order_when_it_is_asked_to(system: tuple[Robot, subprocess.Popen]) -> None:
    _, node = system
    node.send_signal(signal.SIGINT)
    assert node.wait(timeout=60.0) == 0


IMU = "type: sensor_msgs/Imu, field: orientation, max_age: 0.1"
POSE = "type: geometry_msgs/PoseStamped, value: taskSpaceReferencePose/ee"


@pytest.mark.parametrize(
    "rows, words",
    [
        (f"in: [{{topic: lwr/ros_events, key: a, {IMU}}}]", "std_msgs/String"),
        (f"out: [{{topic: lwr/target_joint_states, {POSE}}}]", "target_joint_states"),
        (f"out: [{{topic: controller_manager/status, {POSE}}}]", "controller_manager/status"),
        (f"in: [{{topic: imu, key: a, {IMU}}}]\nout: [{{topic: hand, {POSE}}}]", "imu"),
        (f"in: [{{topic: there, key: a, {IMU}}}]", "waiting"),
    ],
)
def test_topics_of_the_file_of_signals_that_cannot_be_are_refused_in_words(
    tmp_path: Path, rows: str, words: str
) -> None:
    file = tmp_path / "signals.yaml"
    file.write_text(rows + "\n")
    with own_master() as master:
        parameters(master)
        master.setParam("/controller_manager/signals_file", str(file))
        # Another node has it with another type.
        master.registerPublisher("/there", "std_msgs/String", "http://127.0.0.1:1/")
        node = subprocess.Popen(
            [str(built("lib", "coglab_controllers", "robot_node")), "/hand:=/imu"], stderr=subprocess.PIPE, text=True
        )
        try:
            wait_until(
                lambda: any("add_ptp" in name for name, _ in master.getSystemState()[2]) or node.poll() is not None,
                "the services",
            )
            subscribed = [name for name, _ in master.getSystemState()[1]]
        finally:
            node.send_signal(signal.SIGINT)
            said = node.communicate(timeout=60.0)[1]
    assert node.returncode == 0, said[-2000:]
    assert words in said
    if "waiting" in words:
        assert "/there" in subscribed
    else:
        assert f"{file}:" in said
        assert "/imu" not in subscribed


@pytest.mark.parametrize(
    "name, value, words",
    [
        ("lwr/arm", "toy", ("'toy'", "fri, ideal")),
        ("lwr/start_position", [0.0] * 6, ("7 numbers, got 6",)),
        ("controller_manager/speed_scale", 1.5, ("speed_scale: ", "0 to 1, got 1.5")),
    ],
)
def test_a_parameter_out_of_range_ends_the_start_in_words(name: str, value: object, words: tuple[str, ...]) -> None:
    with own_master() as master:
        parameters(master)
        master.setParam("/" + name, value)
        ended = subprocess.run(
            [str(built("lib", "coglab_controllers", "robot_node"))], capture_output=True, text=True, timeout=60.0
        )
    assert ended.returncode == 1 and all(word in ended.stderr for word in words), ended.stderr[-2000:]
