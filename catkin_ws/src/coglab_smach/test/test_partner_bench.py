"""The bench of the partner: its computations on motions with known answers, and its machinery on two trials."""

import sys

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_perception.recogniser import load_patterns
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import bench_partner
import campaign
import motion_figures as motion
import partner_motion_rows
import partner_rows
import partner_trials
import trial_file
import true_trace
from coglab_sim.conditions import HARDSHIPS, Conditions
from coglab_sim.person.reach import min_jerk
from coglab_smach.context.config import Config
from reach_figures import human_time

RATE = 200.0
RECEIVE, GIVE = campaign.EXCHANGES


def reach(way=0.4, duration=1.0):
    """(path (n, 3), speed (n)) of one minimum-jerk motion along x."""
    times = np.arange(0.0, duration, 1.0 / RATE)
    shares = np.array([min_jerk(t / duration) for t in times])
    return way * shares[:, :1] * [1.0, 0.0, 0.0], way * shares[:, 1] / duration


# --- one motion -------------------------------------------------------------------------------------------------------


def test_onset_is_where_the_speed_stays_up():
    speed = np.zeros(200)
    speed[20:30] = 0.5  # for 0.05 s alone
    speed[60:] = 0.021
    assert motion.onset(speed, RATE) == 60
    assert motion.onset(np.full(200, 0.02), RATE) is None and motion.onset(speed[:79], RATE) is None
    assert motion.rest(speed, RATE) == 0 and motion.rest(speed[20:], RATE) == 10
    assert motion.rest(speed[60:], RATE) is None


def test_wrong_way_is_the_farthest_behind_what_was_reached():
    path = np.array([0.0, -0.004, 0.1, 0.2, 0.193, 0.3])[:, None] * [0.6, 0.8, 0.0]
    assert motion.wrong_way(motion.along(path)) == pytest.approx(0.007)
    assert motion.wrong_way(motion.along(path)[:3]) == pytest.approx(0.004)
    assert motion.wrong_way(motion.along(reach()[0])) == 0.0
    assert not motion.along(np.ones((4, 3))).any(), "no line from a place to itself"


def test_a_half_circle_is_longer_than_its_chord():
    angle = np.linspace(0.0, np.pi, 500)
    assert motion.detour(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)) == pytest.approx(np.pi / 2, 1e-4)
    assert motion.detour(reach()[0]) == pytest.approx(1.0)
    assert motion.detour(np.zeros((3, 3))) == np.inf


def test_peaks_of_a_speed():
    _, one = reach()
    two = np.concatenate([one, 0.6 * one])
    turn = 2 * np.pi * np.arange(len(one)) / RATE
    assert motion.peaks(one, RATE) == 1 and motion.peaks(two, RATE) == 2
    assert motion.peaks(np.concatenate([one, 0.08 * one]), RATE) == 1, "a peak of 8 % does not stand out"
    assert motion.peaks(np.concatenate([one, 0.14 * one]), RATE) == 2
    assert motion.peaks(one + 0.15 * (1.0 - np.cos(4.0 * turn)), RATE) > 1
    assert motion.peaks(one + 0.15 * (1.0 - np.cos(40.0 * turn)), RATE) == 1, "40 Hz"
    assert motion.peaks(one[:120], RATE) == 1, "one that is stopped"


# --- what is made of a trace ------------------------------------------------------------------------------------------


def series(n, **columns):
    """A part of a trace, n periods in which nothing happens, but for these columns."""
    nothing = {
        "time": 10.0 + np.arange(n) / RATE,
        **{name: np.zeros((n, 3)) for name in ("palm", "velocity", "hand", "thing")},
        **{name: np.zeros(n) for name in ("reaching", "force", "pull", "share")},
        "grip": np.ones(n),
        "held_by": np.array(["human"] * n, dtype="U8"),
        "moving": np.zeros(n, dtype=bool),
    }
    return nothing | columns


