#!/usr/bin/python3
"""Time of kinematics, inverse kinematics and of the cores' whole cycle beside KDL's velocity solvers.

Processor time of one call: median over 401 blocks of 240 calls, which alternate between all candidates, over 256
postures. Shares are the median of the blocks' own ratios. Nothing is left out.
"""

import json
import sys

from core_bench import core_times, row

BLOCKS = 401
"""as core_times.cpp runs them"""


def main() -> None:
    """Prints the rows as JSON."""
    t = core_times()
    calls, ratios = f"median of {BLOCKS} blocks of 240 calls", f"median of {BLOCKS} block ratios"
    share = "time of a cycle of the cores over that of the same cycle on KDL"
    rows = [
        row(
            "ik",
            f"forward kinematics and Jacobian, {calls}",
            t["fk_jacobian"],
            "us",
            "",
            "KDL",
            t["kdl_fk_jacobian"],
            below_peer=True,
        ),
        row(
            "ik",
            f"two-task IK with kinematics, beside KDL wdls, {calls}",
            t["two_task_ik"],
            "us",
            "",
            "KDL wdls, whole-vector scaling",
            t["kdl_wdls"],
            below_peer=True,
        ),
        row(
            "ik",
            f"two-task IK with kinematics, beside KDL pinv, {calls}",
            t["two_task_ik"],
            "us",
            "",
            "KDL pinv, whole-vector scaling",
            t["kdl_pinv"],
            below_peer=True,
        ),
        row(
            "ik",
            f"cycle of the cores (motion, kinematics, IK, guard), {calls}",
            t["cycle"],
            "us",
            "<= 5",
            "the same on KDL wdls",
            t["cycle_kdl_wdls"],
            below_peer=True,
        ),
        row("ik", f"{share} wdls, {ratios}", t["share_of_kdl_wdls"], "1", "<= 0.5"),
        row("ik", f"{share} pinv, {ratios}", t["share_of_kdl_pinv"], "1", "<= 0.5"),
    ]
    json.dump(rows, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
