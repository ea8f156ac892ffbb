#!/usr/bin/python3
"""The hand node (D4.10 Table 3); see ih2_hand.ros.hand_node."""

import sys

import rospy
from coglab_py.node_start import init_node
from coglab_py.steady import end_quietly
from ih2_hand.ros.hand_node import HandNode


def main() -> int:
    init_node("ih2_hand")
    end_quietly()
    try:
        node = HandNode()
    except (TypeError, ValueError, OSError) as error:
        rospy.logfatal("hand node: %s", error)
        return 1
    return node.run()


if __name__ == "__main__":
    sys.exit(main())