def receiving():
    """The hand moves from 0.5 s to 1.5 s, the palm touches at 2.0 s and carries from 2.6 s; the grip opens at 3.0 s."""
    n = 800
    part = series(n, thing=np.tile([0.45, 0.0, 0.0], (n, 1)), hand=np.tile([0.55, 0.0, 0.0], (n, 1)))
    part["reaching"][100:300] = 0.4
    part["velocity"][180:380, 0] = 0.2
    part["force"][400:] = 3.0
    part["force"][410], part["force"][425] = 7.0, 30.0
    part["held_by"][500:600], part["held_by"][600:] = "both", "robot"
    part["share"][520:] = 0.6
    part["share"][510:515] = 0.6  # not for 0.1 s
    part["grip"][600:] = 0.0
    part["pull"][550], part["pull"][650] = 9.0, 20.0
    return part


def test_receiving_against_a_human_taker():
    part = receiving()
    found = true_trace.of_action(part, RECEIVE)
    assert (found["onset"], found["arm_onset"]) == pytest.approx((10.5, 10.9))
    assert found["held_by"] == "robot" and found["pull"] == 9.0, "what it weighs once it is the robot's is no pull"
    assert found["near_speed"] == 0.0, "0.55 m away"
    late = true_trace.of_receiving(part, found)
    assert late["touch_late"] == pytest.approx(12.0 - (10.5 + 0.2 + human_time(0.45)))
    assert late["carry"] == pytest.approx(0.6) and late["holding_on"] == pytest.approx(1.5)
    assert late["touch_force"] == 7.0 and late["touch_moving"] is False


def test_a_taker_does_not_touch_before_the_object_is_there():
    part = receiving()
    part["reaching"][100:390] = 0.4
    late = true_trace.of_receiving(part, true_trace.of_action(part, RECEIVE))
    assert late["touch_late"] == pytest.approx(0.05) and late["holding_on"] == pytest.approx(1.05)
    part["reaching"][100:450] = 0.4  # it is met on its way
    late = true_trace.of_receiving(part, true_trace.of_action(part, RECEIVE))
    assert late["touch_late"] == pytest.approx(0.0) and late["holding_on"] == pytest.approx(1.0)


def test_what_never_happens_is_none():
    part = series(400)
    found = true_trace.of_action(part, RECEIVE)
    assert found["onset"] is None and found["arm_onset"] is None
    assert set(true_trace.of_receiving(part, found).values()) == {None}
    part["reaching"][100:200] = 0.4
    late = true_trace.of_receiving(part, true_trace.of_action(part, RECEIVE))
    assert set(late.values()) == {None}


def test_speed_near_the_hand():
    part = series(100, hand=np.tile([0.2, 0.0, 0.0], (100, 1)))
    part["velocity"][10], part["velocity"][11], part["velocity"][12] = [0.3, 0.9, 0.0], [-0.8, 0.0, 0.0], [0.2, 0, 0]
    assert true_trace.of_action(part, GIVE)["near_speed"] == pytest.approx(0.3), "across and away do not count"
    assert true_trace.toward_of(part, "hand")[11] == pytest.approx(-0.8)


def test_a_chase_begins_once_something_has_happened():
    part = series(400, hand=np.tile([0.5, 0.0, 0.0], (400, 1)), thing=np.tile([0.0, 0.0, -0.5], (400, 1)))
    part["velocity"][50:150, 0], part["velocity"][150:250, 0] = 0.6, 0.4
    part["velocity"][260], part["velocity"][300] = [0.0, 0.0, -0.3], [-0.9, 0.0, 0.0]
    found = true_trace.after_event(part, 10.5, 10.9)  # indices 100 and 180, and 0.2 s later 140 and 220
    assert (found["chase_at_once"], found["chase"]) == pytest.approx((0.6, 0.4)) and found["moved_before"]
    assert true_trace.after_event(part, 10.5, 11.05)["chase"] == pytest.approx(0.3), "the object counts as the hand"
    assert true_trace.after_event(part, 10.2, None) == {
        "event": 10.2,
        "chase": 0.0,
        "chase_at_once": pytest.approx(0.6),
        "moved_before": False,
    }
    assert true_trace.after_event(part, None, None) == {}


