"""Files of sessions as the tools read them: order, outcomes, notes, and what the brain's journal says of each trial."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest
from coglab_console.desk.experiment import Experiment
from coglab_console.desk.session_file import (
    COLUMNS,
    SessionFileError,
    newest,
    read_session,
    rows_of,
    session_files,
)

TOOL = Path(__file__).resolve().parents[1] / "scripts" / "console_session.py"


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.time = 1_000_000.0

    def __call__(self) -> float:
        return self.time


def result(duration: float, outcome: str = "succeeded", kind: str = "exchange_human_to_robot", **more) -> dict:
    """A row of the journal as the brain tells it; its clock is the steady one."""
    return {
        "kind": kind,
        "object_id": "mug",
        "outcome": outcome,
        "reason": "" if outcome == "succeeded" else "no contact within 6 s",
        "reason_code": 0 if outcome == "succeeded" else 41,
        "causes": [],
        "started": 50.0,
        "ended": 50.0 + duration,
        "duration_s": duration,
        "marks": {"offered": 51.0, "contact": 53.5},
        **more,
    }


@pytest.fixture
def written(tmp_path):
    """A session of four trials as an experimenter would run it: one repeated, one whose action ends after it."""
    clock = Clock()
    session = Experiment(tmp_path, clock, lambda text: None)
    session.begin("P07", ["receive", "give"], 2, "as_listed", 3)
    clock.time += 10.0
    session.trial_begin()
    clock.time += 8.0
    session.result(result(6.0, "failed"))
    session.note("browser 1", "moved too early; =1+1")
    session.trial_end("repeat")
    clock.time += 5.0
    session.note("/rostopic", "between trials")
    session.trial_begin()
    clock.time += 4.0
    session.trial_end("done")  # the object is there; the arm still goes home
    session.trial_begin()
    clock.time += 3.0
    session.result(result(6.5, started=70.0, ended=76.5))
    session.record("stop", who="browser 2")
    session.record("stopped", cause="hold on /lwr")
    clock.time += 2.0
    session.trial_end("skipped")
    session.trial_begin()
    return next(tmp_path.glob("P07_*.jsonl"))


def test_order_outcomes_notes_and_results_of_each_trial(written):
    session = read_session(written)
    assert (session.participant, session.number, session.order) == ("P07", 3, "as_listed")
    assert session.trials == ["receive", "give", "receive", "give"] and session.ended is None
    found = [(a.trial, a.attempt, a.condition, a.outcome) for a in session.attempts]
    assert found == [
        (1, 1, "receive", "repeat"),
        (1, 2, "receive", "done"),
        (2, 1, "give", "skipped"),
        (3, 1, "receive", "open"),
    ]
    first, second, third, _ = session.attempts
    assert [row["outcome"] for row in first.results] == ["failed"] and first.duration == 8.0
    assert [row["text"] for row in first.notes] == ["moved too early; =1+1"]
    assert [row["text"] for row in session.outside.notes] == ["between trials"]
    # The action began in the second attempt and ended, with the arm at home, in the next trial.
    assert [row["outcome"] for row in second.results] == ["succeeded"] and third.results == []
    assert [row["type"] for row in third.stops] == ["stop", "stopped"]
    assert session.problems == []


def test_an_action_that_began_before_its_trial_counts_where_it_ended(tmp_path):
    clock = Clock()
    session = Experiment(tmp_path, clock, lambda text: None)
    session.begin("P1", ["a"], 1, "as_listed", 0)
    clock.time += 5.0
    session.trial_begin()
    clock.time += 2.0
    session.result(result(4.0))
    session.trial_end("done")
    session.end()
    found = read_session(newest(tmp_path))
    assert len(found.attempts[0].results) == 1 and found.ended == clock.time


def test_tables_with_a_row_per_trial_action_and_event(written):
    sessions = [read_session(written)]
    trials = rows_of(sessions, "trials")
    assert [(row["trial"], row["attempt"], row["outcome"]) for row in trials] == [
        (1, 1, "repeat"),
        (1, 2, "done"),
        (2, 1, "skipped"),
        (3, 1, "open"),
        (4, 0, "not begun"),
    ]
    assert trials[0]["result"] == "failed" and trials[0]["reason_code"] == 41 and trials[0]["actions"] == 1
    assert trials[0]["notes"] == "moved too early; =1+1" and trials[2]["stops"] == 2 and trials[2]["result"] == ""
    assert trials[0]["began"] == "1970-01-12T13:46:50.000Z"
    actions = rows_of(sessions, "actions")
    assert [(row["trial"], row["attempt"], row["action_s"]) for row in actions] == [(1, 1, 6.0), (1, 2, 6.5)]
    assert json.loads(actions[0]["marks"]) == {"offered": 1.0, "contact": 3.5}  # s after the action began
    events = rows_of(sessions, "events")
    assert [(row["trial"], row["kind"], row["who"]) for row in events] == [
        (1, "note", "browser 1"),
        ("", "note", "/rostopic"),
        (2, "stop", "browser 2"),
        (2, "stopped", ""),
    ]
    assert events[3]["text"] == "hold on /lwr"
    for table, columns in COLUMNS.items():
        assert all(tuple(row) == columns for row in rows_of(sessions, table))


@pytest.mark.parametrize(
    "line",
    [
        '{"type": "note", "stamp": 1000011.0, "who": "a", "te',
        "[1, 2]",
        '{"type": "note"}',
        '{"type": "note", "stamp": NaN, "who": "a", "text": "x"}',
        '{"type": "note", "stamp": "now", "who": "a", "text": "x"}',
        '{"type": "note", "stamp": 1000011.0, "who": "a"}',
        '{"type": "trial_end", "stamp": 1000011.0, "trial": 4, "condition": "give", "outcome": "done"}',
        '{"type": "trial_begin", "stamp": 1000011.0, "trial": 99, "condition": "give"}',
        '{"type": "result", "stamp": 1000011.0, "outcome": "succeeded"}',
        '{"type": "dance", "stamp": 1000011.0}',
        "[" * 100000,
        "\x00\x01",
    ],
    ids=lambda line: line[:40],
)
def test_a_line_that_means_nothing_is_named_and_left_out(written, line):
    lines = written.read_text().splitlines()
    before = rows_of([read_session(written)], "trials")
    written.write_text("\n".join([*lines[:2], line, *lines[2:]]) + "\n")
    session = read_session(written)
    assert rows_of([session], "trials") == before
    (problem,) = session.problems
    assert problem.startswith("line 3: ")


def test_a_file_whose_last_line_was_not_finished_is_read(written):
    text = written.read_text()
    written.write_text(text[:-20])
    session = read_session(written)
    assert len(session.attempts) == 3 and len(session.problems) == 1


@pytest.mark.parametrize("text", ["", "hello\n", "{}\n", '{"type": "note", "stamp": 1.0, "who": "a", "text": "b"}\n'])
def test_what_is_no_session_is_refused_in_words(tmp_path, text):
    path = tmp_path / "x.jsonl"
    path.write_text(text)
    with pytest.raises(SessionFileError, match="expected .* session"):
        read_session(path)
    with pytest.raises(SessionFileError, match="cannot be read"):
        read_session(tmp_path / "gone.jsonl")


def test_a_file_that_is_no_text_or_too_long_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "x.jsonl"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SessionFileError, match="expected"):
        read_session(path)
    monkeypatch.setattr("coglab_console.desk.session_file.MAX_BYTES", 2)
    with pytest.raises(SessionFileError, match="at most 2 bytes"):
        read_session(path)


def test_the_newest_session_of_a_folder(tmp_path):
    assert newest(tmp_path) is None and newest(tmp_path / "gone") is None
    for stamp, name in ((2000, "P1"), (3000, "P2"), (1000, "P3")):
        session = Experiment(tmp_path, lambda stamp=stamp: float(stamp), lambda text: None)
        session.begin(name, ["a"], 1, "as_listed", 0)
    (tmp_path / "notes.jsonl").write_text("mine\n")
    assert newest(tmp_path).name == "P2_3000.jsonl"
    assert [path.name for path in session_files(tmp_path)] == ["P3_1000.jsonl", "P1_2000.jsonl", "P2_3000.jsonl"]


# --- the command ----------------------------------------------------------------------------------------------


def tool(*words, home=None):
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path), "ROS_HOME": str(home or "/nonexistent")}
    return subprocess.run(
        [sys.executable, str(TOOL), *map(str, words)], capture_output=True, text=True, timeout=60, env=environment
    )


def test_the_command_prints_a_table(written):
    ended = tool(written)
    assert ended.returncode == 0, ended.stderr
    lines = ended.stdout.splitlines()
    assert "P07" in lines[0] and "2 of 4 trials" in lines[0] and "not ended" in lines[0]
    assert lines[1].split()[:4] == ["trial", "attempt", "condition", "outcome"]
    assert "no contact within 6 s" in ended.stdout and "not begun" in ended.stdout


def test_the_command_writes_csv_of_several_sessions(written, tmp_path):
    other = Experiment(written.parent, lambda: 2_000_000.0, lambda text: None)
    other.begin("P08", ["give"], 1, "as_listed", 1)
    out = tmp_path / "trials.csv"
    ended = tool(written.parent, "--csv", out)
    assert ended.returncode == 0 and str(out) in ended.stdout, ended.stderr
    with out.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["participant"] for row in rows] == ["P07"] * 5 + ["P08"]
    assert tuple(rows[0]) == COLUMNS["trials"] and rows[0]["notes"] == "moved too early; =1+1"


def test_without_a_name_the_command_takes_the_newest(written, tmp_path):
    home = tmp_path / "home"
    (home / "console_sessions").mkdir(parents=True)
    written.rename(home / "console_sessions" / written.name)
    assert "P07" in tool(home=home).stdout
    nothing = tool(home=tmp_path / "gone")
    assert nothing.returncode == 1 and "no session" in nothing.stderr and "Experiment" in nothing.stderr


@pytest.mark.parametrize(
    "words, status, part",
    [
        (["gone.jsonl"], 1, "cannot be read"),
        (["--table", "dances"], 2, "trials"),
        (["--csv", "x.jsonl"], 2, ".csv"),
        (["--csv", "/nonexistent/x.csv"], 1, "cannot be written"),
    ],
)
def test_the_command_says_what_it_cannot_do(written, words, status, part):
    given = words if words == ["gone.jsonl"] else [written, *words]
    ended = tool(*given)
    assert ended.returncode == status and part in ended.stderr and "Traceback" not in ended.stderr


def test_the_command_names_lines_that_were_left_out_and_goes_on(written):
    written.write_text(written.read_text() + "half a li")
    ended = tool(written)
    assert ended.returncode == 0 and "left out" in ended.stderr and "not begun" in ended.stdout
