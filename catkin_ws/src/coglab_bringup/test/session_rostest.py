#!/usr/bin/python3
"""A session of the whole system: from the person with all cases of a handover, onto the board, from the board, to the
person. Then every topic and service receives odd messages, and the robot's node is killed while the machine waits: the
reason is published, and the machine can continue."""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rospkg
import rospy
import rostest
from coglab_msgs.msg import MasterState
from handover_rostest import Handover
from odd_messages import OddMessages
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

ORDER = ("put", "take", "exchange_robot_to_human")
THROWN = ("bad callback", "Error processing request")  # how rospy logs an exception in a callback
WORKSPACE = Path(rospkg.RosPack().get_path("coglab_bringup")).parents[1]


def built_for_the_first_demo() -> set[str]:
    """Names of the programs and libraries of the target coglab_system and of its dependencies."""
    needs: dict[str, set[str]] = {}
    for target, needed in re.findall(
        r"^(\S+\.dir)/all: (\S+\.dir)/all$", (WORKSPACE / "build/CMakeFiles/Makefile2").read_text(), re.MULTILINE
    ):
        needs.setdefault(target, set()).add(needed)
    found, waiting = set(), {"coglab_bringup/CMakeFiles/coglab_system.dir"}
    while waiting:
        target = waiting.pop()
        found.add(target)
        waiting |= needs.get(target, set()) - found
    links = [WORKSPACE / "build" / target / "link.txt" for target in found]
    return {re.search(r" -o (\S+)", link.read_text()).group(1).rsplit("/", 1)[-1] for link in links if link.is_file()}


def loaded_by_this_session() -> set[str]:
    """Names of the programs and libraries of this workspace in the memory of its running processes, and of those that
    programs of the launch file load before them."""
    ours = f"ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}\0".encode()
    text = ""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            text += (process / "maps").read_text() if ours in (process / "environ").read_bytes() else ""
        except OSError:  # it has ended, or belongs to another user
            continue
    with tempfile.TemporaryDirectory() as out:
        told = {"LD_DEBUG": "files", "LD_DEBUG_OUTPUT": f"{out}/loaded"}
        dump = ["roslaunch", "--dump-params", "coglab_bringup", "coglab.launch"]
        subprocess.run(dump, env={**os.environ, **told}, stdout=subprocess.DEVNULL, timeout=240, check=True)
        text += "".join(file.read_text(errors="replace") for file in Path(out).iterdir())
    paths = re.findall(rf"{re.escape(str(WORKSPACE / 'devel'))}/[^\s;\]]+", text)
    # A plug-in library is opened as a hidden copy: .NAME.so.LETTERS
    return {re.sub(r"^\.(.+\.so)\.\w+$", r"\1", path.rsplit("/", 1)[-1]) for path in paths}


class Session(Handover):
    """The actions run once, in setUpClass; all cases, also those of Handover, check their results."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.markers = []
        cls.scenes = []
        rospy.Subscriber("/coglab_sim/truth/markers", MarkerArray, cls.markers.append, queue_size=1)
        rospy.Subscriber("/coglab/scene", MarkerArray, cls.scenes.append, queue_size=10)
        cls.outcomes = dict.fromkeys(ORDER, "not reached: an action before it failed")
        first = cls.row, cls.start, cls.end, cls.trial
        for action in ORDER:
            cls.outcomes[action] = cls.perform(action)["outcome"]
            if cls.outcomes[action] != "success":
                break
        cls.row, cls.start, cls.end, cls.trial = first  # for the cases of Handover

    def test_1_onto_the_board(self):
        self.assertEqual(self.outcomes["put"], "success")

    def test_2_from_the_board(self):
        self.assertEqual(self.outcomes["take"], "success")

    def test_3_to_the_person(self):
        self.assertEqual(self.outcomes["exchange_robot_to_human"], "success")

    def test_5_rviz_gets_person_object_cell_goal_path_and_state(self):
        self.assertTrue(self.markers)
        person = {"human_hand", "forearm", "upper_arm", "trunk", "legs", "head"}
        self.assertEqual({m.ns for m in self.markers[-1].markers}, person | {"object"})
        drawn = {m.ns for array in self.scenes for m in array.markers if m.action == Marker.ADD}
        self.assertEqual(drawn, {"pedestal", "board", "goal", "path", "state"})
        self.assertTrue(any(m.points for array in self.scenes for m in array.markers if m.ns == "path"))

    def test_6_only_programs_that_the_first_demo_builds_run(self):
        """After a first ./coglab demo, nothing else of this workspace is built."""
        loaded = loaded_by_this_session()
        self.assertLessEqual(
            {"robot_node", "cell_node", "libcoglab_sim_plant"}, {name.split(".")[0] for name in loaded}
        )
        self.assertEqual(loaded - built_for_the_first_demo(), set())

    def test_y_odd_messages_end_no_node_and_do_not_move_the_arm(self):
        joints, thrown, odd = [], [], OddMessages()

        def on_joints(message):
            if message._connection_header["callerid"] == "/robot":
                joints.append(message.position)

        def on_log(message):
            if message.name in odd.nodes and message.msg.startswith(THROWN):
                thrown.append(f"{message.name}: {message.msg[:200]}")

        rospy.Subscriber("/lwr/joint_states", JointState, on_joints, queue_size=50)
        rospy.Subscriber("/rosout", Log, on_log, queue_size=1000)
        self.assertLessEqual({"/robot", "/coglab", "/ih2_hand", "/perception", "/contact_detector"}, set(odd.nodes))
        odd.send(to_topics=30, to_services=2)
        self.assertEqual((odd.ended, odd.unanswered, thrown), ([], [], []))
        self.assertTrue(joints)
        self.assertLess(np.abs(np.array(joints) - joints[0]).max(), 0.01)

    def test_z_a_killed_robot_node_shows_in_the_hub_and_is_initialised_again(self):
        found = subprocess.run(["rosnode", "info", "/robot"], capture_output=True, text=True, timeout=60, check=True)
        pid = int(next(line.split()[1] for line in found.stdout.splitlines() if line.startswith("Pid:")))
        os.kill(pid, signal.SIGKILL)
        end = time.monotonic() + 60.0
        while not {"initialise", "reset"} & set(self.actions()) and time.monotonic() < end:
            time.sleep(0.2)
        why = rospy.ServiceProxy("/coglab/why", Trigger)().message
        self.assertRegex(why, "silent|blocked|follow")
        self.return_to_hub()
        self.assertIn("exchange_human_to_robot", self.actions())

    @staticmethod
    def actions():
        """Actions that the brain accepts now."""
        return rospy.wait_for_message("/coglab/state", MasterState, 60.0).actions


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "session", Session, sys.argv)
