"""The names that a running system shows: what `rostopic list`, `rosservice list`, `rosnode list` and tf2 must hold."""

from __future__ import annotations

# name: type; relative names are joined to the namespace above them
TOPICS: dict[str, dict[str, str]] = {
    "/lwr": {
        "joint_states": "sensor_msgs/JointState",
        "target_joint_states": "sensor_msgs/JointState",
        "ros_events": "std_msgs/String",
        "state": "coglab_msgs/LwrState",
    },
    "/controller_manager": {
        "speed_scale": "std_msgs/Float64",
        "dmp/dmp_goal": "coglab_msgs/DmpGoal",
        "dmp/ik_debug": "coglab_msgs/IkDebug",
        "dmp/feedback": "coglab_msgs/DmpFeedback",
        "ptp/finished_ptp": "coglab_msgs/FinishedPtp",
    },
    "/ih2_hand": {
        "hand_calibration": "std_msgs/String",
        "hand_status": "coglab_msgs/HandStatus",
        "joint_states": "sensor_msgs/JointState",
        "hand_open/goal": "coglab_msgs/HandOpenActionGoal",
        "hand_close/goal": "coglab_msgs/HandCloseActionGoal",
        "hand_preshape/goal": "coglab_msgs/HandPreshapeActionGoal",
        "hand_preshape_close/goal": "coglab_msgs/HandPreshapeCloseActionGoal",
    },
    "/coglab": {
        "contact": "coglab_msgs/Contact",
        "transitions": "coglab_msgs/Transition",
        "scene": "visualization_msgs/MarkerArray",
        "smach/container_structure": "smach_msgs/SmachContainerStructure",
        "smach/container_status": "smach_msgs/SmachContainerStatus",
        "smach/container_init": "smach_msgs/SmachContainerInitialStatusCmd",
    },
    "/": {
        "joint_states": "sensor_msgs/JointState",
        "tf": "tf2_msgs/TFMessage",
        "diagnostics": "diagnostic_msgs/DiagnosticArray",
    },
}
SERVICES: dict[str, list[str]] = {
    "/lwr": ["command"],
    "/controller_manager": [
        "load_controller", "list_controllers", "switch_controller", "get_active_controller", "speed_scale",
        "dmp/load_dmps", "dmp/execute_dmp", "dmp/switch_dmp", "dmp/cancel", "ptp/add_ptp",
        "ptp/cancel",
    ],
    "/ih2_hand": ["stop"],
    "/coglab": ["start", "stop"],
    "/perception": ["init_vision", "locate_object", "free_places"],
}  # fmt: skip
NODES = [
    "/robot",
    "/perception",
    "/motion_recogniser",
    "/ih2_hand",
    "/coglab",
    "/object_database",
    "/contact_detector",
    "/robot_state_publisher",
    "/joint_state_publisher",
    "/scene_markers",
]
FRAMES = ["world", "lwr_base_link", "lwr_flange", "ih2_palm", "human_hand", "object_mug", "board"]


def joined(namespace: str, name: str) -> str:
    """A full name from a namespace and a name in it."""
    return namespace.rstrip("/") + "/" + name


def missing_names(topics: dict[str, str], services: set[str], nodes: set[str]) -> list[str]:
    """What is missing, or has another type, in a graph: `topics` with types, `services` and `nodes`, by full name."""
    problems = []
    for namespace, names in TOPICS.items():
        for name, kind in names.items():
            full = joined(namespace, name)
            if topics.get(full) != kind:
                problems.append(f"topic {full}: expected {kind}, found {topics.get(full, 'nothing')}")
    wanted = [joined(namespace, name) for namespace, names in SERVICES.items() for name in names]
    problems += [f"service {name} is missing" for name in wanted if name not in services]
    problems += [f"node {name} is missing" for name in NODES if name not in nodes]
    return problems
