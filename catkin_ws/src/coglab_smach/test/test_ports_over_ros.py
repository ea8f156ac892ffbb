"""ROS ports of perception, object database and contact detector: maximum age of messages, requests and their time
limits."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import Contact, ContactSignal, HandoverBelief, ReasonCode
from coglab_py import publish
from coglab_smach.ports.interfaces import Ahead, ContactEvent
from coglab_smach.ports.pending import Permit, PortError, Ready, Threaded
from coglab_smach.ros import ports
from geometry_msgs.msg import Point
from test_arm_port import Topic, ended


class Nodes:
    """The ports, and the requests to their nodes: (name, wait, fields)."""

    def __init__(self, monkeypatch):
        self.now, self.asked, self.answer = 50.0, [], None
        monkeypatch.setattr(ports, "Newest", Topic)
        monkeypatch.setattr(ports, "call", self.call)
        monkeypatch.setattr(ports, "call_now", self.call_now)
        monkeypatch.setattr(ports, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.perception, self.contact, self.database = ports.RosPerception(), ports.RosContact(), ports.RosDatabase()

    def call(self, name, kind, wait=20.0, **fields):
        self.asked.append((name, wait, fields))
        return Ready(self.answer)

    def call_now(self, name, kind, permit, wait=20.0, **fields):
        self.asked.append((name, wait, fields))
        return self.answer

    def say(self, topic, message, seconds=0.0, stamp=50.0):
        there = Topic.every[topic]
        there.message, there.seconds, there.stamp = message, seconds, stamp
        if there.heard is not None:
            there.heard(message)


@pytest.fixture
def nodes(monkeypatch):
    return Nodes(monkeypatch)


# --- perception -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seconds", "known"), [(0.3, True), (0.31, False)])
def test_a_belief_is_valid_for_300_ms(nodes, seconds, known):
    assert nodes.perception.ahead() == Ahead()
    message = HandoverBelief(offer=0.9, request=0.1, object_id="mug", object_frame="object_mug", hand="human_hand")
    message.place, message.place_covariance = Point(1.0, 2.0, 3.0), [0.01, 9, 9, 9, 0.04, 9, 9, 9, 0.02]
    nodes.say("perception/belief", message, seconds)
    place = Ahead(0.9, 0.1, "mug", "object_mug_ahead", (1.0, 2.0, 3.0), 0.2)
    assert nodes.perception.ahead() == (place if known else Ahead())
    if known:
        message.object_frame = ""
        assert nodes.perception.ahead().frame == "human_hand_ahead"
        message.place_covariance[0] = -1.0
        assert nodes.perception.ahead() == Ahead(0.9, 0.1, "mug"), "no place is predicted"
        message.place_covariance = [0.0] * 9
        assert nodes.perception.ahead().deviation == 0.0 and nodes.perception.ahead().frame


# --- contact ----------------------------------------------------------------------------------------------------------


def test_a_request_to_the_detector_contains_the_settings(nodes):
    assert ended(nodes.contact.arm("contact", 6.0, {})).result() is None
    name, wait, fields = nodes.asked[0]
    assert (name, wait) == ("contact_detector/arm", 2.0) and fields["joints"] == [] and fields["frame"] == ""
    assert (fields["mode"], fields["timeout"], fields["k"], fields["mass"], fields["load_share"]) == (
        "contact",
        6,
        0,
        0,
        0,
    )
    assert fields["grasp"].orientation.w == 1.0 and fields["grasp"].position.x == 0.0
    settings = {"k": 9, "joints": (1, 2), "mass": 0.3, "load_share": 0.4, "frame": "object_mug"}
    settings["grasp"] = {"xyz": (1.0, 2.0, 3.0), "quaternion": (1.0, 0.0, 0.0, 0.0)}
    ended(nodes.contact.arm("contact_in_motion", 6.0, settings))
    fields = nodes.asked[1][2]
    assert (fields["k"], fields["joints"], fields["mass"], fields["load_share"]) == (9.0, [1, 2], 0.3, 0.4)
    assert (fields["frame"], fields["grasp"].position.y, fields["grasp"].orientation.x) == ("object_mug", 2.0, 1.0)


def sent(nodes, count):
    end = time.monotonic() + 60.0
    while len(nodes.asked) < count:
        assert time.monotonic() < end
        time.sleep(0.002)


def test_the_detector_is_disarmed_once(nodes):
    nodes.contact.disarm()
    ended(nodes.contact.arm("contact", 6.0, {}))
    nodes.contact.disarm()
    nodes.contact.disarm()
    sent(nodes, 2)
    time.sleep(0.02)
    assert [(wait, fields["mode"]) for _, wait, fields in nodes.asked] == [(2.0, "contact"), (0.5, "off")]


@pytest.mark.parametrize(("mode", "contact"), [("contact", True), ("lift", True), ("release", False)])
def test_the_first_event_of_the_armed_kind_is_kept(nodes, mode, contact):
    topic = "coglab/contact"
    nodes.say(topic, Contact(contact=True))
    nodes.say(topic, Contact(contact=False))
    assert nodes.contact.event() is None, "the detector is not armed"
    nodes.contact.arm(mode, 6.0, {})
    nodes.say(topic, Contact(contact=not contact))
    assert nodes.contact.event() is None
    nodes.say(topic, Contact(contact=contact, source="s", margin=2.0, message="m", confidence=0.75, reason_code=4))
    event = ContactEvent(contact, "s", 2.0, "m", 0.75, 4)
    assert nodes.contact.event() == event
    nodes.say(topic, Contact(contact=contact, source="later"))
    assert nodes.contact.event() == event
    nodes.contact.arm(mode, 6.0, {})
    assert nodes.contact.event() is None


def signal(nodes, seconds=0.0, stamp=50.0, **fields):
    watching = {"mode": "release", "state": "watching", "margin": 1.5, "grip": 7.0}
    nodes.say("contact_detector/signal", ContactSignal(**{**watching, **fields}), seconds, stamp)


def test_the_share_gone_belongs_to_this_arming(nodes):
    assert nodes.contact.share_gone() is None
    nodes.contact.arm("release", 6.0, {"load_share": 0.6})
    assert nodes.contact.share_gone() is None
    signal(nodes)
    assert nodes.contact.share_gone() == pytest.approx(0.9)
    signal(nodes, seconds=0.3)
    assert nodes.contact.share_gone() == pytest.approx(0.9)
    for fields in ({"seconds": 0.31}, {"stamp": 49.9}, {"mode": "contact"}, {"state": "waiting"}):
        signal(nodes, **fields)
        assert nodes.contact.share_gone() is None, fields
    signal(nodes)
    nodes.contact.arm("release", 6.0, {})
    assert nodes.contact.share_gone() == pytest.approx(0.75), "half of the load by default"
    nodes.contact.disarm()
    assert nodes.contact.share_gone() is None
    nodes.contact.arm("contact", 6.0, {"load_share": 0.6})
    assert nodes.contact.share_gone() is None


@pytest.mark.parametrize("over", [True, False])
def test_a_topic_closed_at_the_end_of_the_node_is_no_error(monkeypatch, over):
    def closed(message):
        raise rospy.ROSException("publish() to a closed topic")

    monkeypatch.setattr(publish.rospy.core, "is_shutdown_requested", lambda: over)
    if over:
        publish.publish(SimpleNamespace(publish=closed), "m")
    else:
        with pytest.raises(rospy.ROSException):
            publish.publish(SimpleNamespace(publish=closed), "m")


# --- threads ----------------------------------------------------------------------------------------------------------


def test_a_call_in_its_own_thread():
    good = ended(Threaded(lambda permit: permit.check() or 5, "it"))
    assert good.result() == 5 and not good.failed()
    bad = ended(Threaded(lambda permit: 1 / 0, "it"))
    with pytest.raises(PortError, match="division by zero") as error:
        bad.result()
    assert error.value.code == ReasonCode.UNEXPECTED and bad.failed()
    refused = ended(Threaded(lambda permit: (_ for _ in ()).throw(PortError("no", code=7)), "it"))
    with pytest.raises(PortError) as error:
        refused.result()
    assert error.value.code == 7
    permit = Permit()
    permit.check()
    permit.withdraw()
    with pytest.raises(PortError) as error:
        permit.check()
    assert error.value.code == ReasonCode.CANCELLED
