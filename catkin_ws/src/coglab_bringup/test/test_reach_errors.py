"""Distance and angle of the palm to the true grasp at the end of a reach, in trials with known errors."""

from __future__ import annotations

import numpy as np
import pytest
from coglab.series import Series
from coglab_bringup.reach_errors import GIVES, TAKES, reach_errors
from coglab_py.pose import Pose, about_z

GRASP = Pose(np.array([0.0, -0.04, 0.07]), about_z(0.3))
ENTRY = {
    "default_grasp": "top",
    "grasps": {
        "side": {"pose": GRASP.to_dict(), "approach": {"axis": [0.0, 1.0, 0.0], "distance": 0.025}},
        "top": {"pose": {"xyz": [0.0, 0.0, 0.5], "quaternion": [0.0, 0.0, 0.0, 1.0]}},
    },
    "default_delivery": "handle",
    "deliveries": {"handle": {"pose": {"xyz": [-0.1, 0.0, -0.05], "quaternion": [0.0, 0.0, 0.0, 1.0]}}},
}
OBJECT = Pose(np.array([0.8, 0.1, 0.4]), about_z(1.0))
HAND = Pose(np.array([0.9, -0.2, 0.5]), about_z(-0.5))
FAR = Pose(np.array([0.3, 0.0, 0.9]))


def off(goal: Pose, mm: float, degrees: float = 0.0) -> Pose:
    """A palm that misses `goal` by ``mm`` and ``degrees``."""
    return Pose(
        goal.position + np.array([0.0, 0.0, mm / 1000.0]), (goal * Pose(np.zeros(3), turn(degrees))).orientation
    )


def turn(degrees: float) -> np.ndarray:
    return about_z(np.radians(degrees))


def reach(kind: str, begun: float, left: float, states: list[tuple], outcome: str = "succeeded") -> Series:
    """A trial with one reach; `states` of its motion: (t, state)."""
    path = f"/coglab_master/{kind}/approach/arm_motion"
    trial = Series()
    reason = "grasp 'side'" if kind == TAKES else ""
    trial.transitions = [
        (begun - 0.2, f"/coglab_master/{kind}", "set_dmp_goal", "succeeded", "approach", reason, 0),
        (begun, path, "execute_dmp", "succeeded", "wait_stop", "", 0),
        (left, path, "wait_stop", outcome, outcome, "", 0),
    ]
    trial.feedback = [(t, state, 0.001) for t, state in states]  # the controller's own error is small
    return trial


def test_a_reach_met_by_the_object_is_measured_at_its_end_with_the_truth():
    trial = reach(TAKES, 2.0, 4.0, [(2.01, "running"), (3.99, "running"), (4.1, "aborted")])
    trial.poses = [
        (3.0, FAR, HAND, OBJECT),
        (3.99, off(OBJECT * GRASP, 12.0, 5.0), HAND, OBJECT),
        (4.01, FAR, HAND, OBJECT),
    ]
    row = reach_errors(trial, TAKES, ENTRY, 1.0, 8.0)
    assert row["final_error_mm"] == pytest.approx(12.0, abs=0.01)
    assert row["final_error_deg"] == pytest.approx(5.0, abs=0.01)
    assert row["reaches"] == [{"ended": "met", "error_mm": row["final_error_mm"], "error_deg": row["final_error_deg"]}]
    assert row["final_error_by"] == "truth of the simulated cell"


def test_reach_is_measured_on_arrival():
    trial = reach(TAKES, 2.0, 6.0, [(2.01, "running"), (4.0, "reached"), (4.2, "reached")])
    grasp = OBJECT * GRASP
    trial.poses = [(4.0, off(grasp, 30.0), HAND, OBJECT), (6.0, grasp, HAND, OBJECT)]
    row = reach_errors(trial, TAKES, ENTRY, 1.0, 8.0)
    assert row["final_error_mm"] == pytest.approx(30.0, abs=0.01) and row["reaches"][0]["ended"] == "reached"


@pytest.mark.parametrize("left", [5.0, 20.0])
def test_an_unfinished_reach_counts(left):
    """A failed reach, and one that still runs at the end of the trial."""
    trial = reach(TAKES, 2.0, left, [(2.01, "running"), (4.9, "running")], "failed")
    last = 4.99 if left == 5.0 else 4.5  # a running reach is measured with the last truth
    trial.poses = [(4.0, FAR, HAND, OBJECT), (last, off(OBJECT * GRASP, 250.0), HAND, OBJECT)]
    row = reach_errors(trial, TAKES, ENTRY, 1.0, 5.0)
    assert row["final_error_mm"] == pytest.approx(250.0, abs=0.01) and row["reaches"][0]["ended"] == "unfinished"


def test_giving_is_measured_at_the_true_hand_with_the_grasp_of_the_object():
    trial = reach(TAKES, 2.0, 3.0, [(2.01, "running")])
    giving = reach(GIVES, 12.0, 15.0, [(12.01, "running"), (13.0, "aborted"), (14.9, "aborted")])
    trial.transitions += giving.transitions
    trial.feedback += giving.feedback
    goal = HAND * Pose.from_dict(ENTRY["deliveries"]["handle"]["pose"]) * GRASP
    # The arm stands from 13.0 s on, and the person moves on.
    trial.poses = [(13.0, off(goal, 20.0, 3.0), HAND, FAR), (15.0, goal, HAND, FAR)]
    row = reach_errors(trial, GIVES, ENTRY, 11.0, 18.0)
    assert row["final_error_mm"] == pytest.approx(20.0, abs=0.01)
    assert row["final_error_deg"] == pytest.approx(3.0, abs=0.01)
    assert len(row["reaches"]) == 1 and row["reaches"][0]["ended"] == "met"


def test_missing_measurements_are_null_with_a_reason():
    trial = reach(TAKES, 2.0, 4.0, [(2.01, "running"), (4.0, "reached")])
    real_robot = reach_errors(trial, TAKES, ENTRY, 1.0, 8.0)
    assert real_robot["final_error_mm"] is None and "real robot" in real_robot["final_error_by"]
    assert real_robot["reaches"] == [{"ended": "reached", "error_mm": None, "error_deg": None}]
    trial.poses = [(4.0, OBJECT * GRASP, HAND, OBJECT)]
    assert "database" in reach_errors(trial, TAKES, None, 1.0, 8.0)["final_error_by"]
    assert "no reach" in reach_errors(trial, TAKES, ENTRY, 5.0, 8.0)["final_error_by"]
    trial.transitions[0] = (1.8, *trial.transitions[0][1:5], "", 0)  # the chosen grasp is unknown
    assert reach_errors(trial, TAKES, ENTRY, 1.0, 8.0)["final_error_by"].startswith("nobody")
    trial = reach("put", 2.0, 4.0, [(2.01, "running"), (4.0, "reached")])
    trial.poses = [(4.0, FAR, HAND, OBJECT)]
    assert reach_errors(trial, "put", ENTRY, 1.0, 8.0)["final_error_by"].startswith("nobody")
    trial = reach(TAKES, 2.0, 4.0, [])
    trial.poses = [(3.0, OBJECT * GRASP, HAND, OBJECT)]  # too old
    assert reach_errors(trial, TAKES, ENTRY, 1.0, 8.0)["final_error_mm"] is None
