"""Requests to the contact detector act in the order of their calls, independent of their threads."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest
from coglab_smach.ports.pending import PortError
from coglab_smach.ros import calls, ports


class Detector:
    """Replaces the service. It receives a request when its thread passes its gate, in the order of ``gates``."""

    def __init__(self, monkeypatch):
        self.heard = []
        self.gates = {mode: threading.Event() for mode in ("off", "contact")}
        monkeypatch.setattr(calls.rospy, "resolve_name", lambda name: "/" + name)
        monkeypatch.setattr(calls, "service_answers", lambda name: True)
        monkeypatch.setattr(calls.rospy, "ServiceProxy", lambda name, kind: self.call)
        monkeypatch.setattr(ports, "Newest", lambda *_: None)

    def call(self, request):
        assert self.gates[request.mode].wait(60.0)
        self.heard.append(request.mode)
        return SimpleNamespace(success=True, message="")


def until(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_a_disarm_never_arrives_after_a_later_arm(monkeypatch):
    detector = Detector(monkeypatch)
    port = ports.RosContact()
    detector.gates["contact"].set()
    until(port.arm("contact", 1.0, {}).done)
    port.disarm()  # its thread is slow
    armed = port.arm("contact", 1.0, {})
    time.sleep(0.1)
    assert not armed.done() and detector.heard == ["contact"]
    detector.gates["off"].set()
    until(armed.done)
    assert armed.result() is None and detector.heard == ["contact", "off", "contact"]


def test_a_disarm_also_ends_an_earlier_arm_that_arrives_late(monkeypatch):
    detector = Detector(monkeypatch)
    port = ports.RosContact()
    port.arm("contact", 1.0, {})  # slow
    port.disarm()
    detector.gates["off"].set()
    time.sleep(0.1)
    assert detector.heard == []
    detector.gates["contact"].set()
    until(lambda: detector.heard == ["contact", "off"])


def test_a_request_cancelled_while_it_waits_is_never_sent(monkeypatch):
    detector = Detector(monkeypatch)
    port = ports.RosContact()
    port.arm("contact", 1.0, {})
    second = port.arm("contact", 1.0, {})
    second.cancel()
    until(second.done)
    detector.gates["contact"].set()
    with pytest.raises(PortError, match="given up"):
        second.result()
    until(lambda: detector.heard == ["contact"])
    port.disarm()
    detector.gates["off"].set()
    until(lambda: detector.heard == ["contact", "off"])
