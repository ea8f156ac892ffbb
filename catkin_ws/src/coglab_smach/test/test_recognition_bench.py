"""The bench of recognition in whole trials: its computations on motions with known answers, and all rows of two
trials."""

import sys

import numpy as np
import pytest
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import bench_recognition
import campaign
import partner_rows
import recognition_trials as trials
from coglab_sim.conditions import Conditions
from synthetic_reaches import ENDS, START, pattern_of

RATE = 200
FAMILY = {"centre": "reach_human", "right": "reach_human", "high": "reach_human_high"}
CENTRE = np.array(ENDS["centre"]) - START


def seen():
    """Rest for 2 s, a reach along the pattern 'centre' for 1 s, 1 s at the handover, 1 s back, 1 s of rest."""
    n = 6 * RATE
    names = ["rest"] * 2 + ["reach", "", "back", "rest"]
    part = {
        "time": 10.0 + np.arange(n) / RATE,
        "about": np.repeat(names, RATE),
        "place": np.zeros((n, 3)),
        "speed": np.zeros(n),
        "grip": np.ones(n),
        "best": np.array(["unknown"] * n, dtype="U8"),
        "decided": np.array([""] * n, dtype="U8"),
        "offer": np.zeros(n),
        "request": np.zeros(n),
    }
    part["place"][400:600] = np.linspace(0.0, 1.0, 200)[:, None] * CENTRE
    part["place"][600:800] = CENTRE
    part["speed"][420:600], part["speed"][810:1000] = 0.5, 0.5  # the onsets are 0.10 s and 0.05 s after the beginnings
    return part


def motions(part, orders=()):
    return trials.motions_of(part, orders, FAMILY, 0.9)


def test_the_true_pattern_is_the_nearest_or_none():
    for name, end in ENDS.items():
        assert pattern_of(np.array(end) - START) == name
    assert pattern_of(np.array([0.35, 0.10, 0.05])) == "" and pattern_of(np.zeros(3)) == ""
    deviation = np.hypot(0.02, 0.03)
    assert pattern_of(CENTRE + [3.3 * deviation, 0.0, 0.0]) == "centre"
    assert pattern_of(CENTRE + [3.5 * deviation, 0.0, 0.0]) == ""


def test_a_pattern_that_is_rightly_decided():
    part = seen()
    part["decided"][500:], part["best"][490:] = "centre", "centre"
    reach, back = motions(part)
    assert (reach["about"], reach["truth"], back["about"], back["truth"]) == ("reach", "centre", "back", "")
    assert reach["duration"] == pytest.approx(0.895) and reach["after"] == pytest.approx(0.4)
    assert reach["decided"] == ["centre"] and reach["right_at"] == {"40%": True, "100%": True}
    assert bench_recognition.right(reach) and not bench_recognition.wrong(reach)
    assert back["decided"] == [] and bench_recognition.right(back), "what is left of the reach is no decision"
    part["best"][490:495] = "unknown"
    assert motions(part)[0]["right_at"]["40%"] is False


def test_one_wrong_decision_is_enough():
    part = seen()
    part["decided"][500:560], part["decided"][560:610] = "right", "centre"
    reach, _ = motions(part)
    assert reach["decided"] == ["right", "centre"]
    assert bench_recognition.wrong(reach) and not bench_recognition.right(reach)
    part = seen()
    assert not bench_recognition.right(motions(part)[0]), "nothing was decided"
    part["decided"][380:430] = "high"
    assert bench_recognition.wrong(motions(part)[0]), "what is left from before counts in a reach"
    part = seen()
    part["decided"][658:665] = "high"
    assert bench_recognition.wrong(motions(part)[0]), "the last sights come later"
    part["decided"][:] = ""
    part["decided"][662:670] = "high"
    assert not motions(part)[0]["decided"], "0.3 s after its end it is over"
    part["decided"][820:830] = "left"
    assert bench_recognition.wrong(motions(part)[1]), "a way back has no pattern"


