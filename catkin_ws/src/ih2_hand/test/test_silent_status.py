"""A goal lives on hand_status: without it, and only then, it is aborted in time, and the fingers are stopped."""

from __future__ import annotations

import time

import pytest
import rospy
from goal_parts import Handle, Owner, queue_of_goals, status_now
from ih2_hand.reasons import Reason
from ih2_hand.ros import goals


@pytest.fixture
def queue(monkeypatch):
    """A queue of goals without a master, on the clock of the computer."""
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    queue, _ = queue_of_goals(monkeypatch)
    queue.start()
    yield queue
    queue.shutdown()


def say(queue: goals.GoalQueue) -> None:
    """One hand_status, read just now."""
    queue._mailbox.put(goals.Item("status", content=(status_now(), time.monotonic())))


def test_a_goal_is_aborted_when_hand_status_falls_silent(queue):
    handle = Handle()
    begun = time.monotonic()
    queue._on_goal("hand_close", handle)
    while time.monotonic() - begun < 1.0:  # for a second all is well
        say(queue)
        time.sleep(0.03)
    assert handle.ended is None and ("under way", Reason.HAND_MOVING) in handle.feedback
    silent = time.monotonic()
    while handle.ended is None and time.monotonic() - silent < 60.0:
        time.sleep(0.01)
    took = time.monotonic() - silent
    assert handle.ended is not None, "it waits for ever"
    how, why, code = handle.ended
    assert how == "aborted" and code == Reason.HAND_LINK_LOST
    assert "no hand_status for 1.5 s" in why and Owner.port in why
    assert took > 1.4, f"{took:.2f} s"
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


def test_a_time_in_which_nobody_looked_is_no_standstill(queue):
    """A busy computer: two polls that lie 5 s apart tell of no finger that it stood for 5 s."""
    queue._on_goal("hand_close", Handle())
    now = time.monotonic() + 1.0
    for begun in (now, now + 0.04, now + 5.0):
        queue._mailbox.put(goals.Item("status", content=(status_now(), begun)))
    while not queue._owner.tasks or len(queue._owner.tasks[0].asked) < 3:
        time.sleep(0.01)
    first, second, third = queue._owner.tasks[0].asked
    assert second - first == pytest.approx(0.04) and third - second == pytest.approx(goals.LONGEST_GAP_S)