def test_reaches_of_an_action():
    n = 700
    part = series(n)
    path, speed = reach()
    for begin in (100, 400):
        part["palm"][begin : begin + 200] = path
        part["velocity"][begin : begin + 200, 0] = speed
        part["moving"][begin : begin + 150] = True
    part["palm"][450:460, 0] -= 0.006
    part["force"][455:] = 2.0
    codes = [(10.0 + 330 / RATE, ReasonCode.GOAL_WITHDRAWN), (10.0 + 690 / RATE, ReasonCode.NO_CONTACT)]
    first, second = true_trace.reaches_of(part, RECEIVE, codes)
    assert first["code"] == ReasonCode.GOAL_WITHDRAWN and second["code"] == ReasonCode.NO_CONTACT
    assert first["wrong_mm"] < 1e-9 and first["peaks"] == 1 and first["detour"] == pytest.approx(1.0)
    assert first["straight"] > 0.39, "braking belongs to it"
    assert 0.0 < second["wrong_mm"] < 6.0 and second["moved"]
    part["velocity"][:] = 0.0
    still = true_trace.reaches_of(part, RECEIVE, [])[0]
    assert still["moved"] is False and still["detour"] is None and still["code"] == 0


# --- trials and rows --------------------------------------------------------------------------------------------------


def test_seeds_are_those_of_the_commit(monkeypatch):
    hashes = {"a": "1" * 40, "b": "2" * 40}
    monkeypatch.setattr(partner_rows, "whole_hash", hashes.get)
    seeds = partner_rows.seeds_of("a", "people", 100)
    assert seeds == partner_rows.seeds_of("a", "people", 100) and len(set(seeds)) == 100
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert not set(seeds) & set(partner_rows.seeds_of("b", "people", 100))
    assert not set(seeds) & set(partner_rows.seeds_of("a", "falls", 100))


def test_a_commit_has_a_hash_only_with_git(monkeypatch):
    assert trial_file.whole_hash("no such commit") == ""
    monkeypatch.setattr(trial_file, "SOURCES", trial_file.SOURCES / "nowhere")
    assert trial_file.whole_hash("HEAD") == ""


def test_every_hardship_is_there_alone_and_all_together():
    assert set(HARDSHIPS) < set(partner_rows.groups("HEAD"))
    every = partner_rows.hardened(partner_rows.ALL_TOGETHER, 3, "ball")
    assert every.object_id == "ball" and every.person == {"trust": 0.1, "tilt": 20.0} and every.mass == 1.3
    assert every.perception.calibration_offset == 0.010 and every.friction == pytest.approx(0.7)
    assert partner_rows.hardened("friction -30 %", 3, "mug") == Conditions(friction=0.7)


TRIAL = {"stuck": "", "begun": 2, "fell": False}


def tried(receive, give, held):
    """A trial of both directions with these outcomes, and who holds the object after each."""
    outcomes = [(kind, end, "why", code) for kind, (end, code) in zip((RECEIVE, GIVE), (receive, give), strict=True)]
    return TRIAL | {"outcomes": outcomes, "truth": [{"held_by": name, "reaches": []} for name in held]}


def test_a_success_that_the_truth_denies_is_none():
    job = campaign.Job("people, mug", campaign.EXCHANGES, 1, {"conditions": Conditions(person={"trust": 0.19})})
    good = ("succeeded", "NONE")
    ends = lambda *a: [each.end for each in partner_rows.directions(job, tried(*a))]  # noqa: E731
    assert ends(good, good, ("robot", "human")) == ["succeeded", "succeeded"]
    assert ends(good, good, ("both", "floor")) == ["claimed", "claimed"]
    assert ends(good, ("failed_holding", "NOT_RELEASED"), ("robot", "human")) == ["succeeded", "NOT_RELEASED"]
    assert all(each.eager for each in partner_rows.directions(job, tried(good, good, ("robot", "human"))))


