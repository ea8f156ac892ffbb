#!/usr/bin/python3
"""Introspection on the wire, between real nodes."""

import base64
import os
import pickle
import sys
import threading
import time
import unittest

import rospy
import smach
import smach_ros
import smach_ros.introspection
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)
from smach_ros.introspection import INIT_TOPIC, STATUS_TOPIC, STRUCTURE_TOPIC
from smach_ros.plain_data import decode, encode

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from states_support import LIMIT, wait_for

NEVER = os.path.join(os.environ.get("ROS_HOME", "/tmp"), "smach_never")


class Bomb:
    """Unpickling it leaves a file."""

    def __reduce__(self):
        return os.system, (f"touch {NEVER}",)


class Viewer:
    """Collects what a server sends."""

    def __init__(self, server):
        self.statuses, self.structures = [], []
        self.first_beat = None
        self._subs = [
            rospy.Subscriber(server + STATUS_TOPIC, SmachContainerStatus, self.on_status),
            rospy.Subscriber(server + STRUCTURE_TOPIC, SmachContainerStructure, self.structures.append),
        ]

    def on_status(self, message):
        if message.info == "HEARTBEAT" and self.first_beat is None:
            self.first_beat = time.monotonic()
        self.statuses.append(message)

    def of(self, path):
        return [status for status in self.statuses if status.path == path]

    def infos(self, path):
        return [status.info for status in self.of(path)]

    def close(self):
        for sub in self._subs:
            sub.unregister()


class Gate(smach.State):
    """Waits until the test opens it."""

    def __init__(self):
        super().__init__(["done", "failed"])
        self.inside, self.open = threading.Event(), threading.Event()

    def execute(self, ud):
        self.inside.set()
        self.open.wait(LIMIT)
        return "done"


def build():
    """A machine with a nested one, a concurrence and an iterator."""
    gate = Gate()
    inner = smach.StateMachine(["done"])
    with inner:
        smach.StateMachine.add("GATE", gate, {"failed": "GATE"})
    both = smach.Concurrence(["done"], "done", outcome_map={"done": {"X": "ok"}})
    with both:
        smach.Concurrence.add("X", smach.CBState(lambda ud: "ok", outcomes=["ok"]))
    each = smach.Iterator(["done"], [], [], [1, 2], exhausted_outcome="done")
    with each:
        state = smach.CBState(lambda ud: "go", outcomes=["go"])
        smach.Iterator.set_contained_state("ITEM", state, loop_outcomes=["go"])
    root = smach.StateMachine(["end"])
    root.userdata.count = 3
    root.userdata.lock = threading.Lock()
    with root:
        smach.StateMachine.add("INNER", inner, {"done": "BOTH"})
        smach.StateMachine.add("BOTH", both, {"done": "EACH"})
        smach.StateMachine.add("EACH", each, {"done": "end"})
    return root, gate


