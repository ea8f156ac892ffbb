"""Figures of recorded reaches against motions with known answers: none is left out, whatever it came to."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import bench_trials
from campaign import Campaign
from coglab_sim.person.reach import min_jerk
from reach_figures import figures, human_time

RECEIVE = "exchange_human_to_robot"
WAY, DURATION, RATE = 0.45, 1.5, 200.0


def record(share=1.0, **ended):
    """A minimum-jerk reach over WAY m, of which ``share`` of the time was made; how it ``ended``."""
    times = np.arange(0.0, share * DURATION + 0.5 / RATE, 1.0 / RATE)
    palm = [np.array([WAY * min_jerk(min(1.0, t / DURATION))[0], 0.0, 0.0]) for t in times]
    off = (float(WAY - palm[-1][0]), 0.01)
    reach = SimpleNamespace(begin=0.0, reached=None, over=None, stood=False, met=False, to_goal=off, to_sight=off)
    reach.to_truth, reach.path = off, [(t, p, np.array([WAY, 0.0, 0.0])) for t, p in zip(times, palm, strict=True)]
    vars(reach).update(ended)
    return reach


def test_a_reach_that_stands_has_arrived_when_it_stays_within_five_millimetres():
    found = figures(record(stood=True, reached=DURATION, over=2.0, met=True))
    times = np.arange(0.0, DURATION, 1.0 / RATE)
    away = [WAY * (1.0 - min_jerk(t / DURATION)[0]) for t in times]
    last = max(t for t, distance in zip(times, away, strict=True) if distance > 0.005)
    assert found["late"] == pytest.approx(last - human_time(WAY), abs=1.5 / RATE)
    assert found["reached_late"] == pytest.approx(DURATION - human_time(WAY))
    assert found["truth_mm"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("off", [0.006, 0.012, 0.1])
def test_one_that_stands_beside_its_goal_is_never_there(off):
    reach = record(stood=True, reached=DURATION, over=2.0, met=True)
    reach.path = [(t, p, g + [0.0, off, 0.0]) for t, p, g in reach.path]
    found = figures(reach)
    assert "late" not in found and found["reached_late"] == pytest.approx(DURATION - human_time(WAY))
    median = rows_of(reach)["arm within 5 mm of its goal later than a person, median"]
    assert median["value"] == bench_trials.NEVER and not median["ok"]


def test_what_the_palm_does_after_its_arrival_is_no_part_of_the_way():
    reach = record(stood=True, reached=DURATION, over=2.0, met=True)
    expected = figures(reach)["late"]
    reach.path += [(DURATION + 0.1 * k, np.array([0.1, 0.0, 0.0]), np.array([WAY, 0.0, 0.0])) for k in range(1, 5)]
    assert figures(reach)["late"] == pytest.approx(expected, abs=1e-6)


def test_one_that_is_met_far_from_its_goal_has_been_met_and_has_not_arrived():
    found = figures(record(0.6, met=True, over=0.6 * DURATION + 1e-9))
    way = WAY - found["truth_mm"] / 1000.0
    assert found["met_late"] == found["reached_late"] == pytest.approx(0.6 * DURATION - human_time(way))
    assert "late" not in found and found["truth_mm"] > 50.0 and found["sparc"] < 0.0
    rows = rows_of(record(0.6, met=True, over=0.6 * DURATION + 1e-9))
    assert not rows["arm within 5 mm of its goal later than a person, median"]["ok"]
    assert rows["arm there, or met on the way, later than a person, median"]["ok"]


def test_one_that_is_met_beside_its_goal_has_arrived():
    found = figures(record(met=True, over=DURATION + 1e-9))
    assert found["late"] < found["met_late"] == pytest.approx(DURATION - human_time(WAY))


def test_an_unfinished_one_is_never_there_and_stays_in_the_distances():
    found = figures(record(0.5, over=0.5 * DURATION))
    assert "late" not in found and found["truth_mm"] > 100.0 and found["sparc"] < 0.0


def rows_of(*reaches, without=0):
    campaign = Campaign()
    campaign.without_reach[RECEIVE] = without
    campaign.reaches[RECEIVE] = [figures(reach) for reach in reaches]
    rows = bench_trials.reach_rows(campaign, RECEIVE, "perfect perception")
    return {row["figure"].partition(": ")[2]: row for row in rows if row["unit"] != "deg"}


def test_unfinished_reaches_are_in_every_percentile():
    good = record(stood=True, reached=DURATION, over=2.0, met=True)
    rows = rows_of(*[good] * 3)
    assert rows["hand to the true grasp pose, p95"]["ok"] and rows["reaches unfinished"]["value"] == 0
    rows = rows_of(good, good, good, record(0.5, over=0.5 * DURATION), record(0.5, over=0.5 * DURATION))
    assert rows["reaches unfinished"]["value"] == 2
    assert not rows["hand to the true grasp pose, p95"]["ok"] and not rows["hand to the latched goal, p95"]["ok"]
    assert rows["arm within 5 mm of its goal later than a person, p95"]["value"] == bench_trials.NEVER
    rows = rows_of(good, record(0.5, over=0.5 * DURATION), record(0.5, over=0.5 * DURATION))
    median = rows["arm within 5 mm of its goal later than a person, median"]
    assert median["value"] == bench_trials.NEVER and not median["ok"]


def test_a_trial_in_which_no_reach_began_is_never_there_and_in_every_percentile():
    good = record(stood=True, reached=DURATION, over=2.0, met=True)
    rows = rows_of(*[good] * 3, without=2)
    assert rows["trials in which no reach began"]["value"] == 2
    assert rows["reaches with a latched goal at their end"]["value"] == 3
    missed = [name for name, row in rows.items() if row["goal"] and not row["ok"] and "SPARC" not in name]
    assert {"reaches with a latched goal at their end", "hand to the latched goal, p95"} <= set(missed)
    assert rows["hand to the true grasp pose, p95"]["value"] == bench_trials.NEVER
    assert rows["arm within 5 mm of its goal later than a person, p95"]["value"] == bench_trials.NEVER


def test_trials_without_a_reach_are_counted():
    trial = {
        "reaches": [(RECEIVE, {"stood": True, "met": True})],
        "touches": [{}],
        "stuck": "",
        "outcomes": [],
        "begun": 1,
    }
    fields = (
        "fastest",
        "outside_commanded",
        "outside_measured",
        "over_command",
        "moving",
        "virtual",
        "processor",
        "fell",
    )
    trial |= dict.fromkeys(fields, 0)
    campaign = Campaign()
    for reaches in (trial["reaches"], []):
        campaign._count(bench_trials.EXCHANGES, trial | {"reaches": reaches, "touches": [{}] * len(reaches)}, "normal")
    assert campaign.without_reach == {RECEIVE: 1, bench_trials.EXCHANGES[1]: 2}


def test_misbehaving_people_are_seen_by_the_noisy_tracker(monkeypatch):
    seen = []

    class Nothing(Campaign):
        def run_each(self, actions, trials, name):
            seen.extend((actions, name, kw) for _, kw in trials)
            self.ends = {action: [] for action in actions}
            return self

    monkeypatch.setattr(bench_trials, "Campaign", Nothing)
    bench_trials.misbehaviour_rows("one")
    assert len(seen) == len(bench_trials.OUTCOMES) * bench_trials.MISBEHAVED
    for actions, name, kw in seen:
        assert kw["conditions"].perception == bench_trials.NOISY.perception and "perfect" not in kw
        assert name == (kw["later_behaviour"] if len(actions) == 2 else kw["conditions"].behaviour)


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_rows_without_a_reach_that_is_long_enough_are_missed_and_not_dropped(share):
    """As many rows as of a good reach; of the short ones smoothness and arrival are missed."""
    good = rows_of(record(stood=True, reached=DURATION, over=2.0, met=True))
    rows = rows_of(record(share, over=share * DURATION))
    assert {name for name in rows if "standing" not in name and "never stood" not in name} == {
        name for name in good if "standing" not in name and "never stood" not in name
    }
    short = share < 0.1
    assert (rows["SPARC, median"]["value"] is None) is short
    assert not (short and rows["SPARC, median"]["ok"])
    assert not rows["arm within 5 mm of its goal later than a person, median"]["ok"]
    received = rows["hand to the pose as received, p95"]
    assert received["goal"] == "<= 5" and not received["ok"]


@pytest.mark.parametrize("perception", ["noisy perception", "perfect perception"])
@pytest.mark.parametrize("action", bench_trials.EXCHANGES)
def test_the_pose_as_received_is_judged_whatever_was_latched(action, perception):
    """Asked for were 5 mm and 3 deg to the goal as received; the latched one is the controller's own estimate."""
    campaign = Campaign()
    ended = dict(stood=True, reached=DURATION, over=2.0, met=True)
    for off, fine in (((0.004, 0.05), True), ((0.006, 0.06), False)):
        campaign.reaches[action] = [figures(record(**ended, to_goal=(0.0, 0.0), to_sight=off))] * 20
        rows = [row for row in bench_trials.reach_rows(campaign, action, perception) if "as received" in row["figure"]]
        assert [(row["unit"], row["goal"], row["ok"]) for row in rows] == [("mm", "<= 5", fine), ("deg", "<= 3", fine)]


