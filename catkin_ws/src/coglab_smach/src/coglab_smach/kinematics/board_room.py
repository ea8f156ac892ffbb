"""Clearance between the storage board and the arm, computed from the robot description.

The board is an infinite plane. The arm is checked from the elbow on: forearm, wrist and hand with straight fingers.
Links nearer to the base stand beside the board and are not checked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import coglab_controllers as cc
import numpy as np
from coglab_py.pose import Pose

from coglab_smach.kinematics.reachability import solve

FROM_ELBOW = 3  # index of the first joint whose link is checked
STEPS = 5  # largest number of lifts of a palm: each one changes the posture of the arm
ENOUGH = 1e-4  # m, tolerance of the clearance


@dataclass(frozen=True)
class Solid:
    """Primitive shape of a link: box, cylinder along z, or sphere. ``at``: pose of its centre in the link. ``half``, m:
    half sizes of the box; (0, 0, half length) of the cylinder; zeros for the sphere. ``radius``, m."""

    kind: str
    at: Pose
    half: np.ndarray
    radius: float = 0.0

    def below(self, link: Pose, up: np.ndarray) -> float:
        """Returns the height (m along ``up``) of its lowest point. ``link``: pose of the link in the frame of
        ``up``."""
        middle = link * self.at
        along = middle.rotation.inv().apply(up)
        flat = float(np.sqrt(max(0.0, 1.0 - along[2] ** 2))) if self.kind == "cylinder" else 1.0
        return float(up @ middle.position - np.abs(along) @ self.half) - flat * self.radius


def _numbers(text: str | None) -> list[float]:
    return [float(word) for word in (text or "0 0 0").split()]


def _pose(element: ElementTree.Element) -> Pose:
    """Returns the pose of an element with an <origin>."""
    origin = element.find("origin")
    xyz, rpy = (_numbers(None if origin is None else origin.get(name)) for name in ("xyz", "rpy"))
    return Pose.from_dict({"xyz": xyz, "rpy_deg": np.degrees(rpy).tolist()})


def read_solid(element: ElementTree.Element) -> Solid | None:
    """Reads a <collision> or <visual> of a robot description. None for a mesh, which is not a primitive shape."""
    at = _pose(element)
    for shape in element.findall("geometry/*"):
        if shape.tag == "box":
            return Solid("box", at, 0.5 * np.array(_numbers(shape.get("size"))))
        if shape.tag == "cylinder":
            half = np.array([0.0, 0.0, 0.5 * float(shape.get("length", 0.0))])
            return Solid("cylinder", at, half, float(shape.get("radius", 0.0)))
        if shape.tag == "sphere":
            return Solid("sphere", at, np.zeros(3), float(shape.get("radius", 0.0)))
    return None


@dataclass(frozen=True)
class _Joint:
    name: str
    child: str
    origin: Pose
    axis: np.ndarray


class BoardRoom:
    """Clearance above the board for a given pose of the palm.

    ``urdf``: the robot description. Links without <collision>, such as fingers, use their <visual>. ``start`` (rad):
    the posture from which the arm starts, by default home. ValueError if the description has no arm to ``ih2_palm``.
    """

    def __init__(self, urdf: str, start: Sequence[float] | None = None) -> None:
        self._arm = cc.Chain(urdf)
        self._start = start
        root = ElementTree.fromstring(urdf)
        self._below: dict[str, list[_Joint]] = {}
        for joint in root.findall("joint"):
            parent, child, axis = joint.find("parent"), joint.find("child"), joint.find("axis")
            if parent is None or child is None:
                continue
            turns = _numbers(axis.get("xyz")) if axis is not None else [1.0, 0.0, 0.0]
            described = _Joint(joint.get("name", ""), child.get("link", ""), _pose(joint), np.array(turns))
            self._below.setdefault(parent.get("link", ""), []).append(described)
        self._solids = {
            link.get("name", ""): [
                solid
                for each in link.findall("collision") or link.findall("visual")
                if (solid := read_solid(each)) is not None
            ]
            for link in root.findall("link")
        }

    def over(self, board: Pose, palm: Pose) -> float:
        """Returns the distance (m) from the plane through ``board`` (z axis up) to the lowest point of the arm from the
        elbow on, for a pose of the palm in the same parent, the base frame. Negative: the arm would be in the board.
        Infinite if the arm has no posture for the palm: other checks handle that."""
        posture = solve(self._arm, palm, self._start)
        if posture is None:
            return np.inf
        angles = dict(zip(self._arm.joint_names, posture, strict=True))
        watched = set(self._arm.joint_names[FROM_ELBOW:])
        up = board.axis(2)
        return self._lowest("lwr_base_link", Pose(), angles, watched, False, up) - float(up @ board.position)

    def _lowest(
        self, link: str, at: Pose, angles: dict[str, float], watched: set[str], counts: bool, up: np.ndarray
    ) -> float:
        """Returns the height (m along ``up``) of the lowest point of a link (if it counts) and of its children."""
        found = min((solid.below(at, up) for solid in self._solids.get(link, [])), default=np.inf) if counts else np.inf
        for joint in self._below.get(link, []):
            half = 0.5 * angles.get(joint.name, 0.0)
            turn = np.array([*(np.sin(half) * joint.axis), np.cos(half)])
            child = at * joint.origin * Pose(np.zeros(3), turn)
            below = self._lowest(joint.child, child, angles, watched, counts or joint.name in watched, up)
            found = min(found, below)
        return float(found)

    def raised(self, board: Pose, palm: Pose, room: float, most: float) -> tuple[float, Pose | None]:
        """Returns (lift (m) of the palm for a clearance of ``room`` m, lifted palm). The palm is None if the lift would
        exceed ``most`` m."""
        lift, up = 0.0, board.axis(2)
        for _ in range(STEPS):
            now = Pose(palm.position + lift * up, palm.orientation)
            missing = room - self.over(board, now)
            if missing <= ENOUGH:
                return lift, now
            lift += missing
            if lift > most:
                break
        return lift, None
