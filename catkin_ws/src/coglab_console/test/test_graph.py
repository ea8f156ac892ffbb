"""State machines on this master as the page gets them: last transition, reason, and missing data."""

import threading
from types import SimpleNamespace

import pytest
from coglab_console.ros import graph
from coglab_console.ros.graph import SmachGraphs
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from topics import Topics


@pytest.fixture
def told(monkeypatch):
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


def structure(told, path="/M", children=("A", "B")):
    message = SmachContainerStructure(path=path, children=list(children))
    message.internal_outcomes, message.outcomes_from, message.outcomes_to = ["ok"], ["A"], ["B"]
    told.send("/coglab" + graph.STRUCTURE, message)


def status(told, active, path="/M"):
    told.send("/coglab" + graph.STATUS, SmachContainerStatus(path=path, active_states=[active]))


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


def test_number_of_containers_is_bounded(told):
    for number in range(graph.MAX_CONTAINERS + 30):
        structure(told, f"/{number}")
        status(told, "A", f"/{number}")
    active = told.documents["active"]["/coglab"]["active"]
    assert len(active) == graph.MAX_CONTAINERS and "/0/A" in active
