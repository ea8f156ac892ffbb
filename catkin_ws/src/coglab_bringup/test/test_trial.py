"""Figures and intervals of trials with known values."""

import os
import re

import numpy as np
import pytest
from coglab.plot import draw_trial, figure_of, rows_without_overlap
from coglab.series import Series
from coglab_bringup import demo
from coglab_bringup.demo import keep, unfinished
from coglab_bringup.handover import NotTaken
from coglab_bringup.trial_recorder import summarise
from coglab_msgs.msg import ReasonCode
from coglab_tools.report import page
from coglab_tools.trial import read

LIMITS = np.full(7, 2.0)


def test_summary_of_a_known_trial():
    trial = Series()
    trial.joints = [(t, [0.0] * 7, [0.0] * 6 + [t / 10]) for t in np.arange(0.0, 10.0, 0.1)]
    trial.feedback = [(4.0, "running", 0.2), (5.0, "reached", 0.004), (5.5, "reached", 0.003), (9.0, "reached", 0.5)]
    trial.truth = [(5.9, [0, 0, 0], [0, 0, 0], [0, 0, 0], 0.1), (6.0, [0, 0, 0], [0, 0, 0], [0, 0, 0], 2.0)]
    trial.contacts = [(6.04, True, 3.0)]
    trial.fri_lost = [(0.5, 3), (1.5, 3), (7.5, 5), (9.5, 9)]  # two of them during the handover
    row = summarise(trial, "exchange_human_to_robot", "success", 1.0, 8.0, LIMITS)
    assert row["fri_lost"] == 2
    assert row["duration_s"] == 7.0
    assert row["believed_error_mm"] == pytest.approx(3.0)  # the last arrival before contact
    assert row["contact_delay_ms"] == pytest.approx(40.0)
    assert row["peak_velocity_share"] == pytest.approx(0.4)


def test_giving_has_no_contact_delay():
    """The held object touches the hand all the time, so a touch means nothing."""
    trial = Series()
    trial.truth = [(t, [0, 0, 0], [0, 0, 0], [0, 0, 0], 3.0) for t in (1.0, 2.0, 3.0)]
    trial.contacts = [(3.1, True, 2.0)]
    assert summarise(trial, "exchange_robot_to_human", "success", 0.9, 8.0, LIMITS)["contact_delay_ms"] is None


def test_summary_without_measurements_has_none():
    row = summarise(Series(), "take", "no end", 0.0, 1.0, LIMITS)
    assert row["final_error_mm"] is None and row["contact_delay_ms"] is None and row["peak_velocity_share"] is None
    assert row["fri_lost"] is None and row["believed_error_mm"] is None
    assert row["final_error_by"].startswith("nobody") and row["reaches"] == []


def test_a_handover_that_did_not_end_has_a_code():
    assert unfinished("take", KeyboardInterrupt())["reason_code"] == ReasonCode.CANCELLED
    assert unfinished("take", RuntimeError("roslaunch ended"))["reason_code"] == ReasonCode.NODE_SILENT
    refused = unfinished("take", NotTaken("take was not taken", ReasonCode.WRONG_STATE))
    assert refused == {"kind": "take", "outcome": "take was not taken", "reason_code": ReasonCode.WRONG_STATE}


@pytest.mark.parametrize("load", [9.0, 1.0])
def test_a_slow_start_is_explained_by_the_load_of_the_computer(monkeypatch, capsys, load):
    """Before the simulated cell runs, nothing else tells why the screen stands still."""
    monkeypatch.setattr(demo, "SLOW_START", 0.01)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    watch = demo.PaceWatch()
    watch.slow_start.join()
    assert (re.search(r"\b9\.0\b.*\b2\b", capsys.readouterr().out) is not None) == (load > 2.0)


