"""Questionnaires: scores, and answers from CSV files."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from coglab_tools.command import CheckFailed
from coglab_tools.study.ask import ask
from coglab_tools.study.plan import load
from coglab_tools.study.questionnaires import add_answers, answers_of, find, read_answers, scores_of, shipped

HERE = Path()
TLX = "mental_demand,physical_demand,temporal_demand,performance,effort,frustration"


STUDY = (
    "version: 1\nname: s\nparticipants: 2\nconditions: {calm: {}}\ntrial: [receive]\n"
    "questionnaires: [nasa_tlx, godspeed]\n"
)


def study_in(tmp_path, text=STUDY):
    (tmp_path / "study.yaml").write_text(text)
    return load(tmp_path)


def read(tmp_path, text):
    file = tmp_path / "answers.csv"
    file.write_text(text)
    return read_answers(file, study_in(tmp_path))


def test_a_reversed_item_is_inverted():
    godspeed = find("godspeed", HERE)
    safety = godspeed.scores({"anxious_relaxed": 5, "agitated_calm": 4, "quiescent_surprised": 1})
    assert safety == {"perceived_safety": pytest.approx((5 + 4 + 5) / 3)}


@pytest.mark.parametrize("name, items", [("rosas", 18), ("godspeed", 24), ("nasa_tlx", 6), ("fluency", 8)])
def test_shipped_questionnaires_are_complete(name, items):
    assert name in shipped() and len(find(name, HERE).items) == items


def test_a_table_of_a_web_form_is_read_scored_and_kept(tmp_path):
    rows = read(tmp_path, f"participant,condition,{TLX}\nP01,calm,10,20,30,40,50,60\nP02,calm,5,5,5,5,5,\n")
    study = study_in(tmp_path)
    assert add_answers(study, rows) == (11, 0)
    assert add_answers(study, rows[:1]) == (0, 1)
    scores = scores_of(answers_of(study), study.questionnaires)
    assert [(s["participant"], s["scale"], s["value"]) for s in scores] == [("P01", "workload", 35.0)]


def test_answers_written_at_the_same_time_are_all_kept(tmp_path):
    study = study_in(tmp_path)
    rows = read(tmp_path, f"participant,condition,{TLX}\nP01,calm,10,20,30,40,50,60\nP02,calm,5,5,5,5,5,5\n")
    with ThreadPoolExecutor(len(rows)) as pool:
        assert sum(new for new, _ in pool.map(lambda row: add_answers(study, [row]), rows)) == 12
    assert len(answers_of(study)) == 12


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ":1: a line"),
        ("condition,effort\n", ":1: the column participant"),
        ("participant,condition,fatigue\n", ":1: the column 'fatigue'"),
        ("participant,condition,effort\nP01,calm,50\nAnna,calm,5\n", ":3: participant: one of P01, P02"),
        ("participant,condition,effort\nP01,loud,50\n", ":2: condition"),
        ("participant,condition,effort\nP01,calm,52\n", ":2: effort: 0 to 100"),
        ("participant,condition,effort\nP01,calm,nan\n", ":2: effort: 0 to 100"),
        ("participant,condition,effort\nP01,calm,high\n", ":2: effort: a number"),
        ("participant,condition,effort\nP01,calm\n", ":2: 3 cells"),
        ("participant,condition,effort\nP01,calm,5\nP01,calm,10\n", ":3: effort: answered twice"),
        ("participant,condition,questionnaire,item,answer\nP01,calm,rosas,happy,5\n", ":2: an item of"),
    ],
)
def test_bad_answers_are_refused_with_file_and_line(tmp_path, text, words):
    with pytest.raises(CheckFailed) as refused:
        read(tmp_path, text)
    assert f"answers.csv{words}" in str(refused.value)


def test_the_terminal_corrects_goes_back_and_keeps_complete_questionnaires(tmp_path):
    study = study_in(tmp_path, STUDY.replace(", godspeed", ""))
    lines = iter(["7", "x", "50", "back", "10", "20", "skip", "40", "50", "60"])
    assert ask(study, "P01", line=lambda prompt: next(lines)) == 5
    assert {row.item: row.answer for row in answers_of(study)}["mental_demand"] == 10.0
    assert ask(study, "P01", line=lambda prompt: "30") == 1


def test_ctrl_c_keeps_the_answers(tmp_path):
    lines = iter(["10", "20"])

    def line(prompt):
        try:
            return next(lines)
        except StopIteration:
            raise KeyboardInterrupt from None

    study = study_in(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        ask(study, "P01", line=line)
    assert [row.answer for row in answers_of(study)] == [10.0, 20.0]


def test_a_table_of_a_german_excel_is_read(tmp_path):
    rows = read(tmp_path, "\ufeffparticipant;condition;effort;frustration\nP01;calm;50,0;5\n")
    assert [(row.item, row.answer) for row in rows] == [("effort", 50.0), ("frustration", 5.0)]


@pytest.mark.parametrize(
    "line", ["P01,1,calm,nasa_tlx,effort", "P01,one,calm,nasa_tlx,effort,5", '"P01,1,calm', "Q,,,,,"]
)
def test_an_invalid_answers_file_is_refused_with_file_and_line(tmp_path, line):
    (tmp_path / "questionnaires.csv").write_text(f"participant,block,condition,questionnaire,item,answer\n{line}\n")
    with pytest.raises(CheckFailed, match="questionnaires.csv:2:"):
        answers_of(study_in(tmp_path))


def test_a_column_of_two_questionnaires_is_refused(tmp_path):
    own = "title: Own\nsource: us\nlow: 0\nhigh: 9\nscales: {load: [effort]}\n"
    (tmp_path / "own.yaml").write_text(own)
    (tmp_path / "answers.csv").write_text("participant,condition,effort\nP01,calm,5\n")
    study = study_in(tmp_path, STUDY.replace("godspeed", "own.yaml"))
    with pytest.raises(CheckFailed, match=":1: .*'effort'.* nasa_tlx.* own"):
        read_answers(tmp_path / "answers.csv", study)
