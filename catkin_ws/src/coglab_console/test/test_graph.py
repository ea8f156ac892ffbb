"""State machines on this master as the page gets them: last transition, reason, and missing data."""

import threading
from types import SimpleNamespace

import pytest
from coglab_console.ros import graph
from coglab_console.ros.graph import Machine, SmachGraphs
from coglab_console.scene.graph_layout import Container
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure


@pytest.fixture
def told(monkeypatch):
    """SmachGraphs without a master, with its documents and events; its threads end with the test."""
    over = threading.Event()
    monkeypatch.setattr(graph, "rospy", SimpleNamespace(is_shutdown=over.is_set, get_published_topics=lambda: []))
    found = SimpleNamespace(documents={}, said=[])
    found.graphs = SmachGraphs(found.documents.__setitem__, lambda text, level: found.said.append((level, text)))
    found.machine = found.graphs._machines["/coglab"] = Machine("/coglab")
    yield found
    over.set()


def structure(told, path="/M", children=("A", "B")):
    message = SmachContainerStructure(path=path, children=list(children))
    message.internal_outcomes, message.outcomes_from, message.outcomes_to = ["ok"], ["A"], ["B"]
    told.graphs._on_structure(message, told.machine)


def status(told, active, path="/M"):
    told.graphs._on_status(SmachContainerStatus(path=path, active_states=[active]), told.machine)


def last(told):
    return told.documents["active"]["/coglab"]["last"]


def test_a_transition_keeps_its_outcome_also_without_a_reason(told):
    structure(told)
    status(told, "A")
    told.graphs.transition("/M", "A", "ok", "B", "")
    status(told, "B")  # introspection tells the same, and knows no outcome
    assert last(told) == {"path": "/M", "from": "A", "outcome": "ok", "to": "B", "reason": ""}
    told.graphs.transition("/M", "B", "failed", "A", "no contact")
    status(told, "A")
    assert (last(told)["outcome"], last(told)["reason"]) == ("failed", "no contact")


def test_states_are_known_without_published_transitions(told):
    structure(told)
    status(told, "A")
    status(told, "B")
    status(told, "A")
    assert (last(told)["from"], last(told)["to"], last(told)["outcome"]) == ("B", "A", "")


def test_containers_and_machines_are_bounded(told):
    for number in range(graph.MAX_CONTAINERS + 30):
        structure(told, f"/{number}")
        status(told, "A", f"/{number}")
    assert len(told.machine.containers) == len(told.machine.active) == graph.MAX_CONTAINERS
    assert told.machine.containers["/0"] == Container("/0", ("A", "B"), (("ok", "A", "B"),))
