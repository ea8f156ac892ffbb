"""Perception and contact of the virtual world in parts, on a rig that is what the test says: how long what they say
counts, and what is felt and seen once."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import Ahead, Recognition
from coglab_trials.world_ports import VirtualContact, VirtualPerception
from test_world_ports_parts import Rig, refused


@pytest.fixture
def rig():
    return Rig()


# --- what is seen and believed ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("age", "seen"), [(0.49, True), (0.5, False)])
def test_a_sight_of_a_tracker_counts_for_half_a_second(rig, age, seen):
    perception = VirtualPerception(rig)
    rig.seen["object_mug"] = (Pose(np.array([1.0, 2.0, 3.0])), age)
    sight = perception.locate_object("mug", 0.3)
    assert sight.done() == seen
    if seen:
        found = sight.result()
        assert (found.frame, found.parent, found.xyz, found.age) == ("object_mug", "world", (1.0, 2.0, 3.0), age)
    rig.t += 0.3
    assert sight.done()
    if not seen:
        refused(sight, ReasonCode.OBJECT_NOT_SEEN)
    rig.seen["board"] = rig.seen["object_gnu"] = (Pose(), 0.0)
    assert perception.locate_object("board", 0.3).done() and not perception.locate_object("gnu", 0.3).done()


def test_a_frozen_perception_sees_nothing_more_and_gives_back_what_it_saw(rig):
    perception = VirtualPerception(rig)
    rig.trackers, rig.blind = {"a": 1, "b": 1}, {"b"}
    perception.freeze()
    assert rig.blind == {"a", "b"}
    perception.thaw()
    assert rig.blind == {"b"}, "who was blind before stays so"


class Believing:
    """In the place of BeliefFilter and recogniser."""

    def __init__(self):
        self.things, self.hands, self.estimate = (
            [],
            [],
            SimpleNamespace(pattern="high", confidence=0.9, decided=True, probabilities={"high": 0.9}),
        )
        place = np.array([1.0, 2.0, 3.0])
        self.belief = SimpleNamespace(offer=0.9, request=0.1, object_id="mug", place=place, hand_place=place + 1.0)
        self.belief.covariance, self.belief.stamp = np.diag([0.01, 0.04, 0.02]), 0.0

    def see_object(self, *what):
        self.things.append(what)

    def see_hand(self, captured, *what):
        self.hands.append((captured, *what))
        self.belief.stamp = captured if captured < 50.0 else 0.0
        return self.belief

    def update(self, *what):
        self.hands.append(what)

    def pattern_end(self):
        return "end"


def test_each_sight_is_believed_once_and_the_frames_ahead_are_sent(rig):
    both = Believing()
    perception = VirtualPerception(rig, both, both)
    turned = np.array([0.0, 0.0, 0.0, 1.0])
    sight = lambda at: SimpleNamespace(captured=at, frame=Pose(np.full(3, at), turned))  # noqa: E731
    assert perception.ahead() == Ahead() and perception.recognition() == Recognition()
    rig.sights = {"human_hand": sight(9.9), "object_mug": sight(9.8)}
    for _ in range(2):
        rig.after_period[0]()
    assert [(at, name, t) for at, name, _, t in both.things] == [(9.8, "mug", 10.0)]
    assert len(both.hands) == 2 and both.hands[1][0] == 9.9 and both.hands[1][2:] == (10.0, False, "end")
    frames = [each for each in rig.virtual.asked if each[0] == "set_frame"]
    assert [(name, list(place), list(turn)) for _, name, place, turn, _ in frames] == [
        ("human_hand_ahead", [2.0, 3.0, 4.0], list(turned)),
        ("object_mug_ahead", [1.0, 2.0, 3.0], list(turned)),
    ]
    assert frames[0][4] == pytest.approx(0.1)
    told = Ahead(0.9, 0.1, "mug", "object_mug_ahead", (1.0, 2.0, 3.0), pytest.approx(0.2))
    seen = Recognition("high", 0.9, True, {"high": 0.9})
    for after, known, recognised in ((0.29, True, True), (0.31, False, True), (0.5, False, True), (0.51, False, False)):
        rig.t = 10.0 + after
        assert perception.ahead() == (told if known else Ahead()), after
        assert perception.recognition() == (seen if recognised else Recognition()), after
    rig.t = 10.0
    both.belief.object_id = ""
    assert perception.ahead().frame == "human_hand_ahead"
    both.belief.place = None
    assert perception.ahead() == Ahead(0.9, 0.1, "")
    perception.node.freeze()
    assert perception.ahead() == Ahead() and perception.recognition() == Recognition()
    rig.sights = {"human_hand": sight(10.5)}
    rig.after_period[0]()
    assert len(both.hands) == 2, "frozen, it sees nothing"


# --- contact ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("age", "seen"), [(0.15, True), (0.151, False)])
def test_an_object_is_looked_at_for_15_hundredths_of_a_second(rig, age, seen):
    contact, fed = VirtualContact(rig), []
    contact.detector.feed_sight = lambda *what: fed.append(what)
    palm = Pose(*default_arm().fk(np.full(7, 0.1)))
    rig.seen["object_mug"] = (Pose(palm.position + [0.0, 0.0, 0.02], palm.orientation), age)
    velocity = np.array([0.1, *[0.0] * 6])
    contact._sense_object([0.1] * 7, velocity)
    assert fed == [], "nothing is reached for"
    settings = {"frame": "object_mug", "grasp": Pose().to_dict()}
    assert contact.arm("contact_in_motion", 1.0, settings).result() is None
    contact._sense_object([0.1] * 7, velocity)
    assert len(fed) == seen
    if seen:
        t, distance, angle, speed = fed[0]
        assert t == 10.0 and distance == pytest.approx(0.02) and angle == pytest.approx(0.0, abs=1e-6)
        assert speed == pytest.approx(0.1 * math.hypot(*palm.position[:2]), rel=1e-3)
    refused(contact.arm("juggle", 1.0, {}), ReasonCode.INVALID_ARGUMENT)


def test_motors_count_once_for_each_poll_and_an_empty_hand_carries_nothing(rig):
    contact, fed, payloads = VirtualContact(rig), [], []
    contact.detector.feed_hand = lambda t, motors: fed.append(motors)
    contact.detector.set_payload = payloads.append
    rig.hand.readings = ("a",)
    for _ in range(3):
        contact._sense_hand()
    assert fed == [("a",)] and payloads == []
    contact.moving.load, rig.hand.readings = 0.3, ("b",)
    contact._sense_hand()
    assert payloads == [0.0]
    rig.hand.holding, rig.hand.readings = True, ("c",)
    contact._sense_hand()
    rig.hand.dead, rig.hand.readings = True, ("d",)
    contact._sense_hand()
    assert payloads == [0.0] and fed == [("a",), ("b",), ("c",)]


def test_the_first_event_since_arming_is_kept_and_a_frozen_node_tells_nothing(rig):
    contact = VirtualContact(rig, touch=0.05)
    events = iter([None, "first", "second"])
    contact.detector.feed_measured = lambda *what: next(events)
    contact.detector.share_gone, contact.detector.force = lambda: 0.4, lambda: np.array([1.0, 2.0, 3.0])
    contact.detector.grip = lambda t: 7.0 if t == 10.0 else None
    for expected in (None, "first", "first"):
        rig.after_period[0]()
        assert contact.event() == expected
    contact.arm("contact", 1.0, {})
    assert contact.event() is None and (contact.share_gone(), contact.force(), contact.grip()) == (0.4, (1, 2, 3), 7.0)
    contact.detector.force = lambda: None
    assert contact.force() is None
    contact.freeze()
    assert (contact.share_gone(), contact.force(), contact.grip()) == (None, None, None)
    rig.after_period[0]()  # it asks for no more of them
    contact.thaw()
    contact.disarm()
    assert contact.detector.state() == "off"
    contact.detector.feed_measured = lambda *what: None
    contact.detector.still.state = lambda: "watching"
    for speed, watched in ((0.05, 0), (0.051, 1), (-0.06, 2)):
        rig.robot.report["measured_velocity"] = [speed, *[0.0] * 6] if speed > 0 else [*[0.0] * 6, speed]
        rig.after_period[0]()
        assert contact.watched_while_moving == watched
