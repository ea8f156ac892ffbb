"""Checks whether the arm can bring the palm to the grasp and delivery poses of an object in the handover region.

Damped least squares from the home posture, with joint limits, to grid points of the region, similar to the real motion.
Coarse on purpose: it finds grasps that are impossible for the wrist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z, length
from coglab_py.yaml_file import read

from coglab_smach.kinematics.goals import palm_at_grasp

POSITION_TOLERANCE = 0.003  # m
ANGLE_TOLERANCE = np.radians(3.0)  # rad
DAMPING = 1e-4 * np.eye(6)  # m^2 and rad^2
REGION = ((0.72, 0.78, 0.82), (-0.12, 0.0, 0.12), (0.28, 0.38, 0.45))  # m, base frame: object positions at a handover


@lru_cache(maxsize=1)
def default_arm() -> cc.Chain:
    """Returns the arm of lwr_description."""
    return cc.Chain(package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def joint_limits() -> cc.JointLimits:
    """Returns the joint limits of lwr_description."""
    return cc.load_joint_limits(str(package_path("lwr_description", "config", "joint_limits.yaml")))


@lru_cache(maxsize=1)
def home_posture() -> np.ndarray:
    """Returns ``postures.home`` of the machines' configuration, rad, shape (7,). Read-only, because it is cached."""
    machines = read(package_path("coglab_smach", "config", "machines.yaml")).value
    home = np.array(machines["postures"]["home"], dtype=float)
    home.setflags(write=False)
    return home


def position_jacobian(arm: cc.Chain, q: Sequence[float]) -> np.ndarray:
    """Returns the 3 x 7 matrix from joint velocity (rad/s) to palm velocity (m/s, base frame). Its transpose maps force
    to torque."""
    return np.asarray(arm.jacobian(np.asarray(q, dtype=float)))[:3]


def solve(arm: cc.Chain, target: Pose, start: Sequence[float] | None = None, steps: int = 120) -> np.ndarray | None:
    """Returns joint positions (rad) that bring the palm to ``target`` within 3 mm and 3 deg, or None. Starts from
    ``start``, by default home."""
    q = np.array(home_posture() if start is None else start, dtype=float)
    lower, upper = 0.98 * joint_limits().lower_position, 0.98 * joint_limits().upper_position
    for _ in range(steps):
        pose = Pose(*arm.fk(q))
        way = target.position - pose.position
        turn = (target.rotation * pose.rotation.inv()).as_rotvec()
        far, turned = length(way), length(turn)
        if far < POSITION_TOLERANCE and turned < ANGLE_TOLERANCE:
            return q
        way *= min(1.0, 0.08 / max(1e-9, far))
        turn *= min(1.0, 0.3 / max(1e-9, turned))
        q = np.minimum(np.maximum(q + damped_step(arm.jacobian(q), way, turn, DAMPING), lower), upper)
    return None


def damped_step(jacobian: np.ndarray, way: np.ndarray, turn: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Joint step (rad) of least squares, damped by a 6 x 6 matrix, for a way (m) and a turn (rad) of the palm.

    The six equations are solved in two blocks of three. For six at once OpenBLAS wakes threads: that takes longer, and
    rounds differently with each number of cores, so that a virtual trial ends differently on another computer.
    """
    square = jacobian @ jacobian.T + damping
    first = np.linalg.solve(square[:3, :3], np.column_stack([square[:3, 3:], way]))
    coupling = square[3:, :3]
    last = np.linalg.solve(square[3:, 3:] - coupling @ first[:, :3], turn - coupling @ first[:, 3])
    step: np.ndarray = jacobian.T @ np.concatenate([first[:, 3] - first[:, :3] @ last, last])
    return step


def share_reached(
    palm_in_object: Pose, arm: cc.Chain | None = None, yaws_deg: Sequence[float] = (-20.0, 0.0, 20.0)
) -> tuple[int, int]:
    """Counts the object poses of the handover region (27 places, rotated about z) that the palm can reach. Returns
    (reached, total)."""
    arm = arm or default_arm()
    reached = total = 0
    for x in REGION[0]:
        for y in REGION[1]:
            for z in REGION[2]:
                for yaw in yaws_deg:
                    at = Pose(np.array([x, y, z]), about_z(np.radians(yaw)))
                    total += 1
                    reached += solve(arm, at * palm_in_object) is not None
    return reached, total


def reachability_report(entry: Mapping[str, Any], needed: float = 0.7) -> list[tuple[str, bool]]:
    """Returns one sentence per grasp, and whether enough places are reached (share ``needed``)."""
    report = []
    for name, grasp in entry["grasps"].items():
        reached, total = share_reached(palm_at_grasp(grasp), yaws_deg=(0.0,))
        ok = reached >= needed * total
        report.append(
            (
                f"grasp '{name}': {reached} of {total} places of the handover region reached"
                f"{'' if ok else f' (at least {needed:.0%} expected: turn or move the grasp pose)'}",
                ok,
            )
        )
    return report
