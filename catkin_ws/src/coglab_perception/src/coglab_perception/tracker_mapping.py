"""The mapping file of the perception bridge, from poses of a tracker to the frames of the contract. No ROS.

``config/perception_bridge.yaml`` is a commented example.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from coglab_py.pose import Pose
from coglab_py.yaml_file import Document, YamlError, read
from scipy.spatial.transform import Rotation

from coglab_perception.frames import FrameNames
from coglab_perception.sights import slots_of

TEXT = {"type": "string", "minLength": 1}
TRIPLE = {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}}
AGE = {"type": "number", "exclusiveMinimum": 0, "maximum": 10}
SOURCE = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "tf": TEXT,
        "topic": TEXT,
        "type": {"enum": ["PoseStamped", "MarkerArray"]},
        "namespace": {"type": "string"},
        "id": {"type": "integer"},
        "offset": {
            "type": "object",
            "additionalProperties": False,
            "properties": {"position": TRIPLE, "rpy_deg": TRIPLE},
        },
        "largest_age": AGE,
    },
}
SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "required": ["frames"],
    "properties": {
        "stamp": {"enum": ["capture", "arrival"]},
        "latency": {"type": "number", "minimum": 0, "maximum": 1},
        "largest_age": AGE,
        "frames": {"type": "object", "minProperties": 1, "additionalProperties": SOURCE},
        "slots": {"type": "object", "additionalProperties": TRIPLE},
    },
}
BOARD_AGE = 3600.0  # s; a board that stands still may be seen once

MARKER_KEY = tuple[str, int]  # namespace and id of a marker


@dataclass(frozen=True)
class Source:
    """Source of one frame: a tf frame, a topic of poses, or a marker of a topic of markers."""

    frame: str
    """frame of the perception contract"""
    tf: str = ""
    topic: str = ""
    type: str = ""
    marker: MARKER_KEY | None = None
    offset: Pose = field(default_factory=Pose)
    """pose of the contract's frame in the tracker's frame: palm in the markers of the hand, object in its marker"""
    largest_age: float = 0.2
    """s; older poses are dropped"""

    @property
    def is_there(self) -> bool:
        """True if the tracker broadcasts the contract's frame itself: it is served, and not broadcast again."""
        return self.tf == self.frame


@dataclass(frozen=True)
class TrackerMapping:
    """A mapping file."""

    sources: tuple[Source, ...]
    slots: dict[str, np.ndarray]
    by_arrival: bool = False
    """True: the tracker's stamps are by another clock; the capture is ``latency`` before the arrival"""
    latency: float = 0.0

    @staticmethod
    def load(path: str, names: FrameNames) -> TrackerMapping:
        """Reads a mapping file. A YamlError names file, line and field."""
        document = read(path)
        document.check(SCHEMA)
        value: Mapping[str, Any] = document.value
        age, by_arrival = float(value.get("largest_age", 0.2)), value.get("stamp", "capture") == "arrival"
        sources = tuple(_source(document, names, frame, age) for frame in value["frames"])
        for source in sources:
            if source.tf and (names.is_tracked(source.tf) or source.tf == names.board):
                if not source.is_there or by_arrival or "offset" in value["frames"][source.frame]:
                    text = (
                        f"'{source.tf}' is a name that this bridge broadcasts; give your tracker's frame another name, "
                        f"or write {source.tf}: {{tf: {source.tf}}} without offset and without stamp: arrival"
                    )
                    raise YamlError(document.sentence(("frames", source.frame, "tf"), text))
        return TrackerMapping(
            sources,
            slots_of(value.get("slots", {})),
            by_arrival,
            float(value.get("latency", 0.0)),
        )

    def captured(self, stamp: float, arrived: float) -> float:
        """Returns the time of the capture (s), from stamp and time of arrival (s, same clock)."""
        return arrived - self.latency if self.by_arrival else stamp


def _source(document: Document, names: FrameNames, frame: str, age: float) -> Source:
    value: Mapping[str, Any] = document.value["frames"][frame]

    def refuse(text: str) -> YamlError:
        return YamlError(document.sentence(("frames", frame), text))

    if not (names.is_tracked(frame) or frame == names.board):
        known = f"{names.human_hand}, {names.board}, {names.object.replace('{id}', '<id>')}"
        raise refuse(f"not a frame of the perception contract; expected one of {known}")
    by_marker, by_pose = "id" in value or "namespace" in value, value.get("type") == "PoseStamped"
    if ("tf" in value) == ("topic" in value):
        raise refuse("expected one source: tf (a frame), or topic and type")
    if "topic" in value and "type" not in value:
        raise refuse("type is missing: PoseStamped or MarkerArray")
    if "tf" in value and ("type" in value or by_marker):
        raise refuse("a tf frame has no type, namespace or id")
    if (by_marker and by_pose) or (value.get("type") == "MarkerArray" and "id" not in value):
        raise refuse("a MarkerArray needs the id of the marker (and its namespace), a PoseStamped has none")
    offset = value.get("offset", {})
    turn = Rotation.from_euler("xyz", offset.get("rpy_deg", [0.0, 0.0, 0.0]), degrees=True)
    return Source(
        frame,
        value.get("tf", ""),
        value.get("topic", ""),
        value.get("type", ""),
        (value.get("namespace", ""), value["id"]) if "id" in value else None,
        Pose(np.array(offset.get("position", [0.0, 0.0, 0.0]), dtype=float), turn.as_quat()),
        float(value.get("largest_age", BOARD_AGE if frame == names.board else age)),
    )


def usable(pose: Pose) -> bool:
    """True if every number is finite and the quaternion is near unit length: other poses of a tracker are errors."""
    length = float(np.linalg.norm(pose.orientation))
    return bool(np.isfinite(pose.position).all()) and math.isfinite(length) and abs(length - 1.0) < 0.01
