"""How much room is left between the storage board and the arm: pure geometry on the robot description.

The board counts as a plane without end, and what is above it as the arm from the elbow on: forearm, wrist and hand with
straight fingers. What is nearer to the base stands beside the board and is not looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import coglab_controllers as cc
import numpy as np
from coglab_py.pose import Pose

from coglab_smach.kinematics.reachability import solve

FROM_ELBOW = 3  # index of the first joint of the arm whose link is looked at
STEPS = 5  # times that a palm is raised at most: the posture of the arm changes with it
ENOUGH = 1e-4  # m that may be missing after that


@dataclass(frozen=True)
class Solid:
    """A plain shape of a link: a box, a cylinder along z, or a sphere. ``at``: pose of its middle in the link;
    ``half``: m, half sizes of the box, (0, 0, half length) of the cylinder, zeros of the sphere; ``radius`` m."""

    kind: str
    at: Pose
    half: np.ndarray
    radius: float = 0.0

    def below(self, link: Pose, up: np.ndarray) -> float:
        """m along ``up`` of its lowest point, the link being at a pose in the same parent."""
        middle = link * self.at
        along = middle.rotation.inv().apply(up)
        flat = float(np.sqrt(max(0.0, 1.0 - along[2] ** 2))) if self.kind == "cylinder" else 1.0
        return float(up @ middle.position - np.abs(along) @ self.half) - flat * self.radius


def _numbers(text: str | None) -> list[float]:
    return [float(word) for word in (text or "0 0 0").split()]


def _pose(element: ElementTree.Element) -> Pose:
    """Of what has an <origin>."""
    origin = element.find("origin")
    xyz, rpy = (_numbers(None if origin is None else origin.get(name)) for name in ("xyz", "rpy"))
    return Pose.from_dict({"xyz": xyz, "rpy_deg": np.degrees(rpy).tolist()})


def _solid(element: ElementTree.Element) -> Solid | None:
    """Of a <collision> or <visual>; None of a mesh, which has no plain shape."""
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
    """Room above the board for a palm that is to be somewhere.

    ``urdf``: the robot description; links without <collision>, such as fingers, count as they are drawn. ``start``
    (rad): the posture from which the arm comes, by default home. ValueError where the description has no arm to
    ``ih2_palm``.
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
                if (solid := _solid(each)) is not None
            ]
            for link in root.findall("link")
        }

    def over(self, board: Pose, palm: Pose) -> float:
        """m between the plane through ``board``, whose z axis is up, and the lowest point of the arm from the elbow on
        with the palm at a pose in the same parent, the base frame; negative: it would stand in the board. Infinite
        where the arm has no posture for the palm: that is not for the board to judge."""
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
        """m along ``up`` of the lowest point of a link, if it counts, and of all below it."""
        found = min((solid.below(at, up) for solid in self._solids.get(link, [])), default=np.inf) if counts else np.inf
        for joint in self._below.get(link, []):
            half = 0.5 * angles.get(joint.name, 0.0)
            turn = np.array([*(np.sin(half) * joint.axis), np.cos(half)])
            child = at * joint.origin * Pose(np.zeros(3), turn)
            below = self._lowest(joint.child, child, angles, watched, counts or joint.name in watched, up)
            found = min(found, below)
        return float(found)

    def raised(self, board: Pose, palm: Pose, room: float, most: float) -> tuple[float, Pose | None]:
        """(m by which the palm has to rise so that ``room`` m are left, that palm); None for the palm where it would
        be more than ``most`` m."""
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
