#!/usr/bin/python3
"""The node motion_recogniser: partner's hand from tf2 -> reaching pattern on perception/recognition.

Publishes coglab_msgs/Recognition for each new transform of the hand: all probabilities, live. Names
are relative. Parameters: perception/frames (mapping of frames.yaml); private: patterns (file of
train_patterns.py), memory (s, how long an estimate outlives its reach; default the file's).
"""

from __future__ import annotations

import dataclasses
import sys

import rospy
import tf2_ros
from coglab_msgs.msg import Recognition
from coglab_perception.frames import FrameNames
from coglab_perception.recogniser import CLOCK_JUMP, Recogniser, load_patterns
from coglab_perception.tf_listener import TfListener
from coglab_py import parameters


class RecogniserNode:
    """Thin node over Recogniser."""

    def __init__(self) -> None:
        frames = FrameNames.from_mapping(
            rospy.get_param("perception/frames", None), rospy.resolve_name("perception/frames")
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
        self.hand, self.base = frames.human_hand, frames.world
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = TfListener(self.buffer, self.base)
        self.publisher = rospy.Publisher("perception/recognition", Recognition, queue_size=1)
        self.last = rospy.Time(0)  # stamp of the newest transform taken
        rospy.Timer(rospy.Duration(0.01), self.on_timer)

    def on_timer(self, _event: rospy.timer.TimerEvent) -> None:
        """The timer's thread would not survive an exception."""
        try:
            self.take_newest()
        except Exception as error:
            rospy.logerr_throttle(5.0, f"motion_recogniser: a transform of '{self.hand}' was not used: {error}")

    def take_newest(self) -> None:
        """Take the newest transform once."""
        try:
            transform = self.buffer.lookup_transform(self.base, self.hand, rospy.Time(0))
        except tf2_ros.TransformException:
            return
        late = (self.last - transform.header.stamp).to_sec()
        if 0.0 <= late <= CLOCK_JUMP:
            return
        self.last = transform.header.stamp
        try:
            self.publisher.publish(self.message(transform))
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():
                raise  # else: rospy has closed the topic under a last tick of the timer

    def message(self, transform) -> Recognition:
        """What the recogniser says after this transform."""
        p = transform.transform.translation
        estimate = self.recogniser.update(self.last.to_sec(), (p.x, p.y, p.z))
        message = Recognition(
            pattern=estimate.pattern,
            confidence=estimate.confidence,
            decided=estimate.decided,
            progress=estimate.progress,
            names=list(estimate.probabilities),
            probabilities=list(estimate.probabilities.values()),
        )
        message.header.stamp = self.last
        message.header.frame_id = self.base
        return message


def main() -> int:
    """Entry point; exit status 1 where frames or patterns cannot be used."""
    rospy.init_node("motion_recogniser")
    try:
        RecogniserNode()
    except ValueError as error:
        rospy.logfatal("motion_recogniser: %s", error)
        return 1
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
