"""Tables of the page from topics: corrections per controller, reasons of pauses, and the recogniser's estimate."""

import math
import time

import pytest
from coglab_console.ros import tables
from coglab_msgs.msg import (
    FeedbackControllerState,
    FeedbackControllerStatus,
    FeedbackCorrection,
    FeedbackState,
    FeedbackStatus,
    Recognition,
)
from coglab_py.packages import package_path
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rospy import Time
from std_msgs.msg import Float64
from topics import Topics


@pytest.fixture
def shown(monkeypatch):
    """Tables without a master, their topics, and the documents that they put."""
    topics, documents = Topics(), {}
    monkeypatch.setattr(tables.rospy, "Subscriber", topics)
    return tables.Tables(documents.__setitem__), topics.send, documents


def test_who_changed_what_by_how_much_in_execution_order(shown):
    table, send, documents = shown
    message = FeedbackState(cycle=12)
    message.corrections = [
        FeedbackCorrection(controller="yield", signal="pose/ee", size=0.01234567, angle=0.1234567),
        FeedbackCorrection(controller="limit", signal="velocity/arm", size=2.0),
    ]
    message.states = [
        FeedbackControllerState(controller="yield", names=["force", "on"], values=[3.1234567, 1.0], units=["N", "1"])
    ]
    send("controller_manager/feedback/state", message)
    assert documents["attribution"] == {
        "cycle": 12,
        "rows": [
            {"controller": "yield", "signal": "pose/ee", "size": 0.012346, "angle": 0.12346},
            {"controller": "limit", "signal": "velocity/arm", "size": 2.0, "angle": 0.0},
        ],
        "inside": [{"controller": "yield", "values": [["force", 3.12346, "N"], ["on", 1.0, "1"]]}],
    }


def test_controllers_with_their_pauses_and_recognition_with_its_confidences(shown):
    table, send, documents = shown
    limit = FeedbackControllerStatus(name="limit", stage="joint", paused=True, pause_reasons=["user"], faults=2)
    send("controller_manager/feedback/status", FeedbackStatus(profile="dmp", controllers=[limit]))
    assert documents["feedback"]["profile"] == "dmp"
    (row,) = documents["feedback"]["rows"]
    assert (row["name"], row["stage"], row["paused"], row["reasons"], row["faults"]) == (
        "limit", "joint", True, ["user"], 2
    )  # fmt: skip
    message = Recognition(pattern="high", decided=True, progress=0.456, names=["low", "high"])
    message.probabilities, message.header.stamp = [0.096, 0.904], Time(7, 500_000_000)
    send("perception/recognition", message)
    assert documents["recognition"] == {
        "pattern": "high", "decided": True, "stamp": 7.5, "progress": 0.46, "rows": [["low", 0.1], ["high", 0.9]]
    }  # fmt: skip


def test_overloaded_computer_is_reported_with_many_diagnostics(shown):
    table, send, documents = shown

    def tell(name, level, message):
        send("diagnostics", DiagnosticArray(status=[DiagnosticStatus(name=name, level=level, message=message)]))
        return table.busy(time.monotonic())

    for number in range(200):
        assert tell(f"somebody: part {number}", b"\x01", "worn") == ""
    assert tell("coglab_sim: computer", b"\x00", "in time") == ""
    assert tell("coglab_sim: computer", b"\x01", "too busy") == "too busy"
    assert table.busy(time.monotonic() + 5.0) == ""  # the cell has ended
    send("coglab_sim/real_time_factor", Float64(0.5))
    assert documents["real_time_factor"] == 0.5


def test_latency_and_answer_time_are_those_that_the_bridge_names(shown):
    """The keys of lwr_fri_bridge/src/ros/bridge_diagnostics.cpp; other keys give no number."""
    table, send, _ = shown

    def tell(**values):
        status = DiagnosticStatus(name="lwr: FRI connection", level=b"\x00", message="ok")
        status.values = [KeyValue(key.replace("_", " ") + " (s)", value) for key, value in values.items()]
        send("diagnostics", DiagnosticArray(status=[status]))
        return table.latency, table.answer_time

    assert tell(latency="0.001", mean_answer_time="0.00002", longest_answer_time="0.5") == (0.001, 0.00002)
    assert all(math.isnan(value) for value in tell(delay="0.001", answer_time="0.00002", longest_answer_time="0.5"))
    assert table.diagnostics["lwr: FRI connection"]["message"] == "ok"
    source = package_path("lwr_fri_bridge", "src", "ros", "bridge_diagnostics.cpp").read_text(encoding="utf-8")
    assert '"latency (s)"' in source and '"mean answer time (s)"' in source
