"""The scripts without a master: what they end with, and what they pass on."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import rosgraph
import rospy
from ih2_hand.ros import hand_node
from std_msgs.msg import String

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


def run(monkeypatch: pytest.MonkeyPatch, name: str, *arguments: str) -> int:
    """Exit status of a script."""
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")
    return ended.value.code


@pytest.fixture
def ros(monkeypatch):
    """A master that is there; `lines` come on every topic, and `done` tells what the script did."""
    ros = SimpleNamespace(done=[], lines=["one", "two", "three"])

    def subscribe(topic: str, kind: type, show: object, queue_size: int) -> None:
        ros.done.append(topic)
        ros.show = show

    def spin() -> None:
        for line in ros.lines:
            ros.show(String(line))

    monkeypatch.setattr(rosgraph, "is_master_online", lambda: True)
    monkeypatch.setattr(rospy, "init_node", lambda name, **_: ros.done.append(f"node {name}"))
    monkeypatch.setattr(rospy, "Subscriber", subscribe)
    monkeypatch.setattr(rospy, "spin", spin)
    monkeypatch.setattr(rospy, "signal_shutdown", lambda why: ros.done.append("shut down"))
    monkeypatch.setattr(rospy, "logfatal", lambda text, error: ros.done.append(text % error))
    return ros


def test_the_trace_of_a_hand_without_a_master_is_told_at_once(monkeypatch, capsys):
    monkeypatch.setattr(rosgraph, "is_master_online", lambda: False)
    assert run(monkeypatch, "hand_trace.py") == 3
    assert "no ROS master answers" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "topic", "printed", "ends"),
    [
        ((), "ih2_hand/trace", 3, False),
        (("--count", "2"), "ih2_hand/trace", 2, True),
        (("--count", "4", "__name:=x"), "ih2_hand/trace", 3, False),
        (("--topic", "other/trace"), "other/trace", 3, False),
    ],
)
def test_the_trace_is_printed_up_to_a_count(monkeypatch, capsys, ros, arguments, topic, printed, ends):
    assert run(monkeypatch, "hand_trace.py", *arguments) == 0
    assert capsys.readouterr().out.split() == ros.lines[:printed]
    assert ros.done[:2] == ["node hand_trace", topic] and ("shut down" in ros.done) is ends


def test_bytes_are_explained_without_a_time_or_a_master(monkeypatch, capsys):
    assert run(monkeypatch, "hand_trace.py", "--hex", "4C 41") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines] == [[">", "4c", "OpenALL"], [">", "41", "StopALL"]]
    assert run(monkeypatch, "hand_trace.py", "--hex", "") == 0 and capsys.readouterr().out == ""


@pytest.mark.parametrize("error", [None, ValueError("rate"), TypeError("kind"), OSError("no file")])
def test_the_node_runs_or_says_why_it_does_not(monkeypatch, ros, error):
    def node() -> SimpleNamespace:
        if error:
            raise error
        return SimpleNamespace(run=lambda: ros.done.append("ran") or 0)

    monkeypatch.setattr(hand_node, "HandNode", node)
    monkeypatch.setattr("ih2_hand.ros.shutdown.end_quietly", lambda: None)
    assert run(monkeypatch, "hand_node.py") == (1 if error else 0)
    assert ros.done == ["node ih2_hand", f"hand node: {error}" if error else "ran"]
