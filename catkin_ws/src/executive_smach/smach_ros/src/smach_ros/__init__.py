"""smach for ROS: states for actions, services and topics, an action server for machines, introspection.

The import connects smach's messages to rospy's loggers. Machines then end when rospy shuts down.

Example::

    import rospy, smach, smach_ros

    rospy.init_node("executive")
    server = smach_ros.IntrospectionServer("executive", machine, "/SM_ROOT")
    server.start()
    outcome = machine.execute()
    server.stop()
"""

import rospy
import smach

from smach_ros.action_server_wrapper import ActionServerWrapper
from smach_ros.condition_state import ConditionState
from smach_ros.introspection import IntrospectionClient, IntrospectionServer
from smach_ros.monitor_state import MonitorState
from smach_ros.service_state import ServiceState
from smach_ros.simple_action_state import SimpleActionState
from smach_ros.util import set_preempt_handler

__all__ = [
    "ActionServerWrapper",
    "ConditionState",
    "IntrospectionClient",
    "IntrospectionServer",
    "MonitorState",
    "ServiceState",
    "SimpleActionState",
    "set_preempt_handler",
]

smach.set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)
smach.set_shutdown_check(rospy.is_shutdown)
