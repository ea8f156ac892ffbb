"""Every state machine on this master, from the topics of smach introspection. Their pickled data is never read."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

from ..scene.graph_layout import Container, Layout, roots

STRUCTURE, STATUS = "/smach/container_structure", "/smach/container_status"
MAIN = "/coglab"
MAX_MACHINES = 12  # besides MAIN
MAX_CONTAINERS = 120
SILENCE = 10.0  # s without a message after which a machine counts as gone; heartbeats come every 2 s


class Machine:
    """One introspection server."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.containers: dict[str, Container] = {}
        self.active: dict[str, list[str]] = {}
        self.last: dict[str, Any] = {}
        self.has_reasons = False  # True if it publishes transitions with outcome and reason, which introspection lacks
        self.heard = time.monotonic()
        self.dirty = True
        self.subscribers: list[rospy.Subscriber] = []


class SmachGraphs:
    """`put(name, value)` gets documents `graph:<machine>`, `active` and `machines`; called from its own threads."""

    def __init__(self, put: Callable[[str, Any], None], say: Callable[[str, str], None]) -> None:
        self._put, self._say = put, say
        self._layout = Layout()
        self._lock = threading.Lock()
        self._machines: dict[str, Machine] = {}
        self._said: set[str] = set()
        threading.Thread(target=self._look, name="smach_topics", daemon=True).start()
        threading.Thread(target=self._draw, name="smach_layout", daemon=True).start()

    def transition(self, path: str, from_state: str, outcome: str, to_state: str, reason: str) -> None:
        """The last transition of the machine that has this container, with its reason."""
        with self._lock:
            for machine in self._machines.values():
                if path in machine.containers:
                    machine.has_reasons = True
                    machine.last = _step(path, from_state, outcome, to_state, reason)
        self._show()

    def _look(self) -> None:
        while not rospy.is_shutdown():
            try:
                topics = rospy.get_published_topics()
            except Exception:  # no master: keep the known machines
                topics = []
            for topic, kind in topics:
                if topic.endswith(STRUCTURE) and kind == "smach_msgs/SmachContainerStructure":
                    self._add(topic.removesuffix(STRUCTURE))
            self._forget()
            time.sleep(2.0)

    def _add(self, name: str) -> None:
        with self._lock:
            if name in self._machines or (len(self._machines) > MAX_MACHINES and name != MAIN):
                return
            machine = self._machines[name] = Machine(name)
        machine.subscribers = [
            rospy.Subscriber(name + STRUCTURE, SmachContainerStructure, self._on_structure, machine, queue_size=200),
            rospy.Subscriber(name + STATUS, SmachContainerStatus, self._on_status, machine, queue_size=200),
        ]

    def _forget(self) -> None:
        now = time.monotonic()
        with self._lock:
            gone = [machine for machine in self._machines.values() if now - machine.heard > SILENCE]
            for machine in gone:
                del self._machines[machine.name]
        for machine in gone:
            for subscriber in machine.subscribers:
                subscriber.unregister()
            self._put(f"graph:{machine.name}", None)
        if gone:
            self._show()

    def _on_structure(self, message: SmachContainerStructure, machine: Machine) -> None:
        edges = zip(message.internal_outcomes, message.outcomes_from, message.outcomes_to, strict=False)
        container = Container(message.path, tuple(message.children), tuple(edges))
        with self._lock:
            machine.heard = time.monotonic()
            known = machine.containers.get(message.path)
            if known == container or (known is None and len(machine.containers) >= MAX_CONTAINERS):
                return
            machine.containers[message.path] = container
            machine.dirty = True

    def _on_status(self, message: SmachContainerStatus, machine: Machine) -> None:
        active = [label for label in message.active_states if label != "None"]
        with self._lock:
            machine.heard = time.monotonic()
            before = machine.active.get(message.path)
            if before == active or (before is None and len(machine.active) >= MAX_CONTAINERS):
                return
            machine.active[message.path] = active
            if before and active and not machine.has_reasons:
                machine.last = _step(message.path, ", ".join(before), "", ", ".join(active), "")
        self._show()

    def _show(self) -> None:
        with self._lock:
            shown = {name: {"active": _active_paths(m), "last": dict(m.last)} for name, m in self._machines.items()}
        self._put("active", shown)

    def _draw(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(0.5)
            with self._lock:
                waiting = [(m, dict(m.containers)) for m in self._machines.values() if m.dirty and m.containers]
                for machine, _ in waiting:
                    machine.dirty = False
            for machine, containers in waiting:
                picture = self._layout.of(containers)
                if picture["problem"] and picture["problem"] not in self._said:
                    self._said.add(picture["problem"])
                    self._say(picture["problem"], "warning")
                self._put(f"graph:{machine.name}", {**picture, "roots": roots(containers)})
            if waiting:
                self._show()


def _step(*values: str) -> dict[str, str]:
    """A transition for the page."""
    return dict(zip(("path", "from", "outcome", "to", "reason"), values, strict=True))


def _active_paths(machine: Machine) -> list[str]:
    """Paths of the active states whose containers are active themselves."""
    found: list[str] = []
    waiting = [path for path in roots(machine.containers)]
    while waiting:
        path = waiting.pop()
        for label in machine.active.get(path, []):
            child = f"{path}/{label}"
            found.append(child)
            if child in machine.containers:
                waiting.append(child)
    return sorted(found)
