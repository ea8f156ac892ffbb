"""A recording drives the person's hand, with the object in it, through a whole handover."""

import numpy as np
import pytest
import smach
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.person.recorded_motion import RecordingError
from coglab_trials.conditions import CONSIDERATE
from coglab_trials.trial import VirtualTrial
from coglab_trials.world import World

RECEIVE = "exchange_human_to_robot"
FRAMES = ("human_hand", "object_mug")


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


@pytest.fixture(scope="module")
def handover():
    """Rows (t, pose of hand, pose of object) at 50 Hz of a simulated person who gives; from the reach on."""
    smach.set_loggers(*[lambda *a: None] * 4)
    trial, rows = VirtualTrial(seed=3, conditions=CONSIDERATE), []

    def beside(t):
        if t.rig.human.phase not in ("idle", "reacting") and t.rig.ticks % 4 == 0:
            truth = t.rig.cell.truth()
            rows.append((t.rig.t, pose_of_truth(truth["human_hand"]), pose_of_truth(truth["object"])))

    trial.beside = beside
    assert trial.run(RECEIVE)[0].outcome == "succeeded"
    return rows


def write_csv(path, rows, frames=FRAMES):
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("t,x,y,z,qx,qy,qz,qw,frame\n")
        for t, *poses in rows:
            for name, pose in zip(FRAMES, poses, strict=True):
                if name in frames:
                    numbers = ",".join(repr(float(v)) for v in (t, *pose.position, *pose.orientation))
                    stream.write(f"{numbers},{name}\n")
    return str(path)


def write_npz(path, rows):
    arrays = {}
    for i, name in enumerate(FRAMES):
        arrays[f"{name}.t"] = np.array([row[0] for row in rows])
        arrays[f"{name}.position"] = np.array([row[1 + i].position for row in rows])
        arrays[f"{name}.orientation"] = np.array([row[1 + i].orientation for row in rows])
    np.savez(path, **arrays)
    return str(path)


def write_bag(path, rows):
    import rosbag
    import rospy
    from geometry_msgs.msg import Point, TransformStamped
    from tf2_msgs.msg import TFMessage

    with rosbag.Bag(str(path), "w") as bag:
        for t, *poses in rows:
            message = TFMessage()
            for name, pose in zip(FRAMES, poses, strict=True):
                item = TransformStamped(child_frame_id=name)
                item.header.frame_id, item.header.stamp = "world", rospy.Time.from_sec(t)
                at, turn = item.transform.translation, item.transform.rotation
                at.x, at.y, at.z = Point(*pose.position).x, pose.position[1], pose.position[2]
                turn.x, turn.y, turn.z, turn.w = pose.orientation
                message.transforms.append(item)
            bag.write("/tf", message, rospy.Time.from_sec(t))
    return str(path)


WRITERS = {"csv": write_csv, "npz": write_npz, "bag": write_bag}


def play(file, person, timing="natural", **more):
    """Outcome of a handover with the recorded hand, the trial, and the distance (m) of its hand from the recorded one
    during the reach, largest, as long as it alone holds the object."""
    recording = {"file": file, "person": person, **more}
    trial, off = VirtualTrial(seed=8, conditions=CONSIDERATE, recording=recording, timing=timing), [0.0]

    def beside(t):
        human, truth = t.rig.human, t.rig.cell.truth()
        # From the robot's grip on, the arm lifts the object and the hand with it.
        if human.phase == "reaching" and truth["held_by"] == "human":
            begun = t.rig.t - human._since
            shown = pose_of_truth(truth["human_hand"]).position
            off.append(float(np.linalg.norm(shown - human.recorded.at(begun).position)))

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    return result, trial, max(off)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_recorded_person_who_waits_hands_over(tmp_path, handover, kind):
    result, trial, off = play(WRITERS[kind](tmp_path / f"handover.{kind}", handover), "wait")
    assert result.outcome == "succeeded", result.reason
    truth = trial.rig.cell.truth()
    assert truth["held_by"] == "robot" and not truth["dropped"]
    assert 0.0 < off < 0.02, "the plant's hand follows the recorded one"


@pytest.mark.parametrize("person", ["no_wait", "leave"])
def test_a_recorded_person_goes_on_or_leaves_at_the_recorded_time(tmp_path, handover, person):
    """What comes of it is control's matter: printed by the bench. Here: the hand went as recorded, and it ended."""
    file = write_csv(tmp_path / "handover.csv", handover)
    result, trial, off = play(file, person)
    assert off < 0.02 and trial.rig.robot.limit_violations == 0
    assert result.outcome in ("succeeded", "failed_empty") and (result.outcome == "succeeded" or result.reason)
    human = trial.rig.human
    assert human.phase in ("idle", "retreating", "holding", "releasing")
    if person == "leave":
        assert np.linalg.norm(human._hand - human.recorded.at(human.recorded.end).position) < 0.02


@pytest.mark.parametrize("person, outcome", [("leave", "failed_empty"), ("no_wait", "succeeded")])
def test_who_leaves_early_takes_the_object_along(tmp_path, handover, person, outcome):
    """The same handover without its waiting, so fast that a calm robot comes too late: two seconds in all."""
    begin, end = handover[0][0], handover[-1][0]
    reach = [row for row in handover if row[0] < begin + 1.6]
    back = [(row[0] - end + begin + 3.0, *row[1:]) for row in handover if row[0] > end - 1.4]
    back = [(t, hand, hand * (handover[0][1].inverse() * handover[0][2])) for t, hand, _ in back]
    result, trial, _ = play(write_csv(tmp_path / "early.csv", reach + back), person, timing="calm")
    assert result.outcome == outcome, result.reason
    truth = trial.rig.cell.truth()
    assert truth["held_by"] == ("human" if person == "leave" else "robot") and not truth["dropped"]


def test_a_hand_without_its_object_is_refused_or_gets_one(tmp_path, handover):
    alone = write_csv(tmp_path / "hand.csv", handover, frames=("human_hand",))
    with pytest.raises(RecordingError, match="a handover needs the frame 'object_mug', the recording has human_hand"):
        World(1, CONSIDERATE, recording={"file": alone})
    result, _, _ = play(alone, "wait", object="in_hand")
    assert result.outcome == "succeeded", result.reason


def changed(rows, change):
    return [(t, *change(hand, thing)) for t, hand, thing in rows]


def test_recordings_that_cannot_be_used_say_why(tmp_path, handover):
    no_hand = write_csv(tmp_path / "object.csv", handover, frames=("object_mug",))
    still = write_csv(tmp_path / "still.csv", changed(handover, lambda h, o: (handover[0][1], handover[0][2])))
    apart = write_csv(
        tmp_path / "apart.csv", changed(handover, lambda h, o: (h, type(o)(o.position + [0, 0.5, 0], o.orientation)))
    )
    faults = [
        ({"file": no_hand}, "needs the frame 'human_hand'"),
        ({"file": still}, "moves 0.000 m, a reach is at least 0.1 m long"),
        ({"file": apart}, "begins 0.5. m from the hand, at most 0.3 m are accepted"),
        ({"file": str(tmp_path / "none.csv")}, "no such file"),
        ({"file": no_hand, "person": "runs"}, "person must be wait, no_wait, leave, got 'runs'"),
        ({"file": no_hand, "object": "gone"}, "object must be recorded or in_hand"),
        ({"file": no_hand, "pace": 2}, "unknown fields pace"),
    ]
    for recording, words in faults:
        with pytest.raises(RecordingError, match=words):
            World(1, CONSIDERATE, recording=recording)
