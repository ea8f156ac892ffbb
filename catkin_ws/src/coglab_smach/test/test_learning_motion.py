"""Learning the thresholds of the moving arm: where they are to be written is judged before anybody gathers, and what
was gathered is not thrown away because of a disk."""

import importlib.util
import threading
from pathlib import Path
from unittest.mock import MagicMock

import pytest
import rospy
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import LearnMotionRequest
from coglab_py.pace import Pace
from coglab_smach.contact.learning import MotionRecorder, unwritable
from coglab_smach.contact.motion_thresholds import Thresholds
from coglab_trials.world_ports import THRESHOLDS

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "contact_detector_node.py"
BEGIN, END = LearnMotionRequest(gather=True), LearnMotionRequest(gather=False)


@pytest.fixture
def node(tmp_path, monkeypatch):
    """The node's part that learns, without ROS; what is learnt are the shipped thresholds."""
    spec = importlib.util.spec_from_file_location("contact_detector_node", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.ContactDetectorNode.__new__(module.ContactDetectorNode)
    made.pace, made.last_stamp = Pace(), rospy.Time()
    made.lock, made.recorder, made.moving = threading.Lock(), None, MagicMock()
    made.learnt_file = str(tmp_path / "learnt.yaml")
    monkeypatch.setattr(MotionRecorder, "learn", lambda self: Thresholds.load(THRESHOLDS))
    return made


def answered(node, request):
    """(success, code, sentence)"""
    answer = node.on_learn_motion(request)
    return answer.success, answer.reason_code, answer.message


def test_what_is_learnt_is_written_and_used(node):
    assert answered(node, BEGIN)[:2] == (True, ReasonCode.NONE)
    success, code, sentence = answered(node, END)
    assert (success, code) == (True, ReasonCode.NONE) and node.learnt_file in sentence
    assert Thresholds.load(Path(node.learnt_file)).limit == Thresholds.load(THRESHOLDS).limit
    assert node.moving.use.called and node.recorder is None
    assert answered(node, END)[1] == ReasonCode.NOTHING_RUNS


def test_without_a_file_nothing_is_gathered(node):
    node.learnt_file = ""
    success, code, sentence = answered(node, BEGIN)
    assert (success, code, node.recorder) == (False, ReasonCode.BAD_FILE, None)
    assert "~learnt_file" in sentence and "contact_learnt_file:=" in sentence


@pytest.mark.parametrize("place, words", [("", "is a folder"), ("none/learnt.yaml", "is not there")])
def test_a_file_that_cannot_be_is_refused_before_anything_is_gathered(node, tmp_path, place, words):
    node.learnt_file = str(tmp_path / place)
    success, code, sentence = answered(node, BEGIN)
    assert (success, code, node.recorder) == (False, ReasonCode.BAD_FILE, None)
    assert words in sentence and str(tmp_path) in sentence and "\n" not in sentence


def test_a_refusal_leaves_what_is_being_gathered(node, tmp_path):
    answered(node, BEGIN)
    gathering, node.learnt_file = node.recorder, str(tmp_path)
    assert answered(node, BEGIN)[1] == ReasonCode.BAD_FILE
    assert node.recorder is gathering


def test_what_was_gathered_outlives_a_file_that_was_not_written(node, tmp_path):
    """The folder is gone meanwhile: it can be made again, the motions cannot."""
    node.learnt_file = str(tmp_path / "gone" / "learnt.yaml")
    (tmp_path / "gone").mkdir()
    answered(node, BEGIN)
    gathering = node.recorder
    (tmp_path / "gone").rmdir()
    success, code, sentence = answered(node, END)
    assert (success, code) == (False, ReasonCode.BAD_FILE) and "call again" in sentence
    assert node.recorder is gathering and not node.moving.use.called
    (tmp_path / "gone").mkdir()
    assert answered(node, END)[:2] == (True, ReasonCode.NONE)


def test_a_file_or_folder_that_may_not_be_written(tmp_path, monkeypatch):
    file = tmp_path / "learnt.yaml"
    assert unwritable(str(file)) == ""
    monkeypatch.setattr("os.access", lambda path, mode: False)
    assert "may not be written" in unwritable(str(file)), "the folder"
    file.write_text("")
    assert f"{file} may not be written" in unwritable(str(file))