class TestIntrospection(unittest.TestCase):
    count = 0

    def setUp(self):
        smach_ros.introspection.WELCOME_DELAY = 0.02  # most tests need not wait as long as a viewer
        type(self).count += 1
        self.name = f"/server_{self.count}"
        self.root, self.gate = build()
        self.viewer = Viewer(self.name)
        self.server = smach_ros.IntrospectionServer(self.name, self.root, "/SM_ROOT")

    def tearDown(self):
        self.gate.open.set()
        self.server.stop()
        self.viewer.close()

    def start(self):
        self.server.start()
        self.assertTrue(wait_for(lambda: len(self.viewer.of("/SM_ROOT/EACH")) > 0))

    def test_structure_of_every_container(self):
        self.start()
        paths = {"/SM_ROOT", "/SM_ROOT/INNER", "/SM_ROOT/BOTH", "/SM_ROOT/EACH"}
        self.assertTrue(wait_for(lambda: {m.path for m in self.viewer.structures} == paths))
        by_path = {message.path: message for message in self.viewer.structures}
        root = by_path["/SM_ROOT"]
        self.assertEqual(root.children, ["INNER", "BOTH", "EACH"])
        self.assertEqual(root.container_outcomes, ["end"])
        edges = list(zip(root.internal_outcomes, root.outcomes_from, root.outcomes_to, strict=True))
        self.assertEqual(edges, [("done", "INNER", "BOTH"), ("done", "BOTH", "EACH"), ("done", "EACH", "end")])
        inner = by_path["/SM_ROOT/INNER"]
        self.assertEqual(inner.outcomes_to, ["None", "GATE"], "falls through")
        self.assertEqual(by_path["/SM_ROOT/BOTH"].outcomes_to, ["done"])
        self.assertEqual(by_path["/SM_ROOT/EACH"].internal_outcomes, ["go"])
        self.assertEqual(root.header.frame_id, "")
        self.assertLess(abs((rospy.Time.now() - root.header.stamp).to_sec()), LIMIT)

    def test_a_proxy_shows_one_container_alone(self):
        proxy = smach_ros.introspection.ContainerProxy(
            self.name, self.root, "/SM_ROOT", update_rate=rospy.Duration(0.5)
        )
        proxy.start()
        try:
            self.assertTrue(wait_for(lambda: len(self.viewer.structures) >= 2))
            self.gate.open.set()
            self.root.execute()
            self.assertTrue(wait_for(lambda: "END end" in self.viewer.infos("/SM_ROOT")))
        finally:
            proxy.stop()
        self.assertEqual({m.path for m in self.viewer.structures + self.viewer.statuses}, {"/SM_ROOT"})

    def test_user_data_and_what_cannot_be_pickled(self):
        self.start()
        status = self.viewer.of("/SM_ROOT")[-1]
        raw = base64.b64decode(status.local_data, validate=True)
        self.assertEqual(raw[:2], b"\x80\x02")
        data = pickle.loads(raw)  # as a viewer does
        self.assertEqual(data["count"], 3)
        self.assertEqual(data["lock"], repr(self.root.userdata.lock))

    def test_a_status_at_each_transition_and_at_start_and_end(self):
        self.start()
        self.viewer.statuses.clear()
        self.gate.open.set()
        self.assertEqual(self.root.execute(), "end")
        self.assertTrue(wait_for(lambda: "END end" in self.viewer.infos("/SM_ROOT")))
        statuses = [s for s in self.viewer.of("/SM_ROOT") if s.info != "HEARTBEAT"]
        active = [s.active_states for s in statuses]
        self.assertEqual(active, [["INNER"], ["BOTH"], ["EACH"], ["EACH"], ["None"]])
        for path, idle in (("INNER", ["None"]), ("BOTH", []), ("EACH", [])):
            seen = [s for s in self.viewer.of(f"/SM_ROOT/{path}") if s.info != "HEARTBEAT"]
            self.assertTrue(seen[0].info.startswith("START"), path)
            self.assertEqual(seen[-1].active_states, idle, f"{path} looks idle at once")
        self.assertEqual(statuses[0].initial_states, ["INNER"])

    def test_a_container_that_ends_with_an_error_looks_idle(self):
        def broken(ud):
            raise ValueError("broken")

        machine = smach.StateMachine(["done"])
        with machine:
            smach.StateMachine.add("A", smach.CBState(broken, outcomes=["done"]))
        self.server.clear()
        self.server.construct(self.name, machine, "/OTHER")
        self.server.start()
        self.assertTrue(wait_for(lambda: self.viewer.of("/OTHER")))
        with self.assertRaises(smach.InvalidUserCodeError):
            machine.execute()
        self.assertTrue(wait_for(lambda: "END None" in self.viewer.infos("/OTHER")))
        self.assertEqual(self.viewer.of("/OTHER")[-1].active_states, ["None"])

    def test_one_thread_per_server_and_nothing_left_by_stop(self):
        self.viewer.close()
        time.sleep(0.2)
        before = set(threading.enumerate())
        server = smach_ros.IntrospectionServer("/quiet", self.root, "/SM_ROOT")
        server.start()
        ours = set(threading.enumerate()) - before
        self.assertEqual([t.name for t in ours if "introspection" in t.name], ["smach_introspection:/quiet"])
        server.stop()
        self.assertFalse([t for t in threading.enumerate() if "introspection:/quiet" in t.name])
        self.assertNotIn("/quiet" + STATUS_TOPIC, [name for name, _ in rospy.get_published_topics()])

    def test_stop_sends_what_is_left(self):
        self.start()
        self.gate.open.set()
        self.root.execute()
        self.server.stop()
        self.assertTrue(wait_for(lambda: "END end" in self.viewer.infos("/SM_ROOT")))

    def test_client_finds_servers(self):
        self.start()
        self.assertIn(self.name, smach_ros.IntrospectionClient().get_servers())

    def test_client_sets_initial_state(self):
        self.start()
        ud = smach.UserData()
        ud.count, ud.raw = 7, b"\x01"
        client = smach_ros.IntrospectionClient()
        self.assertTrue(client.set_initial_state(self.name, "/SM_ROOT", ["EACH"], ud, rospy.Duration(LIMIT)))
        self.assertEqual(self.root.get_initial_states(), ["EACH"])
        self.assertEqual((self.root.userdata.count, self.root.userdata.raw), (7, b"\x01"))
        self.assertTrue(wait_for(lambda: "REMOTE_INIT" in self.viewer.infos("/SM_ROOT")))
        self.assertEqual(self.root.execute(), "end")
        self.assertFalse(self.gate.inside.is_set())

    def test_client_unknown_state_or_path(self):
        self.start()
        client = smach_ros.IntrospectionClient()
        for path, states in (("/SM_ROOT", ["NOWHERE"]), ("/NOWHERE", ["EACH"])):
            self.assertFalse(client.set_initial_state(self.name, path, states, timeout=rospy.Duration(1.0)))
        self.assertEqual(self.root.get_initial_states(), ["INNER"])

    def test_hostile_commands_change_nothing_and_run_nothing(self):
        self.start()
        pub = rospy.Publisher(self.name + INIT_TOPIC, SmachContainerInitialStatusCmd, queue_size=1000)
        self.assertTrue(wait_for(lambda: pub.get_num_connections() > 0))

        def b64(raw):
            return base64.b64encode(raw).decode()

        texts = [b64(pickle.dumps({"count": Bomb()}, p)) for p in range(6)]
        texts += [
            b64(b"cos\nsystem\n(S'touch " + NEVER.encode() + b"'\ntR."),
            "no base64!",
            "A" * 100_000,
        ]
        texts += [b64(b"\x80\x02}r\xff\xff\xff\x7f."), b64(pickle.dumps([1], 2)), b64(b"." * 50)]
        for text in texts:
            pub.publish("/SM_ROOT", ["EACH"], text)
        pub.publish("/SM_ROOT", ["NOWHERE"] * 10_000, encode({}))
        pub.publish("/SM_ROOT", ["a\x00\n\N{SNOWMAN}"], encode({}))
        pub.publish("/SM_ROOT" * 1000, ["EACH"], encode({}))
        pub.publish("/SM_ROOT", ["BOTH"], encode({"last": 1}))  # a good one behind them
        self.assertTrue(wait_for(lambda: self.root.get_initial_states() == ["BOTH"]))
        self.assertFalse(os.path.exists(NEVER))
        self.assertEqual((self.root.userdata.count, self.root.userdata.last), (3, 1))
        self.assertTrue(wait_for(lambda: decode(self.viewer.of("/SM_ROOT")[-1].local_data).get("last") == 1))

    def test_bursts_lose_nothing(self):
        machine = smach.StateMachine(["end"])
        with machine:
            for i in range(400):
                state = smach.CBState(lambda ud: "ok", outcomes=["ok"])
                smach.StateMachine.add(f"S{i}", state, {"ok": f"S{i + 1}" if i < 399 else "end"})
        self.server.clear()
        self.server.construct(self.name, machine, "/LONG")
        self.server.start()
        self.assertTrue(wait_for(lambda: self.viewer.of("/LONG")))
        self.viewer.statuses.clear()
        machine.execute()
        self.assertTrue(wait_for(lambda: "END end" in self.viewer.infos("/LONG")))
        active = [s.active_states[0] for s in self.viewer.of("/LONG") if not s.info.startswith(("TERM", "HEART"))]
        self.assertEqual(active, [f"S{i}" for i in range(400)] + ["None"])


if __name__ == "__main__":
    import rostest

    rospy.init_node("introspection_rostest")
    rostest.rosrun("smach_ros", "introspection", __name__)
