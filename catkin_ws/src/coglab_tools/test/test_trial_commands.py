"""`./coglab trial` on whole, damaged and foreign trials, without ROS."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rosbag
from coglab_tools.__main__ import run
from coglab_tools.report.page import page_of
from coglab_tools.trial.explain import explain
from coglab_tools.trial.record import Outcome
from coglab_tools.trial.video import write_video
from rospy import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trials import ACTION, MASTER, measured, record, write


def bag_of(place, *messages):
    with rosbag.Bag(str(place / "trial.bag"), "w") as bag:
        for topic, message, stamp in messages:
            bag.write(topic, message, Time.from_sec(stamp))


def answer(capsys, *words):
    """Exit code, answer as JSON, and the error."""
    status = run(["trial", *map(str, words), "--json"])
    out, error = capsys.readouterr()
    return status, json.loads(out), error


AFTER_THE_FIRST_DEMO = """
import sys
for name in ("coglab_sim._cell", "coglab_sim._virtual", "coglab_sim._plant", "coglab_sim._camera", "ctrl_more._core"):
    sys.modules[name] = None
from coglab_tools.report.page import page_of
from coglab_tools.trial.read import read_trial
from trials import measured
page_of(measured())
"""


def test_a_report_needs_only_the_libraries_that_the_demo_builds():
    command, place = [sys.executable, "-c", AFTER_THE_FIRST_DEMO], Path(__file__).parent
    ended = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=600)
    assert ended.returncode == 0, ended.stderr


def test_the_list_has_complete_unreadable_and_unfinished_trials(tmp_path, capsys):
    write(tmp_path, record())
    write(tmp_path, record(id="failed", outcome=Outcome(False, 41, "NOT_RELEASED", "nobody let go")))
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "trial.yaml").write_text("version: 1\nid: [", encoding="utf-8")
    (tmp_path / ".part-1-2.0").mkdir()
    status, data, _ = answer(capsys, "list", tmp_path)
    assert status == 0 and [row["outcome"] for row in data["trials"]] == ["succeeded", "NOT_RELEASED"]
    assert "bad/trial.yaml:2" in data["unreadable"][0] and len(data["unfinished"]) == 1


@pytest.mark.parametrize("kind", ["missing", "empty", "cut", "no bag", "foreign", "wrong type"])
def test_an_unusable_bag_is_named_and_nothing_is_written(tmp_path, capsys, kind):
    place = write(tmp_path, record())
    bag = place / "trial.bag"
    if kind == "empty":
        bag.touch()
    elif kind == "no bag":
        bag.write_bytes(b"RIFF" + bytes(5000))
    elif kind == "foreign":
        bag_of(place, ("/camera", String("x"), 1.0))
    elif kind == "wrong type":
        bag_of(place, ("/coglab/transitions", String("x"), 1.0))
    elif kind == "cut":
        bag_of(place, *[("/lwr/joint_states", JointState(position=[0.0] * 7), k / 100) for k in range(5000)])
        bag.write_bytes(bag.read_bytes()[:100000])
    status, _, error = answer(capsys, "report", place)
    assert status == 1 and str(place.name) in error
    assert {each.name for each in place.iterdir()} <= {"trial.yaml", "trial.bag"}


def test_a_bag_with_only_joints_and_nan_gets_a_page(tmp_path, capsys):
    place = write(tmp_path, record(marks=(), duration_s=2.0))
    bag_of(place, *[
        ("/lwr/joint_states", JointState(position=[np.nan] * 7, velocity=[0.0] * 7), 10.0 + k / 100) for k in range(200)
    ])  # fmt: skip
    status, data, _ = answer(capsys, "report", place)
    assert status == 0 and "</html>" in (place / "report.html").read_text(encoding="utf-8")
    assert answer(capsys, "show", place)[1]["metrics"]["peak_force_n"] is None and data["file"].endswith("report.html")


def test_a_failure_is_explained_in_ten_lines_with_its_first_cause():
    trial = measured()
    trial.record = record(
        outcome=Outcome(False, 41, "NOT_RELEASED", "the person did not let go"),
        marks=tuple({"name": f"mark_{k}", "time_s": float(k) / 3} for k in range(30)),
        notes="P03 laughed",
    )
    trial.series.transitions.insert(1, (4.0, f"{MASTER}/{ACTION}", "reach", "aborted", "failed", "goal lost", 41))
    lines = explain(trial)
    assert len(lines) <= 10 and "the person did not let go" in lines[0]
    assert lines[1].strip().startswith("+4.00 s") and "reach" in lines[1]
    assert lines[-1] == "notes: P03 laughed"


def test_the_page_is_complete_and_escapes_typed_text():
    trial = measured()
    trial.record = record(notes="<script>alert(1)</script>")
    text = page_of(trial)
    assert "<script" not in text and "&lt;script&gt;" in text
    assert "http://" not in text and "https://" not in text and text.count("data:image/png;base64,") == 2
    assert "0.12 s" in text  # detection delay


def test_two_actions_of_one_recording_have_their_own_figures_and_plots():
    trial = measured()
    second = replace(
        trial.exchanges[0], what="give", started=6.0, ended=10.0, ok=False, code=41, sentence="nobody took it", marks={}
    )
    trial.exchanges = (replace(trial.exchanges[0], ended=6.0), second)
    text = page_of(trial)
    assert text.count("data:image/png;base64,") == 4 and text.count('class="verdict') == 2
    assert "6.00 s" in text and "nobody took it" in text


def test_a_trial_is_found_by_a_unique_start_of_its_name(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    write(tmp_path / "trials", record(id="20261128T1000_a"))
    write(tmp_path / "trials", record(id="20261128T1100_b"))
    status, _, error = answer(capsys, "explain", "20261128")
    assert status == 2 and "20261128T1000_a, 20261128T1100_b" in error
    status, _, error = answer(capsys, "explain", "20261128T11")
    assert status == 1 and "20261128T1100_b" in error and "trial.bag" in error


def test_a_trial_is_drawn_without_a_screen(tmp_path):
    pytest.importorskip("coglab_sim._camera", reason="./coglab film builds the camera")
    image = pytest.importorskip("PIL.Image")
    trial = measured()
    trial.start, trial.end = 0.0, 0.5
    trial.series.joints = [(k / 10, (0.0, 0.3 + k / 10, 0.0, -1.2, 0.0, 0.5, 0.0), (0.0,) * 7) for k in range(6)]
    found = write_video(trial, tmp_path / "a.gif")
    with image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == found["frames"] > 5
        first = np.asarray(film.convert("L"), dtype=int)
        film.seek(film.n_frames - 1)
        assert np.abs(np.asarray(film.convert("L"), dtype=int) - first).max() > 50, "the arm moves"
