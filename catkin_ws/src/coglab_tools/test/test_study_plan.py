"""study.yaml: refusals with file and line, and the resulting plan."""

from __future__ import annotations

from pathlib import Path

import pytest
from coglab_py.packages import package_path
from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.study.live import with_settings
from coglab_tools.study.plan import load, new

GOOD = """\
version: 1
name: pilot
participants: 2
conditions:
  calm: {timing: calm}
  fast: {timing: natural, handover.reach_ratio: 0.8, speed: 0.9, delivery: handle_first}
trial: [receive, give]
"""


def study(tmp_path, text=GOOD):
    (tmp_path / "study.yaml").write_text(text)
    return load(tmp_path)


def test_a_new_study_is_valid_and_is_not_overwritten(tmp_path):
    file = new(tmp_path / "pilot")
    assert len(load(file).trials()) == 36
    with pytest.raises(UsageError, match="pilot"):
        new(tmp_path / "pilot")


def test_a_study_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    with pytest.raises(CheckFailed, match="/proc/pilot/study.yaml"):
        new(Path("/proc/pilot"))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(CheckFailed, match="No space left"):
        new(tmp_path / "pilot")
    assert not any(tmp_path.iterdir())


def test_own_primitives_and_objects_are_conditions_until_they_change(tmp_path):
    text = GOOD.replace("speed: 0.9, delivery: handle_first", "primitive: {receive: reach_high}, object: box_of_mine")
    with pytest.raises(CheckFailed, match=r"dmp train .*primitives.xml"):
        study(tmp_path, text)
    shipped = package_path("coglab_controllers", "config", "primitives.xml").read_text()
    (tmp_path / "primitives.xml").write_text(shipped.replace('id="reach_human_high"', 'id="reach_high"'))
    with pytest.raises(CheckFailed, match=r"study.yaml:6: .*objects/"):
        study(tmp_path, text)
    (tmp_path / "objects").mkdir()
    mug = package_path("coglab_objects", "objects", "mug.yaml").read_text()
    (tmp_path / "objects" / "box_of_mine.yaml").write_text(mug.replace("id: mug", "id: box_of_mine"))
    before = study(tmp_path, text)
    assert {"reach_high", "reach_human_high", "give_human"} <= set(before.own.primitive_names)
    (tmp_path / "primitives.xml").write_text(shipped.replace('id="reach_human_high"', 'id="reach_high"') + "\n")
    assert study(tmp_path, text).plan != before.plan
    (tmp_path / "primitives.xml").write_text(shipped[:2000])
    with pytest.raises(CheckFailed, match="primitives.xml"):
        study(tmp_path, text)


@pytest.mark.parametrize(
    ("old", "bad", "line", "words"),
    [
        ("participants: 2", "participants: [P01, Anna]", 3, "P03"),
        ("participants: 2", "participants: [P01, P01]", 3, "twice"),
        ("{timing: calm}", "{timing: slow}", 5, "calm, natural"),
        ("{timing: calm}", "{timeing: calm}", 5, "'timing'"),
        ("handover.reach_ratio: 0.8", "handover.reach_ratio: -1", 6, "minimum"),
        ("speed: 0.9", "speed: 2", 6, "0.05 to 1"),
        ("handle_first", "upside_down", 6, "handle_first"),
        ("speed: 0.9", "primitive: reach", 6, "reach_human"),
        ("speed: 0.9", "feedback: [wobble]", 6, "ee_admittance"),
        ("speed: 0.9", "auto_trigger: true", 6, "no setting"),
        ("[receive, give]", "[give]", 7, "empty"),
        ("[receive, give]", "[receive]\norder: latin", 8, "latin_square"),
        ("[receive, give]", "[receive]\nquestionnaires: [sus]", 8, "nasa_tlx"),
        ("[receive, give]", "[receive]\nsimulated: {person: {trsut: 1}}", 8, "trust"),
        ("name: pilot", "name: pilot\nname: b", 3, "twice"),
    ],
)
def test_bad_values_are_refused_with_file_and_line(tmp_path, old, bad, line, words):
    with pytest.raises(CheckFailed) as refused:
        study(tmp_path, GOOD.replace(old, bad))
    sentence = str(refused.value)
    assert f"study.yaml: line {line}" in sentence or f"study.yaml:{line}:" in sentence, sentence
    assert words in sentence


def test_levels_are_combined(tmp_path):
    text = (
        GOOD[: GOOD.index("conditions:")]
        + "conditions: {timing: [calm, natural], speed: [0.5, 1.0]}\ntrial: [receive]\n"
    )
    made = study(tmp_path, text)
    assert made.conditions["calm-speed0.5"] == {"timing": "calm", "speed": 0.5}
    assert len(made.conditions) == 4
    with pytest.raises(CheckFailed, match=r"study.yaml:4: conditions.speed.1"):
        study(tmp_path, text.replace("1.0", "3.0"))


def test_a_participant_keeps_the_person_and_repetitions_differ(tmp_path):
    trials = study(tmp_path, GOOD + "repetitions: 2\n").trials()
    own = [trial for trial in trials if trial.participant == "P01"]
    assert len({trial.person_seed for trial in own}) == 1 and len({trial.seed for trial in own}) == 2
    assert {t.seed for t in own if t.condition == "calm"} == {t.seed for t in own if t.condition == "fast"}


def test_a_live_condition_wins_over_the_active_timing():
    base = {
        "timing": "calm",
        "timings": {"calm": {}, "natural": {"handover.reach_ratio": 1.0}},
        "handover": {"drop": 0.1},
    }
    made = with_settings(base, {"timing": "natural", "handover.reach_ratio": 0.8, "handover.retreat": 0.2})
    assert made["timings"]["natural"] == {"handover.reach_ratio": 0.8} and made["timing"] == "natural"
    assert (
        made["handover"] == {"drop": 0.1, "retreat": 0.2} and base["timings"]["natural"]["handover.reach_ratio"] == 1.0
    )