def test_a_reach_without_a_sight_is_counted_and_missed():
    good = record(stood=True, reached=DURATION, over=2.0, met=True)
    assert rows_of(good, good)["reaches with a sight at their end"]["ok"]
    row = rows_of(good, record(stood=True, reached=DURATION, over=2.0, met=True, to_sight=None))
    assert not row["reaches with a sight at their end"]["ok"]


def test_who_holds_the_object_in_the_end_has_a_share_each():
    campaign = Campaign()
    campaign.ends[RECEIVE], campaign.trials = [("failed_empty", "human")] * 3 + [("failed_empty", "")], 4
    rows = bench_trials.holder_rows(campaign, RECEIVE, "pull_back")
    assert [(row["figure"].split(": ")[1].split()[0], row["value"]) for row in rows] == [
        ("human", 0.75), ("nobody", 0.25), ("robot", 0.0)]  # fmt: skip
    assert not any(row["goal"] for row in rows)


def test_the_people_of_the_trials_are_those_of_the_commit(monkeypatch):
    seen = {}

    class Nothing(Campaign):
        def run_each(self, actions, trials, name):
            seen.setdefault(commit, []).append([seed for seed, _ in trials])
            self.ends = {action: [] for action in actions}
            self.processor = self.virtual = 1.0
            return self

    monkeypatch.setattr(bench_trials, "Campaign", Nothing)
    monkeypatch.setattr(bench_trials, "seeds_of", lambda commit, name, n: [f"{commit} {name} {i}" for i in range(n)])
    for commit in ("one", "two"):
        bench_trials.people_rows(commit)
        bench_trials.misbehaviour_rows(commit)
        assert all(str(seed).startswith(commit) for seeds in seen[commit] for seed in seeds)
    noisy, board, perfect, *others = seen["one"]
    assert noisy == board and noisy != perfect and len(others) == len(bench_trials.OUTCOMES)
    assert len({seed for seeds in (noisy, perfect, *others) for seed in seeds}) == sum(
        map(len, (noisy, perfect, *others))
    )


