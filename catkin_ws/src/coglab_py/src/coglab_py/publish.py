"""Publishing from threads that outlive the node's topics for a moment, with stamps that came from elsewhere."""

from __future__ import annotations

from typing import Any

import rospy


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publish, unless the node is shutting down: its topics close before its threads have ended."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not rospy.is_shutdown():
            raise


def can_be_sent(stamp: rospy.Time) -> bool:
    """Whether a message can carry this stamp, also as a number of seconds: nanoseconds beyond a second have led some
    past the last one. Publishing it would throw, and end the timer that does so."""
    return bool(0.0 <= stamp.to_sec() < 2**32)
