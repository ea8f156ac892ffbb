"""The services and transforms of the perception contract, for every node that serves it."""

from __future__ import annotations

import time
from typing import Any, Protocol

import numpy as np
import rospy
from coglab_msgs.srv import (
    FreePlaces,
    FreePlacesResponse,
    InitVision,
    InitVisionResponse,
    LocateObject,
    LocateObjectResponse,
)
from coglab_py.messages import pose_message
from coglab_py.pose import Pose
from coglab_py.steady import Stamps
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, Vector3

from coglab_perception.frames import FrameNames
from coglab_perception.sights import NotSeen, Sight

LONGEST_WAIT = 10.0  # s, longest time limit of a service


class Queries(Protocol):
    """Backend of the services. Each method returns within its time limit or raises NotSeen."""

    def init_vision(self, timeout: float) -> str:
        """Waits until the tracker works; returns a message."""

    def locate(self, target: str, timeout: float) -> tuple[str, Sight, float]:
        """Returns frame, newest sight and its age (s) of an object id, of the hand's or of the board's frame."""

    def free_places(self, object_id: str, timeout: float) -> list[tuple[str, np.ndarray]]:
        """Returns name and object position (m, frame of the board) of the free places, best first."""


class PerceptionServices:
    """Serves ~init_vision, ~locate_object and ~free_places, and makes the transforms. Stamps are times of capture.

    ``queries``: backend. ``stamps``: converts its clock, the steady one, to ROS time.
    """

    def __init__(self, names: FrameNames, queries: Queries, stamps: Stamps) -> None:
        self._names, self._queries, self._stamps = names, queries, stamps
        rospy.Service("~init_vision", InitVision, self._on_init)
        rospy.Service("~locate_object", LocateObject, self._on_locate)
        rospy.Service("~free_places", FreePlaces, self._on_places)

    def transform(self, sight: Sight) -> TransformStamped:
        """Converts a sight to a tf message."""
        message = TransformStamped()
        message.header.stamp = self._stamps.stamp(sight.captured)
        message.header.frame_id = self._names.world
        message.child_frame_id = sight.name
        message.transform.translation = Vector3(*sight.frame.position)
        message.transform.rotation = Quaternion(*sight.frame.orientation)
        return message

    def _on_init(self, request: Any) -> InitVisionResponse:
        try:
            return InitVisionResponse(success=True, message=self._queries.init_vision(_bounded(request.timeout)))
        except NotSeen as reason:
            return InitVisionResponse(False, reason.code, str(reason))

    def _on_locate(self, request: Any) -> LocateObjectResponse:
        try:
            frame, sight, age = self._queries.locate(request.object_id, _bounded(request.timeout))
        except NotSeen as reason:
            return LocateObjectResponse(success=False, reason_code=reason.code, message=str(reason))
        pose = self._pose(self._names.world, sight.captured, sight.frame)
        return LocateObjectResponse(success=True, frame_id=frame, age=age, pose=pose)

    def _on_places(self, request: Any) -> FreePlacesResponse:
        try:
            places = self._queries.free_places(request.object_id, _bounded(request.timeout))
        except NotSeen as reason:
            return FreePlacesResponse(False, reason.code, str(reason), [])
        return FreePlacesResponse(
            success=True,
            message=", ".join(name for name, _ in places),
            places=[self._pose(self._names.board, time.monotonic(), Pose(place)) for _, place in places],
        )

    def _pose(self, parent: str, captured: float, frame: Pose) -> PoseStamped:
        message = PoseStamped()
        message.header.frame_id = parent
        message.header.stamp = self._stamps.stamp(captured)
        message.pose = pose_message(frame)
        return message


def _bounded(timeout: float) -> float:
    """Requested time limit (s), limited to 0..LONGEST_WAIT; 0 for NaN."""
    return min(max(timeout, 0.0), LONGEST_WAIT) if timeout == timeout else 0.0
