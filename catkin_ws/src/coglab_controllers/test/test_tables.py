"""Tables 4, 5 and 6 of D4.10: the printed fields come first and unchanged; additional fields follow."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from coglab_msgs import msg, srv

CONFIG = Path(__file__).resolve().parent.parent / "config" / "controllers.yaml"

# As printed; `int` is int32, `float` is float64, `intinitial_state` lost its space.
DMP = [
    ("primitive_id", "string"),
    ("dmp_ratio", "float64"),
    ("goal_offset", "geometry_msgs/Point"),
    ("orientation_control", "bool"),
    ("target_orientation", "geometry_msgs/Quaternion"),
]
INITIAL = [
    ("initial_state", "int32"),
    ("initial_position", "geometry_msgs/Point"),
    ("initial_velocity", "geometry_msgs/Vector3"),
]
IDS = [("controller_ids", "string[]"), ("controller_types", "string[]")]
SERVICES = {
    "LoadDmps": ([("filename", "string")], [("num_loaded", "int16")]),
    "ExecuteDmp": (DMP[:1] + INITIAL + DMP[1:], []),
    "SwitchDmp": (DMP, []),
    "AddPtp": (
        [("position", "float64[]"), ("max_vel", "float64[]"), ("max_acc", "float64[]")],
        [("status", "int32"), ("ptp_id", "int32")],
    ),
    "LoadController": ([("controller_id", "string"), ("controller_type", "string")], []),
    "ListControllers": ([], IDS),
    "SwitchController": ([("controller_id", "string")], [("controller_type", "string")]),
    "GetActiveController": ([], [("controller_id", "string"), ("controller_type", "string")]),
}
LIMITS = [("goal_region_low", "geometry_msgs/Point"), ("goal_region_high", "geometry_msgs/Point")]
LIMITS += [("goal_retreat", "float64"), ("goal_drop", "float64"), ("goal_approach", "geometry_msgs/Vector3")]
LIMITS += [("arrival_speed", "float64")]
ANSWER = [("success", "bool"), ("reason_code", "uint16"), ("message", "string")]
OURS = {("goal_frame", "string"), *LIMITS, *ANSWER, *IDS}
MESSAGES = {"DmpGoal": [("goal", "geometry_msgs/Point")], "FinishedPtp": [("ptp_id", "int32")]}


def fields(kind: type) -> list[tuple[str, str]]:
    """Names and types of a generated class."""
    return list(zip(kind.__slots__, kind._slot_types, strict=True))


@pytest.mark.parametrize("name", SERVICES)
def test_services_begin_with_the_fields_of_the_table(name: str) -> None:
    service = getattr(srv, name)
    for kind, table in zip((service._request_class, service._response_class), SERVICES[name], strict=True):
        there = fields(kind)
        assert there[: len(table)] == table
        assert set(there[len(table) :]) <= OURS, "what is appended is known and documented"


@pytest.mark.parametrize("name", MESSAGES)
def test_messages_hold_the_fields_of_the_table(name: str) -> None:
    assert [f for f in fields(getattr(msg, name)) if f[0] != "header"] == MESSAGES[name]


def test_states_and_statuses_have_their_numbers() -> None:
    assert (srv.ExecuteDmpRequest.CURRENT, srv.ExecuteDmpRequest.GIVEN) == (0, 1)
    statuses = srv.AddPtpRequest
    assert (statuses.STARTED, statuses.QUEUED, statuses.REJECTED) == (0, 1, 2)


def test_parameters_of_the_tables_are_in_the_parameter_file() -> None:
    parameters = yaml.safe_load(CONFIG.read_text())
    kinds = {
        "pos_clik_gain": float,
        "rot_clik_gain": float,
        "robot_base_frame_name": str,
        "dmp_frame_name": str,
        "enable_ik_debug": bool,
    }
    assert {name: type(parameters["dmp"][name]) for name in kinds} == kinds
    assert (type(parameters["ptp"]["Kp"]), type(parameters["ptp"]["max_queue"])) == (float, int)
    assert type(parameters["cycle_time"]) is float
    text = CONFIG.read_text()
    for optional in ("upper_joint_pos_limit", "lower_joint_pos_limit", "joint_vel_limit"):
        assert optional in text, "optional: named in a comment with its default"
