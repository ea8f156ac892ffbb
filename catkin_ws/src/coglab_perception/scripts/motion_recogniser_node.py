#!/usr/bin/python3
"""The node /motion_recogniser: partner's hand from tf2 -> reaching pattern on /perception/recognition.

Parameters (private): patterns (file of train_patterns.py), hand_frame (human_hand), base_frame (world).
Publishes coglab_msgs/Recognition for each new transform.
"""
import sys

import rospy
import tf2_ros
from coglab_msgs.msg import Recognition
from coglab_perception.recogniser import Recogniser, load_patterns


class RecogniserNode:
    """Thin node over Recogniser."""

    def __init__(self) -> None:
        patterns, settings = load_patterns(rospy.get_param("~patterns"))
        self.recogniser = Recogniser(patterns, settings)
        self.hand = rospy.get_param("~hand_frame", "human_hand")
        self.base = rospy.get_param("~base_frame", "world")
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = tf2_ros.TransformListener(self.buffer)
        self.publisher = rospy.Publisher("/perception/recognition", Recognition, queue_size=1)
        self.last = rospy.Time(0)
        rospy.Timer(rospy.Duration(0.01), self.on_timer)

    def on_timer(self, _event) -> None:
        """Take the newest transform once."""
        try:
            transform = self.buffer.lookup_transform(self.base, self.hand, rospy.Time(0))
        except tf2_ros.TransformException:
            return
        stamp = transform.header.stamp
        if stamp <= self.last:
            return
        self.last = stamp
        p = transform.transform.translation
        estimate = self.recogniser.update(stamp.to_sec(), (p.x, p.y, p.z))
        message = Recognition(pattern=estimate.pattern, confidence=estimate.confidence, decided=estimate.decided,
                              progress=estimate.progress, names=list(estimate.probabilities),
                              probabilities=list(estimate.probabilities.values()))
        message.header.stamp = stamp
        message.header.frame_id = self.base
        self.publisher.publish(message)


def main() -> int:
    """Entry point."""
    rospy.init_node("motion_recogniser")
    try:
        RecogniserNode()
    except (KeyError, ValueError) as error:
        rospy.logfatal("motion_recogniser: %s", error)
        return 1
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
