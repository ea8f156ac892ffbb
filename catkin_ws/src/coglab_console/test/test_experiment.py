"""The next console resumes the session of a killed one; trials accept only their actions; recorders get the names."""

import itertools
import time
from dataclasses import replace

import pytest
from coglab_console.desk.desk import Desk
from coglab_console.desk.events import EventLog
from coglab_console.desk.experiment import FILE, RESUME, Experiment, ExperimentError, unprepared
from coglab_console.web.fan_out import Documents
from coglab_py.orders import order_of
from console_double import RobotDouble
from desk_double import ask

ROW = {"kind": "take", "object_id": "mug", "outcome": "succeeded", "started": 1.0, "ended": 3.0, "duration_s": 2.0}


def desk_in(folder, now=time.time):
    return Desk(RobotDouble(), EventLog(now), Documents(), folder, now, lambda: "http://link")


def begun(folder, now=time.time):
    """A console with a session in its second trial."""
    desk = desk_in(folder, now)
    session = desk.experiment
    session.begin("P07", ["receive", "give"], 2, "as_listed", 3)
    session.trial_begin()
    session.note("a", "looked away")
    session.trial_end("done")
    session.trial_begin()
    return desk


def test_the_session_of_a_killed_console_goes_on_where_it_was(tmp_path):
    before = begun(tmp_path)
    after = desk_in(tmp_path)
    assert after.experiment.view() == before.experiment.view() and after.experiment.names() == before.experiment.names()
    (event,) = after.events.since(0)[0]
    assert "P07" in event["text"] and "2 of 4" in event["text"]
    after.experiment.trial_end("repeat")
    assert [trial["outcome"] for trial in after.experiment.trials] == ["done", "repeat", "", ""]
    assert after.experiment.position == 1 and [each.name for each in tmp_path.iterdir()] == [FILE]


def test_a_session_that_was_ended_or_is_old_does_not_go_on(tmp_path):
    session = begun(tmp_path).experiment
    session.trial_end("done")
    session.end()
    assert desk_in(tmp_path).experiment.view()["participant"] == ""
    begun(tmp_path, lambda: time.time() + 10)
    later = desk_in(tmp_path, lambda: time.time() + 10 + RESUME + 1)
    assert later.experiment.view()["participant"] == ""
    later.experiment.begin("P08", ["a"], 1, "as_listed", 0)


def test_damaged_session_file_is_reported_and_console_starts(tmp_path):
    begun(tmp_path)
    whole = (tmp_path / FILE).read_text()
    for text in (
        "nothing\n",
        "[]",
        whole[:40],
        whole.replace('"position":1', '"position":9'),
        whole.replace("who", "x"),
    ):
        (tmp_path / FILE).write_text(text)
        desk = desk_in(tmp_path)
        assert desk.experiment.view()["participant"] == ""
        (event,) = desk.events.since(0)[0]
        assert event["level"] == "warning" and FILE in event["text"]


def test_repeated_result_counts_once(tmp_path):
    """coglab/results is latched: a restarted console receives the last result again."""
    desk = begun(tmp_path)
    result = {**ROW, "kind": RECEIVE, "outcome": "failed_empty"}
    desk.result(dict(result))
    desk.experiment.trial_end("repeat")
    again = desk_in(tmp_path)
    again.experiment.trial_begin()
    again.result(dict(result))
    assert "yet" in again.experiment.refusals()["trial_done"]


def test_outcome_of_a_trial_reaches_its_recording(tmp_path):
    desk = begun(tmp_path)
    desk.experiment.trial_end("skipped")  # nothing was done in it, nothing was recorded
    desk.experiment.trial_begin()
    desk.result({**ROW, "kind": RECEIVE})
    desk.backend.now = replace(desk.backend.now, in_hub=False)
    desk.stop("browser 1")
    desk.experiment.trial_end("failed")
    assert desk.backend.published == [("note", "STOP by browser 1"), ("note", "trial 3: failed")]


def test_a_session_does_not_end_in_the_middle_of_a_trial(tmp_path):
    session = begun(tmp_path).experiment
    with pytest.raises(ExperimentError, match="trial 2"):
        session.end()
    session.trial_end("skipped")
    assert "closed" in session.end()


