"""A whole handover in which a recording moves the person's hand with the object."""

import numpy as np
import pytest
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.person.recorded_motion import RecordingError
from coglab_trials import RECEIVE, VirtualTrial, World
from coglab_trials.conditions import CONSIDERATE

FRAMES = ("human_hand", "object_mug")


@pytest.fixture(scope="module")
def handover():
    """Rows (t, pose of hand, pose of object) at 50 Hz of a simulated giving person, from the reach on."""
    trial, rows = VirtualTrial(seed=3, conditions=CONSIDERATE), []

    def beside(t):
        if t.world.human.phase not in ("idle", "reacting") and t.world.ticks % 4 == 0:
            truth = t.world.cell.truth()
            rows.append((t.world.t, pose_of_truth(truth["human_hand"]), pose_of_truth(truth["object"])))

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


def play(file, person, timing="natural", **more):
    """Returns the outcome of a handover with the recorded hand, the trial, and the largest distance (m) of the hand
    from the recorded one while only that hand holds the object."""
    recording = {"file": file, "person": person, **more}
    trial, off = VirtualTrial(world=World(8, CONSIDERATE, recording=recording), settings={"timing": timing}), [0.0]
    begun: list[float] = []
    """s, begin of the recording"""

    def beside(t):
        human, truth = t.world.human, t.world.cell.truth()
        # From the robot's grip on, the arm lifts the object and the hand with it.
        if human.phase == "reaching" and truth["held_by"] == "human":
            begun[:] = begun or [t.world.t]
            shown = pose_of_truth(truth["human_hand"]).position
            off.append(float(np.linalg.norm(shown - human.recorded.at(t.world.t - begun[0]).position)))

    trial.beside = beside
    result = trial.run(RECEIVE)[0]
    return result, trial, max(off)


def test_a_recorded_person_who_waits_hands_over(tmp_path, handover):
    result, trial, off = play(write_csv(tmp_path / "handover.csv", handover), "wait")
    assert result.outcome == "succeeded", result.reason
    truth = trial.world.cell.truth()
    assert truth["held_by"] == "robot" and not truth["dropped"]
    assert 0.0 < off < 0.02, "the simulated hand follows the recorded one"


@pytest.mark.parametrize("person", ["no_wait", "leave"])
def test_a_recorded_person_continues_or_leaves_at_the_recorded_time(tmp_path, handover, person):
    """Checks only that the hand follows the recording and the action ends. The benchmark prints the outcome."""
    file = write_csv(tmp_path / "handover.csv", handover)
    result, trial, off = play(file, person)
    assert off < 0.02 and trial.world.robot.limit_violations == 0
    assert result.outcome in ("succeeded", "failed_empty") and (result.outcome == "succeeded" or result.reason)
    human = trial.world.human
    assert human.phase in ("idle", "retreating", "holding", "releasing")
    if person == "leave":
        hand = pose_of_truth(trial.world.cell.truth()["human_hand"]).position
        assert np.linalg.norm(hand - human.recorded.at(human.recorded.end).position) < 0.02


@pytest.mark.parametrize("person, outcome", [("leave", "failed_empty"), ("no_wait", "succeeded")])
def test_a_person_who_leaves_early_takes_the_object_along(tmp_path, handover, person, outcome):
    """The same handover without its wait, 2 s in total: too fast for a calm robot."""
    begin, end = handover[0][0], handover[-1][0]
    reach = [row for row in handover if row[0] < begin + 1.6]
    back = [(row[0] - end + begin + 3.0, *row[1:]) for row in handover if row[0] > end - 1.4]
    back = [(t, hand, hand * (handover[0][1].inverse() * handover[0][2])) for t, hand, _ in back]
    result, trial, _ = play(write_csv(tmp_path / "early.csv", reach + back), person, timing="calm")
    assert result.outcome == outcome, result.reason
    truth = trial.world.cell.truth()
    assert truth["held_by"] == ("human" if person == "leave" else "robot") and not truth["dropped"]


def test_a_hand_without_its_object_is_refused_or_gets_one(tmp_path, handover):
    alone = write_csv(tmp_path / "hand.csv", handover, frames=("human_hand",))
    with pytest.raises(RecordingError, match="'object_mug'.* human_hand"):
        World(1, CONSIDERATE, recording={"file": alone})
    result, _, _ = play(alone, "wait", object="in_hand")
    assert result.outcome == "succeeded", result.reason