def test_rows_of_fewer_trials_than_asked_say_so():
    (row,) = bench_trials.of_asked([bench_trials.row("share", 1.0, "share", ">= 0.97")], 12, 100)
    assert (row["done"], row["asked"], row["ok"]) == (12, 100, True)


def test_without_any_reach_every_row_with_a_goal_is_missed():
    rows = rows_of()
    assert rows["hand to the latched goal, p95"]["value"] is None
    assert not [name for name, row in rows.items() if row["goal"] and row["ok"]]


def documented(outcome, *ends):
    campaign = Campaign()
    campaign.ends[RECEIVE], campaign.trials = list(ends), len(ends)
    return bench_trials.documented_rows(campaign, RECEIVE, "pull_back", outcome)


def test_a_case_that_did_not_occur_has_no_value_and_is_not_judged():
    held, empty = documented(bench_trials.BY_HOLDER, *[("succeeded", "robot")] * 2)
    assert (held["value"], held["goal"], held["ok"]) == (1.0, ">= 1", True)
    assert (empty["value"], empty["goal"], empty["ok"]) == (None, "", True)
    assert "did not occur in 2 trials" in empty["figure"]


def test_where_no_trial_ended_the_outcome_is_missed():
    for outcome in (bench_trials.BY_HOLDER, "succeeded"):
        assert all(row["goal"] == ">= 1" and not row["ok"] for row in documented(outcome))


def test_one_wrong_end_misses_the_outcome():
    (row,) = documented("succeeded", ("succeeded", "robot"), ("failed_empty", "person"))
    assert (row["value"], row["ok"]) == (0.5, False)