def test_experiment_starts_without_a_folder(tmp_path):
    session = Experiment(tmp_path / "gone", time.time, lambda text: None)
    assert session.resume() == ""


RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
TIMES = itertools.count(10.0, 5.0)


def results(desk, kind, outcome, held=""):
    """Reports a result of the robot, and the object in its hand."""
    at = next(TIMES)
    desk.result({**ROW, "kind": kind, "outcome": outcome, "started": at, "ended": at + 1})
    desk.backend.now = replace(desk.backend.now, object_id=held, actions=(GIVE, "put") if held else (RECEIVE, "take"))


def opened(desk, *conditions):
    given = {"participant": "P1", "conditions": list(conditions), "repetitions": 1, "order": "as_listed"}
    return ask(desk, "a", "session_begin", **given)


def test_a_trial_begins_with_the_hand_that_its_action_needs(desk):
    """Also if a Latin square has Give before Receive: the hand is filled between the trials."""
    assert unprepared(order_of(["receive", "give"], 2, "latin_square", 1), held=False) == [1, 3]
    assert "trial 1" in opened(desk, "give", "receive ball", "give slowly")["message"]
    refused = ask(desk, "a", "trial_begin")
    assert not refused["success"] and "empty" in refused["message"]
    assert ask(desk, "a", "start", action=RECEIVE)["success"]
    results(desk, RECEIVE, "succeeded", held="mug")
    assert ask(desk, "a", "trial_begin")["success"]
    results(desk, GIVE, "succeeded")
    assert ask(desk, "a", "trial_end", outcome="done")["success"]


def test_a_session_does_not_begin_beside_a_live_study(desk):
    desk.backend.now = replace(desk.backend.now, study="pilot")
    refused = opened(desk, "receive")
    assert not refused["success"] and "pilot" in refused["message"]


def test_a_trial_takes_its_own_action_alone(desk):
    opened(desk, "receive", "give")
    assert ask(desk, "a", "trial_begin")["success"]
    refused = ask(desk, "a", "start", action="take")
    assert not refused["success"] and "Receive" in refused["message"]
    results(desk, "take", "succeeded", held="mug")  # asked for in a terminal
    warned = [event["text"] for event in desk.events.since(0)[0] if event["source"] == "experiment"]
    assert len(warned) == 1 and "Take" in warned[0]


def test_only_a_succeeded_trial_can_be_done(desk):
    desk.backend.now = replace(desk.backend.now, object_id="mug", actions=(GIVE, "put"))
    opened(desk, "give", "give slowly", "by hand")
    ask(desk, "a", "trial_begin")
    assert "no Give" in ask(desk, "a", "trial_end", outcome="done")["message"]
    results(desk, GIVE, "failed_holding", held="mug")
    assert not ask(desk, "a", "trial_end", outcome="done")["success"]
    assert ask(desk, "a", "trial_end", outcome="failed")["success"]
    ask(desk, "a", "trial_begin")
    results(desk, GIVE, "failed_holding", held="mug")
    results(desk, GIVE, "succeeded")
    desk.backend.now = replace(desk.backend.now, in_hub=False)
    assert "under way" in ask(desk, "a", "trial_end", outcome="done")["message"]
    desk.backend.now = replace(desk.backend.now, in_hub=True)
    assert ask(desk, "a", "trial_end", outcome="done")["success"]
    ask(desk, "a", "trial_begin")
    assert ask(desk, "a", "trial_end", outcome="done")["success"]  # a trial that names no action
    assert [trial["outcome"] for trial in desk.experiment.trials] == ["failed", "done", "done"]


def test_recorders_get_the_names_of_the_trial_under_way(desk):
    given = {"participant": "P1", "conditions": ["calm"], "repetitions": 1, "order": "as_listed", "study": "pilot"}
    assert ask(desk, "a", "session_begin", **given)["success"]
    assert ask(desk, "a", "trial_begin")["success"]
    assert ask(desk, "a", "trial_end", outcome="failed")["success"]
    during, after = desk.backend.marks
    assert (during["participant"], during["condition"], during["study"]) == ("P1", "calm", "pilot")
    assert during["session"].startswith("P1_")
    assert set(after.values()) == {""}
