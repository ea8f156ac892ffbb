"""The rows of ./coglab bench tracking: the arm as measured is judged by range, speed and acceleration, also after its
reach was aborted; and rows as shipped say that no feedback controller runs in them."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_tracking
import lockstep
from tracking import Outcome

LIMITS = SimpleNamespace(
    lower_position=np.full(7, -1.0),
    upper_position=np.full(7, 1.0),
    velocity=np.full(7, 2.0),
    acceleration=np.full(7, 10.0),
)
REST = np.zeros(7)


def watch_of(outcome):
    """A watch on an arm that stands in the middle of its range."""
    robot = SimpleNamespace(cell=SimpleNamespace(position=REST, velocity=REST))
    robot.report = lambda: {"commanded_position": REST}
    return lockstep.Watch(robot, LIMITS, outcome)


def test_the_true_state_is_measured_against_range_speed_and_acceleration():
    outcome = lockstep.LockstepReach(True, "", 0.0, 0.0)
    watch = watch_of(outcome)
    third = np.eye(7)[2]
    watch.look_at_arm(-0.9 * third, 0.01 * third)
    assert outcome.arm_beyond == pytest.approx(-0.1)
    assert outcome.arm_acceleration == pytest.approx(0.01 / lockstep.PERIOD / 10.0)
    assert watch.look_at_arm(-1.02 * third, -0.09 * third) == pytest.approx(0.045)
    watch.look_at_arm(REST, -0.09 * third)
    assert outcome.arm_beyond == pytest.approx(0.02) and outcome.arm_over == pytest.approx(0.045)
    assert outcome.arm_acceleration == pytest.approx(0.1 / lockstep.PERIOD / 10.0), "the largest stays"


class Arm:
    """A robot whose motion ends in one tick as told, and whose arm is as fast as told in another one."""

    def __init__(self, ended: str, at: int, fast: int) -> None:
        self.ended, self.at, self.fast, self.ticks = ended, at, fast, 0
        self.cell = self

    now = property(lambda self: self.ticks * lockstep.PERIOD)
    position = property(lambda self: REST)
    velocity = property(lambda self: np.full(7, 3.0 if self.ticks == self.fast else 0.0))

    def tick(self) -> None:
        self.ticks += 1

    def set_frame(self, *_) -> None:
        """Perception, which sees the goal where it stays."""

    def ik_debug(self) -> list:
        return []

    def feedback_status(self) -> dict:
        return {"controllers": []}

    def report(self) -> dict:
        motion = self.ended if self.ticks >= self.at else "running"
        return {"commanded_position": REST, "motion": motion, "reason": "at its stop" if motion == "aborted" else ""}


def followed(arm: Arm) -> lockstep.LockstepReach:
    """What has been seen of its reach."""
    outcome = lockstep.LockstepReach(True, "", 0.0, 0.0)
    lockstep.follow(arm, REST[:3], REST[:4], LIMITS, outcome)
    return outcome


@pytest.mark.parametrize("ended", ["reached", "aborted", "running"])
def test_the_arm_is_watched_for_as_long_after_an_abort_as_after_a_reach(ended):
    end = 60 if ended != "running" else round(lockstep.REACH_LIMIT / lockstep.PERIOD)
    after = round(lockstep.WATCHED / lockstep.PERIOD)
    arm = Arm(ended, 60, end + after - 6)
    outcome = followed(arm)
    assert arm.ticks == pytest.approx(end + after, abs=12)
    assert outcome.arm_over == pytest.approx(1.5) and outcome.arm_acceleration > 1.0
    why = {"reached": "", "aborted": "at its stop", "running": "the motion waits at a border of the workspace"}
    assert outcome.why == why[ended]


def test_a_reach_that_is_given_up_after_its_end_is_watched_from_then_on():
    arm = Arm("aborted", 60, 0)
    ended = arm.report
    arm.report = lambda: ended() | ({"motion": "reached"} if 30 <= arm.ticks < 60 else {})
    outcome = followed(arm)
    assert outcome.why == "at its stop"
    assert arm.ticks == pytest.approx(60 + round(lockstep.WATCHED / lockstep.PERIOD), abs=12)


def shipped(monkeypatch, running: int, enabled: bool) -> list[dict]:
    """The rows of two reaches in which so many feedback controllers ran, in the second at least."""
    left = iter([lockstep.LockstepReach(True, "", 0.0, 0.0, feedback=count) for count in ((2, 2), (running, running))])
    monkeypatch.setattr(lockstep, "_virtual", object())
    monkeypatch.setattr(lockstep, "reach", lambda *_, **__: next(left))
    reaches = [SimpleNamespace(posture=REST, goal=REST, target=REST)] * 2
    return bench_tracking.shipped_rows(LIMITS, reaches, enabled)


def test_rows_as_shipped_say_how_many_feedback_controllers_ran_in_them(monkeypatch):
    rows = shipped(monkeypatch, 0, False)
    (row,) = [row for row in rows if "feedback controllers that ran" in row["figure"]]
    assert (row["value"], row["goal"]) == (2, "reported"), "the most of any reach"
    assert all("as shipped" in row["figure"] for row in rows)


def test_rows_with_feedback_enabled_are_reported_and_missed_where_it_did_not_run(monkeypatch):
    rows = shipped(monkeypatch, 2, True)
    (row,) = [row for row in rows if "feedback controllers that ran" in row["figure"]]
    assert (row["value"], row["goal"], row["ok"]) == (2, ">= 2", True)
    assert {row["goal"] for row in rows} == {"reported", ">= 2"}
    (row,) = [row for row in shipped(monkeypatch, 1, True) if "feedback controllers that ran" in row["figure"]]
    assert (row["value"], row["ok"]) == (1, False), "the fewest of any reach"


@pytest.mark.parametrize(
    "words, field, fine, beyond",
    [
        ("joint position of the arm as measured", "arm_beyond", -0.01, 0.001),
        ("joint speed of the arm as measured", "arm_over", 1.0, 1.01),
        ("joint acceleration of the arm as measured", "arm_acceleration", 1.0, 1.01),
    ],
)
def test_the_worst_of_all_reaches_that_began_is_judged(monkeypatch, words, field, fine, beyond):
    def ok(*values):
        outcomes = [lockstep.LockstepReach(True, why, 0.0, 0.0) for why in ("", "given up")]
        for outcome, value in zip(outcomes, values, strict=True):
            outcome.arm_beyond = -0.5
            setattr(outcome, field, value)
        left = iter(outcomes)
        monkeypatch.setattr(lockstep, "_virtual", object())
        monkeypatch.setattr(lockstep, "reach", lambda *_, **__: next(left))
        reaches = [SimpleNamespace(posture=REST, goal=REST, target=REST)] * len(outcomes)
        (row,) = [row for row in bench_tracking.shipped_rows(LIMITS, reaches) if words in row["figure"]]
        return row["ok"]

    assert ok(fine, fine) and not ok(fine, beyond) and not ok(beyond, fine)


def outcomes(*ends):
    """Reaches of an ideal arm: (largest distance from the path in mm, deg at the end, whether a joint was stopped)."""
    return [Outcome(0.001 * worst, 0.0, turned, 1.0, stopped, 1.2) for worst, turned, stopped in ends]


def test_beside_a_peer_the_rule_is_judged_where_no_joint_is_stopped():
    ours = outcomes((0.1, 0.0, False), (0.2, 9.0, False), (200.0, 9.0, True), (0.2, 0.0, False))
    theirs = outcomes((3.0, 0.0, False), (4.0, 0.0, False), (200.0, 0.0, True), (90.0, 0.0, True))
    rows = bench_tracking.priority_rows(ours, {"peer": {"": theirs}})
    free = {row["figure"].rpartition(": ")[2]: row for row in rows if "the 2 of 300 reaches" in row["figure"]}
    largest = free["distance from the path, largest"]
    assert (largest["value"], largest["peer_value"], largest["goal"], largest["ok"]) == (0.2, 4.0, "<= 1, < peer", True)
    assert free["distance from the path, 95th percentile"]["goal"] == "<= 0.3, < peer"
    turned = free["more than 3 deg from the goal's orientation at the end"]
    assert (turned["value"], turned["peer_value"]) == (0.5, 0.0)
    (missed,) = [row for words, row in free.items() if words.startswith("misses")]
    assert (missed["value"], missed["peer_value"]) == (1, 2)
    whole = [row for row in rows if ", 300 reaches: distance from the path, largest" in row["figure"]]
    assert [(row["value"], row["ok"]) for row in whole] == [(200.0, False)]


def test_each_row_has_the_peer_in_its_best_setting_by_the_rows_own_figure():
    ours = outcomes(*[(0.2, 1.0, False)] * 100)
    steady = outcomes(*[(0.25, 9.0, False)] * 100)
    sharp = outcomes(*[(0.1, 1.0, False)] * 60, *[(0.1, 9.0, False)] * 39, (7.0, 9.0, False))
    turned = outcomes(*[(30.0, 0.0, False)] * 99, (30.0, 0.0, True))
    rows = bench_tracking.priority_rows(ours, {"KDL": {"steady": steady, "sharp": sharp, "turned": turned}})
    best = {
        "a joint came to its stop": ("steady", 0, True),
        "misses (joint at its stop, 1 mm off the path, 3 deg at the end)": ("sharp", 40, True),
        "distance from the path, 95th percentile": ("sharp", 0.1, False),
        "distance from the path, largest": ("steady", 0.25, True),
        "more than 3 deg from the goal's orientation at the end": ("turned", 0.0, True),
    }
    for words, (setting, value, ok) in best.items():
        (row,) = [row for row in rows if row["figure"].endswith(f", 300 reaches: {words}")]
        assert row["peer"] == f"KDL, best setting by this row: {setting}", words
        assert row["peer_value"] == pytest.approx(value) and row["ok"] is ok, words


def test_a_bad_setting_of_a_peer_takes_no_reach_out_of_those_without_a_stop():
    ours = outcomes((0.1, 0.0, False), (0.2, 0.0, False))
    peer = {"good": outcomes((3.0, 0.0, False), (4.0, 0.0, True)), "bad": outcomes((9.0, 0.0, True), (9.0, 0.0, True))}
    rows = bench_tracking.priority_rows(ours, {"peer": peer})
    assert any("the 1 of 300 reaches in which no method comes to a stop" in row["figure"] for row in rows)


def test_a_peer_that_is_not_there_makes_its_rows_missed():
    rows = bench_tracking.priority_rows(outcomes((0.1, 0.0, False)), {"KDL wdls: PyKDL is not installed": None})
    assert len(rows) == 4 and all(row["value"] is None and not row["ok"] and row["goal"] for row in rows)
    stopped = outcomes((0.1, 0.0, True))
    rows = bench_tracking.priority_rows(stopped, {"peer": {"": stopped}})
    judged = [row for row in rows if "the 0 of 300" in row["figure"] and row["goal"] != "reported"]
    assert len(judged) == 2 and not any(row["ok"] for row in judged)


def test_the_list_with_feedback_is_the_shipped_one_but_for_the_profile_of_reaches(tmp_path):
    ours = yaml.safe_load(Path(yaml.safe_load(lockstep.with_feedback(tmp_path))["feedback_file"]).read_text())
    shipped = yaml.safe_load(Path(yaml.safe_load(lockstep.as_shipped())["feedback_file"]).read_text())
    assert shipped["profiles"]["dmp"] == [], "the docstring of the bench says so"
    assert (
        ours["profiles"]["dmp"] == shipped["loadControllers"] and len(shipped["loadControllers"]) == lockstep.listed()
    )
    for table in (ours, shipped):
        del table["profiles"]
    assert ours.pop("searchPath") and ours == shipped
