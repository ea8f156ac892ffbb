"""A service call cancelled before it was sent never acts, even if its server starts or resumes later."""

from __future__ import annotations

import io
import threading
import time
from types import SimpleNamespace

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import LwrCommand
from coglab_smach.ports.pending import PortError
from coglab_smach.ros import calls


class Server:
    """Replaces the master and a server. ``there``: it is registered. ``thawed``: it accepts connections."""

    def __init__(self, monkeypatch):
        self.there, self.thawed = threading.Event(), threading.Event()
        self.heard = []
        self.answer = SimpleNamespace(success=True, message="done", reason_code=0)
        monkeypatch.setattr(calls.rospy, "resolve_name", lambda name: "/" + name)
        monkeypatch.setattr(calls, "service_answers", lambda name: self.there.is_set())
        monkeypatch.setattr(calls.rospy, "ServiceProxy", lambda name, kind: self.call)

    def call(self, request):
        assert self.thawed.wait(60.0)
        buff = io.BytesIO()
        request.serialize(buff)  # as rospy does when the connection exists
        self.heard.append(request.event)
        return self.answer


def ended(call):
    end = time.monotonic() + 60.0
    while not call.done() and time.monotonic() < end:
        time.sleep(0.005)
    return call.done()


@pytest.mark.parametrize("late", ["there", "thawed"])
def test_a_call_cancelled_before_it_was_sent(monkeypatch, late):
    server = Server(monkeypatch)
    if late == "thawed":
        server.there.set()
    call = calls.call("lwr/command", LwrCommand, event="reset")
    time.sleep(0.05)
    call.cancel()
    server.there.set()
    server.thawed.set()
    assert ended(call)
    with pytest.raises(PortError) as raised:
        call.result()
    assert raised.value.code == ReasonCode.CANCELLED
    assert server.heard == []


def test_the_thread_of_a_cancelled_call_without_server_ends(monkeypatch):
    """It ends before its time limit: otherwise repeated calls would collect threads."""
    server = Server(monkeypatch)
    call = calls.call("lwr/command", LwrCommand, wait=20.0, event="reset")
    time.sleep(0.05)
    call.cancel()
    assert ended(call) and server.heard == []
    with pytest.raises(PortError) as raised:
        call.result()
    assert raised.value.code == ReasonCode.CANCELLED
    until = time.monotonic() + 60.0
    while any(t.name == "call:service lwr/command" for t in threading.enumerate()):
        assert time.monotonic() < until, "its thread must end"
        time.sleep(0.01)


def test_a_refusal_has_its_code(monkeypatch):
    server = Server(monkeypatch)
    server.there.set()
    server.thawed.set()
    server.answer = SimpleNamespace(success=False, message="hold is latched", reason_code=ReasonCode.HELD)
    call = calls.call("lwr/command", LwrCommand, event="start")
    assert ended(call) and server.heard == ["start"]
    with pytest.raises(PortError, match="/lwr/command.*hold is latched") as raised:
        call.result()
    assert raised.value.code == ReasonCode.HELD


def test_a_server_that_never_starts(monkeypatch):
    Server(monkeypatch)
    call = calls.call("lwr/command", LwrCommand, wait=0.1, event="start")
    assert ended(call)
    with pytest.raises(PortError, match="lwr/command") as raised:
        call.result()
    assert raised.value.code == ReasonCode.NODE_SILENT
