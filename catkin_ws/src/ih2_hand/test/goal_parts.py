"""Doubles of goals, hand, node and master for tests of the goal queue."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import HandStatus, MotorStatus
from coglab_py.pace import Pace
from ih2_hand.progress import MotorVerdict
from ih2_hand.ros import goals


class Handle:
    """A goal's handle; remembers how it ended."""

    def __init__(self) -> None:
        self.accepted = False
        self.status = 1
        self.ended: tuple[str, str, int] | None = None
        self.feedback: list[tuple[str, int]] = []
        self.positions: list[int] = []

    def set_accepted(self) -> None:
        self.accepted = True

    def get_goal(self) -> object:
        return object()

    def get_goal_status(self) -> SimpleNamespace:
        return SimpleNamespace(status=self.status)

    def publish_feedback(self, feedback: object) -> None:
        self.feedback.append((feedback.status, feedback.status_code))
        self.positions = feedback.positions

    def _end(self, how: str, result: object, text: str) -> None:
        assert self.ended is None, "a goal ends once"
        assert result.isOk == (how == "succeeded") and text in ("", result.message)
        self.ended = (how, result.message, result.reason_code)

    def set_aborted(self, result: object, text: str) -> None:
        self._end("aborted", result, text)

    def set_succeeded(self, result: object, text: str) -> None:
        self._end("succeeded", result, text)

    def set_canceled(self, result: object, text: str = "") -> None:
        self._end("cancelled", result, text)


class Task:
    """A goal that never comes to an end by itself, unless `verdict` says so."""

    name = "hand_close"

    def __init__(self) -> None:
        self.limit = 60.0
        self.begun = 0
        self.asked: list[float] = []
        self.verdict = MotorVerdict("under way")

    def begin(self, driver: object) -> None:
        self.begun += 1

    def judge(self, motors: object, elapsed: float) -> MotorVerdict:
        self.asked.append(elapsed)
        return self.verdict


class Driver:
    """Counts the stops."""

    def __init__(self) -> None:
        self.counters, self.stops = SimpleNamespace(fillers=0), 0
        self.error: Exception | None = None

    def stop_all(self) -> None:
        self.stops += 1
        if self.error:
            raise self.error


class Owner:
    """Double of the hand node."""

    port = "/dev/of_the_test"

    def __init__(self) -> None:
        self.driver: Driver | None = Driver()
        self.tasks: list[Task] = []
        self.verdicts: list[MotorVerdict] = []
        self.refusal: Exception | None = None

    def connected_driver(self) -> Driver:
        return self.driver

    def make_task(self, name: str, goal: object) -> Task:
        if self.refusal:
            raise self.refusal
        self.tasks.append(Task())
        return self.tasks[-1]

    def task_ended(self, task: Task, verdict: MotorVerdict) -> None:
        assert task in self.tasks
        self.verdicts.append(verdict)


class Server:
    """An action server without a master."""

    started = 0
    every: dict[str, Server] = {}

    def __init__(self, name: str, action: type, on_goal: Callable, on_cancel: Callable, auto_start: bool) -> None:
        assert auto_start is False, "a goal must not come before there is what takes it"
        self.action, self.on_goal, self.on_cancel = action, on_goal, on_cancel
        Server.every[name] = self

    def start(self) -> None:
        Server.started += 1


class Master:
    """Records the queue's warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []


def queue_of_goals(monkeypatch: pytest.MonkeyPatch, pace: Pace, owner: Owner) -> tuple[goals.GoalQueue, Master]:
    """A queue of goals without a master; its thread is not started."""
    master = Master()
    Server.started = 0
    monkeypatch.setattr(goals, "ActionServer", Server)
    monkeypatch.setattr(goals.rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(goals.rospy, "get_name", lambda: "/ih2_hand")
    monkeypatch.setattr(goals.rospy, "is_shutdown", lambda: False)
    for log in ("logwarn", "logerr"):
        monkeypatch.setattr(goals.rospy, log, lambda text, *values: master.warnings.append(text % values))
    monkeypatch.setattr(goals.rospy, "logwarn_throttle", lambda _, text, *values: master.warnings.append(text % values))
    return goals.GoalQueue(owner, pace), master


def status_now(**fields: object) -> HandStatus:
    """A hand_status of five motors, read just now."""
    motors = [MotorStatus(motor=n, position=10 * n) for n in range(5)]
    status = HandStatus(**({"connected": True, "motors": motors} | fields))
    status.header.stamp = rospy.Time.now()
    return status
