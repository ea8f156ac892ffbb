"""Markers for the cell in rviz: pedestal, board, goal and path of a motion, a text.

Pure functions from numbers to visualization_msgs/Marker. The node is scripts/scene_markers.py. Lengths in m.
"""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

BASE = "lwr_base_link"
FLOOR = -0.75  # m, height of the simulated cell's floor above the robot's base
PEDESTAL = (0.30, 0.30)
BOARD_THICKNESS = 0.02
LEG = 0.04
GREY, WOOD = (0.45, 0.48, 0.52, 1.0), (0.80, 0.68, 0.50, 1.0)
BLUE, GREEN, DARK = (0.0, 0.45, 0.70, 1.0), (0.0, 0.62, 0.45, 0.9), (0.11, 0.12, 0.14, 1.0)


def _marker(name: str, kind: int, frame: str, colour: tuple, scale: tuple, number: int = 0) -> Marker:
    marker = Marker(ns=name, id=number, type=kind, action=Marker.ADD, scale=Vector3(*scale), color=ColorRGBA(*colour))
    marker.header.frame_id = frame
    marker.pose.orientation.w = 1.0
    return marker


def gone(name: str) -> Marker:
    """Marker that removes a marker."""
    return Marker(ns=name, id=0, action=Marker.DELETE)


def pedestal() -> Marker:
    """The pedestal of the robot, from the floor to its base."""
    marker = _marker("pedestal", Marker.CUBE, BASE, GREY, (*PEDESTAL, -FLOOR))
    marker.pose.position.z = FLOOR / 2
    return marker


def board(size: tuple[float, float], height: float) -> list[Marker]:
    """The board with four legs down to the floor. Its top is in the frame `board`. `size`: m along x and y of this
    frame; `height`: m of the top above the robot's base."""
    top = _marker("board", Marker.CUBE, "board", WOOD, (*size, BOARD_THICKNESS))
    top.pose.position.z = -BOARD_THICKNESS / 2
    legs, length = [], height - FLOOR - BOARD_THICKNESS
    for number, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), start=1):
        leg = _marker("board", Marker.CUBE, "board", GREY, (LEG, LEG, length), number)
        leg.pose.position = Point(sx * (size[0] - LEG) / 2, sy * (size[1] - LEG) / 2, -BOARD_THICKNESS - length / 2)
        legs.append(leg)
    return [top, *legs]


def goal(position: np.ndarray) -> Marker:
    """The goal of the current motion (m, frame of the robot's base)."""
    marker = _marker("goal", Marker.SPHERE, BASE, GREEN, (0.05, 0.05, 0.05))
    marker.pose.position = Point(*position)
    return marker


def path(points: np.ndarray) -> Marker:
    """The path (n, 3), in m, of the primitive to its current goal."""
    marker = _marker("path", Marker.LINE_STRIP, BASE, BLUE, (0.012, 0.0, 0.0))
    marker.points = [Point(*point) for point in points]
    return marker


def text(words: str) -> Marker:
    """State, object and reason as text above the robot."""
    marker = _marker("state", Marker.TEXT_VIEW_FACING, BASE, DARK, (0.0, 0.0, 0.07))
    marker.pose = Pose(Point(0.35, 0.0, 1.05), Quaternion(w=1.0))
    marker.text = words
    return marker


def words_of(state: str, object_id: str, why: str, width: int = 60) -> str:
    """Text for a state of the brain. A long reason is cut."""
    name = state.rsplit("/", 1)[-1].replace("_", " ")
    lines = [f"{name}, holds {object_id}" if object_id else name]
    if why:
        lines.append(why if len(why) <= width else why[: width - 1] + "…")
    return "\n".join(lines)
