"""Campaigns kept in a file: nothing is run twice, a cut line is dropped, trials of two commits are never mixed."""

import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import campaign
import world_rows
from trial_file import TrialFile, commit_in, origin_in
from virtual_trial import TouchRecord

JOBS = [campaign.Job("mug", ("exchange_human_to_robot",), seed, {}) for seed in range(3)]
TRIAL = {
    **dict.fromkeys(("seed", "fell", "outside_commanded", "outside_measured", "over_command", "moving"), 0),
    "fastest": 0.5,
    **dict.fromkeys(("virtual", "processor"), 1.0),
    "stuck": "",
    "outcomes": [("exchange_human_to_robot", "succeeded", "", "NONE")],
    "reaches": [],
    "touches": [],
    "begun": 1,
}
RECEIVE, GIVE = campaign.EXCHANGES


def test_what_a_file_holds_is_not_run_again(tmp_path, monkeypatch):
    path, run = tmp_path / "trials.jsonl", []
    monkeypatch.setattr(campaign, "FILE", TrialFile(path, "abc"))
    monkeypatch.setattr(campaign, "one_trial", lambda job: run.append(job.seed) or dict(TRIAL, seed=job.seed))
    monkeypatch.setattr(campaign, "pool_of", lambda processes: InThisProcess())
    assert campaign.fill(JOBS[:2], 1, 60.0) == 2 and run == [0, 1]
    monkeypatch.setattr(campaign, "FILE", TrialFile(path, "abc"))
    assert campaign.fill(JOBS, 1, 60.0) == 3 and run == [0, 1, 2]
    done = campaign.Campaign().run(("exchange_human_to_robot",), range(3))
    assert done.asked == 3 and run == [0, 1, 2, 0, 1, 2], "another name is another trial"
    monkeypatch.setattr(campaign, "RUN_MISSING", False)
    some = campaign.Campaign().run_each(("exchange_human_to_robot",), [(seed, {}) for seed in range(5)], "mug")
    assert (some.trials, some.asked, some.share("exchange_human_to_robot")) == (3, 5, 1.0)
    figure, ok = some.marked(lambda figure, value, unit, goal, ok: (figure, ok))("share", 1.0, "share", ">= 0.9", True)
    assert figure == "share [incomplete: missed; 3 of 5 trials]" and not ok


class InThisProcess:
    """A pool of none."""

    imap = staticmethod(map)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass


def test_a_line_that_was_cut_off_is_dropped(tmp_path):
    path = tmp_path / "trials.jsonl"
    file = TrialFile(path, "abc")
    assert file.add("one", TRIAL)["outcomes"] == [["exchange_human_to_robot", "succeeded", "", "NONE"]]
    with open(path, "a") as stream:
        stream.write('{"key": "two", "tri')
    again = TrialFile(path, "abc")
    assert list(again.known) == ["one"]
    again.add("three", TRIAL)
    assert list(TrialFile(path, "abc").known) == ["one", "three"] and commit_in(path) == "abc"


@pytest.mark.parametrize(
    "text", ["rubbish\n", '{"sources": "abc"}\nrubbish\n', '{"a": 1}\n', '{"sources": "abc"}\n{}\n']
)
def test_other_files_are_refused(tmp_path, text):
    path = tmp_path / "trials.jsonl"
    path.write_text(text)
    with pytest.raises(ValueError, match="is no file of trials"):
        TrialFile(path, "abc")


def test_another_commit_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "trials.jsonl"
    TrialFile(path, "abc").add("one", TRIAL)
    with pytest.raises(ValueError, match="holds trials of commit abc, the sources are def: check that commit out, or"):
        TrialFile(path, "def")


def test_rows_grow_alike():
    """Whenever a campaign is stopped, every row has the same share of its trials, the first rows first."""
    rows = [[campaign.Job(name, (), seed, {}) for seed in range(n)] for name, n in (("a", 4), ("b", 1), ("c", 8))]
    order = [f"{job.name}{job.seed}" for job in campaign.in_turn(rows)]
    assert order == "a0 b0 c0 c1 a1 c2 c3 a2 c4 c5 a3 c6 c7".split()


def trial(*ends, stuck="", begun=None):
    """A trial of both directions that came to these outcomes."""
    outcomes = [(kind, end, "why", "NO_CONTACT") for kind, end in zip((RECEIVE, GIVE), ends, strict=False)]
    return {**TRIAL, "outcomes": outcomes, "stuck": stuck, "begun": len(ends) if begun is None else begun}


TRIALS = [
    trial("succeeded", "succeeded"),
    trial("succeeded", "failed_holding"),
    trial("failed_empty"),
    trial(stuck="no end", begun=1),
    trial(stuck="before it began", begun=0),
    trial("succeeded", stuck="no end", begun=2),
    trial("succeeded", "succeeded", stuck="the machine waits in ''"),
    trial("failed_empty", stuck="the machine waits in ''"),
]


