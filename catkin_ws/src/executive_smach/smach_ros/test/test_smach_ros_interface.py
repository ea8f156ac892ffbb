"""Names, modules, signatures, and what importing smach_ros does. No roscore."""

import itertools
import random
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest
import smach
from smach_ros import introspection
from smach_ros.introspection import STRUCTURE_TOPIC, WELCOME_DELAY, IntrospectionServer


def test_importing_smach_ros_redirects_log_and_shutdown_check():
    code = (
        "import rospy, smach, smach_ros;"
        "assert (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr) =="
        " (rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr);"
        "assert smach.is_shutdown is rospy.is_shutdown"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)


def test_the_core_does_not_import_ros():
    code = "import sys, smach; assert not {'rospy', 'genpy', 'roslib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)


END = 40.0
"""s after which the node ends"""


class Topic:
    """Stands for a publisher; connections are names, and what each was sent is kept with its time."""

    def __init__(self, cell, name, listener):
        self.impl, self.connections, self.cell, self.name, self.sent = self, [], cell, name, {}
        self.listener = listener
        self.acquire = self.release = lambda: None

    def get_num_connections(self):
        return len(self.connections)

    def publish(self, _message, connection):
        self.sent.setdefault(connection, []).append(self.cell.now)


class Cell:
    """Time, topics and viewers of a server. Its thread runs within start(), and time passes while it waits."""

    def __init__(self, monkeypatch, comes):
        self.comes, self.steps, self.now, self.notified, self.topics = comes, 0, 0.0, False, {}
        rospy = introspection.rospy
        monkeypatch.setattr(introspection, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(
            introspection,
            "threading",
            SimpleNamespace(Condition=lambda: self, Lock=threading.Lock, Thread=self.thread),
        )
        monkeypatch.setattr(rospy, "Publisher", self.publisher)
        monkeypatch.setattr(rospy, "Subscriber", lambda *_: None)
        monkeypatch.setattr(rospy, "is_shutdown", lambda: self.now >= END)
        monkeypatch.setattr(rospy.Time, "now", rospy.Time)

    def thread(self, target, name, daemon):
        assert daemon, "it must not block the end of the process"
        return SimpleNamespace(start=target)

    def publisher(self, name, kind, queue_size, subscriber_listener):
        self.topics[name] = Topic(self, name, subscriber_listener)
        return self.topics[name]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def notify(self):
        self.notified = True

    def wait(self, timeout):
        end, self.notified = self.now + timeout, False
        while not self.notified and self.now < end:
            self.step()

    def step(self):
        """10 ms pass. Each viewer stays for 20 s."""
        self.steps += 1
        self.now = 0.01 * self.steps
        topic = self.topics["/server" + STRUCTURE_TOPIC]
        for i, when in enumerate(self.comes):
            if i not in topic.connections and when <= self.now < when + 20.0:
                topic.connections.append(i)
                topic.listener.peer_subscribe(topic.name, None, None)
            if i in topic.connections and self.now >= when + 20.0:
                topic.connections.remove(i)


@pytest.mark.parametrize("seed", range(20))
def test_new_viewers_get_their_first_heartbeat_after_a_delay(seed, monkeypatch):
    draw = random.Random(seed)
    comes = sorted(draw.uniform(0.0, 30.0) for _ in range(draw.choice((2, 3, 40))))
    cell = Cell(monkeypatch, comes)
    IntrospectionServer("/server", smach.StateMachine(["end"]), "/SM_ROOT").start()
    topic = cell.topics["/server" + STRUCTURE_TOPIC]
    for i, when in enumerate(comes):
        sent = topic.sent.get(i, [])
        assert WELCOME_DELAY <= sent[0] - when <= WELCOME_DELAY + 0.02, "its first beat"
        end = min(when + 20.0, END)
        gaps = [after - before for before, after in itertools.pairwise([*sent, end])]
        assert max(gaps) <= 2.02, "a beat was left out"
        assert sent[-1] < end


def test_a_restarted_server_publishes_each_status_once(monkeypatch):
    sent, rospy = [], introspection.rospy
    topic = SimpleNamespace(
        impl=SimpleNamespace(connections=[]),
        get_num_connections=lambda: 1,
        publish=sent.append,
        unregister=lambda: None,
    )
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: topic)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_: topic)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(rospy.Time, "now", rospy.Time)
    machine = smach.StateMachine(["end"])
    with machine:
        smach.StateMachine.add("WORK", smach.CBState(lambda _: "end", outcomes=["end"]))
    server = IntrospectionServer("/server", machine, "/SM_ROOT")
    for _ in range(2):
        server.start()
        sent.clear()
        machine.execute()
        server.stop()
    assert [message.info for message in sent].count("END end") == 1
    machine.execute()
    server.start()
    server.stop()
    assert [message.info for message in sent].count("END end") == 1, "a stopped server follows nothing"
