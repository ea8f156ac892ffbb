"""Rows of a live study find the recordings of their handovers."""

from __future__ import annotations

import trials
from coglab_tools.study import recordings
from coglab_tools.study.plan import load, new

ROW = {"session": "s_P01_1", "action": "receive", "duration_s": 8.0}


def test_a_recording_belongs_to_the_last_request_before_it(tmp_path, monkeypatch):
    monkeypatch.setattr("coglab_tools.trial.read.read_trial", lambda folder: trials.measured())
    study = load(new(tmp_path / "s"))
    told = {"session": "s_P01_1", "action": "exchange_human_to_robot", "started": "2026-11-28T10:00:08.200Z"}
    trials.write(study.folder / "recordings", trials.record(id="b", **told))
    trials.write(study.folder / "recordings", trials.record(id="other", **{**told, "session": "t"}))
    (study.folder / "recordings" / "bad").mkdir()
    (study.folder / "recordings" / "bad" / "trial.yaml").write_text("[")
    table = [
        {**ROW, "started_utc": "2026-11-28T10:00:00.000Z"},
        {**ROW, "started_utc": "2026-11-28T10:00:08.000Z"},
        {**ROW, "started_utc": "2026-11-28T10:00:08.500Z"},
    ]
    rows, problems = recordings.joined(study, table)
    assert [row.get("recording") for row in rows] == [None, "b", None]
    assert rows[1]["peak_force_n"] == 6.0 and rows[1]["duration_s"] == 8.0
    assert len(problems) == 1 and "bad/trial.yaml" in problems[0]
