"""Campaigns kept in a file: nothing is run twice, a cut line is dropped, trials of two commits are never mixed."""

import sys

import pytest
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import campaign
from trial_file import TrialFile, commit_in

JOBS = [campaign.Job("mug", ("exchange_human_to_robot",), seed, {}) for seed in range(3)]
TRIAL = {
    **dict.fromkeys(("seed", "fell", "outside_commanded", "outside_measured", "over_command", "moving"), 0),
    "fastest": 0.5,
    **dict.fromkeys(("virtual", "processor"), 1.0),
    "stuck": "",
    "outcomes": [("exchange_human_to_robot", "succeeded", "", "NONE")],
    "reaches": [],
    "touches": [(1.0, 1.1, False, False)],
}


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
    assert figure == "share [incomplete: 3 of 5 trials]" and not ok


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
    rows = [[campaign.Job(name, (), seed, {}) for seed in range(n)] for name, n in (("a", 3), ("b", 1), ("c", 2))]
    assert [f"{job.name}{job.seed}" for job in campaign.in_turn(rows)] == ["a0", "b0", "c0", "a1", "c1", "a2"]
