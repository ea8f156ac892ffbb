"""The client of actions, without a master."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import actionlib
import pytest
from actionlib.simple_action_client import SimpleGoalState
from coglab_py.action_client import ActionClient


@pytest.fixture(name="quick")
def quick_server(monkeypatch):
    """A client whose goals end before they are completely sent. Yields the client."""
    threads = []

    def send(goal, transition, feedback):
        handle = SimpleNamespace(
            get_comm_state=lambda: actionlib.CommState.DONE, get_goal_status=lambda: 0, get_result=lambda: None
        )
        threads.append(threading.Thread(target=transition, args=(handle,)))
        threads[-1].start()
        threads[-1].join(0.3)
        return handle

    connection = SimpleNamespace(send_goal=send, ns="/name")
    monkeypatch.setattr(actionlib.simple_action_client, "ActionClient", lambda name, action: connection)
    yield ActionClient("/name", None)
    for thread in threads:
        thread.join(60.0)


def test_a_result_during_send_goal_is_not_missed(quick):
    ended = threading.Event()
    quick.send_goal("goal", done_cb=lambda status, result: ended.set())
    assert ended.wait(60.0) and quick.simple_state == SimpleGoalState.DONE
