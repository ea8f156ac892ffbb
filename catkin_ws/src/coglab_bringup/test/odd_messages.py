"""Unexpected messages for every subscribed topic and every service of a running system."""

from __future__ import annotations

import math
import random
import re
import threading
import time
from collections.abc import Iterator
from typing import Any
from xmlrpc.client import ServerProxy

import genpy
import rosgraph
import roslib.message
import rospy
import rosservice

FOREIGN = ("/rosout", "/joint_state_publisher", "/robot_state_publisher", "/rviz")
LEFT_OUT = ("/coglab/stop",)  # would block every later motion
FLOATS = (math.nan, math.inf, -math.inf, 3e38, -3e38)
TEXTS = (" ", "\0", "a\0b", "../../etc/passwd", "%s%n%x", "☃" * 50, "{[}:", "//x", "-1", "nan", "\x1b[2J", "x" * 5000)
KNOWN = ("mug", "human_hand", "object_mug", "world", "dmp", "ptp", "reach_human", "lwr_a1")
SECONDS = (0, 1, 2**31 - 1, 2**32 - 1)
ARRAY = re.compile(r"(.*)\[(\d*)\]$")
INTEGER = re.compile(r"(u?)int(8|16|32|64)$")


def fill(message: Any, draw: random.Random, fine: bool) -> Any:
    """Fill with floats that are not finite or huge, and odd texts. `fine`: harmless ones, but odd times."""
    for name, of in zip(message.__slots__, message._slot_types, strict=True):
        array = ARRAY.match(of)
        if not array:
            setattr(message, name, value_of(of, draw, fine))
            continue
        element, fixed = array.groups()
        count = int(fixed) if fixed else draw.choice((1, 2, 7, 8, 20))
        values = [value_of(element, draw, fine) for _ in range(count)]
        setattr(message, name, bytes(v % 256 for v in values) if element in ("uint8", "char") else values)
    return message


def has_time(kind: Any) -> bool:
    """True if a message type contains a time or a duration, at any depth."""
    for of in kind._slot_types:
        name = (ARRAY.match(of) or [of, of])[1]
        if name in ("time", "duration", "Header", "std_msgs/Header"):
            return True
        if "/" in name and has_time(roslib.message.get_message_class(name)):
            return True
    return False


def odd_messages(kind: Any, count: int, draw: random.Random) -> Iterator[Any]:
    """Yields ``count`` messages. Of types with a time, every third message has only an odd time."""
    timed = has_time(kind)
    for number in range(count):
        yield fill(kind(), draw, timed and number % 3 == 0)


def value_of(of: str, draw: random.Random, fine: bool) -> Any:
    """A value of this type."""
    integer = INTEGER.match(of)
    if of in ("float32", "float64"):
        return draw.choice((0.0, 0.5, 1.0)) if fine else draw.choice(FLOATS)
    if of == "string":
        return draw.choice(KNOWN if fine else TEXTS)
    if of in ("time", "duration"):
        seconds = draw.choice(SECONDS) if fine else draw.choice(SECONDS[:3])
        ahead = int(time.time() + draw.choice((-1e4, 10.0, 1e4)))
        return genpy.Time(draw.choice((seconds, ahead))) if of == "time" else genpy.Duration(draw.choice(SECONDS[:3]))
    if of == "bool":
        return draw.random() < 0.5
    if integer or of in ("byte", "char"):
        bits = int(integer.group(2)) if integer else 8
        signed = of != "char" and not (integer and integer.group(1))
        return draw.choice((-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1))
    return fill(roslib.message.get_message_class("std_msgs/Header" if of == "Header" else of)(), draw, fine)


class OddMessages:
    """Sends odd messages. `ended`: nodes that died. `unanswered`: services without a response within `limit` s."""

    def __init__(self) -> None:
        self.master = rosgraph.Master(rospy.get_name())
        publishers, subscribers, services = self.master.getSystemState()
        everybody = {node for _, nodes in (*publishers, *subscribers, *services) for node in nodes}
        self.nodes = sorted(everybody - {*FOREIGN, rospy.get_name()})
        kinds, ours = dict(self.master.getTopicTypes()), set(self.nodes)
        heard = {name for name, nodes in subscribers if ours & set(nodes)} | {"/tf", "/tf_static"}
        self.topics = {name: roslib.message.get_message_class(kinds[name]) for name in sorted(heard) if name in kinds}
        names = sorted(name for name, nodes in services if ours & set(nodes) and name not in LEFT_OUT)
        self.services = {name: rosservice.get_service_class_by_name(name) for name in names}
        self.processes = {node: self._process(node) for node in self.nodes}
        self.ended: list[str] = []
        self.unanswered: list[str] = []

    def _process(self, node: str) -> int:
        try:
            return int(ServerProxy(self.master.lookupNode(node)).getPid(rospy.get_name())[2])
        except Exception:  # any error: no answer
            return 0

    def send(self, to_topics: int, to_services: int, limit: float = 180.0) -> None:
        """Send these numbers of messages to each topic and to each service."""
        threads = {
            name: threading.Thread(target=self._call, args=(name, kind, to_services), daemon=True)
            for name, kind in self.services.items()
        }
        for thread in threads.values():
            thread.start()
        publishers = {name: rospy.Publisher(name, kind, queue_size=200) for name, kind in self.topics.items()}
        time.sleep(0.7)  # for the subscribers to connect
        messages = {name: odd_messages(kind, to_topics, random.Random(name)) for name, kind in self.topics.items()}
        for _ in range(to_topics):
            for name, publisher in publishers.items():
                publisher.publish(next(messages[name]))
            time.sleep(0.05)
        end = time.monotonic() + limit
        for thread in threads.values():
            thread.join(max(0.0, end - time.monotonic()))
        for publisher in publishers.values():
            publisher.unregister()
        self.unanswered = [name for name, thread in threads.items() if thread.is_alive()]
        self.ended = [node for node in self.nodes if self._process(node) != self.processes[node]]

    def _call(self, name: str, kind: Any, each: int) -> None:
        proxy = rospy.ServiceProxy(name, kind)
        for request in odd_messages(kind._request_class, each, random.Random(name)):
            try:
                proxy(request)
            except Exception:  # an error response, or a request that cannot be serialised
                continue
