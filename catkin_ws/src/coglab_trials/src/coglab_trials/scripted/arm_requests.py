"""What the controller manager refuses of an arm, for the kinematic cell: PortError with its code, and in its words.

The checks are those of the manager's load, of the point-to-point plug-in and of the DMP plug-in, in their order.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from functools import lru_cache

import coglab_controllers as cc
import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_py.yaml_file import read
from coglab_smach.kinematics.reachability import default_arm, joint_limits
from coglab_smach.ports.interfaces import DmpRequest
from coglab_smach.ports.pending import PortError

TYPES = ("coglab/DmpController", "coglab/PtpController")
PROFILES = ("dmp", "dmp_compliant", "ptp")
"""of ctrl_more/config/feedback.yaml"""
TOLERANCE = 0.002
"""rad, of a posture that was reached"""
SLOWEST = 1e-4
"""rad/s"""
REACH_MARGIN = 0.5
"""m by which a goal in a frame may lie outside the workspace: it may come in"""
LONGEST_APPROACH = 0.3
"""m"""
NORM = 1e-3
"""how far the norm of a quaternion may be from 1"""


@lru_cache(maxsize=1)
def _workspace() -> cc.Workspace:
    block = read(package_path("coglab_controllers", "config", "controllers.yaml")).value["workspace"]
    names = ("box_min", "box_max", "base_centre", "base_radius", "max_stretch")
    return cc.Workspace(cc.WorkspaceParameters(**{name: block[name] for name in names}))


@lru_cache(maxsize=1)
def _position_margin() -> float:
    """rad, that no posture comes nearer to the end of a joint's range."""
    return TOLERANCE + float(
        read(package_path("lwr_description", "config", "joint_limits.yaml")).value["position_margin"]
    )


def _refuse(wrong: bool, code: int, sentence: str) -> None:
    if wrong:
        raise PortError(sentence, code=code)


def check_load(controller_id: str, controller_type: str, loaded: Container[str]) -> None:
    """As load_controller refuses."""
    _refuse(
        re.fullmatch("[A-Za-z][A-Za-z0-9_]{0,47}", controller_id) is None,
        ReasonCode.INVALID_ARGUMENT,
        f"controller_id '{controller_id}': expected up to 48 letters, digits and '_', beginning with a letter",
    )
    _refuse(
        controller_id in loaded,
        ReasonCode.INVALID_ARGUMENT,
        f"controller_id '{controller_id}' is in use; choose another id, or go on with the loaded one",
    )
    _refuse(
        controller_type not in TYPES,
        ReasonCode.UNKNOWN_NAME,
        f"controller_type '{controller_type}' is unknown; motion controllers: {', '.join(TYPES)}",
    )


def read_library(filename: str) -> list[str]:
    """Ids of the primitives in a file, and as load_dmps refuses."""
    library = cc.Library()
    try:
        library.load(filename)
    except cc.LibraryError as error:
        raise PortError(str(error), code=ReasonCode.BAD_FILE) from None
    return list(library.ids())


def check_profile(profile: str) -> None:
    """As feedback/apply_profile refuses."""
    known = ", ".join(PROFILES)
    _refuse(profile not in PROFILES, ReasonCode.UNKNOWN_NAME, f"there is no profile '{profile}'; there are: {known}")


def _joints(field: str, values: Sequence[float], least: np.ndarray, most: np.ndarray, unit: str) -> None:
    names = default_arm().joint_names
    _refuse(
        len(values) != len(names),
        ReasonCode.INVALID_ARGUMENT,
        f"{field} has {len(values)} numbers; expected {len(names)}, in the order {' '.join(names)}",
    )
    for name, value, low, high in zip(names, values, least, most, strict=True):
        _refuse(
            not low <= value <= high,
            ReasonCode.OUT_OF_RANGE if np.isfinite(value) else ReasonCode.INVALID_ARGUMENT,
            f"{field} of {name} is {value:g} {unit}; expected {low:g} to {high:g}",
        )


