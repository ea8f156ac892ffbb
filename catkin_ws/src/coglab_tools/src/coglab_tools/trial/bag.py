"""Reads a recorded bag into the time series that plots and metrics use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from coglab.series import Series
from coglab_py.pose import Pose

from coglab_tools.command import CheckFailed

FRAMES = ("human_hand", "object_")  # of the person's hand, and the beginning of those of objects
STEP = 0.02  # s between two looks at tf


def series_of(file: Path) -> Series:
    """The series of a bag, times in s of ROS time. Poses are the simulation's truth where the bag has it, else what
    perception saw and the arm's kinematics say. CheckFailed names the file and what is wrong with it."""
    import rosbag

    try:
        with rosbag.Bag(str(file)) as bag:
            return _read(bag)
    except FileNotFoundError:
        raise CheckFailed(f"{file} is not there: give a folder with a recorded trial") from None
    except rosbag.ROSBagUnindexedException:
        raise CheckFailed(f"{file} was not closed: `rosbag reindex {file}` may save it") from None
    except (rosbag.ROSBagException, OSError, ValueError, KeyError) as error:
        raise CheckFailed(f"{file} is no bag that can be read: {error}") from None


def _read(bag: Any) -> Series:
    series, hand_frames = Series(), _Frames()
    sees_truth = False
    for topic, message, stamp in bag.read_messages():
        name, kind, arrived = topic.lstrip("/"), message._type, stamp.to_sec()
        made = message.header.stamp.to_sec() if hasattr(message, "header") else arrived
        if kind == "sensor_msgs/JointState" and name.endswith("lwr/joint_states") and len(message.position) == 7:
            velocity = message.velocity if len(message.velocity) == 7 else (0.0,) * 7
            series.joints.append((made, message.position, velocity))
        elif name.endswith("lwr/external_torques") and kind == "sensor_msgs/JointState":
            series.external_torques.append((made, message.effort))
        elif kind == "coglab_msgs/CellTruth":
            sees_truth = True
            poses = [_pose(message.robot_hand), _pose(message.human_hand), _pose(message.object)]
            force = float(np.linalg.norm(_three(message.touch_force)))
            series.truth.append((made, *(each.position for each in poses), force))
            series.poses.append((made, *poses))
        elif kind == "coglab_msgs/HandStatus" and len(message.motors) == 5:
            series.fingers.append((made, [motor.position for motor in message.motors]))
        elif kind == "coglab_msgs/DmpFeedback":
            series.feedback.append((made, message.state, message.remaining_distance))
        elif kind == "coglab_msgs/Transition":
            m = message
            row = (made, m.path, m.from_state, m.outcome, m.to_state, m.reason, m.reason_code)
            series.transitions.append(row)
        elif kind == "coglab_msgs/Contact":
            text = f"{message.source}: {message.message}"
            series.contacts.append((made, message.contact, message.margin, text))
    if not sees_truth:
        for topic, message, stamp in bag.read_messages(topics=["/tf", "/tf_static"]):
            hand_frames.take(message, topic == "/tf_static", stamp.to_sec())
        series.truth = hand_frames.rows(series.joints)
    return series


def _three(vector: Any) -> np.ndarray:
    return np.array([vector.x, vector.y, vector.z])


def _pose(pose: Any) -> Pose:
    q = pose.orientation
    return Pose(_three(pose.position), np.array([q.x, q.y, q.z, q.w]))


class _Frames:
    """Tracks of the person's hand and of an object from tf, in the frame of the arm's base."""

    def __init__(self) -> None:
        import rospy
        import tf2_py

        self._buffer = tf2_py.BufferCore(rospy.Duration(5.0))
        self._now, self._error = rospy.Time, tf2_py.TransformException
        self._looked = 0.0
        self._seen: dict[str, list[tuple[float, np.ndarray]]] = {}

    def take(self, message: Any, static: bool, arrived: float) -> None:
        """Take a message of /tf or /tf_static, in the order of the bag."""
        from geometry_msgs.msg import TransformStamped

        for read in message.transforms:  # of a class that rosbag has made, which tf2 warns of
            transform = TransformStamped(header=read.header, child_frame_id=read.child_frame_id)
            for name in "xyz":
                setattr(transform.transform.translation, name, getattr(read.transform.translation, name))
            for name in "xyzw":
                setattr(transform.transform.rotation, name, getattr(read.transform.rotation, name))
            (self._buffer.set_transform_static if static else self._buffer.set_transform)(transform, "bag")
            frame = transform.child_frame_id
            if not static and frame.startswith(FRAMES) and not frame.endswith("_ahead"):
                self._seen.setdefault(frame, [])
        if arrived - self._looked < STEP:
            return
        self._looked = arrived
        for frame, track in self._seen.items():
            try:
                found = self._buffer.lookup_transform_core("world", frame, self._now(0))
            except self._error:
                continue
            stamp = found.header.stamp.to_sec()
            if not track or stamp > track[-1][0]:
                track.append((stamp, _three(found.transform.translation)))

    def rows(self, joints: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
        """Rows of Series.truth at the times of the joints: palm by kinematics, hand and object as seen, no force."""
        hand = self._seen.get("human_hand", [])
        things = [track for frame, track in self._seen.items() if frame != "human_hand" and track]
        if not joints or len(hand) < 3:
            return []
        import coglab_controllers as cc
        from coglab_py.packages import package_path

        chain = cc.Chain(package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8"))
        times = [row[0] for row in joints][::4]
        palm = [np.asarray(chain.fk(np.array(row[1]))[0]) for row in joints][::4]
        person, thing = _along(hand, times), _along(max(things, key=len) if things else hand, times)
        return list(zip(times, palm, person, thing, [float("nan")] * len(times), strict=True))


def _along(track: list[tuple[float, np.ndarray]], times: list[float]) -> np.ndarray:
    stamps, points = [row[0] for row in track], np.array([row[1] for row in track])
    return np.column_stack([np.interp(times, stamps, axis) for axis in points.T])
