#!/usr/bin/python3
"""Time of kinematics, inverse kinematics and of the cores' whole cycle beside KDL's velocity solvers.

Processor time of one call: median over 401 blocks of 240 calls, which alternate between all candidates, over 256
postures. Shares are the median of the blocks' own ratios. Nothing is left out.
"""

import json
import sys

from core_bench import core_times, row


def main() -> None:
    """Prints the rows as JSON."""
    t = core_times()
    rows = [
        row(
            "ik",
            "forward kinematics and Jacobian",
            t["fk_jacobian"],
            "us",
            "",
            "KDL",
            t["kdl_fk_jacobian"],
            below_peer=True,
        ),
        row(
            "ik",
            "two-task IK with kinematics",
            t["two_task_ik"],
            "us",
            "",
            "KDL wdls, whole-vector scaling",
            t["kdl_wdls"],
            below_peer=True,
        ),
        row(
            "ik",
            "two-task IK with kinematics (2)",
            t["two_task_ik"],
            "us",
            "",
            "KDL pinv, whole-vector scaling",
            t["kdl_pinv"],
            below_peer=True,
        ),
        row(
            "ik",
            "cycle of the cores: motion, kinematics, IK, guard",
            t["cycle"],
            "us",
            "<= 5",
            "the same on KDL wdls",
            t["cycle_kdl_wdls"],
            below_peer=True,
        ),
        row("ik", "share of the time of the same cycle on KDL wdls", t["share_of_kdl_wdls"], "1", "<= 0.5"),
        row("ik", "share of the time of the same cycle on KDL pinv", t["share_of_kdl_pinv"], "1", "<= 0.5"),
    ]
    json.dump(rows, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
