"""A goal lives on hand_status: without it, and only then, it is aborted in time, and the fingers are stopped."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import HandStatus, MotorStatus
from ih2_hand.progress import Verdict
from ih2_hand.reasons import Reason
from ih2_hand.ros import goals


class Handle:
    """A goal's handle; remembers how it ended."""

    def __init__(self) -> None:
        self.ended: tuple[str, str, int] | None = None
        self.feedback: list[tuple[str, int]] = []

    def set_accepted(self) -> None:
        """It begins."""

    def get_goal(self) -> object:
        return object()

    def get_goal_status(self) -> SimpleNamespace:
        return SimpleNamespace(status=1)

    def publish_feedback(self, feedback: object) -> None:
        self.feedback.append((feedback.status, feedback.status_code))

    def set_aborted(self, result: object, text: str) -> None:
        self.ended = ("aborted", text, result.reason_code)

    def set_succeeded(self, result: object, text: str) -> None:
        self.ended = ("succeeded", text, result.reason_code)


class Task:
    """A goal that never comes to an end by itself."""

    name, limit = "hand_close", 60.0

    def begin(self, driver: object) -> None:
        """Nothing is sent."""

    def judge(self, motors: object, elapsed: float) -> Verdict:
        return Verdict("under way")


class Driver:
    """Counts the stops."""

    def __init__(self) -> None:
        self.counters, self.stops = SimpleNamespace(fillers=0), 0

    def stop_all(self) -> None:
        self.stops += 1


class Owner:
    """As much of the hand node as the goals see of it."""

    port = "/dev/of_the_test"

    def __init__(self) -> None:
        self.driver = Driver()
        self.verdicts: list[Verdict] = []

    def connected_driver(self) -> Driver:
        return self.driver

    def make_task(self, name: str, goal: object) -> Task:
        return Task()

    def task_ended(self, task: Task, verdict: Verdict) -> None:
        self.verdicts.append(verdict)


class Server:
    """An action server without a master."""

    def __init__(self, *arguments: object, **options: object) -> None:
        """Nobody asks it."""

    def start(self) -> None:
        """Nobody asks it."""


@pytest.fixture
def queue(monkeypatch):
    """A queue of goals without a master, on the clock of the computer."""
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    monkeypatch.setattr(goals, "HandActionServer", Server)
    monkeypatch.setattr(goals.rospy, "Subscriber", lambda *a, **k: SimpleNamespace(unregister=lambda: None))
    monkeypatch.setattr(goals.rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(goals.rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(goals.rospy, "logwarn", lambda *a: None)
    queue = goals.GoalQueue(Owner())
    queue.start()
    yield queue
    queue.shutdown()


def say(queue: goals.GoalQueue) -> None:
    """One hand_status, read just now."""
    status = HandStatus(connected=True, motors=[MotorStatus(motor=n) for n in range(5)])
    status.header.stamp = rospy.Time.now()
    queue._mailbox.put(goals.Item("status", content=status))


def test_a_goal_is_aborted_when_hand_status_falls_silent(queue):
    handle = Handle()
    begun = time.monotonic()
    queue._on_goal("hand_close", handle)
    while time.monotonic() - begun < 1.0:  # for a second all is well
        say(queue)
        time.sleep(0.03)
    assert handle.ended is None and ("under way", Reason.HAND_MOVING) in handle.feedback
    silent = time.monotonic()
    while handle.ended is None and time.monotonic() - silent < 10.0:
        time.sleep(0.01)
    took = time.monotonic() - silent
    assert handle.ended is not None, "it waits for ever"
    how, why, code = handle.ended
    assert how == "aborted" and code == Reason.HAND_LINK_LOST
    assert "no hand_status for 1.5 s" in why and Owner.port in why
    assert 1.4 < took < 3.0, f"{took:.2f} s"
    assert queue._owner.driver.stops == 1, "the fingers are stopped"
    assert queue.active is None and len(queue._owner.verdicts) == 1


def test_pauses_of_hand_status_below_the_limit_are_ridden_through(queue):
    handle = Handle()
    queue._on_goal("hand_close", handle)
    for _ in range(4):
        time.sleep(0.9)
        say(queue)
    time.sleep(0.1)
    assert handle.ended is None and queue.active == "hand_close"
    assert queue._owner.driver.stops == 0
