"""State machines on this master as the page gets them: last transition, reason, and missing data."""

import threading
from types import SimpleNamespace

import pytest
from coglab_console.ros import graph
from coglab_console.ros.graph import SmachGraphs
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from topics import Topics


@pytest.fixture
def machines(monkeypatch):
    """SmachGraphs without a master, with its documents and events; its threads end with the test."""
    over = threading.Event()
    topics, published = Topics(), [("/coglab" + graph.STRUCTURE, "smach_msgs/SmachContainerStructure")]
    master = {"is_shutdown": over.is_set, "get_published_topics": lambda: published, "Subscriber": topics}
    monkeypatch.setattr(graph, "rospy", SimpleNamespace(**master))
    found = SimpleNamespace(documents={}, said=[], send=topics.send)
    found.graphs = SmachGraphs(found.documents.__setitem__, lambda text, level: found.said.append((level, text)))
    assert topics.wait("/coglab" + graph.STATUS, 60.0)
    yield found
    over.set()


def structure(machines, path="/M", children=("A", "B")):
    message = SmachContainerStructure(path=path, children=list(children))
    message.internal_outcomes, message.outcomes_from, message.outcomes_to = ["ok"], ["A"], ["B"]
    machines.send("/coglab" + graph.STRUCTURE, message)


def status(machines, active, path="/M"):
    machines.send("/coglab" + graph.STATUS, SmachContainerStatus(path=path, active_states=[active]))


def last(machines):
    return machines.documents["active"]["/coglab"]["last"]


def test_a_transition_keeps_its_outcome_also_without_a_reason(machines):
    structure(machines)
    status(machines, "A")
    machines.graphs.transition("/M", "A", "ok", "B", "")
    status(machines, "B")  # introspection has the same, without an outcome
    assert last(machines) == {"path": "/M", "from": "A", "outcome": "ok", "to": "B", "reason": ""}
    machines.graphs.transition("/M", "B", "failed", "A", "no contact")
    status(machines, "A")
    assert (last(machines)["outcome"], last(machines)["reason"]) == ("failed", "no contact")


def test_states_are_known_without_published_transitions(machines):
    structure(machines)
    status(machines, "A")
    status(machines, "B")
    status(machines, "A")
    assert (last(machines)["from"], last(machines)["to"], last(machines)["outcome"]) == ("B", "A", "")


def test_number_of_containers_is_bounded(machines):
    for number in range(graph.MAX_CONTAINERS + 30):
        structure(machines, f"/{number}")
        status(machines, "A", f"/{number}")
    active = machines.documents["active"]["/coglab"]["active"]
    assert len(active) == graph.MAX_CONTAINERS and "/0/A" in active
