#!/usr/bin/python3
"""Time until the robot node answers a FRI datagram, compared with a bare echo, at 1 kHz: in monitor mode, and during
point-to-point motions to and fro with the shipped feedback controllers enabled.

Blocks of 500 packets go to echo, bridge, bridge, echo. Both get one packet per millisecond; the one under test gets its
packet first. Ratio: of the medians of neighbouring blocks, median over all pairs. An answer that does not come within
20 ms counts as 20 ms. The node is robot.launch as it ships.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from coglab_bringup.run_directory import free_port, run_environment
from common import Row, end, helper, main, median

MISSING = 20_000.0  # us
PATIENCE = 60.0  # s, longest duration of each step of the start
SHARE = 0.8  # smallest share of the answers that must move the arm while its motion runs
HOME = [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782]
AWAY = [value + 0.25 for value in HOME]


def move() -> None:
    """Command mode, feedback controllers, and point-to-point motions to and fro until the process ends."""
    import rospy
    from coglab_msgs.msg import FinishedPtp
    from coglab_msgs.srv import AddPtp, FeedbackSelect, LoadController, LwrCommand, SwitchController

    def call(name: str, kind: type, *arguments: object) -> object:
        """Until the service accepts it."""
        limit = time.monotonic() + PATIENCE
        rospy.wait_for_service(name, PATIENCE)
        while not (answer := rospy.ServiceProxy(name, kind)(*arguments)).success:
            if time.monotonic() > limit:
                raise TimeoutError(f"{name}: {answer.message}")
            time.sleep(0.2)
        return answer

    finished: list[int] = []
    rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: finished.append(m.ptp_id))
    call("controller_manager/load_controller", LoadController, "ptp", "coglab/PtpController")
    call("lwr/command", LwrCommand, "start")
    call("controller_manager/switch_controller", SwitchController, "ptp")
    call("controller_manager/feedback/enable", FeedbackSelect, [], "")  # no name: all that are loaded
    target = AWAY
    while True:
        motion = call("controller_manager/ptp/add_ptp", AddPtp, target, [], [])
        target = HOME if target is AWAY else AWAY
        limit = time.monotonic() + 20.0
        while motion.ptp_id not in finished and time.monotonic() < limit:
            time.sleep(0.02)


def measure(moving: bool, quads: int) -> dict[str, object]:
    """`ratios` of neighbouring blocks, median `us` of the bridge's blocks, `missing` answers."""
    with ExitStack() as stack:
        home = Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        port = free_port()
        os.environ.update(run_environment(port, home))
        launch = ["roslaunch", "-p", str(port), "coglab_controllers", "robot.launch", "fri_port:=0"]
        stack.callback(end, subprocess.Popen(launch, stdout=sys.stderr))
        echo = subprocess.Popen([helper("fri_peer"), "echo"], stdout=subprocess.PIPE, text=True)
        stack.callback(end, echo)
        assert echo.stdout is not None
        echo_port = echo.stdout.readline().strip()
        import rosgraph
        import rospy

        limit, bridge_port = time.monotonic() + PATIENCE, 0
        while not bridge_port:
            if time.monotonic() > limit:
                raise TimeoutError(f"the robot node published no UDP port within {PATIENCE:.0f} s")
            time.sleep(0.1)
            bridge_port = rospy.get_param("/lwr/fri_port_bound", 0) if rosgraph.is_master_online() else 0
        rospy.init_node("bench_wire", disable_signals=True)
        if moving:
            threading.Thread(target=move, daemon=True).start()
        command = [helper("fri_peer"), "measure" if moving else "monitor", echo_port, str(bridge_port), str(quads)]
        text = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, timeout=300 + 10 * quads).stdout
    return read(text, moving)


def read(text: str, moving: bool) -> dict[str, object]:
    """Parses the output of fri_peer."""
    blocks: list[tuple[str, float]] = []  # kind, median
    numbers = {}
    for kind, *values in map(str.split, text.splitlines()):
        if kind in ("echo", "bridge"):
            us = [float(value) if float(value) >= 0.0 else MISSING for value in values]
            blocks.append((kind, statistics.median(us)))
        elif values:
            numbers[kind] = float(values[0])
    if moving and numbers["moving"] < SHARE:
        raise RuntimeError(f"only {numbers['moving']:.0%} of the answers moved the arm, expected {SHARE:.0%}")
    medians = [value for _, value in blocks]
    ratios = []
    for first in range(0, len(blocks), 4):  # echo, bridge, bridge, echo
        ratios += [medians[first + 1] / medians[first], medians[first + 2] / medians[first + 3]]
    return {"ratios": ratios, "missing": numbers["missing"]}


def measured(way: str, quick: bool) -> dict:
    """measure() in its own process, because a process can be a node of only one master."""
    command = [sys.executable, __file__, "--way", way, "2" if quick else "40"]
    return json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, timeout=1200).stdout)


def answers(quick: bool) -> Iterator[Row]:
    """Monitor mode and moving."""
    found = measured("monitor", quick)
    yield median("answer time divided by that of a bare echo, monitor mode", found["ratios"], "", "<= 1.1")
    moving = measured("moving", quick)
    yield median("answer time divided by that of a bare echo, while a motion runs", moving["ratios"], "", "<= 1.1")
    missing = found["missing"] + moving["missing"]
    yield Row("FRI datagrams without an answer within 20 ms", missing, "", "<= 0")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--way"]:
        print(json.dumps(measure(sys.argv[2] == "moving", int(sys.argv[3]))))
    else:
        main("wire", answers)
