"""Publishing from threads that outlive the node's topics for a moment."""

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
