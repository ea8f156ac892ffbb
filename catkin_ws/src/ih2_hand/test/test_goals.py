"""The queue of goals: at most one moves the fingers, each ends once, and its client gets the reason."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from coglab_py import pace
from goal_parts import Handle, Owner, Server, Task, queue_of_goals, status_now
from ih2_hand.errors import HandConnectionLost
from ih2_hand.progress import RESENDS
from ih2_hand.reasons import Reason
from ih2_hand.ros import goals


class Desk:
    """A queue with its own clock. Every call waits until the goals' thread has processed what it sent."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.looks = 100.0, 0
        clock = SimpleNamespace(monotonic=self.look, sleep=lambda seconds: None)
        monkeypatch.setattr(goals, "time", clock)
        monkeypatch.setattr(pace, "time", clock)
        monkeypatch.setattr(goals.rospy.Time, "now", lambda: rospy.Time.from_sec(self.now))
        self.pace, self.owner, self.started = pace.Pace(), Owner(), False
        self.queue, self.master = queue_of_goals(monkeypatch, self.pace, self.owner)

    def look(self) -> float:
        now = self.now
        self.looks += 1
        return now

    def work(self) -> None:
        if not self.started:
            self.started = True
            self.queue.start()
            assert Server.started == len(goals.SPECS)
        done = threading.Event()
        self.queue.call(done.set)
        assert done.wait(60.0), "it waits for ever"

    def tick(self) -> None:
        """Wait until the idle thread has looked at the present time, or ended the goal."""
        before = self.looks
        wait(lambda: self.looks > before + 1 or self.queue.active is None)
        self.work()

    def goal(self, name: str = "hand_close") -> Handle:
        handle = Handle()
        Server.every[f"~{name}"].on_goal(handle)
        self.work()
        return handle

    def cancel(self, name: str, handle: Handle) -> None:
        Server.every[f"~{name}"].on_cancel(handle)
        self.work()

    def status(self, after: float = 0.1, **fields: object) -> None:
        self.now += after
        self.queue.polled(status_now(**fields), self.now)
        self.work()

    @property
    def task(self) -> Task:
        return self.owner.tasks[-1]

    @property
    def stops(self) -> int:
        return self.owner.driver.stops


@pytest.fixture
def desk(monkeypatch):
    desk = Desk(monkeypatch)
    yield desk
    if desk.started:
        desk.queue.shutdown()


def wait(what) -> None:
    end = time.monotonic() + 60.0
    while not what():
        assert time.monotonic() < end, "it waits for ever"
        time.sleep(0.005)


def test_only_the_last_of_many_goals_begins(desk):
    flood = [Handle() for _ in range(5)]
    for handle in flood:
        Server.every["~hand_close"].on_goal(handle)
    desk.work()
    replaced = ("cancelled", "replaced by a new goal before it began", Reason.SUPERSEDED)
    assert [handle.ended for handle in flood] == [replaced] * 4 + [None]
    assert all(handle.accepted for handle in flood)
    assert len(desk.owner.tasks) == 1 and desk.stops == 0


def test_a_goal_that_was_cancelled_while_it_waited_does_not_begin(desk):
    handle = Handle()
    handle.status = actionlib.GoalStatus.PREEMPTING
    Server.every["~hand_close"].on_goal(handle)
    desk.work()
    assert (handle.ended[0], handle.ended[2]) == ("cancelled", Reason.CANCELLED)
    assert desk.task.begun == 0 and desk.queue.active is None


@pytest.mark.parametrize("driver", ["that fails", "that is gone"])
def test_a_goal_ends_though_its_fingers_cannot_be_stopped(desk, driver):
    handle = desk.goal()
    if driver == "that fails":
        desk.owner.driver.error = HandConnectionLost("gone")
    else:
        desk.owner.driver = None
    desk.cancel("hand_close", handle)
    assert handle.ended[0] == "cancelled" and desk.queue.active is None


