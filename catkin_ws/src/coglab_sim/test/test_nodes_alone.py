"""The nodes /perception and /coglab_sim/virtual_human without a master: their parameters, what they subscribe, answer
and publish."""

import threading
from dataclasses import replace

import pytest
import rospy
from coglab_msgs.msg import CellTruth, Say
from coglab_sim.person.participant import Participant
from coglab_sim.person.recorded_person import RecordedPerson
from coglab_sim.person.scene import shipped
from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from node_alone import Alone, script
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
        self.ros = Alone(monkeypatch)
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
    assert sorted(one.see()) == ["object_mug"] and one.node.people == 2 and "2 people in view" in one.ros.said[-1]
    one.ros.subscribed["~people"](UInt8(0))
    assert sorted(one.see()) == ["object_mug"]
    bad = truth(human_hand=message((float("nan"), 0, 0)))
    assert one.see(bad) == {} and "truth/cell ignored" in one.ros.said[-1]
    assert one.node.truth is not bad
    no_object = truth("", object=message((float("nan"), 0, 0)))
    one.ros.subscribed["~people"](UInt8(1))
    assert sorted(one.see(no_object)) == ["human_hand"]


def test_a_clock_that_is_set_costs_no_sight(monkeypatch):
    one = Perception(monkeypatch)
    one.see()
    one.ros.now, one.ros.boot = one.ros.now - 3.0, one.ros.boot + 3.0
    seen = one.see()
    assert seen["human_hand"].header.stamp.to_sec() == pytest.approx(one.ros.now)


class Request:
    """Of a service."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


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
        self.ros = Alone(monkeypatch)
        self.ros.parameters = parameters
        self.module = script("virtual_human")
        self.node = self.module.VirtualHumanNode()


def test_a_person_begins_with_their_parameters(monkeypatch):
    one = Person(monkeypatch)
    human = one.node.human
    assert human.participant == Participant.draw(7) and human.holds() and not isinstance(human, RecordedPerson)
    assert one.node.object_id == "mug" and human.scene.object_mass == shipped("mug")["mass"]
    assert set(one.ros.subscribed) == {"truth/cell", "human_command", "/a/say", "real_time_factor"}
    assert one.ros.made["human_state"]["latch"] is True
    parameters = {"~seed": 3, "~behaviour": "tug", "~profile": "patient", "cell/object/id": "bottle"}
    parameters |= {"~holds_object": False, "~object_mass": 0.7, "~rest": [1.0, 0.1, 0.2], "~say": "/other/say"}
    parameters |= {"~object_in_hand": [-0.1, 0.0, -0.1], "~handover_object": [0.7, 0.0, 0.4]}
    one = Person(monkeypatch, **parameters)
    human = one.node.human
    assert human.participant == Participant.draw(3, "tug", "patient") and not human.holds()
    assert human.scene.object_mass == 0.7 and list(human.scene.rest) == [1.0, 0.1, 0.2]
    assert list(human.scene.object_in_hand) == [-0.1, 0.0, -0.1] and list(human.scene.handover_object) == [
        0.7,
        0.0,
        0.4,
    ]
    assert "/other/say" in one.ros.subscribed and one.node.object_id == "bottle"
    assert "/a/say" not in Person(monkeypatch, **{"~react": False}).ros.subscribed
    assert Person(monkeypatch, seed=5).node.human.participant.seed == 5
    fields = {"seed": 9, "behaviour": "slow", "trust": 0.3}
    person = Person(monkeypatch, **{"~participant": fields, "~seed": 2, "~behaviour": "tug"}).node.human.participant
    assert person == replace(Participant.draw(9, "slow"), trust=0.3)
    for wrong in ({"~object_mass": -0.1}, {"~object_mass": 101.0}, {"~rest": [1.0, 2.0]}, {"~behaviour": "silly"}):
        with pytest.raises(ValueError):
            Person(monkeypatch, **wrong)
    assert Person(monkeypatch, **{"~object_mass": 100.0}).node.human.scene.object_mass == 100.0


def test_what_the_truth_says_is_what_the_person_may_perceive(monkeypatch):
    one = Person(monkeypatch)
    feel = one.ros.subscribed["truth/cell"]
    feel(truth(hand_closure=0.4, human_force=Vector3(1.0, 2.0, -3.0)))
    view = one.node.view
    assert view.hand_closure == 0.4 and list(view.load) == [1.0, 2.0, -3.0]
    assert list(view.robot_hand.position) == list(PALM) and list(view.object.position) == list(MUG)
    for wrong in (
        truth(hand_closure=float("nan")),
        truth(human_force=Vector3(0.0, float("inf"), 0.0)),
        truth(object=message((1e9, 0, 0))),
        truth(robot_hand=message(PALM, (0, 0, 0, 0))),
    ):
        feel(wrong)
        assert one.node.view is view and "truth/cell ignored" in one.ros.said[-1]
    feel(truth("", object=message((1e9, 0, 0))))
    assert one.node.view is not view, "without an object nothing is wrong with it"
    assert isinstance(one.node.lock, type(threading.Lock()))


def test_commands_and_words_reach_the_person(monkeypatch):
    one = Person(monkeypatch)
    monkeypatch.setattr(one.module.time, "monotonic", lambda: 3.0)
    one.ros.subscribed["human_command"](String("give mug"))
    assert one.node.human._pending == "give"
    one.ros.subscribed["human_command"](String("juggle"))
    assert "give, receive or rest" in one.ros.said[-1]
    one.ros.subscribed["/a/say"](Say(code=Say.I_HAVE_IT))
    assert one.node.human._heard == [(3.0 + one.node.human.participant.hearing_delay, Say.I_HAVE_IT)]
    for age in (60.0, 3.0):  # latched: said before this person came
        one.ros.now = 100.0
        late = Say(code=Say.READY_TO_RECEIVE)
        late.header.stamp = rospy.Time.from_sec(100.0 - age)
        one.ros.subscribed["/a/say"](late)
    assert [code for _, code in one.node.human._heard] == [Say.I_HAVE_IT, Say.READY_TO_RECEIVE]


@pytest.mark.parametrize("name", ["perception_stand_in", "truth_markers", "virtual_human"])
def test_a_node_that_was_ended_ends_with_0_and_one_that_cannot_begin_with_1(monkeypatch, name):
    ros = Alone(monkeypatch)
    ros.parameters = {"~frames": FRAMES, "~board": BOARD}
    module, spun = script(name), []
    monkeypatch.setattr(rospy, "init_node", lambda given: spun.append(given))
    monkeypatch.setattr(rospy, "spin", lambda: spun.append("spin"))
    monkeypatch.setattr(rospy, "is_shutdown", lambda: True)
    assert module.main() == 0 and spun[0] == name.replace("_stand_in", "")
    if name != "truth_markers":
        ros.parameters = {"~frames": FRAMES, "~behaviour": "silly"}
        assert module.main() == 1 and "silly" in ros.said[-1] or "board" in ros.said[-1]
