"""Names, modules, signatures, and what importing smach_ros does. No roscore."""

import itertools
import random
import subprocess
import sys
from types import SimpleNamespace

import pytest
import smach
from smach_ros import introspection
from smach_ros.introspection import WELCOME_DELAY, IntrospectionServer, _Beat, _Viewers


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


class Topic:
    """Stands for a publisher; connections are names, and what each was sent is kept with its time."""

    def __init__(self):
        self.impl, self.connections, self.now, self.sent = self, [], 0.0, {}
        self.acquire = self.release = lambda: None

    def get_num_connections(self):
        return len(self.connections)

    def publish(self, _message, connection):
        self.sent.setdefault(connection, []).append(self.now)


@pytest.mark.parametrize("seed", range(20))
def test_new_viewers_get_their_first_heartbeat_after_a_delay(seed, monkeypatch):
    draw = random.Random(seed)
    comes = sorted(draw.uniform(0.0, 30.0) for _ in range(draw.choice((2, 3, 40))))
    topic, server = Topic(), IntrospectionServer("/server", smach.StateMachine(["end"]), "/SM_ROOT")
    monkeypatch.setattr(introspection.time, "monotonic", lambda: topic.now)
    server._watched, server._beat = [SimpleNamespace(path="/SM_ROOT", structure=lambda: None)], _Beat(0.0, 2.0)
    server._structure_pub, server._viewers = topic, [_Viewers(topic)]
    for step in range(4000):
        topic.now = 0.01 * step
        for i, when in enumerate(comes):
            if i not in topic.connections and when <= topic.now < when + 20.0:
                topic.connections.append(i)
                server._welcome()
            if i in topic.connections and topic.now >= when + 20.0:
                topic.connections.remove(i)
        if server._is_due(topic.now):
            server._publish_heartbeats(topic.now)
    for i, when in enumerate(comes):
        sent = topic.sent.get(i, [])
        assert WELCOME_DELAY <= sent[0] - when <= WELCOME_DELAY + 0.02, "its first beat"
        end = min(when + 20.0, 40.0)
        gaps = [after - before for before, after in itertools.pairwise([*sent, end])]
        assert max(gaps) <= 2.02, "a beat was left out"
        assert sent[-1] < end
