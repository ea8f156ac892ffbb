"""Names in a running system: required entries of `rostopic list`, `rosservice list`, `rosnode list` and tf2."""

from __future__ import annotations

TOPICS = dict(
    line.split()
    for line in """
        /lwr/joint_states sensor_msgs/JointState
        /lwr/target_joint_states sensor_msgs/JointState
        /lwr/ros_events std_msgs/String
        /lwr/state coglab_msgs/LwrState
        /controller_manager/speed_scale std_msgs/Float64
        /controller_manager/dmp/dmp_goal coglab_msgs/DmpGoal
        /controller_manager/dmp/ik_debug coglab_msgs/IkDebug
        /controller_manager/dmp/feedback coglab_msgs/DmpFeedback
        /controller_manager/ptp/finished_ptp coglab_msgs/FinishedPtp
        /controller_manager/joint_trajectory/follow_joint_trajectory/goal control_msgs/FollowJointTrajectoryActionGoal
        /controller_manager/twist_stream/twist geometry_msgs/TwistStamped
        /controller_manager/pose_stream/pose geometry_msgs/PoseStamped
        /controller_manager/joint_velocity_stream/joint_velocity std_msgs/Float64MultiArray
        /ih2_hand/hand_calibration std_msgs/String
        /ih2_hand/hand_status coglab_msgs/HandStatus
        /ih2_hand/joint_states sensor_msgs/JointState
        /ih2_hand/hand_open/goal coglab_msgs/HandOpenActionGoal
        /ih2_hand/hand_close/goal coglab_msgs/HandCloseActionGoal
        /ih2_hand/hand_preshape/goal coglab_msgs/HandPreshapeActionGoal
        /ih2_hand/hand_preshape_close/goal coglab_msgs/HandPreshapeCloseActionGoal
        /coglab/contact coglab_msgs/Contact
        /coglab/transitions coglab_msgs/Transition
        /coglab/handover/goal coglab_msgs/HandoverActionGoal
        /coglab/handover_results coglab_msgs/HandoverResult
        /coglab/scene visualization_msgs/MarkerArray
        /coglab/smach/container_structure smach_msgs/SmachContainerStructure
        /coglab/smach/container_status smach_msgs/SmachContainerStatus
        /coglab/smach/container_init smach_msgs/SmachContainerInitialStatusCmd
        /joint_states sensor_msgs/JointState
        /tf tf2_msgs/TFMessage
        /diagnostics diagnostic_msgs/DiagnosticArray
    """.strip().splitlines()
)
MANAGER = "load_controller list_controllers switch_controller get_active_controller speed_scale dmp/load_dmps "
MANAGER += "dmp/execute_dmp dmp/switch_dmp dmp/cancel ptp/add_ptp ptp/cancel"
SERVICES = [f"/controller_manager/{name}" for name in MANAGER.split()]
SERVICES += ["/lwr/command", "/ih2_hand/stop", "/coglab/start", "/coglab/stop"]
SERVICES += [f"/perception/{name}" for name in ("init_vision", "locate_object", "free_places")]
NODES = ["/robot", "/perception", "/motion_recogniser", "/ih2_hand", "/coglab", "/object_database", "/contact_detector"]
NODES += ["/robot_state_publisher", "/joint_state_publisher", "/scene_markers"]
FRAMES = ["world", "lwr_base_link", "lwr_flange", "ih2_palm", "human_hand", "object_mug", "board"]


def missing_names(topics: dict[str, str], services: set[str], nodes: set[str]) -> list[str]:
    """Returns missing names and wrong types in a graph: `topics` with types, `services` and `nodes`, by full name."""
    problems = [
        f"topic {name}: expected {kind}, found {topics.get(name, 'nothing')}"
        for name, kind in TOPICS.items()
        if topics.get(name) != kind
    ]
    problems += [f"service {name} is missing" for name in SERVICES if name not in services]
    return problems + [f"node {name} is missing" for name in NODES if name not in nodes]