def test_a_reach_of_an_unknown_pattern():
    part = seen()
    part["place"] *= 0.5
    assert motions(part)[0]["truth"] == "" and bench_recognition.right(motions(part)[0])
    part["decided"][590:] = "centre"
    assert bench_recognition.wrong(motions(part)[0])


def test_belief_is_timed_from_the_onset():
    part = seen()
    part["offer"][460:700] = 0.9
    reach, back = motions(part)
    assert reach["holds"] and reach["believed"] == pytest.approx(0.2) and reach["crossed"] and not reach["other_kind"]
    assert back["believed"] is None and not back["crossed"]
    assert trials.rests_of(part, 0.9) == [False]
    part["grip"][:] = 0.0
    reach, _ = motions(part)
    assert not reach["holds"] and reach["believed"] is None and reach["other_kind"]
    part["request"][470:] = 0.95
    assert motions(part)[0]["believed"] == pytest.approx(0.25)


def test_belief_in_a_rest_before_a_reach():
    part = seen()
    part["offer"][399] = 0.9
    assert trials.rests_of(part, 0.9) == [True]
    part["offer"][:] = 0.0
    part["request"][:59] = 0.9
    assert trials.rests_of(part, 0.9) == [False], "what is left of the motion before"
    part["offer"][1100:] = 0.9
    assert trials.rests_of(part, 0.9) == [False], "no motion came after that rest"


def test_switches_belong_to_the_motion_before():
    part = seen()
    told = lambda *orders: motions(part, orders)[0]  # noqa: E731
    began = (12.2, "execute_dmp", "reach_human_high")
    assert told()["needed"] is False
    assert told(began)["needed"] and told(began)["missing"]
    found = told(began, (12.6, "switch_dmp", "reach_human"))
    assert (found["switched"], found["switched_wrong"], found["missing"]) == (1, 0, False)
    found = told((12.2, "execute_dmp", "reach_human"), (13.99, "switch_dmp", "reach_human_high"))
    assert (found["switched"], found["switched_wrong"], found["needed"]) == (1, 1, False)
    found = motions(part, [(14.5, "switch_dmp", "reach_human")])
    assert found[0]["switched"] == 0 and found[1]["switched_wrong"] == 1, "there is nothing to switch to on a way back"
    assert told((12.2, "execute_dmp", "give"))["needed"] is False, "another family"


def test_the_trials_are_those_that_are_defined():
    jobs = bench_recognition.jobs_of("HEAD")
    assert len({job.seed for job in jobs}) == len(jobs) == bench_recognition.PEOPLE + bench_recognition.OTHERS
    assert [job.arguments["hub"] for job in jobs if "hub" in job.arguments][:3] == [True, True, False]


def test_two_trials_make_all_rows(monkeypatch):
    monkeypatch.setattr(campaign, "FILE", None)
    whole, other = {"conditions": Conditions()}, {"number": 2, "hub": False}
    jobs = [
        campaign.Job("recognition, people", campaign.EXCHANGES, 6001, whole, trials.people),
        campaign.Job("recognition, others", campaign.EXCHANGES[:1], 6003, whole | other, trials.others),
    ]
    rows = bench_recognition.rows_of("HEAD", jobs)
    assert {row["bench"] for row in rows} == {"recognition"} and all(np.isfinite(row["value"]) for row in rows)
    assert {row["goal"] for row in rows} - {""} == {"<= 0.01", ">= 0.95", "<= 0.25", "<= 0.05"}
    names = [row["figure"] for row in rows]
    assert len(set(names)) == len(names) and all(name.startswith("whole trials: ") for name in names)
    assert any("of 2 reaches" in name for name in names) and any("of 1 motions of something else" in n for n in names)
    assert any("believed before there was a motion, of 3 rests" in name for name in names)
    shown = {row["figure"]: row["value"] for row in rows}
    carried_out = "whole trials: motions of something else that were not carried out, the robot had no object"
    assert shown[carried_out] == 0.0
    delays = [row["value"] for row in rows if "onset to belief, median" in row["figure"]]
    assert all(0.0 < value < 1.0 or value == partner_rows.NEVER for value in delays)