def test_each_slower_pace_of_the_cell_is_shown_once(monkeypatch, capsys):
    monkeypatch.setattr(demo, "SLOW_START", 3600.0)
    watch, shown = demo.PaceWatch(), []
    for factor in (1.0, 0.5, 0.5, 1.0, 0.5, 0.25):
        watch.take(factor)
        shown.append(capsys.readouterr().out)
    assert [bool(text) for text in shown] == [False, True, False, False, False, True] and "0.25" in shown[-1]
    assert watch.lowest == 0.25
    watch.slow_start.join(60.0)
    assert not watch.slow_start.is_alive(), "the cell runs: its start is over"


def test_children_of_a_concurrence_have_their_own_rows():
    rows = rows_without_overlap([(0.0, 2.0, "a"), (0.0, 1.0, "b"), (1.0, 3.0, "c")])
    assert sorted(name for row in rows for _, _, name in row) == ["a", "b", "c"]
    for row in rows:
        assert all(first[1] <= second[0] + 1e-3 for first, second in zip(row, row[1:], strict=False))
    assert len(rows) == 2


def two_approaches() -> Series:
    """Two actions, each with an approach of two parallel children."""
    trial = Series()
    for action, since in (("take", 0.0), ("give", 10.0)):
        inner = f"/m/{action}/approach"
        trial.transitions += [
            (since, "/m", "hub", action, action, ""),
            (since + 1.0, f"/m/{action}", "wait", "go", "approach", ""),
            (since + 4.0, f"{inner}", "arm", "done", "done", ""),
            (since + 5.0, f"/m/{action}", "approach", "done", "done", ""),
            (since + 6.0, "/m", action, "done", "hub", ""),
        ]
    times = np.arange(0.0, 18.0, 0.02)
    trial.truth = [(t, [t / 20, 0, 0], [1 - t / 40, 0, 0], [0, 0, 0], 2.0 * (t > 4)) for t in times]
    trial.external_torques = [(t, list(np.sin(t + np.arange(7)))) for t in times]
    trial.fingers = [(t, [10 * k + t for k in range(5)]) for t in times]
    trial.contacts = [(4.0, True, 2.0), (14.0, False, 1.0)]
    return trial


def test_the_picture_is_written_with_labels_in_their_bars(tmp_path):
    draw_trial(two_approaches(), "title", 0.0, 18.0, tmp_path / "trial.png")
    assert (tmp_path / "trial.png").stat().st_size > 10000 and (tmp_path / "trial.pdf").read_bytes()[:4] == b"%PDF"
    figure = figure_of(two_approaches(), "title", 0.0, 18.0)
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    bars = [bar.get_window_extent(renderer) for bar in figure.axes[0].patches]
    for label in figure.axes[0].texts:
        box = label.get_window_extent(renderer)
        assert any(bar.x0 <= box.x0 and box.x1 <= bar.x1 for bar in bars), label.get_text()


def test_a_result_that_cannot_be_written_leaves_the_old_one_and_a_sentence(tmp_path):
    def write(path):
        path.write_text("half")
        raise OSError(28, "No space left on device")

    (tmp_path / "result.json").write_text("old")
    problems = []
    keep(problems, tmp_path, "result.json", write)
    assert len(problems) == 1 and "No space left on device" in problems[0] and "make room" in problems[0]
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]
    assert (tmp_path / "result.json").read_text() == "old"
    keep(problems, tmp_path, "result.json", lambda path: path.write_text("new"))
    assert (tmp_path / "result.json").read_text() == "new" and len(problems) == 1


def test_only_a_report_that_cannot_be_written_asks_for_room(tmp_path, monkeypatch):
    """A recording that cannot be read needs no room."""
    assert demo.report_on([tmp_path / "trial.yaml"], problems := []) == ""
    assert len(problems) == 1 and str(tmp_path) in problems[0]
    assert "roslaunch.log" in problems[0] and "room" not in problems[0]
    monkeypatch.setattr(read, "read_trial", lambda folder: folder)
    (tmp_path / "report.html").mkdir()  # no file can take its place
    monkeypatch.setattr(page, "page_of", lambda trial: "")
    assert demo.report_on([tmp_path / "trial.yaml"], problems := []) == ""
    assert len(problems) == 1 and "report.html cannot be written" in problems[0] and "make room" in problems[0]
