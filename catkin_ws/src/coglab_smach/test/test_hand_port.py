"""RosHand without a ROS master: maximum age of a status, ends of actions and of calibrations, also with a silent node.
The tests set the clock."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus
from coglab_msgs.msg import HandStatus, MotorStatus, ReasonCode
from coglab_smach.ports.interfaces import HandState
from coglab_smach.ports.pending import PortError
from coglab_smach.ros import calls, hand


class Client:
    """An action server that accepts every goal at once; the test ends it."""

    every = {}

    def __init__(self, name, kind):
        self.name, self.goals, self.there, self.ends_at_once = name, [], True, False
        self.handles = []
        Client.every[name] = self

    def send_goal(self, goal, transition_cb, feedback_cb=None):
        self.goals.append(goal)
        self.handles.append(Handle(transition_cb))
        if self.ends_at_once:
            self.handles[-1].end(GoalStatus.SUCCEEDED, None)
        return self.handles[-1]


class Handle:
    """One goal, like actionlib.ClientGoalHandle."""

    def __init__(self, transition_cb):
        self.transition_cb, self.cancelled = transition_cb, 0
        self.state, self.status, self.result, self.text = CommState.ACTIVE, GoalStatus.ACTIVE, None, ""
        self.get_comm_state, self.get_result = lambda: self.state, lambda: self.result
        self.get_goal_status, self.get_goal_status_text = lambda: self.status, lambda: self.text

    def cancel(self):
        self.cancelled += 1

    def end(self, status, result, text=""):
        self.state, self.status, self.result, self.text = CommState.DONE, status, result, text
        self.transition_cb(self)


class Thread:
    """Runs its target at once."""

    def __init__(self, target, args, name, daemon):
        assert daemon, "it must not block the end of the process"
        self.start = lambda: target(*args)


class Node:
    """Replaces the hand's node; with the port and the clock."""

    def __init__(self, monkeypatch):
        self.now, self.listens, self.orders = 100.0, 1, []
        clock = SimpleNamespace(monotonic=lambda: self.now)
        monkeypatch.setattr(calls, "time", clock)
        monkeypatch.setattr(hand, "time", clock)
        monkeypatch.setattr(hand, "wait_for", lambda condition, limit: condition())
        monkeypatch.setattr(hand, "server_is_there", lambda client: client.there)
        monkeypatch.setattr(hand.threading, "Thread", Thread)
        monkeypatch.setattr(hand.actionlib, "ActionClient", Client)
        monkeypatch.setattr("actionlib.simple_action_client.ActionClient", Client)
        monkeypatch.setattr(calls.rospy, "Subscriber", self.subscribe)
        monkeypatch.setattr(hand.rospy, "Publisher", self.publisher)
        self.port = hand.RosHand("right_hand")

    def subscribe(self, topic, kind, take, queue_size):
        assert (topic, kind) == ("right_hand/hand_status", HandStatus)
        self.take = take

    def publisher(self, topic, kind, queue_size):
        assert topic == "right_hand/hand_calibration"
        return SimpleNamespace(
            publish=lambda message: self.orders.append(message.data), get_num_connections=lambda: self.listens
        )

    def say(self, passed=0.0, **fields):
        """Publish the hand_status of a healthy hand, changed by ``fields``, ``passed`` s later."""
        self.now += passed
        motors = [MotorStatus(motor=n, position=10 * n) for n in range(5)]
        self.take(HandStatus(**{"connected": True, "motors": motors, **fields}))

    def client(self, name):
        return Client.every[f"right_hand/{name}"]


@pytest.fixture
def node(monkeypatch):
    return Node(monkeypatch)


def refused(pending, code):
    """The error of a call that has ended with this code."""
    assert pending.done()
    with pytest.raises(PortError) as raised:
        pending.result()
    assert raised.value.code == code
    return raised.value


# --- status -----------------------------------------------------------------------------------------------------------


def test_a_hand_without_any_status_is_silent(node):
    state = node.port.state()
    assert state == HandState(message=state.message, event=ReasonCode.NODE_SILENT)
    assert "right_hand/hand_status" in state.message
    node.now = 0.3  # the computer has just started
    assert node.port.state() == state


def test_a_status_is_valid_for_one_second(node):
    node.say(calibrated=True, holding=True)
    node.now += 1.0
    assert node.port.state().holding
    node.now += 0.01
    state = node.port.state()
    assert not (state.connected or state.calibrated or state.holding) and state.positions == ()
    assert state.event == ReasonCode.NODE_SILENT and "hand_status" in state.message
    node.say()
    assert node.port.state().connected, "it is back"


# --- actions ----------------------------------------------------------------------------------------------------------


def test_goal_that_ends_while_it_is_sent_is_done(node):
    node.client("hand_close").ends_at_once = True
    assert node.port.close(200).done()


def test_a_goal_is_sent_before_the_next_one_is_asked_for(node, monkeypatch):
    """A late thread would let an older order to close overtake a newer one to open."""
    monkeypatch.setattr(hand.threading, "Thread", lambda **_: SimpleNamespace(start=lambda: None))
    node.port.close(60)
    assert len(node.client("hand_close").goals) == 1


def test_late_end_of_an_older_goal_ends_only_that_goal(node):
    first, second = node.port.close(200), node.port.close(300)
    older, newer = node.client("hand_close").handles
    older.end(GoalStatus.PREEMPTED, None)
    assert first.done() and not second.done()
    second.cancel()
    first.cancel()
    assert (older.cancelled, newer.cancelled) == (0, 1)


