"""The nodes /perception and /coglab_sim/virtual_human without a master: their parameters, what they subscribe, answer
and publish."""

import threading
from dataclasses import replace

import numpy as np
import pytest
import rospy
from coglab_msgs.msg import CellTruth, ReasonCode, Say
from coglab_py.pose import Pose, about_z
from coglab_sim.person.participant import Participant
from coglab_sim.person.recorded_person import RecordedPerson
from coglab_sim.person.scene import HandSample, Scene, shipped
from coglab_sim.tracker.tracker import PerceptionSettings
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


def test_perception_begins_with_its_parameters(monkeypatch):
    one = Perception(monkeypatch, **{"~perfect": None})
    vision = one.node.vision
    assert vision.settings == PerceptionSettings() and vision.seed == 7 and vision.choice.margin == 0.0
    assert one.node.people == 1 and one.node.playback is None and not one.ros.timers
    assert [list(place.position) for place in one.node.others] == [[1.05, 0.45, 0.35], [1.05, -0.45, 0.35]]
    assert set(one.ros.services) == {"~init_vision", "~locate_object", "~free_places"}
    parameters = {"~seed": 3, "~settings": {"rate": 10.0, "perfect": True}, "~perfect": None, "~partner_margin": 0.2}
    vision = Perception(monkeypatch, **parameters).node.vision
    assert vision.seed == 3 and vision.settings == PerceptionSettings(rate=10.0, perfect=True)
    assert vision.choice.margin == 0.2
    assert Perception(monkeypatch, **{"coglab_sim/seed": 9}).node.vision.seed == 9
    assert Perception(monkeypatch, **{"~settings": {"perfect": False}}).node.vision.settings.perfect is True
    assert Perception(monkeypatch, **{"~people": 0}).node.people == 0
    for wrong in ({"~people": -1}, {"~people": 256}, {"~partner_margin": -0.1}, {"~settings": {"speed": 1}}):
        with pytest.raises(ValueError):
            Perception(monkeypatch, **wrong)


def test_the_board_is_broadcast_once_where_it_is_seen(monkeypatch):
    one = Perception(monkeypatch)
    (board,) = one.ros.static
    assert (board.child_frame_id, board.header.frame_id, board.header.stamp.to_sec()) == ("board", "world", 5.0)
    place, turn = board.transform.translation, board.transform.rotation
    assert (place.x, place.y, place.z) == (0.45, -0.55, 0.05)
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx(about_z(-np.pi / 2))
    straight = Perception(monkeypatch, **{"~board": {name: BOARD[name] for name in ("xyz", "slots")}})
    assert straight.ros.static[0].transform.rotation.w == 1.0


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


def test_of_several_the_nearer_one_by_the_margin_is_shown(monkeypatch):
    one = Perception(monkeypatch, **{"~people": 2, "~partner_margin": 0.2, "~others": [[0.6, 0.0, 0.4]]})
    place = one.see()["human_hand"].transform.translation
    assert (place.x, place.y, place.z) == (0.6, 0.0, 0.4)