def test_a_row_with_too_few_trials_is_missed():
    row = bench_partner.row
    jobs = [campaign.Job("people", (RECEIVE,), seed, {"conditions": Conditions()}) for seed in range(3)]
    group = partner_rows.Group(row, jobs, {job.key: TRIAL for job in jobs[:2]})
    got = group.row("share", 1.0, "share", ">= 0.9")
    assert not got["ok"] and got["figure"] == "share [incomplete: missed; 2 of 3 trials]"
    whole = partner_rows.Group(row, jobs, {job.key: TRIAL for job in jobs})
    assert whole.row("share", 0.9, "share", ">= 0.9")["ok"] and not whole.row("share", 0.89, "share", ">= 0.9")["ok"]
    never = whole.row("time", partner_rows.late([0.1, None, None], 50), "s", "<= 2")
    assert never["value"] == partner_rows.NEVER and not never["ok"]
    assert partner_rows.late([0.1, 0.2, None], 50) == 0.2 and partner_rows.late([], 50) == np.inf


def test_a_sample_meets_no_goal():
    """However good it is; what has no goal is shown and not judged."""
    job = campaign.Job("falls", (RECEIVE,), 1, {"conditions": Conditions()})
    group = partner_rows.Group(bench_partner.row, [job], {job.key: TRIAL}, partner_rows.asked_of("falls"))
    got = group.row("share", 1.0, "share", ">= 0.9")
    assert not got["ok"] and got["figure"] == "share [sample of 1 of 200 asked: missed]" and got["value"] == 1.0
    assert group.row("reaches", 3, "reaches")["ok"]
    counts = {name: partner_rows.asked_of(name) for name in partner_rows.groups("HEAD")}
    assert counts["people, mug"] == counts["bias 10 mm"] == counts["all together"] == counts["pulls"] == 100
    assert counts["withdrawals"] == counts["falls"] == counts["others"] == counts["others, hub"] == 200


def test_a_direction_without_an_onset_is_infinitely_late():
    """None is left out: who never began, a person who did not reach and an arm that did not start are each counted."""
    job = campaign.Job("people, mug", campaign.EXCHANGES, 1, {"conditions": Conditions()})
    both = [{"held_by": "robot", "reaches": [], "onset": o, "arm_onset": a} for o, a in ((1.0, 1.3), (None, 2.0))]
    one = [{"held_by": "robot", "reaches": [], "onset": 1.0, "arm_onset": None}]
    jobs = [job, campaign.Job("people, mug", campaign.EXCHANGES, 2, job.arguments)]
    found = [TRIAL | {"outcomes": [], "truth": truth} for truth in (both, one)]
    group = partner_rows.Group(bench_partner.row, jobs, {j.key: t for j, t in zip(jobs, found, strict=True)})
    shown = {row["figure"]: row for row in partner_motion_rows.onset_rows(group)}
    what = "onset of the person's reach to the onset of the arm"
    assert shown[f"{what}, median of 4"]["value"] == partner_rows.NEVER and not shown[f"{what}, median of 4"]["ok"]
    for why in ("the direction never began", "the person did not reach", "the arm did not start"):
        assert shown[f"{what}: infinitely late, {why}"]["value"] == 1.0
    assert partner_motion_rows.starts_late(group.directions[0]) == pytest.approx(0.3)


GOALS = """>= 0.95, >= 0.9, <= 0.01, <= 0, >= 0.75, <= 5, <= 1.08, >= -1.5, >= -1.65, <= 0.35, <= 0.05, <= 0.5, <= 1.2,
<= 2, <= 0.25, >= 1, <= 8, <= 15"""


def test_every_trial_is_watched_by_a_recogniser_of_its_own(monkeypatch):
    """As coglab.launch does by default, with the patterns and the monitor of the shipped files."""
    seen = []
    monkeypatch.setattr(partner_trials, "one_trial", lambda job, *a: seen.append(job.arguments))
    for jobs in partner_rows.groups("HEAD").values():
        job = jobs[0]
        job.runner(job)
        assert "recogniser" not in job.arguments, "a job is data, and may be run again"
    assert len(seen) == len(partner_rows.groups("HEAD"))
    recognisers = [arguments["recogniser"] for arguments in seen]
    assert len(set(map(id, recognisers))) == len(seen)
    shipped, _ = load_patterns(str(package_path("coglab_perception", "config", "patterns.json")))
    names = [pattern.name for pattern in shipped]
    assert all([pattern.name for pattern in each.patterns] == names for each in recognisers)
    assert not any(name.startswith("monitor") for arguments in seen for name in arguments)
    config = Config.load(str(package_path("coglab_smach", "config", "machines.yaml")), {})
    assert config.get("monitor.enabled") and set(config.get("monitor.primitives")) <= set(names)


