"""`./coglab controller run` with a real robot node (ideal arm), and its messages for unusable files."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from coglab.control import slot as wire
from coglab.control.host import find_class, load_module
from coglab.control.motion import ControlError

HERE = Path(__file__).resolve().parent
SOURCES = HERE.parents[1]
sys.path.insert(0, str(SOURCES / "coglab_controllers" / "test"))
from own_master import node_path, own_master  # noqa: E402

LIMIT = 60.0  # s, limit of each wait


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import nowhere_at_all\n", r"bad.py:1: ModuleNotFoundError"),
        ("x = 1\ny = (\n", r"bad.py:2: SyntaxError"),
        ("import sys\nsys.exit(3)\n", r"bad.py:2: SystemExit"),
        ("x = 1\n", "class"),
        ("class A:\n    describe = initialize = update = len\n", r"\bA\b.*FeedbackController"),
        ("class A:\n    start = reference = done = len\nclass B(A): pass\n", "A, B"),
    ],
)
def test_a_bad_file_is_refused_with_a_reason(tmp_path, text, words):
    file = tmp_path / "bad.py"
    file.write_text(text)
    with pytest.raises(ControlError, match=words):
        find_class(load_module(file))


def test_a_missing_service_is_named_though_the_date_stands(monkeypatch):
    """A clock that is set back must not keep the command waiting."""
    from coglab.control import ros

    with own_master():
        monkeypatch.setattr(ros, "WAIT", 0.3)
        monkeypatch.setattr(time, "time", lambda: 1000.0)
        with pytest.raises(wire.SlotError, match="feedback/enable"):
            ros.SlotServices().enable("slot")


def test_a_frozen_master_keeps_no_command_waiting(monkeypatch):
    from coglab.control import ros

    with socket.create_server(("127.0.0.1", 0)) as frozen:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{frozen.getsockname()[1]}")
        for ask in (ros.SlotServices().robot, lambda: ros.SlotServices().enable("slot")):
            with pytest.raises(wire.SlotError, match="master"):
                ask()


@pytest.fixture(name="robot", scope="module")
def running_robot() -> Iterator[subprocess.Popen]:
    """A robot node with the ideal arm and the slot `python_motion`."""
    import rospy
    from coglab_msgs.srv import LwrCommand

    with own_master() as master:
        master.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
        master.setParam("/lwr", {"arm": "ideal", "rt_priority": 0})
        patience = {"silent_time": 5.0, "max_age": 0.5}  # s: a busy computer ends no motion
        manager = {"load": {"python_motion": "coglab/RemoteMotion"}, "python_motion": patience, "silent_time": 5.0}
        master.setParam("/controller_manager", manager)
        node = subprocess.Popen([node_path("robot_node"), "__name:=robot"])
        try:
            wait(lambda: any(one.robot == node.pid for one in wire.offered()), "the slot")
            rospy.init_node("test_control_run", disable_signals=True)
            rospy.wait_for_service("/lwr/command", LIMIT)
            wait(lambda: rospy.ServiceProxy("/lwr/command", LwrCommand)("start").success, "the arm's start")
            yield node
        finally:
            node.send_signal(signal.SIGINT)
            node.wait(timeout=LIMIT)


def wait(condition, what: str) -> None:
    """Wait until ``condition()``; fail with the text ``what``."""
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, f"not within {LIMIT} s: {what}"
        time.sleep(0.02)


def command_of(file: str, *words: str) -> subprocess.Popen:
    """`./coglab controller run` of a file beside this one."""
    command = [sys.executable, "-u", "-m", "coglab.control.run", str(HERE / file), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=dict(os.environ))


def test_the_robot_of_the_master_is_taken_though_another_offers_the_slot(robot):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as world:
        world.bind(b"\0" + str(wire.Address(os.getpid(), "python_motion")).encode())
        world.listen()
        with command_of("my_sway.py") as process:
            try:
                assert process.stdout is not None and f"process {robot.pid}" in process.stdout.readline()
            finally:
                process.kill()


def test_motion_of_a_file_moves_the_arm_and_is_stopped(robot):
    import rospy
    from coglab_msgs.msg import MotionFeedback
    from coglab_msgs.srv import StartMotion, SwitchController

    ends: list[MotionFeedback] = []
    rospy.Subscriber("/controller_manager/python_motion/motion_feedback", MotionFeedback, ends.append)
    with command_of("my_sway.py", "--slot", "python_motion", "duration=4") as process:
        assert process.stdout is not None
        try:
            assert "python_motion" in process.stdout.readline()
            with pytest.raises(wire.SlotError, match=rf"\b{process.pid}\b"):
                wire.Slot(wire.Address(robot.pid, "python_motion"), wire.MOTION)
            with pytest.raises(wire.SlotError, match="99"):
                wire.Slot(wire.Address(robot.pid, "python_motion"), wire.MOTION, interface=99)
            assert rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)(
                "python_motion"
            ).success
            start = rospy.ServiceProxy("/controller_manager/python_motion/start_motion", StartMotion)
            answer = start([], [], False)
            assert answer.success, answer.message
            wait(lambda: any(m.state == "reached" for m in ends), f"the end: {ends[-1:]}")

            ends.clear()
            assert start([], [], False).success
            time.sleep(0.2)  # the motion of 4 s still runs when the process is stopped
            process.send_signal(signal.SIGSTOP)
            wait(lambda: any(m.state == "aborted" and m.reason for m in ends), "an abort")
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=LIMIT) == 0
        finally:
            process.kill()
    with wire.Slot(wire.Address(robot.pid, "python_motion"), wire.MOTION):
        pass  # a restart is accepted


def test_feedback_controllers_of_a_file_find_slots_and_let_go(robot):
    import rospy
    from coglab_msgs.msg import FeedbackState
    from coglab_msgs.srv import SwitchController

    shifts: dict[str, float] = {}
    rospy.Subscriber(
        "/controller_manager/feedback/state",
        FeedbackState,
        lambda state: shifts.update({each.controller: each.values[2] for each in state.states}),
    )
    assert rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)("python_motion").success
    with (
        command_of("remote_controllers.py", "--class=Shift", "height=0.02") as first,
        command_of("remote_controllers.py", "--class=Endless", "height=0.01") as endless,
    ):
        try:
            said = [next(line for line in process.stdout if " holds the slot " in line) for process in (first, endless)]
            slots = {line.split(" of ")[0].rpartition(" ")[2] for line in said}
            assert slots == {"python_feedback", "python_feedback_2"}
            wait(lambda: any(value == pytest.approx(0.02) for value in shifts.values()), f"the shift: {shifts}")
            assert "has not returned" in endless.stdout.readline()
            for process in 3 * (first, endless):  # an impatient user presses Ctrl-C several times
                process.send_signal(signal.SIGINT)
            assert first.wait(timeout=LIMIT) == 0 and endless.wait(timeout=LIMIT) == 1
            assert "Traceback" not in first.stdout.read() + endless.stdout.read()
            wait(lambda: not any(shifts.values()), f"the end of the shifts: {shifts}")
        finally:
            first.kill()
            endless.kill()