def test_services_answer_with_codes_and_frames(monkeypatch):
    one = Perception(monkeypatch)
    ask = {name: lambda _call=call, **fields: _call(Request(**fields)) for name, call in one.ros.services.items()}
    answer = ask["~init_vision"](timeout=0.0)
    assert not answer.success and answer.reason_code == ReasonCode.NOT_PERCEIVED and "not visible" in answer.message
    answer = ask["~free_places"](object_id="mug", timeout=0.0)
    assert not answer.success and answer.reason_code == ReasonCode.NOT_PERCEIVED and answer.places == []
    answer = ask["~locate_object"](object_id="mug", timeout=float("nan"))
    assert not answer.success and answer.reason_code == ReasonCode.OBJECT_NOT_SEEN and "'object_mug'" in answer.message
    one.see()
    assert ask["~init_vision"](timeout=0.0).success
    one.ros.now += 0.2
    answer = ask["~locate_object"](object_id="mug", timeout=-1.0)
    assert answer.success and answer.frame_id == "object_mug" and answer.age == pytest.approx(0.2)
    assert answer.pose.header.frame_id == "world" and answer.pose.pose.position.x == MUG[0]
    assert answer.pose.header.stamp.to_sec() == pytest.approx(one.ros.now - 0.2)
    answer = ask["~free_places"](object_id="mug", timeout=0.0)
    assert answer.success and answer.message == "A1, A2"
    assert [place.header.frame_id for place in answer.places] == ["board", "board"]
    assert [place.pose.position.y for place in answer.places] == [0.0, 0.15]
    bounded = one.module.bounded
    assert [bounded(t) for t in (-1.0, 0.0, 3.0, 10.0, 11.0)] == [0.0, 0.0, 3.0, 10.0, 10.0]
    assert bounded(float("nan")) == 0.0


