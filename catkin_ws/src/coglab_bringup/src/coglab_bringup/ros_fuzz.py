"""Random messages for every topic that a node of ours listens to and for every service that it offers.

Malformed by design, so that no request is valid by chance: each message holds at least one odd value. That is a float
that is not finite or near 1e308 (one in each array at least), else an odd string; every third message with a time has
an odd stamp instead, the rest of it being fine (joint states with all joints of the arm). Only messages without any
such field are valid by nature (`Empty`, `Trigger`, integers and flags alone), and those whose odd values are all
documented (fuzz_rules.py) are allowed: both are sent as well and counted apart. What they ask for is no motion of the
arm; but `stop` would refuse every motion from then on: left out.
"""

from __future__ import annotations

import math
import random
import re
import threading
import time
from collections import Counter
from collections.abc import Collection, Container
from dataclasses import dataclass, field
from typing import Any
from xmlrpc.client import ServerProxy

import genpy
import rosgraph
import roslib.message
import rospy
import rosservice

from coglab_bringup.fuzz_rules import EXCLUDED, ODD, excluded

FOREIGN = ("/rosout", "/joint_state_publisher", "/robot_state_publisher", "/rviz")
LEFT_OUT = ("/coglab/stop",)
FLOATS = (*EXCLUDED, 5e-324, 0.0, -0.0, -1.0, 1e9, -1e9)
WORDS = (0, 1, 999_999_999, 1_000_000_000, 2**31 - 1, 2**31, 2**32 - 1)
JOINTS = ("lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6")
KNOWN = (
    "",
    "mug",
    "human_hand",
    "object_mug",
    "board",
    "world",
    "lwr_base_link",
    "dmp",
    "ptp",
    "reach_human",
    "joint_limits",
    "lwr_a1",
    "lwr_a2",
    "/coglab_master",
    "reach_goal",
)
INTEGER = re.compile(r"(u?)int(8|16|32|64)$")
BOUND = re.compile(r"(.*)\[(\d*)\]$")


MALFORMED, ODD_STAMP, VALID = "malformed", "odd stamp, the rest fine", "valid by nature"
ALLOWED = "odd, as its definition allows"
LAST_WAIT = 60.0
"""s after the campaign for an answer that is still missing: late, or lost"""


