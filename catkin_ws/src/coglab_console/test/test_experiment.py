"""The session of a console that was killed goes on in the next one, and its file stays whole whatever happens."""

import itertools
import json
import time
from dataclasses import replace

import pytest
from coglab_console.desk.desk import Desk
from coglab_console.desk.events import EventLog
from coglab_console.desk.experiment import RESUME, Experiment, ExperimentError, unprepared
from coglab_console.desk.session_file import newest, read_session, rows_of
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
    assert after.experiment.view() == before.experiment.view()
    (event,) = after.events.since(0)[0]
    assert "P07" in event["text"] and "trial 2 of 4" in event["text"] and "under way" in event["text"]
    after.experiment.trial_end("repeat")
    after.experiment.trial_begin()
    session = read_session(newest(tmp_path))
    assert [(a.trial, a.attempt, a.outcome) for a in session.attempts] == [
        (1, 1, "done"),
        (2, 1, "repeat"),
        (2, 2, "open"),
    ]
    assert session.problems == [] and len(list(tmp_path.glob("*.jsonl"))) == 1


def test_a_session_that_was_ended_or_is_old_does_not_go_on(tmp_path):
    session = begun(tmp_path).experiment
    session.trial_end("done")
    session.end()
    assert desk_in(tmp_path).experiment.view()["participant"] == ""
    begun(tmp_path, lambda: time.time() + 10)
    later = desk_in(tmp_path, lambda: time.time() + 10 + RESUME + 1)
    assert later.experiment.view()["participant"] == ""
    later.experiment.begin("P08", ["a"], 1, "as_listed", 0)


def test_a_file_that_cannot_be_read_again_is_told_and_the_console_begins(tmp_path):
    (tmp_path / "P07_1700000000.jsonl").write_text("nothing\n")
    desk = desk_in(tmp_path)
    assert desk.experiment.view()["participant"] == ""
    (event,) = desk.events.since(0)[0]
    assert event["level"] == "warning" and "P07_1700000000" in event["text"]


def test_a_result_that_is_told_twice_is_written_once(tmp_path):
    """coglab/results is latched: a console that comes back hears the last one again."""
    desk = begun(tmp_path)
    desk.result(dict(ROW))
    desk.result(dict(ROW))
    desk_in(tmp_path).result(dict(ROW))
    assert len(read_session(newest(tmp_path)).attempts[1].results) == 1
    desk.result({**ROW, "started": 4.0, "ended": 6.0})
    assert len(read_session(newest(tmp_path)).attempts[1].results) == 2


def test_a_stop_by_somebody_else_is_in_the_file(tmp_path):
    desk = begun(tmp_path)
    desk.observe(False, "")
    desk.observe(True, "hold on /lwr")
    desk.observe(True, "hold on /lwr")
    (row,) = read_session(newest(tmp_path)).attempts[1].stops
    assert (row["type"], row["cause"], row["trial"]) == ("stopped", "hold on /lwr", 2)


def test_notes_and_stops_say_in_which_phase_they_were(tmp_path):
    desk = begun(tmp_path)
    desk.events.phase = lambda: "reaches and receives"
    desk.stop("a")
    desk.told("note", "let go early", "/x")
    rows = rows_of([read_session(newest(tmp_path))], "events")
    assert sorted((row["kind"], row["phase"]) for row in rows) == [
        ("note", ""),
        ("note", "reaches and receives"),
        ("stop", "reaches and receives"),
    ]


def test_half_a_line_spoils_no_other(tmp_path):
    """As after a disk that was full in the middle of a line."""
    session = begun(tmp_path).experiment
    path = newest(tmp_path)
    with path.open("a") as stream:
        stream.write('{"type": "note", "stamp"')
    session.note("a", "after")
    found = read_session(path)
    assert [note["text"] for note in found.attempts[1].notes] == ["after"] and len(found.problems) == 1


def test_numbers_that_are_not_finite_are_written_as_json(tmp_path):
    desk = begun(tmp_path)
    desk.result({**ROW, "marks": {"contact": float("nan")}})
    lines = newest(tmp_path).read_text().splitlines()
    assert json.loads(lines[-1], parse_constant=lambda word: pytest.fail(word))["marks"] == {"contact": None}


