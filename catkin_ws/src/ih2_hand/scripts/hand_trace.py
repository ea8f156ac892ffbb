#!/usr/bin/python3
"""Prints every frame between host and hand in hex, with its meaning.

Without arguments: the frames of the running hand node (topic /ih2_hand/trace). With --hex: the meaning of
the given host-to-hand bytes; this needs no ROS.
"""

from __future__ import annotations

import argparse
import sys

from ih2_hand.trace import Tracer


def follow(topic: str, count: int) -> int:
    """Print the lines that the hand node traces, until interrupted or `count` lines."""
    import rosgraph
    import rospy
    from std_msgs.msg import String

    if not rosgraph.is_master_online():
        print("no ROS master answers: start the system first (or use --hex)", file=sys.stderr)
        return 3
    rospy.init_node("hand_trace", anonymous=True)
    printed = 0

    def show(line: String) -> None:
        nonlocal printed
        if not count or printed < count:
            printed += 1
            print(line.data, flush=True)
        if count and printed >= count:
            rospy.signal_shutdown("enough lines")

    rospy.Subscriber(topic, String, show, queue_size=1000)
    rospy.spin()
    return 0


def explain(text: str) -> int:
    """Print the meaning of bytes given as hex digits."""
    try:
        data = bytes.fromhex(text)
    except ValueError as error:
        print(f"--hex needs pairs of hex digits such as `44 04 64`: {error}", file=sys.stderr)
        return 2
    for line in Tracer().feed(">", data, 0.0):
        print(line[15:])
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--topic", default="ih2_hand/trace", help="trace topic of the hand node")
    parser.add_argument("--count", type=int, default=0, help="end after this many lines")
    parser.add_argument("--hex", help='explain these bytes, for instance "44 04 64"')
    arguments = [item for item in sys.argv[1:] if ":=" not in item]
    options = parser.parse_args(arguments)
    return explain(options.hex) if options.hex is not None else follow(options.topic, options.count)


if __name__ == "__main__":
    sys.exit(main())
