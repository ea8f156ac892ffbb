"""Model of the robot for the page, from its URDF: links with simple shapes, joints, and the kinematics.

Lengths m, angles rad. A transform is a 4 x 4 array; a pose for the page is [x, y, z, qx, qy, qz, qw].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

MAX_URDF = 2_000_000  # characters
SHAPES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}


class ModelError(Exception):
    """The description cannot be shown. The message gives the reason."""


def _numbers(text: str | None, default: str) -> list[float]:
    return [float(word) for word in (text or default).split()]


def transform(xyz: Sequence[float] | np.ndarray, turn: Rotation | None = None) -> np.ndarray:
    """4 x 4 transform from a position and a rotation (None: no rotation)."""
    found = np.eye(4)
    found[:3, 3] = xyz
    if turn is not None:
        found[:3, :3] = turn.as_matrix()
    return found


def _origin(element: ElementTree.Element | None) -> np.ndarray:
    if element is None:
        return np.eye(4)
    turn = Rotation.from_euler("xyz", _numbers(element.get("rpy"), "0 0 0"))
    return transform(_numbers(element.get("xyz"), "0 0 0"), turn)


def _pose(matrix: np.ndarray) -> list[float]:
    return [round(float(value), 9) for value in (*matrix[:3, 3], *Rotation.from_matrix(matrix[:3, :3]).as_quat())]


@dataclass(frozen=True)
class Joint:
    """A joint between two links; `axis` in the child's frame."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray


def _child(element: ElementTree.Element, tag: str) -> dict[str, str]:
    """Attributes of the child of that name; KeyError if there is none."""
    found = element.find(tag)
    if found is None:
        raise KeyError(f"<{element.tag}> has no <{tag}>")
    return found.attrib


class RobotModel:
    """Links, shapes and joints of one URDF. Raises ModelError for an invalid one."""

    def __init__(self, urdf: str) -> None:
        if len(urdf) > MAX_URDF:
            raise ModelError(f"robot_description has {len(urdf)} characters, more than {MAX_URDF}")
        try:
            root = ElementTree.fromstring(urdf)
            self.joints = [self._joint(element) for element in root.findall("joint")]
            self.shapes = {link.get("name", ""): self._shapes(link) for link in root.findall("link")}
        except (ElementTree.ParseError, ValueError, AttributeError, KeyError) as error:
            raise ModelError(f"robot_description is not a usable URDF: {error}") from error
        children = {joint.child for joint in self.joints}
        roots = [name for name in self.shapes if name not in children]
        if len(roots) != 1:
            raise ModelError(f"expected one root link, found {', '.join(roots) or 'none'}")
        self.root = roots[0]
        self._by_child = {joint.child: joint for joint in self.joints}

    @staticmethod
    def _joint(element: ElementTree.Element) -> Joint:
        axis_tag = element.find("axis")
        axis = np.array(_numbers(axis_tag.get("xyz") if axis_tag is not None else None, "1 0 0"))
        return Joint(element.attrib["name"], element.attrib["type"], _child(element, "parent")["link"],
                     _child(element, "child")["link"], _origin(element.find("origin")),
                     axis / np.linalg.norm(axis))  # fmt: skip

    @staticmethod
    def _shapes(link: ElementTree.Element) -> list[dict]:
        found = []
        for visual in link.findall("visual"):
            geometry = visual.find("geometry")
            for kind, fields in SHAPES.items():
                tag = geometry.find(kind) if geometry is not None else None
                if tag is not None:
                    size = [value for name in fields for value in _numbers(tag.attrib[name], "")]
                    material = visual.find("material")
                    colour = material.get("name", "") if material is not None else ""
                    found.append(
                        {"kind": kind, "size": size, "pose": _pose(_origin(visual.find("origin"))), "of": colour}
                    )
        return found

    def moving(self) -> list[str]:
        """Names of the joints that move, in the order of the description."""
        return [joint.name for joint in self.joints if joint.kind in ("revolute", "continuous", "prismatic")]

    def place(self, link: str, positions: dict[str, float]) -> np.ndarray:
        """Transform of a link in the root frame; joints without a position are at 0."""
        found = np.eye(4)
        while link != self.root:
            joint = self._by_child[link]
            found = joint.origin @ self._motion(joint, positions.get(joint.name, 0.0)) @ found
            link = joint.parent
        return found

    @staticmethod
    def _motion(joint: Joint, q: float) -> np.ndarray:
        if joint.kind == "prismatic":
            return transform(joint.axis * q)
        if joint.kind in ("revolute", "continuous"):
            return transform((0.0, 0.0, 0.0), Rotation.from_rotvec(joint.axis * q))
        return np.eye(4)

    def document(self) -> dict:
        """Document for the page: joints, each after its parent, and shapes by link."""
        ordered, known = [], {self.root}
        waiting = list(self.joints)
        while waiting:
            ready = [joint for joint in waiting if joint.parent in known]
            if not ready:
                raise ModelError(f"joint {waiting[0].name} is not connected to the root link")
            ordered += ready
            known |= {joint.child for joint in ready}
            waiting = [joint for joint in waiting if joint.child not in known]
        joints = [{"name": j.name, "kind": j.kind, "parent": j.parent, "child": j.child, "pose": _pose(j.origin),
                   "axis": j.axis.tolist()} for j in ordered]  # fmt: skip
        return {
            "root": self.root,
            "joints": joints,
            "shapes": {name: rows for name, rows in self.shapes.items() if rows},
        }