def test_every_trial_has_succeeded_or_failed_for_exactly_one_reason():
    done = campaign.Campaign()
    for each in TRIALS:
        done._count(campaign.EXCHANGES, each, "people")
    assert (done.trials, done.stuck) == (8, 5)
    for action in campaign.EXCHANGES:
        assert done.outcomes[(action, "succeeded")] + sum(done.reasons[action].values()) == done.trials
    assert done.reasons[RECEIVE] == {"NO_CONTACT": 1, "STUCK": 3}
    assert done.reasons[GIVE] == {"NO_CONTACT": 1, "STUCK": 2, "NOT_BEGUN": 4}
    assert sum(done.reasons[action]["STUCK"] for action in campaign.EXCHANGES) == done.stuck
    assert done.begun(GIVE) == 4 and done.share(RECEIVE) == 4 / 8
    assert done.failures(RECEIVE) == "stuck 3, no_contact 1"


def reach(mm, stood):
    return RECEIVE, {"stood": stood, "truth_mm": mm, "truth_deg": 1.0}


def touch(touched, found, moving=False, moving_when_found=False):
    alarm = found is not None and (touched is None or found < touched)
    return {
        "touched": touched,
        "found": found,
        "moving": moving,
        "moving_when_found": moving_when_found,
        "false_alarm": alarm,
    }


def touched(*forces, found_at=None, standing=True):
    """The record of a wait in which such forces (N) came on fingers and palm, one period after the other."""
    event, report = [None], {"standing": standing}
    rig = SimpleNamespace(
        t=0.0, cell=SimpleNamespace(), robot=SimpleNamespace(report=report), truth={"palm_force": 0.0}
    )
    record = TouchRecord(rig, SimpleNamespace(event=lambda: event[0]))
    for k, force in enumerate(forces):
        rig.t = float(k)
        rig.cell.touch = lambda force=force: {name: np.array(each) for name, each in force.items()}
        event[0] = "contact" if found_at is not None and k >= found_at else None
        record.look()
    return record.figures()


NOTHING = {"palm": [0.0, 0.0, 0.0]}
BY_HAND = {"palm": [0.0, 0.0, 0.0], "middle_distal": [0.0, 0.0, -2.6]}
ITSELF = {"index_distal": [0.0, 5.0, 0.0], "thumb_distal": [0.0, -5.0, 0.0]}


def test_whatever_touches_the_hand_is_a_touch_and_the_hand_itself_is_none():
    """The person's hand on a fingertip too: who finds that has not been alarmed for nothing."""
    found = touched(NOTHING, BY_HAND, BY_HAND, found_at=2)
    assert (found["touched"], found["found"], found["false_alarm"]) == (1.0, 2.0, False)
    alarm = touched(ITSELF, NOTHING, ITSELF, found_at=1, standing=False)
    assert (alarm["touched"], alarm["false_alarm"], alarm["moving_when_found"]) == (None, True, True)


def test_every_reach_counts_and_false_alarms_are_split():
    """Three reaches: one stood and was touched; one never stood and was touched on the way; one found contact on the
    way that was none, was not touched and never stood."""
    done = campaign.Campaign()
    for palm, hand in (
        (reach(4.0, True), touch(1.0, 1.1)),
        (reach(30.0, False), touch(1.0, 1.2, True, True)),
        (reach(50.0, False), touch(None, 0.5, moving_when_found=True)),
    ):
        done._count(campaign.EXCHANGES, {**trial("failed_empty"), "reaches": [palm], "touches": [hand]}, "people")
    done.asked, rows = 3, {}

    def row(figure, value, unit, goal="", ok=True):
        return rows.setdefault(figure, (float(value), unit))

    world_rows.whole_rows(row, done, "world")
    end = "never stood still, at the reach's end"
    assert rows["world, receive: reaches, arm standing"] == (1, "of 3")
    assert rows[f"world, receive: reaches, {end}"] == (2, "of 3")
    assert rows[f"world, receive: palm to the true goal pose, {end}, median"] == (40.0, "mm")
    world_rows.contact_rows(row, done)
    assert rows["drawn people, arm still: contact found before anything touched"] == (0, "of 3 waits")
    assert rows["drawn people, arm moving: contact found before anything touched"] == (1, "of 3 waits")
    still, moving = ("drawn people, arm still at first touch", "drawn people, arm moving at first touch")
    assert rows[f"{still}: touches"] == rows[f"{moving}: touches"] == (1, "of 3 waits")
    assert rows[f"{still}: palm to the true goal pose, arm standing, median"] == (4.0, "mm")
    assert rows[f"{moving}: palm to the true goal pose, {end}, median"] == (30.0, "mm")
    assert rows[f"drawn people, nothing touched the hand: palm to the true goal pose, {end}, median"] == (50.0, "mm")


def test_machine_and_date_are_kept_and_not_made_up(tmp_path):
    path = tmp_path / "trials.jsonl"
    TrialFile(path, "abc").add("key", {})
    assert re.fullmatch(r"Machine: \d+ cores, .+, Linux .+; begun: \d{4}-\d\d-\d\d\.", origin_in(path))
    assert TrialFile(path, "abc").known == {"key": {}} and commit_in(path) == "abc"
    path.write_text('{"sources": "abc"}\n')
    assert origin_in(path) == "Machine: not noted; begun: not noted."
