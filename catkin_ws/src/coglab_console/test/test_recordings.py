"""Recorded handovers and questionnaires of a live study, as the page gets them."""

import pytest
from coglab_console.ros import recordings
from coglab_console.ros.recordings import LiveStudy, Recordings
from coglab_tools.command import CheckFailed
from coglab_tools.study.plan import load
from coglab_tools.study.questionnaires import answers_of
from coglab_tools.trial.record import Outcome, TrialRecord

STUDY = "version: 1\nname: s\nparticipants: 1\nconditions: {calm: {}}\ntrial: [receive]\nquestionnaires: [nasa_tlx]\n"


@pytest.fixture
def parameters(monkeypatch):
    given = {}
    monkeypatch.setattr(recordings.rospy, "get_param", lambda name, default=None: given.get(name, default))
    return given


def test_the_newest_recordings_come_first_and_a_broken_one_says_why(tmp_path, parameters):
    parameters["trial_recorder/folder"] = str(tmp_path)
    shown = Recordings()
    assert shown.document() == {"folder": str(tmp_path), "recording": True, "rows": []}
    for name, outcome in (("20260101T000001Z_a", Outcome(True)), ("20260101T000002Z_b", Outcome(False, 3, "X", "why"))):
        (tmp_path / name).mkdir()
        TrialRecord(name, "2026-01-01", 1.0, "take", outcome, participant="P03", notes="early").save(tmp_path / name)
    assert [(row["name"][-1], row["outcome"]) for row in shown.document()["rows"]] == [
        ("b", "X: why"),
        ("a", "succeeded"),
    ]
    (tmp_path / "20260101T000002Z_b" / "trial.yaml").write_text("[]")
    assert "trial.yaml" in shown.document()["rows"][0]["outcome"]


def test_answers_of_the_page_are_those_of_the_study(tmp_path, parameters):
    (tmp_path / "study.yaml").write_text(STUDY)
    live = LiveStudy()
    assert live.document() is None
    parameters["coglab/trial"] = {
        "study": "s", "participant": "P01", "condition": "calm", "block": 1, "study_folder": str(tmp_path)
    }  # fmt: skip
    (one,) = live.document()["questionnaires"]
    assert ["effort", "How hard did you have to work to accomplish your level of performance?"] in one["items"]
    with pytest.raises(CheckFailed, match="nothing"):
        live.answer("nasa_tlx", {})
    with pytest.raises(CheckFailed, match="effort"):
        live.answer("nasa_tlx", {"effort": 52})
    with pytest.raises(CheckFailed, match="P01, calm"):
        live.answer("nasa_tlx", {"effort": 45}, ["P01", "1", "brisk"])
    live.answer("nasa_tlx", {"effort": 50}, ["P01", "1", "calm"])
    assert [(row.participant, row.item, row.answer) for row in answers_of(load(tmp_path))] == [("P01", "effort", 50.0)]
    assert len(live.document()["questionnaires"][0]["items"]) == 5
    (tmp_path / "study.yaml").write_text("nothing")
    assert "study.yaml" in live.document()["problem"]
