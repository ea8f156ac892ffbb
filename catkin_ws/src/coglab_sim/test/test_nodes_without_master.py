"""The nodes /perception and /coglab_sim/virtual_human without a master: their parameters, what they subscribe, answer
and publish."""

import pytest
import rospy
from coglab_msgs.msg import CellTruth, Say
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from ros_double import RosDouble, script
from std_msgs.msg import String, UInt8

FRAMES = {"world": "world", "human_hand": "human_hand", "board": "board", "object": "object_{id}"}
BOARD = {"xyz": [0.45, -0.55, 0.05], "yaw_deg": -90.0, "slots": {"A1": [0.0, 0.0, 0.0], "A2": [0.0, 0.15, 0.0]}}
HAND, MUG, PALM = (0.9, 0.1, 0.45), (0.82, 0.1, 0.40), (0.5, 0.0, 0.4)


def message(place, turn=(0, 0, 0, 1)):
    return PoseMessage(Point(*place), Quaternion(*turn))


def truth(object_id="mug", **fields):
    poses = {"object": message(MUG), "human_hand": message(HAND), "robot_hand": message(PALM)}
    return CellTruth(object_id=object_id, **poses | fields)


# -- perception ---------------------------------------------------------------------------------------------------


class Perception:
    """The node with a perfect tracker, unless its settings say otherwise."""

    def __init__(self, monkeypatch, **parameters):
        given = {"~frames": FRAMES, "~board": BOARD, "~perfect": True} | parameters
        self.ros = RosDouble(monkeypatch)
        self.ros.parameters = {name: value for name, value in given.items() if value is not None}
        self.module = script("perception_stand_in")
        self.node = self.module.PerceptionNode()

    def see(self, seen=None):
        """Frames that are broadcast of a truth."""
        self.ros.now += 0.1
        before = len(self.ros.sent)
        self.ros.subscribed["coglab_sim/truth/cell"](seen or truth())
        return {each.child_frame_id: each for sent in self.ros.sent[before:] for each in sent}


def test_hand_and_object_are_broadcast_with_their_capture_time(monkeypatch):
    one = Perception(monkeypatch)
    seen = one.see()
    assert sorted(seen) == ["human_hand", "object_mug"]
    for name, where in (("human_hand", HAND), ("object_mug", MUG)):
        found = seen[name].transform.translation
        assert (found.x, found.y, found.z) == where and seen[name].header.stamp.to_sec() == pytest.approx(one.ros.now)
    assert sorted(one.see(truth(""))) == ["human_hand"]
    one.ros.subscribed["~people"](UInt8(2))
    assert sorted(one.see()) == ["object_mug"] and one.node.people == 2 and "2 people" in one.ros.said[-1]
    one.ros.subscribed["~people"](UInt8(0))
    assert sorted(one.see()) == ["object_mug"]
    bad = truth(human_hand=message((float("nan"), 0, 0)))
    assert one.see(bad) == {} and "truth/cell ignored" in one.ros.said[-1]
    assert one.node.truth is not bad
    no_object = truth("", object=message((float("nan"), 0, 0)))
    one.ros.subscribed["~people"](UInt8(1))
    assert sorted(one.see(no_object)) == ["human_hand"]


@pytest.mark.parametrize("late, stamped", [(0.06, 0.06), (-0.06, 0.0), (3.0, 0.0)])
def test_a_late_node_keeps_the_time_of_capture(monkeypatch, late, stamped):
    """A busy computer runs the node late: the stamp says when the hand was there. Another clock does not count."""
    one = Perception(monkeypatch)
    one.see()
    state = truth()
    state.header.stamp = rospy.Time.from_sec(one.ros.now + 0.1 - late)
    seen = one.see(state)
    assert seen["human_hand"].header.stamp.to_sec() == pytest.approx(one.ros.now - stamped)


def test_no_sight_is_lost_when_the_clock_is_set(monkeypatch):
    one = Perception(monkeypatch)
    one.see()
    one.ros.now, one.ros.boot = one.ros.now - 3.0, one.ros.boot + 3.0
    seen = one.see()
    assert seen["human_hand"].header.stamp.to_sec() == pytest.approx(one.ros.now)


def test_tf_that_is_closed_at_the_end_is_no_error(monkeypatch):
    one = Perception(monkeypatch)

    def closed(_):
        raise rospy.ROSException("publisher is closed")

    monkeypatch.setattr(one.node.broadcaster, "sendTransform", closed)
    for ending in (True, False):
        monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda ending=ending: ending)
        one.ros.now += 0.1
        if ending:
            one.ros.subscribed["coglab_sim/truth/cell"](truth())
        else:
            with pytest.raises(rospy.ROSException, match="closed"):
                one.ros.subscribed["coglab_sim/truth/cell"](truth())


# -- the person ---------------------------------------------------------------------------------------------------


class Person:
    def __init__(self, monkeypatch, **parameters):
        self.ros = RosDouble(monkeypatch)
        self.ros.parameters = parameters
        self.module = script("virtual_human")
        self.node = self.module.VirtualHumanNode()


def test_a_hand_does_not_jump_when_the_computer_stops_the_person(monkeypatch):
    """Nobody's hand jumps: the reach goes on from where it stopped."""
    one = Person(monkeypatch, **{"~profile": "patient"})
    published = one.ros.published["human_hand"]
    one.ros.subscribed["human_command"](String("give mug"))
    now, speed = one.node.pace.now(), 0.0
    while speed < 0.5:
        now += 0.01
        one.node.step(now)
        speed = abs(published[-1].velocity.linear.x)
        assert now < 115.0, "the person does not reach"
    one.node.step(now + 1.0)
    jump = abs(published[-1].pose.position.x - published[-2].pose.position.x)
    assert 0.02 < jump < 0.12, jump  # the reach takes about a second over 0.4 m


def test_commands_and_words_reach_the_person(monkeypatch):
    one, asked, heard = Person(monkeypatch), [], []
    command = one.node.human.command
    monkeypatch.setattr(one.node.human, "command", lambda text: command(text) or asked.append(text))
    monkeypatch.setattr(one.node.human, "hear", lambda t, code: heard.append((t, code)))
    one.ros.subscribed["human_command"](String("give mug"))
    assert asked == ["give mug"]
    one.ros.subscribed["human_command"](String("juggle"))
    assert "give, receive" in one.ros.said[-1]
    one.ros.subscribed["/a/say"](Say(code=Say.I_HAVE_IT))
    assert heard == [(one.node.pace.now(), Say.I_HAVE_IT)]
    for age in (60.0, 3.0):  # latched: said before this person came
        one.ros.now = 100.0
        late = Say(code=Say.READY_TO_RECEIVE)
        late.header.stamp = rospy.Time.from_sec(100.0 - age)
        one.ros.subscribed["/a/say"](late)
    assert [code for _, code in heard] == [Say.I_HAVE_IT, Say.READY_TO_RECEIVE]
