#!/usr/bin/python3
"""The node motion_recogniser: reaching pattern and belief of a handover, from the partner's hand and objects in tf2.

For each new transform of the hand it publishes coglab_msgs/Recognition on perception/recognition (all
probabilities) and coglab_msgs/HandoverBelief on perception/belief. While a place is predicted, it
broadcasts the frames <hand>_ahead and <object>_ahead: their places at the handover, with their current
orientation. It subscribes to ih2_hand/hand_status for the state of the robot's hand. All names are
relative. Parameters: perception/frames (mapping of frames.yaml); private: patterns (file of
train_patterns.py), memory (s for which an estimate is kept after its reach; default: that of the
file), belief (mapping, config/belief.yaml).
"""

from __future__ import annotations

import dataclasses
import math
import sys

import numpy as np
import rospy
import tf2_ros
from coglab_msgs.msg import HandoverBelief, HandStatus, Recognition
from coglab_perception.belief import Belief, BeliefFilter, BeliefSettings
from coglab_perception.frames import AHEAD, FrameNames
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_perception.tf_listener import TfListener
from coglab_py import parameters, steady
from coglab_py.node_start import init_node
from coglab_py.pace import Pace
from geometry_msgs.msg import Point, TransformStamped, Vector3


class RecogniserNode:
    """ROS interface of Recogniser and BeliefFilter."""

    def __init__(self) -> None:
        self.frames = frames = FrameNames.from_mapping(
            parameters.read("perception/frames", dict, {}), rospy.resolve_name("perception/frames")
        )
        path = parameters.read("~patterns", str, "")
        if not path:
            raise ValueError(
                f"{rospy.resolve_name('~patterns')} is not set: give the path of a "
                "pattern file (train_patterns.py writes them)"
            )
        patterns, settings = load_patterns(path)
        memory = parameters.read("~memory", float, settings.memory, 0.0)
        self.recogniser = Recogniser(patterns, dataclasses.replace(settings, memory=memory))
        self.filter = BeliefFilter(
            BeliefSettings.from_mapping(parameters.read("~belief", dict, {}), rospy.resolve_name("~belief"))
        )
        self.hand, self.base = frames.human_hand, frames.world
        self.pace = Pace().follow()
        self.robot_holds = False
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = TfListener(self.buffer, self.base)
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.publisher = rospy.Publisher("perception/recognition", Recognition, queue_size=1)
        self.beliefs = rospy.Publisher("perception/belief", HandoverBelief, queue_size=1)
        self.stamps = steady.Stamps()
        self.last: dict[str, rospy.Time] = {}  # stamp of the newest transform processed, by frame
        self.seen: dict[str, float] = {}  # the same on the steady clock (s), independent of steps of ROS time
        rospy.Subscriber("ih2_hand/hand_status", HandStatus, self.on_hand_status, queue_size=1)
        steady.SteadyTimer(0.01, self.take_newest, "newest transforms")

    def on_hand_status(self, status: HandStatus) -> None:
        """Store whether the robot holds an object."""
        self.robot_holds = bool(status.holding)

    def take_newest(self) -> None:
        """Process the newest transforms: objects first, because the belief is updated with the hand."""
        for frame in self.listener.moving():
            object_id = self.frames.object_id(frame)
            if object_id and frame != self.hand:
                self.take_object(frame, object_id)
        transform = self.newest(self.hand)
        if transform is not None:
            self.take_hand(transform)

    def newest(self, frame: str) -> TransformStamped | None:
        """The newest transform of a frame; None if it was processed before."""
        try:
            transform = self.buffer.lookup_transform(self.base, frame, rospy.Time(0))
        except tf2_ros.TransformException:
            return None
        stamp = transform.header.stamp
        seen = self.stamps.steady(stamp)
        if stamp == self.last.get(frame) or seen <= self.seen.get(frame, -math.inf):
            return None
        self.last[frame], self.seen[frame] = stamp, seen
        return transform

    def take_object(self, frame: str, object_id: str) -> None:
        """Process an observation of an object."""
        transform = self.newest(frame)
        if transform is not None:
            seen, now = self.pace.at(self.seen[frame]), self.pace.now()
            self.filter.see_object(seen, object_id, position(transform), now)

    def take_hand(self, transform: TransformStamped) -> None:
        """Process an observation of the hand and publish recognition and belief."""
        stamp, place = self.pace.at(self.seen[self.hand]), position(transform)
        self.recogniser.update(stamp, place.tolist())
        self.publisher.publish(self.recognition())
        end = self.recogniser.pattern_end()
        belief = self.filter.see_hand(stamp, place, self.pace.now(), self.robot_holds, end)
        if belief.stamp == stamp:
            self.beliefs.publish(self.message(belief))
            self.broadcast(belief)

    def recognition(self) -> Recognition:
        """The recogniser's estimate as a message."""
        estimate = self.recogniser.estimate
        message = Recognition(
            pattern=estimate.pattern,
            confidence=estimate.confidence,
            decided=estimate.decided,
            progress=estimate.progress,
            names=list(estimate.probabilities),
            probabilities=list(estimate.probabilities.values()),
        )
        message.header.stamp = self.last[self.hand]
        message.header.frame_id = self.base
        return message

    def message(self, belief: Belief) -> HandoverBelief:
        """The belief as a message."""
        message = HandoverBelief(
            offer=belief.offer,
            request=belief.request,
            hand=self.hand,
            object_id=belief.object_id,
            object_frame=self.frames.object_frame(belief.object_id) if belief.object_id else "",
            pattern=belief.pattern,
            time=belief.time,
            time_deviation=belief.time_deviation,
        )
        message.header.stamp = self.last[self.hand]
        message.header.frame_id = self.base
        message.place_covariance = [-1.0] + [0.0] * 8
        if belief.place is not None and belief.covariance is not None:
            message.place = Point(*belief.place)
            message.place_covariance = [float(v) for v in belief.covariance.ravel()]
        return message

    def broadcast(self, belief: Belief) -> None:
        """Broadcast the predicted frames of hand and object; none without a prediction, so that a follower stops."""
        places = {self.hand: belief.hand_place}
        if belief.object_id:
            places[self.frames.object_frame(belief.object_id)] = belief.place
        transforms = []
        for frame, place in places.items():
            if place is None:
                continue
            try:
                turned = self.buffer.lookup_transform(self.base, frame, rospy.Time(0)).transform.rotation
            except tf2_ros.TransformException:
                continue
            ahead = TransformStamped(child_frame_id=frame + AHEAD)
            ahead.header.stamp = self.last[self.hand]
            ahead.header.frame_id = self.base
            ahead.transform.translation = Vector3(*place)
            ahead.transform.rotation = turned
            transforms.append(ahead)
        if transforms:
            self.broadcaster.sendTransform(transforms)


def position(transform: TransformStamped) -> np.ndarray:
    """Translation of a transform (m)."""
    p = transform.transform.translation
    return np.array([p.x, p.y, p.z])


def main() -> int:
    """Entry point. Exit status 1 if frames, patterns or parameters are invalid."""
    init_node("motion_recogniser")
    try:
        RecogniserNode()
    except ValueError as error:
        rospy.logfatal("motion_recogniser: %s", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
