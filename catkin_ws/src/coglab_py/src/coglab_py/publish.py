"""Publishing from threads that may outlive the node's topics, with stamps from other sources."""

from __future__ import annotations

from typing import Any

import rospy

from coglab_py.steady import ending


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Publish, unless the node is shutting down. At shutdown the topics close before the threads end."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not ending():
            raise


def can_be_sent(stamp: rospy.Time) -> bool:
    """True if a message can carry this stamp, also converted to seconds: more than 1e9 nanoseconds can exceed
    the largest number of seconds. Publishing such a stamp would raise an error and end the timer that publishes."""
    return bool(0.0 <= stamp.to_sec() < 2**32)