def run_sample(monkeypatch):
    """One person with the mug and one with the ball, both directions, a withdrawal and a fall: the bench's rows by
    figure, and what each direction of each trial came to."""
    monkeypatch.setattr(campaign, "FILE", None)
    jobs = {name: [] for name in partner_rows.groups("HEAD")}

    def job(name, object_id, seed, runner, actions=(RECEIVE,)):
        return campaign.Job(name, actions, seed, {"conditions": Conditions(object_id=object_id)}, runner)

    for name, seed in (("mug", 21001), ("ball", 21002)):
        jobs[f"people, {name}"] = [job(f"people, {name}", name, seed, partner_rows.handover, campaign.EXCHANGES)]
    jobs["withdrawals"] = [job("withdrawals", "mug", 21003, partner_rows.withdrawal)]
    jobs["falls"] = [job("falls", "ball", 21004, partner_rows.fall)]
    trials = {}

    def kept(asked):
        trials.update(ran := partner_rows.run(asked))
        return ran

    monkeypatch.setattr(bench_partner, "run", kept)
    rows = bench_partner.rows_of(bench_partner.row, "HEAD", jobs)
    groups = {name: partner_rows.Group(bench_partner.row, part, trials) for name, part in jobs.items()}
    return rows, groups


def test_a_sample_is_true_and_makes_all_rows(monkeypatch):
    """What a person would see of it, by the cell's truth; the rows of so few trials meet no goal."""
    rows, groups = run_sample(monkeypatch)
    for name in ("people, mug", "people, ball"):
        (trial,), (receive, give) = groups[name].trials, groups[name].directions
        assert not trial["stuck"] and not trial["fell"], trial
        assert (receive.end, receive.truth["held_by"]) == ("succeeded", "robot"), (receive.end, receive.sentence)
        assert (give.end, give.truth["held_by"]) == ("succeeded", "human"), (give.end, give.sentence)
    for name, codes in (("withdrawals", partner_rows.WITHDRAWN), ("falls", partner_rows.FELL)):
        (trial,), (each,) = groups[name].trials, groups[name].directions
        assert not trial["stuck"] and each.truth["moved_before"], "the arm was on its way"
        assert each.end in {campaign.REASONS[code] for code in codes}, (each.end, each.sentence)
        assert trial["fell"] == (name == "falls") and each.truth["held_by"] != "robot"
    assert {row["goal"] for row in rows} - {""} == set(" ".join(GOALS.split()).split(", "))
    assert all(np.isfinite(row["value"]) for row in rows)
    names = [row["figure"] for row in rows]
    assert len(set(names)) == len(names)
    shown = {row["figure"].partition(" [sample of")[0]: row for row in rows}
    assert shown["withdrawals that came about"]["value"] == 1.0 and shown["reaches of the palm, all"]["value"] >= 4.0
    assert rows[0]["figure"] == "settings of home, region and timing that were changed (none)"
    assert rows[0]["ok"] and rows[1]["ok"] and rows[1]["figure"].startswith("a reach follows what is outside")
    assert not [row["figure"] for row in rows[2:] if row["goal"] and row["ok"]]
    assert names[2].endswith("[sample of 2 of 500 asked: missed]"), names[2]


def test_what_a_reach_follows_beyond_the_region_is_a_row(monkeypatch):
    region = bench_partner.settings_rows(bench_partner.row)[1]
    assert region["value"] == 0.0 and region["ok"]
    for part in ("where it is seen 0 mm", "to where it will be 0 mm"):
        assert part in region["figure"]
    wider = {"goal_region_low": [0.40, -0.52, 0.04], "goal_region_high": [0.87, 0.51, 0.86]}
    monkeypatch.setattr(bench_partner, "unless_withdrawn", lambda ctx, goal: {**goal, "limits": wider})
    region = bench_partner.settings_rows(bench_partner.row)[1]
    assert region["value"] == pytest.approx(0.05) and not region["ok"] and "seen 50 mm" in region["figure"]
