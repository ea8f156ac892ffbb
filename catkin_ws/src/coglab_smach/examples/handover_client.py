#!/usr/bin/python3
"""Request a handover with actionlib and the messages of CogLab. Usage: handover_client.py ACTION OBJECT"""

import sys

import actionlib
import rospy
from coglab_msgs.msg import HandoverAction, HandoverGoal

rospy.init_node("handover_client", anonymous=True)
client = actionlib.SimpleActionClient("coglab/handover", HandoverAction)
client.wait_for_server()
result = None
goal = HandoverGoal(action=sys.argv[1], object_id=sys.argv[2], wait=60.0, time_limit=45.0, condition="example")
rospy.on_shutdown(lambda: result or client.cancel_goal())  # Ctrl-C stops the arm
client.send_goal(goal, feedback_cb=lambda now: print(f"{now.elapsed:5.1f} s  {now.phase}  {now.waits_for}"))
client.wait_for_result()
result = client.get_result()
print(f"{result.outcome} after {result.duration:.1f} s {result.reason}; in the hand: {result.holding or 'nothing'}")
sys.exit(0 if result.success else 1)