def test_an_action_says_when_it_began_by_the_clock_of_the_day(tmp_path):
    """Beside the times of the brain's clock, which no video or questionnaire has."""
    desk = begun(tmp_path, lambda: 1_700_000_000.0)
    desk.result({**ROW, "started": 500.0, "ended": 502.0, "marks": {"contact": 501.5}})
    desk.result({**ROW, "started": 400.0, "started_utc": "2023-11-14T22:11:40.500+00:00"})  # as the brain says it
    rows = rows_of([read_session(newest(tmp_path))], "actions")
    assert [row["began"] for row in rows] == ["2023-11-14T22:11:40.500Z", "2023-11-14T22:13:18.000Z"]
    assert json.loads(rows[1]["marks"]) == {"contact": 1.5}


def test_a_session_does_not_end_in_the_middle_of_a_trial(tmp_path):
    session = begun(tmp_path).experiment
    with pytest.raises(ExperimentError, match="trial 2 is under way"):
        session.end()
    session.trial_end("skipped")
    assert "closed" in session.end()


def test_an_experiment_without_a_folder_begins(tmp_path):
    session = Experiment(tmp_path / "gone", time.time, lambda text: None)
    assert session.resume() == ""


def test_a_note_without_a_session_says_where_it_is(tmp_path):
    session = Experiment(tmp_path, time.time, lambda text: None)
    assert "no session is open" in session.note("a", "x")
    session.begin("P07", ["a"], 1, "as_listed", 0)
    assert session.note("a", "y") == "noted"


RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
TIMES = itertools.count(10.0, 5.0)


def results(desk, kind, outcome, held=""):
    """The robot has done this, and its hand holds that."""
    at = next(TIMES)
    desk.result({**ROW, "kind": kind, "outcome": outcome, "started": at, "ended": at + 1})
    desk.backend.now = replace(desk.backend.now, object_id=held, actions=(GIVE, "put") if held else (RECEIVE, "take"))


def opened(desk, *conditions):
    given = {"participant": "P1", "conditions": list(conditions), "repetitions": 1, "order": "as_listed"}
    return ask(desk, "a", "session_begin", **given)


def test_a_trial_begins_with_the_hand_that_its_action_needs(desk):
    """Also where a Latin square has Give before Receive: the hand is filled between the trials."""
    assert unprepared(order_of(["receive", "give"], 2, "latin_square", 1), held=False) == [1, 3]
    assert "before trial 1" in opened(desk, "give", "receive ball", "give slowly")["message"]
    refused = ask(desk, "a", "trial_begin")
    assert not refused["success"] and "the hand is empty" in refused["message"]
    assert ask(desk, "a", "start", action=RECEIVE)["success"]
    results(desk, RECEIVE, "succeeded", held="mug")
    assert ask(desk, "a", "trial_begin")["success"]
    results(desk, GIVE, "succeeded")
    assert ask(desk, "a", "trial_end", outcome="done")["success"]
    (attempt,) = read_session(newest(desk.experiment._folder)).attempts
    assert [row["kind"] for row in attempt.results] == [GIVE]


def test_a_trial_takes_its_own_action_alone(desk):
    opened(desk, "receive", "give")
    assert ask(desk, "a", "trial_begin")["success"]
    refused = ask(desk, "a", "start", action="take")
    assert not refused["success"] and "Receive" in refused["message"]
    results(desk, "take", "succeeded", held="mug")  # asked for in a terminal
    warned = [event["text"] for event in desk.events.since(0)[0] if event["source"] == "experiment"]
    assert len(warned) == 1 and "Take" in warned[0]


def test_only_what_has_succeeded_is_done(desk):
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
    session = read_session(newest(desk.experiment._folder))
    assert [attempt.outcome for attempt in session.attempts] == ["failed", "done", "done"] and session.passed() == 3


def test_recorders_get_the_names_of_the_trial_under_way(desk):
    opened(desk, "calm")
    assert ask(desk, "a", "trial_begin")["success"]
    assert ask(desk, "a", "trial_end", outcome="failed")["success"]
    during, after = desk.backend.marks
    assert (during["participant"], during["condition"]) == ("P1", "calm") and during["session"].startswith("P1_")
    assert set(after.values()) == {""}
