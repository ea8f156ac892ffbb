"""Frame names: the shipped file, and an error message for every fault in a file."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from coglab_perception.frames import FrameNames, FramesError

SOURCES = Path(__file__).resolve().parents[2]
FILE = SOURCES / "coglab_perception" / "config" / "frames.yaml"
GOOD = {"world": "world", "human_hand": "hand", "board": "board", "object": "object_{id}"}


def test_the_file():
    frames = FrameNames.load(str(FILE))
    assert frames == FrameNames("world", "human_hand", "board", "object_{id}")
    assert frames.object_frame("mug") == "object_mug"
    tracked = (
        "human_hand",
        "object_mug",
        "object_",
        "board",
        "world",
        "lwr_flange",
        "human_hand_ahead",
        "object_mug_ahead",
    )
    assert [name for name in tracked if frames.is_tracked(name)] == ["human_hand", "object_mug"]
    assert [frames.object_id(name) for name in tracked] == ["", "mug", "", "", "", "", "", ""]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"board": ""}, "missing: board"),
        ({"palm": "x"}, "unknown: palm"),
        ({"object": "thing"}, "{id}"),
        ({"board": "world"}, "differ"),
        ({"world": "/world"}, "slash"),
        ({"world": 3}, "missing: world"),
    ],
)
def test_bad_frames(tmp_path, change, words):
    path = tmp_path / "frames.yaml"
    path.write_text(yaml.safe_dump(GOOD | change))
    with pytest.raises(FramesError) as caught:
        FrameNames.load(str(path))
    assert words in str(caught.value) and str(path) in str(caught.value)


def test_bad_files(tmp_path):
    with pytest.raises(FramesError, match="none.yaml"):
        FrameNames.load(str(tmp_path / "none.yaml"))
    path = tmp_path / "frames.yaml"
    path.write_text("world: [")
    with pytest.raises(FramesError, match="not YAML"):
        FrameNames.load(str(path))
    with pytest.raises(FramesError, match=r"coglab_perception/config/frames\.yaml"):
        FrameNames.from_mapping(None)
