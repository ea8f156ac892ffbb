"""The session of a console that was killed goes on in the next one, and its file stays whole whatever happens."""

import json
import time

import pytest
from coglab_console.desk.desk import Desk
from coglab_console.desk.events import EventLog
from coglab_console.desk.experiment import RESUME, Experiment, ExperimentError
from coglab_console.desk.session_file import newest, read_session, rows_of
from coglab_console.web.fan_out import Documents
from console_double import RobotDouble

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
