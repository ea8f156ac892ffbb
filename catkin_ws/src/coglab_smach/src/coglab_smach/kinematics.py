"""Jacobian of a serial arm read from its URDF: what the contact detector needs to choose its joints (numpy only)."""
from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .pose import Pose, from_rpy, multiply, rotate


@dataclass(frozen=True)
class _Joint:
    name: str
    origin: Pose
    axis: np.ndarray
    moves: bool


class SerialArm:
    """Chain of revolute joints from ``base`` to ``tip``; joint order is that of the chain."""

    def __init__(self, urdf_text: str, base: str = "lwr_base_link", tip: str = "ih2_palm") -> None:
        root = ElementTree.fromstring(urdf_text)
        by_child = {}
        for joint in root.findall("joint"):
            by_child[joint.find("child").get("link")] = joint
        chain: list[_Joint] = []
        link = tip
        while link != base:
            if link not in by_child:
                raise ValueError(f"URDF has no chain from '{base}' to '{tip}': nothing leads to '{link}'")
            joint = by_child[link]
            origin = joint.find("origin")
            xyz = [float(v) for v in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
            rpy = [float(v) for v in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()]
            axis = joint.find("axis")
            direction = [float(v) for v in (axis.get("xyz") if axis is not None else "1 0 0").split()]
            chain.append(_Joint(joint.get("name"), Pose(np.array(xyz), from_rpy(*rpy)),
                                np.array(direction),
                                joint.get("type") in ("revolute", "continuous")))
            link = joint.find("parent").get("link")
        self._chain = chain[::-1]
        self.names = tuple(j.name for j in self._chain if j.moves)

    def forward(self, q: Sequence[float]) -> Pose:
        """Pose of the tip in the base frame at joint positions q (rad)."""
        return self._walk(q)[0]

    def position_jacobian(self, q: Sequence[float]) -> np.ndarray:
        """3 x n: velocity of the tip (m/s, base frame) per joint velocity (rad/s); its transpose maps force
        to torque."""
        tip, joints = self._walk(q)
        return np.array([np.cross(axis, tip.position - point) for axis, point in joints]).T

    def jacobian(self, q: Sequence[float]) -> np.ndarray:
        """6 x n: linear rows above angular rows."""
        tip, joints = self._walk(q)
        return np.array([np.concatenate([np.cross(axis, tip.position - point), axis]) for axis, point in joints]).T

    def _walk(self, q: Sequence[float]) -> tuple[Pose, list[tuple[np.ndarray, np.ndarray]]]:
        if len(q) != len(self.names):
            raise ValueError(f"expected {len(self.names)} joint positions ({' '.join(self.names)}), got {len(q)}")
        pose = Pose()
        joints = []
        i = 0
        for joint in self._chain:
            pose = pose * joint.origin
            if joint.moves:
                axis = rotate(pose.orientation, joint.axis)
                joints.append((axis, pose.position))
                half = 0.5 * float(q[i])
                turn = np.array([*(np.sin(half) * joint.axis), np.cos(half)])
                pose = Pose(pose.position, multiply(pose.orientation, turn))
                i += 1
        return pose, joints
