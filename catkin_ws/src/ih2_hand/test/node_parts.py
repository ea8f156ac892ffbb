"""The hand node without a master, its port leading to the emulated hand."""

from __future__ import annotations

import threading

import pytest
import rospy
from goal_parts import queue_of_goals
from ih2_hand.ros import diagnostics, hand_node


class Topic:
    """A topic that keeps what is published on it."""

    every: dict[str, Topic] = {}

    def __init__(self, name: str, kind: type, **_: object) -> None:
        self.kind, self.told, self.listeners = kind, [], 1
        Topic.every[name] = self

    def publish(self, message: object) -> None:
        assert isinstance(message, self.kind)
        self.told.append(message)

    def get_num_connections(self) -> int:
        return self.listeners


class Report:
    """What one look at the diagnostics says."""

    def __init__(self) -> None:
        self.values: dict[str, str] = {}

    def summary(self, level: int, message: str) -> None:
        self.level, self.message = level, message

    def add(self, key: str, value: str) -> None:
        self.values[key] = value


class Updater:
    """Counts the reports."""

    def __init__(self) -> None:
        self.sent = 0

    def add(self, name: str, fill: object) -> None:
        self.name, self.fill = name, fill

    def setHardwareID(self, name: str) -> None:
        self.hardware = name

    def force_update(self) -> None:
        self.sent += 1


def node_without_master(monkeypatch: pytest.MonkeyPatch, bench: object) -> hand_node.HandNode:
    """A node whose port leads to the emulated hand of `bench`, on its clock."""
    settings: dict[str, object] = {}
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    queue, master = queue_of_goals(monkeypatch)
    monkeypatch.setattr(rospy, "Publisher", Topic)
    monkeypatch.setattr(rospy, "Service", lambda *_: None)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "loginfo", lambda *_: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)
    monkeypatch.setattr(diagnostics, "Updater", Updater)
    monkeypatch.setattr(hand_node, "GoalQueue", lambda owner: queue)
    opened: list[object] = []
    monkeypatch.setattr(hand_node, "HandSerialDriver", lambda port, **_: opened.append(port) or bench.driver)
    asked: dict[str, tuple] = {}

    def read(name: str, kind: type, default: object, *bounds: float, **among: object) -> object:
        asked[name] = (default, *bounds, *among.values())
        return settings.get(name, default)

    monkeypatch.setattr(hand_node.parameters, "read", read)
    node = hand_node.HandNode()
    node.settings, node.asked, node.opened, node.warnings = settings, asked, opened, master.warnings
    return node


def last(name: str = "~hand_status"):
    return Topic.every[name].told[-1]


def report(node) -> Report:
    return node._diagnostics._updater.fill(Report())


def works_off(node) -> None:
    """What was asked of the goals' thread."""
    while not node.goals._mailbox.empty():
        node.goals._handle(node.goals._mailbox.get())


def ends_calibration() -> None:
    for thread in threading.enumerate():
        if thread.name == "calibration":
            thread.join(60.0)


def fails(error: Exception):
    def call(*_: object, **__: object):
        raise error

    return call
