#!/usr/bin/python3
"""Figure `ideal_arm`: from the call of roslaunch with arm:=ideal, master included, to the first joint_states.

Five starts, each with a master of its own; the median is judged. Nothing is left out: a start without joint_states
within 30 s counts as 30 s. Prints JSON.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from coglab_bringup.run_directory import free_port, run_environment

STARTS, LIMIT, GOAL = 5, 30.0, 4.0  # s


def first_joint_states() -> float:
    """Seconds from the call of roslaunch to the first message, in this process, which is a node of that master."""
    import rosgraph
    import rospy
    from sensor_msgs.msg import JointState

    port = os.environ["ROS_MASTER_URI"].rpartition(":")[2].strip("/")
    begin = time.monotonic()
    launch = subprocess.Popen(
        ["roslaunch", "-p", port, "coglab_bringup", "coglab.launch", "arm:=ideal"], stdout=sys.stderr
    )
    came: list[float] = []
    try:
        while not rosgraph.is_master_online() and time.monotonic() - begin < LIMIT:
            time.sleep(0.02)
        rospy.init_node("bench_ideal_arm", disable_signals=True)
        rospy.Subscriber("/lwr/joint_states", JointState, lambda _: came.append(time.monotonic()))
        while not came and time.monotonic() - begin < LIMIT:
            time.sleep(0.01)
    finally:
        launch.terminate()
        launch.wait(20)
    return came[0] - begin if came else LIMIT


def main() -> None:
    """Prints the row; with the word once the seconds of one start."""
    if sys.argv[1:] == ["once"]:
        print(first_joint_states())
        return
    times = []
    for _ in range(STARTS):
        with tempfile.TemporaryDirectory() as folder:
            environment = run_environment(free_port(), Path(folder))
            command = [sys.executable, __file__, "once"]
            run = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, timeout=90, check=False)
            times.append(float(run.stdout) if run.returncode == 0 else LIMIT)
    value = statistics.median(times)
    figure = f"launch arm:=ideal to the first joint_states, median of {STARTS}; slowest {max(times):.2f} s"
    row = dict(figure=figure, value=value, unit="s", goal=f"<= {GOAL:g}", peer=None, peer_value=None, ok=value <= GOAL)
    print(json.dumps([dict(bench="ideal_arm", **row)], indent=1))


if __name__ == "__main__":
    main()
