"""A hand action that is cancelled while its server is still awaited: the hand must never move afterwards."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus
from coglab_smach.ports.pending import PortError
from coglab_smach.ros import hand
from coglab_smach.ros.hand import ActionCall


class Client:
    """An action client whose server comes when the test says so."""

    def __init__(self):
        self.server = threading.Event()
        self.calls = []

    def send_goal(self, goal, transition_cb):
        self.calls.append("send")
        self.handle = Handle(self.calls, transition_cb)
        return self.handle


class Handle:
    """The goal, as actionlib.ClientGoalHandle."""

    def __init__(self, calls, transition_cb):
        self.calls, self.transition_cb = calls, transition_cb
        self.get_comm_state = lambda: CommState.DONE
        self.get_goal_status = lambda: GoalStatus.PREEMPTED
        self.get_result = lambda: SimpleNamespace(isOk=False, message="preempted")
        self.get_goal_status_text = lambda: ""

    def cancel(self):
        self.calls.append("cancel")


@pytest.fixture(autouse=True)
def server(monkeypatch):
    monkeypatch.setattr(hand, "server_is_there", lambda client: client.server.is_set())


def ended(call):
    end = time.monotonic() + 60.0
    while not call.done() and time.monotonic() < end:
        time.sleep(0.005)
    return call.done()


def test_cancelled_before_the_goal_was_sent():
    client = Client()
    call = ActionCall(client, "hand_open", "goal")
    call.cancel()
    client.server.set()
    assert ended(call)
    with pytest.raises(PortError, match="cancelled before its goal was sent"):
        call.result()
    assert client.calls == [], "the hand has heard nothing"


def test_cancelled_afterwards():
    client = Client()
    client.server.set()
    call = ActionCall(client, "hand_open", "goal")
    while not client.calls:
        time.sleep(0.005)
    call.cancel()
    assert client.calls == ["send", "cancel"]
    client.handle.transition_cb(client.handle)
    assert ended(call)
    call.cancel()
    assert client.calls == ["send", "cancel"], "an action that is over is not cancelled"
    with pytest.raises(PortError, match="ended PREEMPTED"):
        call.result()
