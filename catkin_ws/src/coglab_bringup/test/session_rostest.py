#!/usr/bin/python3
"""A session of the whole system: from the person, with all cases of a handover, onto the board, from the board, to the
person. Then the robot's node is killed while the machine waits: it says so, and can go on."""

import os
import signal
import subprocess
import sys
import time

import rospy
import rostest
from coglab_bringup.handover import READY_LIMIT, ask_for, run_handover
from coglab_bringup.trial_recorder import TrialRecorder
from coglab_msgs.srv import Start
from handover_rostest import Handover
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

ORDER = ("put", "take", "exchange_robot_to_human")


class Session(Handover):
    """The actions run once, in setUpClass; the cases of Handover, too, look at what has happened then."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.markers = []
        cls.scenes = []
        rospy.Subscriber("/coglab_sim/truth/markers", MarkerArray, cls.markers.append, queue_size=1)
        rospy.Subscriber("/coglab/scene", MarkerArray, cls.scenes.append, queue_size=10)
        recorder = TrialRecorder()
        cls.rows = {}
        cls.outcomes = dict.fromkeys(ORDER, "not reached: an action before it failed")
        for action in ORDER:
            cls.rows[action] = run_handover(action, "mug", recorder)[0]
            cls.outcomes[action] = cls.rows[action]["outcome"]
            if cls.outcomes[action] != "success":
                break

    def test_1_onto_the_board(self):
        self.assertEqual(self.outcomes["put"], "success")

    def test_2_from_the_board(self):
        self.assertEqual(self.outcomes["take"], "success")

    def test_3_to_the_person(self):
        self.assertEqual(self.outcomes["exchange_robot_to_human"], "success")

    def test_4_to_the_person_ends_where_their_hand_truly_is(self):
        """The palm's distance and angle to its place before the person's true hand. The arm may stop within
        give.touch_within (0.05 m) of it, as the person comes."""
        row = self.rows["exchange_robot_to_human"]
        self.assertEqual(row["final_error_by"], "truth of the simulated cell", row)
        self.assertEqual([reach["ended"] in ("reached", "met") for reach in row["reaches"]], [True], row)
        self.assertLessEqual(row["final_error_mm"], 60.0)
        self.assertLessEqual(row["final_error_deg"], 10.0)

    def test_5_rviz_gets_person_object_cell_goal_path_and_state(self):
        self.assertTrue(self.markers)
        person = {"human_hand", "forearm", "upper_arm", "trunk", "legs", "head"}
        self.assertEqual({m.ns for m in self.markers[-1].markers}, person | {"object"})
        drawn = {m.ns for array in self.scenes for m in array.markers if m.action == Marker.ADD}
        self.assertEqual(drawn, {"pedestal", "board", "goal", "path", "state"})
        ends = [m.points[-1] for array in self.scenes for m in array.markers if m.ns == "path" and m.points]
        goals = [m.pose.position for array in self.scenes for m in array.markers if m.ns == "goal" and m.color.a > 0]
        self.assertLess(abs(ends[-1].x - goals[-1].x), 0.02, "the path does not lead to the goal")

    def test_z_a_killed_robot_node_shows_in_the_hub_and_is_initialised_again(self):
        found = subprocess.run(["rosnode", "info", "/robot"], capture_output=True, text=True, timeout=20, check=True)
        pid = int(next(line.split()[1] for line in found.stdout.splitlines() if line.startswith("Pid:")))
        os.kill(pid, signal.SIGKILL)
        start = rospy.ServiceProxy("/coglab/start", Start)
        end = time.monotonic() + 30.0
        answer = start("juggle", "")
        waits = ("takes initialise", "takes reset")
        while not any(words in answer.message for words in waits) and time.monotonic() < end:
            time.sleep(0.2)
            answer = start("juggle", "")
        why = rospy.ServiceProxy("/coglab/why", Trigger)().message
        self.assertRegex(why, "robot is silent|arm is blocked|arm does not follow")
        action = "initialise" if "takes initialise" in answer.message else "reset"
        ask_for(action, "", lambda: True, READY_LIMIT)
        end = time.monotonic() + READY_LIMIT
        while "wait_without_object takes" not in answer.message and time.monotonic() < end:
            time.sleep(0.5)
            answer = start("juggle", "")
            if "takes initialise" in answer.message:
                start("initialise", "")
        self.assertIn("wait_without_object takes", answer.message)


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "session", Session, sys.argv)