def test_a_goal_does_not_go_on_with_another_connection(desk):
    handle = desk.goal()
    desk.owner.driver = type(desk.owner.driver)()
    desk.status()
    assert handle.ended[0] == "aborted" and handle.ended[2] == Reason.HAND_LINK_LOST
    assert Owner.port in handle.ended[1] and desk.task.asked == []


def test_a_status_from_before_the_command_is_not_judged(desk):
    desk.goal()
    desk.status(after=0.019)
    assert desk.task.asked == []
    desk.status(after=0.0015)
    assert len(desk.task.asked) == 1
    desk.status(motors=[])
    assert len(desk.task.asked) == 1


def test_a_resynchronised_line_takes_the_command_again_but_not_for_ever(desk):
    handle = desk.goal()
    for times in range(1, RESENDS + 1):
        desk.owner.driver.counters.fillers += 1
        desk.status()
        assert desk.task.begun == 1 + times and handle.ended is None and desk.task.asked == []
    desk.status()
    assert desk.task.asked == pytest.approx([0.1 * (RESENDS + 1)]), "since the command was sent first"
    desk.owner.driver.counters.fillers += 1
    desk.status()
    how, why, code = handle.ended
    assert how == "aborted" and code == Reason.HAND_LINK_LOST and "3 times" in why
    assert desk.task.begun == 1 + RESENDS, "the fingers are not sent on their way once more"
    assert len(desk.task.asked) == len(handle.feedback) == 1, "nor is it told any more how they move"
    assert desk.owner.verdicts[-1].done
    assert desk.stops == 1 and desk.queue.active is None


def test_a_goal_has_its_time_limit(desk):
    handle = desk.goal()
    desk.task.limit = 3.0
    for _ in range(3):
        desk.status(after=1.0)
    assert handle.ended is None
    desk.status(after=0.1)
    assert (handle.ended[0], handle.ended[2]) == ("aborted", Reason.TIME_LIMIT) and "3 s" in handle.ended[1]
    assert desk.stops == 1


def test_limits_of_time_pass_with_the_simulated_cell(desk):
    """In a cell at a quarter of real time a finger needs four times as long: it is neither stuck nor too late."""
    desk.pace.change(0.25)
    handle = desk.goal()
    desk.task.limit = 3.0
    for _ in range(118):
        desk.status(after=0.1)
    assert handle.ended is None and desk.task.asked[-1] == pytest.approx(11.8 / 4)
    for _ in range(4):
        desk.status(after=0.1)
    assert handle.ended is not None and handle.ended[2] == Reason.TIME_LIMIT


def test_silence_counts_from_the_last_status(desk):
    handle = desk.goal()
    desk.status(after=goals.SILENCE_S)
    desk.now += goals.SILENCE_S
    desk.tick()
    assert handle.ended is None
    desk.now += 0.01
    desk.tick()
    assert handle.ended[0] == "aborted" and "1.5 s" in handle.ended[1]


def test_gap_between_polls_does_not_count_as_standstill(desk):
    """A busy computer: two polls that lie 1.4 s apart do not mean that a finger stood for 1.4 s."""
    desk.goal()
    for after in (1.0, 0.04, 1.4):
        desk.status(after=after)
    first, second, third = desk.task.asked
    assert second - first == pytest.approx(0.04) and third - second == pytest.approx(goals.LONGEST_GAP_S)


def fails(error: Exception):
    raise error


@pytest.mark.parametrize(
    ("error", "why", "code"),
    [
        (HandConnectionLost("cable"), "cable", Reason.HAND_LINK_LOST),
        (KeyError("slip"), "internal error: 'slip'", Reason.UNEXPECTED),
    ],
)
def test_a_goal_ends_whatever_happens_and_the_next_is_taken(desk, error, why, code):
    handle = desk.goal()
    desk.queue.call(lambda: fails(error))
    desk.work()
    assert handle.ended == ("aborted", why, code)
    desk.goal("hand_open")
    assert desk.queue.active == "hand_open"