def check_ptp(position: Sequence[float], max_velocity: Sequence[float], fastest: Sequence[float]) -> None:
    """As add_ptp refuses. ``fastest``: rad/s, limits in force."""
    limits, margin = joint_limits(), _position_margin()
    lowest, highest = np.asarray(limits.lower_position), np.asarray(limits.upper_position)
    _joints("position", position, lowest + margin, highest - margin, "rad")
    if len(max_velocity):
        _joints("max_vel", max_velocity, np.full(7, SLOWEST), np.asarray(fastest), "rad/s")
    hand = default_arm().fk(np.asarray(position, dtype=float))[0]
    _refuse(
        not _workspace().contains(hand),
        ReasonCode.GOAL_OUTSIDE_WORKSPACE,
        f"position puts the hand outside the workspace: {_workspace().violated(hand)}",
    )


def check_primitive(request: DmpRequest, primitives: Iterable[str]) -> None:
    """As execute_dmp and switch_dmp refuse."""
    known = sorted(primitives)
    _refuse(
        request.primitive_id not in known,
        ReasonCode.UNKNOWN_NAME,
        f"primitive '{request.primitive_id}' is unknown; loaded are: {', '.join(known) or 'none'}",
    )
    _refuse(
        not 0.05 <= request.dmp_ratio <= 100.0,
        ReasonCode.OUT_OF_RANGE,
        f"dmp_ratio: expected a number from 0.05 to 100 (1: duration of the demonstration), got {request.dmp_ratio}",
    )
    region = np.array([request.goal_region_low, request.goal_region_high], dtype=float)
    distances = np.array([request.goal_retreat, request.goal_drop], dtype=float)
    turn = np.asarray(request.target_orientation, dtype=float)
    given = request.orientation_control and bool(np.any(turn))
    speed = request.arrival_speed
    for wrong, sentence in (
        (not np.all(np.isfinite(request.goal_offset)), "goal_offset holds a number that is not finite"),
        (
            not float(np.linalg.norm(request.goal_approach)) <= LONGEST_APPROACH,
            f"goal_approach is not finite or longer than {LONGEST_APPROACH} m",
        ),
        (
            speed != 0.0 and not 0.02 <= speed <= 0.45,
            f"arrival_speed is {speed} m/s; expected 0 (as the primitive has it) or 0.02 to 0.45 m/s",
        ),
        (
            not (np.all(np.isfinite(region)) and np.all(np.isfinite(distances))),
            "goal_region_low, goal_region_high, goal_retreat or goal_drop is not finite",
        ),
        (np.any(region[1] < region[0]), "goal_region_low is above goal_region_high in x, y or z"),
        (
            np.any(distances < 0.0),
            "goal_retreat or goal_drop is negative; expected a distance in m, or 0 for none",
        ),
        (
            given and not abs(float(np.linalg.norm(turn)) - 1.0) <= NORM,
            "target_orientation: expected a unit quaternion x y z w, or all zero to keep the present orientation",
        ),
    ):
        _refuse(bool(wrong), ReasonCode.INVALID_ARGUMENT, sentence)


def check_goal(request: DmpRequest, frames: Mapping[str, Pose]) -> None:
    """As execute_dmp refuses where its goal is nowhere, or too far away. ``frames`` in the base frame."""
    _refuse(
        not request.goal_frame,
        ReasonCode.GOAL_MISSING,
        "no goal has come on dmp_goal yet; name the tf2 frame to follow in goal_frame",
    )
    frame = frames.get(request.goal_frame)
    if frame is None:
        raise PortError(f"goal frame '{request.goal_frame}' is not known", code=ReasonCode.UNKNOWN_NAME)
    goal = frame.apply(request.goal_offset)
    outside = float(np.linalg.norm(np.asarray(_workspace().project(goal)) - goal))
    _refuse(
        outside > REACH_MARGIN,
        ReasonCode.GOAL_OUTSIDE_WORKSPACE,
        f"the hand's goal is {outside:.2f} m outside the workspace ({_workspace().violated(goal)})",
    )
