#!/usr/bin/python3
"""Moves the arm with standard ROS messages alone: a trajectory by FollowJointTrajectory, then a stream of twists.

    roslaunch coglab_controllers robot.launch arm:=ideal          # or ./coglab launch
    rosservice call /lwr/command start
    python3 standard_client.py

A planner would send the first part, a joystick the second. The program imports no module of CogLab.
"""

from __future__ import annotations

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

TRAJECTORY = "controller_manager/joint_trajectory/follow_joint_trajectory"
TWIST = "controller_manager/twist_stream/twist"


class Client:
    """A client of the arm; the node has to be initialised."""

    def __init__(self) -> None:
        self.trajectories = actionlib.SimpleActionClient(TRAJECTORY, FollowJointTrajectoryAction)
        self.twists = rospy.Publisher(TWIST, TwistStamped, queue_size=1)
        if not self.trajectories.wait_for_server(rospy.Duration(60.0)):
            raise RuntimeError(f"no action server on {TRAJECTORY} within 60 s; is joint_trajectory loaded?")

    def joints(self) -> dict[str, float]:
        """The measured joints, rad, by name."""
        state = rospy.wait_for_message("lwr/joint_states", JointState, 60.0)
        return dict(zip(state.name, state.position, strict=False))

    def goal(self, waypoints: list[tuple[float, dict[str, float]]]) -> FollowJointTrajectoryGoal:
        """A goal through waypoints: (s from the start, {joint: rad}); omitted joints do not move."""
        now = self.joints()
        goal = FollowJointTrajectoryGoal()
        goal.trajectory.joint_names = sorted(now)
        for seconds, wanted in waypoints:
            point = JointTrajectoryPoint(positions=[wanted.get(name, now[name]) for name in sorted(now)])
            point.time_from_start = rospy.Duration.from_sec(seconds)
            goal.trajectory.points.append(point)
        return goal

    def follow(self, goal: FollowJointTrajectoryGoal, limit: float = 60.0) -> FollowJointTrajectoryResult:
        """Executes a goal and waits for its end, at most `limit` s."""
        self.trajectories.send_goal(goal)
        if not self.trajectories.wait_for_result(rospy.Duration(limit)):
            self.trajectories.cancel_goal()
            raise RuntimeError(f"the trajectory did not end within {limit} s")
        return self.trajectories.get_result()

    def twist(self, linear: tuple[float, float, float], frame: str = "ih2_palm", seconds: float = 1.0) -> None:
        """Streams one twist (m/s, axes of `frame`) at 100 Hz. The stream has to be open."""
        rate = rospy.Rate(100)
        message = TwistStamped()
        message.header.frame_id = frame
        message.twist.linear.x, message.twist.linear.y, message.twist.linear.z = linear
        for _ in range(int(100 * seconds)):
            message.header.stamp = rospy.Time.now()
            self.twists.publish(message)
            rate.sleep()


def main() -> None:
    """Turns the wrist back and forth, then moves the palm up by 5 cm."""
    rospy.init_node("standard_client")
    client = Client()
    wrist = client.joints()["lwr_a6"]
    result = client.follow(client.goal([(1.0, {"lwr_a6": wrist + 0.3}), (2.0, {"lwr_a6": wrist})]))
    print("trajectory:", result.error_code, result.error_string or "successful")
    print('open the stream: rosservice call /controller_manager/twist_stream/start_motion "{}"; then press Enter')
    input()
    client.twist((0.0, 0.0, 0.05), "lwr_base_link")


if __name__ == "__main__":
    main()