class Generator:
    """Messages from a seed."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def message(self, kind: Any, stamp_only: bool = False) -> tuple[Any, str]:
        """A message of a class, and what it is: MALFORMED, ODD_STAMP (if `stamp_only` and it has a time; malformed in
        nothing else), ALLOWED by the words of its definition, or VALID by nature."""
        message = kind()
        leaves: list[tuple[Any, Any, str]] = []  # who holds it, attribute or index, type
        stamp_only = stamp_only and has_time(kind)
        self._fill(message, leaves, stamp_only)
        floats, strings, times = (
            [leaf for leaf in leaves if leaf[2] in names]
            for names in (("float32", "float64"), ("string",), ("time", "duration"))
        )
        if stamp_only and times:
            holder, name, _ = self.random.choice(times)
            put(holder, name, self._odd_time(kind=genpy.Time))
            return message, ODD_STAMP
        if floats:
            holder, name, of = self.random.choice(floats)
            put(holder, name, self.random.choice(EXCLUDED[:3] if of == "float32" else EXCLUDED))
        elif strings:
            holder, name, _ = self.random.choice(strings)
            put(holder, name, self.random.choice(ODD))
        else:
            return message, VALID
        return message, MALFORMED if any(excluded(*leaf) for leaf in leaves) else ALLOWED

    def _fill(self, message: Any, leaves: list, fine: bool) -> None:
        joints = fine and message._type == "sensor_msgs/JointState"
        for name, of in zip(message.__slots__, message._slot_types, strict=True):
            bound = BOUND.match(of)
            if not bound:
                self._set(message, name, of, leaves, fine)
                continue
            element, fixed = bound.group(1), bound.group(2)
            if joints:
                setattr(message, name, list(JOINTS) if element == "string" else [0.05] * len(JOINTS))
                continue
            count = int(fixed) if fixed else self.random.choice((1, 1, 2, 3, 5, 7, 7, 8, 1000))
            if element in ("uint8", "char"):
                setattr(message, name, bytes(self.random.randrange(256) for _ in range(count)))
                continue
            values: list[Any] = [None] * min(count, int(fixed) if fixed else (30 if "/" in element else count))
            setattr(message, name, values)
            for i in range(len(values)):
                self._set(values, i, element, leaves, fine)
            if (
                values and not fine and element in ("float32", "float64")
            ):  # no array is a command of the joints by chance
                values[self.random.randrange(len(values))] = self.random.choice(EXCLUDED[:3])

    def _set(self, holder: Any, name: Any, of: str, leaves: list, fine: bool) -> None:
        draw, integer = self.random, INTEGER.match(of)
        if of in ("float32", "float64"):
            pool = (0.0, 0.5, 1.0) if fine else FLOATS
            fits = pool if of == "float64" else [v for v in pool if not abs(v) > 1e38 or math.isinf(v)]
            value: Any = draw.choice(fits)
        elif of == "string":
            value = draw.choice(KNOWN if fine or draw.random() < 0.5 else ODD)
        elif of in ("time", "duration"):
            value = self._odd_time(genpy.Time if of == "time" else genpy.Duration)
        elif of == "bool":
            value = draw.random() < 0.5
        elif integer or of in ("byte", "char"):
            signed, bits = not (integer and integer.group(1)) and of != "char", int(integer.group(2)) if integer else 8
            low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
            value = draw.choice((low, high, 0, 1, min(high, 77)))
        else:
            value = roslib.message.get_message_class("std_msgs/Header" if of == "Header" else of)()
            self._fill(value, leaves, fine)
            if fine and of.endswith("Quaternion"):
                value.x, value.y, value.z, value.w = 0.0, 0.0, 0.0, 1.0
        put(holder, name, value)
        leaves.append((holder, name, of))

    def _odd_time(self, kind: Any) -> Any:
        value = kind()
        if self.random.random() < 0.3 and kind is genpy.Time:  # ahead of the clock, or behind
            now = time.time() + self.random.choice((-1e4, -0.3, 0.06, 10.0, 1e4))
            value.secs, value.nsecs = int(now), int(1e9 * (now % 1.0))
            return value
        most = 2**32 if kind is genpy.Time else 2**31
        value.secs, value.nsecs = (self.random.choice([w for w in WORDS if w < most]) for _ in range(2))
        return value


def put(holder: Any, name: Any, value: Any) -> None:
    """Sets an element of a list or a field of a message."""
    if isinstance(holder, list):
        holder[name] = value
    else:
        setattr(holder, name, value)


def types_in(kind: Any) -> list[str]:
    """The types of all fields of a message class, those of its parts included."""
    found: list[str] = []
    for of in kind._slot_types:
        found.append(of)
        base = BOUND.match(of)
        name = base.group(1) if base else of
        if "/" in name or name == "Header":
            part = roslib.message.get_message_class("std_msgs/Header" if name == "Header" else name)
            found += types_in(part)
    return found


def has_time(kind: Any) -> bool:
    """Whether a stamp can be odd."""
    return "time" in types_in(kind)


@dataclass
class Report:
    """What was sent and what came of it."""

    sent: Counter = field(default_factory=Counter)  # MALFORMED, ODD_STAMP, ALLOWED, VALID
    odd_stamps: Counter = field(default_factory=Counter)  # messages of ODD_STAMP, by topic or service
    answers: Counter = field(default_factory=Counter)  # of services: success, refused, error, no answer
    accepted: Counter = field(default_factory=Counter)  # malformed requests answered with success, by service
    ended: list[str] = field(default_factory=list)  # nodes
    unanswered: Counter = field(default_factory=Counter)  # requests not answered in time, by service
    late: dict[str, float] = field(default_factory=dict)  # s, longest answer of those that came all the same
    lost: list[str] = field(default_factory=list)  # services that never answered


class Fuzz:
    """The nodes of a running system and what they listen to."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.master = rosgraph.Master(rospy.get_name())
        publishers, subscribers, services = self.master.getSystemState()
        everybody = {node for _, nodes in (*publishers, *subscribers, *services) for node in nodes}
        self.nodes = sorted(everybody - {*FOREIGN, rospy.get_name()})
        ours = set(self.nodes)
        kinds = dict(self.master.getTopicTypes())
        heard = {name for name, nodes in subscribers if ours & set(nodes)} | {"/tf", "/tf_static"}
        self.topics = {name: roslib.message.get_message_class(kinds[name]) for name in sorted(heard) if name in kinds}
        names = sorted(name for name, nodes in services if ours & set(nodes))
        self.left_out = [name for name in names if name in LEFT_OUT]
        names = [name for name in names if name not in LEFT_OUT]
        self.services = {name: rosservice.get_service_class_by_name(name) for name in names}
        self.published = sorted(name for name, nodes in publishers if ours & set(nodes))
        self.pids = {node: self.pid(node) for node in self.nodes}
        self.report = Report()
        self._runs = 0
        self._asked: dict[str, float] = {}
        self._lock = threading.Lock()

    def pid(self, node: str) -> int:
        """Process of a node; 0 if it does not answer."""
        try:
            answer: Any = ServerProxy(self.master.lookupNode(node)).getPid(rospy.get_name())
            code, _, pid = answer
        except Exception:  # of whatever kind: no answer
            return 0
        return int(pid) if code == 1 else 0

    def talking(self, seconds: float, wanted: set[str] | None = None) -> set[str]:
        """Topics of ours on which a node of ours publishes within this time; ends early with all that are wanted."""
        heard: set[str] = set()
        ours = set(self.nodes)

        def note(message: Any, name: str) -> None:
            if message._connection_header.get("callerid") in ours:
                heard.add(name)

        listeners = [rospy.Subscriber(name, rospy.AnyMsg, note, name, queue_size=1) for name in self.published]
        end = time.monotonic() + seconds
        while time.monotonic() < end and (wanted is None or not heard.issuperset(wanted)):
            time.sleep(0.1)
        for listener in listeners:
            listener.unregister()
        return heard

    def run(self, per_topic: int, per_service: int, limit: float, spared: Container[str] = ()) -> Report:
        """Sends so many messages to each; `limit` s for each answer of a service. None to services that are spared.

        What a second run finds is added to the report of the first.
        """
        self._runs += 1
        called = {name: kind for name, kind in self.services.items() if name not in spared}
        threads = [
            threading.Thread(target=self._call, args=(name, kind, per_service, limit), daemon=True)
            for name, kind in called.items()
        ]
        for thread in threads:
            thread.start()
        self._publish(per_topic)
        end = time.monotonic() + limit + per_service * 0.5
        for thread in threads:
            thread.join(max(0.0, end - time.monotonic()))
        alive = [name for thread, name in zip(threads, called, strict=True) if thread.is_alive()]
        # Late or lost? Nobody asks anything else now.
        end = time.monotonic() + LAST_WAIT
        while time.monotonic() < end and any(self._waits(name) > limit for name in alive):
            time.sleep(0.5)
        lost = [name for name in alive if self._waits(name) > limit]
        self.report.lost += lost
        self.report.unanswered.update(lost)
        self.report.ended = [node for node in self.nodes if self.pid(node) != self.pids[node]]
        return self.report

    def _publish(self, count: int) -> None:
        generator = Generator(self.seed + 1000 * (self._runs - 1))
        publishers = {name: rospy.Publisher(name, kind, queue_size=200) for name, kind in self.topics.items()}
        time.sleep(0.7)  # for the subscribers to connect
        for number in range(count):
            for name, publisher in publishers.items():
                message, what = generator.message(self.topics[name], number % 3 == 0)
                publisher.publish(message)
                self._note(name, what)
                time.sleep(0.0005)
        time.sleep(0.5)
        for publisher in publishers.values():
            publisher.unregister()

    def _call(self, name: str, kind: Any, count: int, limit: float) -> None:
        generator = Generator(self.seed + hash_of(name) + 1000 * (self._runs - 1))
        proxy = rospy.ServiceProxy(name, kind)
        for number in range(count):
            request, what = generator.message(kind._request_class, number % 3 == 0)
            started = self._asked[name] = time.monotonic()
            try:
                answer = proxy(request)
                success = getattr(answer, "success", None)
                verdict = "success" if success else "refused" if success is not None else "answered"
            except Exception:  # an error of the service, or a request that cannot be serialised
                verdict = "error"
            del self._asked[name]
            took = time.monotonic() - started
            self._note(name, what)
            with self._lock:
                if took > limit:
                    self.report.unanswered[name] += 1
                    self.report.late[name] = max(took, self.report.late.get(name, 0.0))
                self.report.answers[verdict] += 1
                if verdict == "success" and what not in (ALLOWED, VALID):
                    self.report.accepted[name] += 1

    def _note(self, name: str, what: str) -> None:
        with self._lock:
            self.report.sent[what] += 1
            self.report.odd_stamps[name] += what == ODD_STAMP

    def _waits(self, name: str) -> float:
        """s for which the request that a service has now is under way; 0 if it has none."""
        started = self._asked.get(name)
        return 0.0 if started is None else time.monotonic() - started


