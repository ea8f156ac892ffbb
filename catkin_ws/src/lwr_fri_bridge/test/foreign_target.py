#!/usr/bin/python3
"""Publishes target velocities that nobody asked for, 0.2 rad/s on A6, until it is ended."""

import rospy
from sensor_msgs.msg import JointState

if __name__ == "__main__":
    rospy.init_node("foreign_target")
    target = rospy.Publisher("/lwr/target_joint_states", JointState, queue_size=1)
    rate = rospy.Rate(50)
    while not rospy.is_shutdown():
        message = JointState(velocity=[0.0] * 6 + [0.2])
        message.header.stamp = rospy.Time.now()
        target.publish(message)
        rate.sleep()