class Request:
    """Of a service."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


def write(tmp_path, frame):
    path = tmp_path / "r.csv"
    path.write_text("t,x,y,z,frame\n" + "".join(f"{0.5 * i},{0.1 * i},0,0.4,{frame}\n" for i in range(5)))
    return str(path)


@pytest.mark.parametrize("frame, shown", [("human_hand", ["human_hand", "object_mug"]), ("object_ball", None)])
def test_a_recording_takes_the_place_of_what_it_shows(monkeypatch, tmp_path, frame, shown):
    one = Perception(monkeypatch, **{"~recording": {"file": write(tmp_path, frame)}})
    ((period, look),) = one.ros.timers
    assert period == pytest.approx(0.01) and f": {frame}, 2.0 s" in one.ros.said[0]
    assert one.see() == {}, "it is the recording that is shown, at its own times"
    seen = {}
    for _ in range(3):
        one.ros.now += 0.25
        look()
    for sent in one.ros.sent:
        seen |= {each.child_frame_id: each for each in sent}
    assert sorted(seen) == (shown or ["human_hand", "object_ball", "object_mug"])
    assert seen[frame].transform.translation.x == pytest.approx(0.1)
    if frame != "human_hand":
        assert seen["human_hand"].transform.translation.x == HAND[0]


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


def test_a_recorded_person_is_put_their_object_into_the_hand(monkeypatch, tmp_path):
    path = tmp_path / "h.csv"
    rows = [f"{0.1 * i},{0.04 * i},0,0.4,{name}\n" for i in range(11) for name in ("human_hand", "object_mug")]
    path.write_text("t,x,y,z,frame\n" + "".join(rows))
    one = Person(monkeypatch, **{"~recording": {"file": str(path), "person": "no_wait"}})
    human = one.node.human
    assert isinstance(human, RecordedPerson) and human.way == "no_wait"
    assert f"the person's hand goes as recorded in {path} (no_wait), 1.0 s" in one.ros.said[0]
    waited, asked = [], []

    def proxy(name, kind):
        return lambda **fields: asked.append((name, fields)) or Request(success=len(asked) < 2, message="no")

    monkeypatch.setattr(one.module, "wait_for_service", lambda name, limit: waited.append((name, limit)))
    monkeypatch.setattr(rospy, "ServiceProxy", proxy)
    one.node.put_into_hand()
    name, fields = asked[0]
    assert waited == [("cell/place_object", 30.0)] and name == "cell/place_object" and fields["where"] == "human_hand"
    assert fields["pose"].position.x == pytest.approx(human.scene.object_in_hand[0])
    with pytest.raises(ValueError, match="the cell refuses the object in the recorded hand: no"):
        one.node.put_into_hand()


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


def test_the_hand_is_published_each_time_and_the_phase_when_it_changes(monkeypatch):
    one = Person(monkeypatch)
    sample = HandSample(Pose(np.array([1.0, 2.0, 3.0]), about_z(0.3)), np.array([4.0, 5.0, 6.0]), 0.7, 21.0, "idle")
    sample.spin = np.array([7.0, 8.0, 9.0])
    for phase in ("idle", "idle", "waiting", "waiting", "idle"):
        sample.phase = phase
        one.node.publish(sample)
    hands = one.ros.published["human_hand"]
    assert len(hands) == 5 and [state.data for state in one.ros.published["human_state"]] == ["idle", "waiting", "idle"]
    hand = hands[0]
    assert (hand.grip, hand.grip_force) == (0.7, 21.0) and hand.pose.position.z == 3.0
    assert (hand.velocity.linear.y, hand.velocity.angular.z) == (5.0, 9.0)
    assert hand.header.frame_id == "world" and hand.header.stamp.to_sec() == 5.0
    assert hand.pose.orientation.z == pytest.approx(np.sin(0.15))


def test_the_person_moves_a_hundred_times_a_second(monkeypatch):
    one = Person(monkeypatch)
    clock, slept, steps = [10.0], [], []

    def goes_on(seconds):
        clock[0] += seconds

    def step(t, view):
        steps.append(t)
        return HandSample(Pose(), np.zeros(3), 1.0, 1.0, "idle")

    monkeypatch.setattr(one.module.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(one.module.time, "sleep", lambda s: (slept.append(s), goes_on(s)))
    monkeypatch.setattr(one.module.rospy, "is_shutdown", lambda: len(steps) >= 20)
    monkeypatch.setattr(one.node.human, "step", step)
    monkeypatch.setattr(one.node, "publish", lambda sample: goes_on(0.1 if len(steps) == 5 else 0.0))
    one.node.run()
    assert np.diff(steps[:5]) == pytest.approx([0.01] * 4)
    # After a step that took 0.1 s one follows without a rest, not ten.
    assert slept[4] == 0.0 and slept[5] == pytest.approx(0.0, abs=1e-9)
    assert np.diff(steps[6:]) == pytest.approx([0.01] * 13)


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


def test_a_hand_that_was_recorded_alone_has_nothing_put_into_it(monkeypatch, tmp_path):
    path = tmp_path / "h.csv"
    path.write_text("t,x,y,z\n" + "".join(f"{0.1 * i},{0.04 * i},0,0.4\n" for i in range(11)))
    ros = Alone(monkeypatch)
    ros.parameters = {"~recording": {"file": str(path), "object": "in_hand"}}
    module = script("virtual_human")
    monkeypatch.setattr(rospy, "init_node", lambda given: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: True)
    assert module.main() == 0, ros.said


def test_whether_a_person_can_begin_is_said_for_launch_files(capsys):
    check = script("check_person")
    assert check.main(["normal", "drawn", "", "wait", "", "recorded"]) == 0
    assert capsys.readouterr() == ("usable", "")
    assert check.main(["silly", "angel", "", "stay", "", "recorded"]) == 1
    out, said = capsys.readouterr()
    assert out == "" and len(said.splitlines()) == 3
    assert "the virtual person cannot begin: behaviour:=silly: there is no 'silly'; there are: normal" in said
    assert "recorded_person:=stay" in said and "profile:=angel" in said
    assert check.main(["normal"]) == 2 and "check_person.py BEHAVIOUR" in capsys.readouterr().err
    assert check.main(["normal", "drawn", "/nope.csv", "wait", "", "recorded"]) == 1
    assert "recording:=/nope.csv: /nope.csv: no such file" in capsys.readouterr().err
    assert check.main(["normal", "drawn", "/nope.csv", "stay", "", "recorded"]) == 1
    assert "no such file" not in capsys.readouterr().err, "with a way that there is not it is not even opened"


def test_whether_the_physics_can_be_loaded_is_said_for_launch_files(capsys):
    check = script("check_physics")
    assert check.main() == 0 and capsys.readouterr() == ("usable", "") and check.complaint() == ""
    assert Scene().object_mass == 0.31