def explained(silent: Collection[str], said: dict[str, tuple[float, str]], now: float, within: float) -> dict[str, str]:
    """Silent topics whose node says why, with its words. `said`: of each, when it said so last, and the words; they
    count for `within` s, in which a node that still has that reason says so again."""
    return {name: said[name][1] for name in sorted(silent) if name in said and now - said[name][0] <= within}


def hash_of(name: str) -> int:
    """The same number for the same name in every run."""
    return sum(i * ord(c) for i, c in enumerate(name, 1))


ARM = frozenset({"/lwr/command", "/controller_manager/load_controller"})
WHOLE = ARM | {
    "/coglab/start",
    "/object_database/get_object",
    "/perception/locate_object",
    "/contact_detector/arm",
    "/coglab_sim/cell/fault",
    "/ih2_hand/stop",
}
"""services that are there when an arm with its controllers is up, and when the whole system is"""


def settle(limit: float, wanted: Collection[str] = WHOLE) -> None:
    """Waits until the nodes of the system have registered what they offer: nothing new for 1 s, the last ones there.

    Raises RuntimeError naming what is missing.
    """
    master, end, since, known = rosgraph.Master(rospy.get_name()), time.monotonic() + limit, time.monotonic(), None
    while time.monotonic() < end:
        state = master.getSystemState()
        if state != known:
            known, since = state, time.monotonic()
        missing = set(wanted) - {name for name, _ in state[2]}
        if not missing and time.monotonic() - since > 1.0:
            return
        time.sleep(0.2)
    raise RuntimeError(f"not up within {limit:.0f} s: {', '.join(sorted(missing)) or 'the system does not settle'}")