def test_an_action_cancelled_before_its_goal_was_sent_never_moves_the_hand(monkeypatch):
    client = Client("hand_open", None)
    client.there = False
    monkeypatch.setattr(hand, "server_is_there", lambda client: client.there)
    call = hand.ActionCall(client, "hand_open", "goal")
    call.cancel()
    client.there, end = True, time.monotonic() + 60.0
    while not call.done():
        assert time.monotonic() < end
        time.sleep(0.005)
    refused(call, ReasonCode.CANCELLED)
    assert client.goals == []


def test_an_action_without_a_server_names_the_node(node):
    node.client("hand_open").there = False
    error = refused(node.port.open(300), ReasonCode.NODE_SILENT)
    assert "right_hand/hand_open" in error.sentence and "hand node" in error.sentence
    assert node.client("hand_open").goals == []


def test_ends_of_an_action(node):
    client = node.client("hand_close")

    def ended(status, result, text=""):
        call = node.port.close(200)
        client.handles[-1].end(status, result, text)
        return call

    good = SimpleNamespace(isOk=True, message="", reason_code=0)
    call = ended(GoalStatus.SUCCEEDED, good)
    assert call.done() and call.result() is good
    assert ended(GoalStatus.SUCCEEDED, None).result() is None
    bad = SimpleNamespace(isOk=False, message="blocked", reason_code=ReasonCode.HAND_LINK_LOST)
    error = refused(ended(GoalStatus.ABORTED, bad, "text"), ReasonCode.HAND_LINK_LOST)
    assert error.causes == ("blocked",) and "hand_close" in error.sentence and "ABORTED" in error.sentence
    refused(ended(GoalStatus.SUCCEEDED, bad), ReasonCode.HAND_LINK_LOST)
    refused(ended(GoalStatus.ABORTED, good), ReasonCode.NONE)
    error = refused(ended(GoalStatus.LOST, None, "the node is gone"), ReasonCode.NONE)
    assert error.causes == ("the node is gone",)
    assert refused(ended(GoalStatus.LOST, None), ReasonCode.NONE).causes == ()


# --- calibration ------------------------------------------------------------------------------------------------------


def asked(node, mode="fast"):
    """A calibration whose order was sent."""
    node.say()
    calibration = node.port.calibrate(mode)
    assert not calibration.done() and node.orders[-1:] == [mode]
    return calibration


def test_the_calibration_order_waits_for_a_subscriber(node):
    node.listens = 0
    calibration = node.port.calibrate("fast")
    for connected, listens in ((None, 1), (False, 1), (True, 0)):
        if connected is not None:
            node.say(connected=connected)
        node.listens = listens
        assert not calibration.done() and node.orders == []
    node.listens = 1
    assert not calibration.done() and not calibration.done() and node.orders == ["fast"], "once"


def test_calibration_waits_two_seconds_for_an_empty_hand(node):
    node.say(holding=True)
    calibration = node.port.calibrate("fast")
    assert not calibration.done()
    node.say(1.0, holding=True)
    node.say(1.0, holding=True)
    assert not calibration.done() and node.orders == []
    node.say(0.01, holding=True)
    assert not calibration.done() and node.orders == ["fast"]
    node.say(holding=True)
    calibration = node.port.calibrate("slow")
    node.say(0.1)
    assert not calibration.done() and node.orders == ["fast", "slow"]


def test_a_calibration_that_ends_before_its_start_was_seen(node):
    calibration = asked(node)
    node.say(0.5, calibrated=True)
    assert not calibration.done(), "this status may be older than the order"
    node.say(0.01, calibrated=True)
    assert calibration.done() and calibration.result() is None


def test_a_calibration_without_success(node):
    calibration = asked(node)
    node.say(0.1, calibrating=True)
    assert not calibration.done()
    node.say(0.1, message="a finger is blocked", event_code=ReasonCode.OUT_OF_RANGE)
    assert refused(calibration, ReasonCode.OUT_OF_RANGE).causes == ("a finger is blocked",)


def test_a_refused_calibration(node):
    calibration = asked(node)
    node.say(0.19, message="it holds", event_code=ReasonCode.HAND_REFUSED, calibrated=True)
    assert not calibration.done(), "this status may be older than the order"
    node.say(0.02, message="it holds", event_code=ReasonCode.HAND_REFUSED, calibrated=True)
    error = refused(calibration, ReasonCode.HAND_REFUSED)
    assert "'fast'" in error.sentence and error.causes == ("it holds",)
    for later in ({"calibrated": True}, {"calibrating": True}):
        node.say(1.0, **later)
        refused(calibration, ReasonCode.HAND_REFUSED)


def test_a_calibration_without_any_status_fails(node):
    calibration = asked(node)
    node.say(3.0)
    assert not calibration.done()
    node.say(0.01)
    assert "hand_status" in refused(calibration, ReasonCode.NODE_SILENT).causes[0]


def test_a_node_that_dies_during_calibration(node):
    calibration = asked(node)
    node.say(0.1, calibrating=True)
    assert not calibration.done()
    node.now += 1.01
    assert not calibration.done()
    node.now += 1.0
    assert not calibration.done()
    node.now += 0.01
    assert "right_hand/hand_status" in refused(calibration, ReasonCode.NODE_SILENT).causes[0]


def test_a_late_caller_takes_no_old_status_for_the_end(node):
    calibration = asked(node)
    node.say(0.1, calibrating=True)
    assert not calibration.done()
    node.now += 5.0  # the computer was busy: what the hand said meanwhile has not arrived yet
    assert not calibration.done()
    node.say(0.1, calibrated=True)
    assert calibration.done()
    node.now += 5.0
    assert calibration.done() and calibration.result() is None


def test_a_dead_node_receives_no_order(node):
    node.say()
    node.now += 1.01
    calibration = node.port.calibrate("fast")
    assert not calibration.done() and node.orders == []
    node.say()
    assert not calibration.done() and node.orders == ["fast"], "it is back"
