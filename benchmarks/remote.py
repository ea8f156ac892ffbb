#!/usr/bin/python3
"""Motions in Python on the running robot (coglab.control): how late their answers are at 200 Hz of the real clock.

The robot node with its ideal arm, and a Python process that computes a sway of 2 s again and again. An answer that
comes before the next cycle is one cycle late, which is the least that is possible.
"""

from __future__ import annotations

import math
import subprocess
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt
import rospy
from coglab.control import slot as wire
from coglab.control.host import MotionHost, serve
from coglab_msgs.srv import LwrCommand, StartMotion, SwitchController
from common import URDF, Row, end, main, median, quantile, shared_module

PERIOD = 0.005  # s
LIMIT = 60.0  # s
SLOT = "python_motion"


class Timed(MotionHost):
    """Notes how old each question is when its answer is complete, s."""

    ages: list[float]

    def answer(self, question: np.void, answer: npt.NDArray[np.void]) -> bool:
        """As its base."""
        made = super().answer(question, answer)
        if made:
            self.ages.append(1e-9 * (time.monotonic_ns() - int(question["written_ns"])))
        return made


def wait(condition: Callable[[], bool], what: str) -> None:
    """Wait until a condition holds."""
    latest = time.monotonic() + LIMIT
    while not condition():
        if time.monotonic() > latest:
            raise RuntimeError(f"not within {LIMIT} s: {what}")
        time.sleep(0.02)


def answers(quick: bool) -> Iterator[Row]:
    """Delay of the answers in cycles."""
    master = shared_module("own_master")
    sway = shared_module("my_sway").Sway
    with master.own_master() as names:
        names.setParam("/robot_description", URDF.read_text())
        names.setParam("/lwr", {"arm": "ideal", "rt_priority": 0})
        names.setParam("/controller_manager", {"cycle_time": PERIOD, "load": {SLOT: "coglab/RemoteMotion"}})
        node = subprocess.Popen([master.node_path("robot_node"), "__name:=robot"], stdout=subprocess.DEVNULL)
        try:
            wait(lambda: any(one.robot == node.pid for one in wire.offered()), "the slot")
            rospy.init_node("benchmark_remote", disable_signals=True)
            rospy.wait_for_service("/lwr/command", LIMIT)
            wait(lambda: bool(rospy.ServiceProxy("/lwr/command", LwrCommand)("start").success), "the arm's start")
            rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)(SLOT)
            start = rospy.ServiceProxy(f"/controller_manager/{SLOT}/start_motion", StartMotion)
            host = Timed(sway(), {"duration": 2.0})
            host.ages = []
            ended = threading.Event()
            with wire.Slot(wire.Address(node.pid, SLOT), wire.MOTION) as slot:
                thread = threading.Thread(target=serve, args=(slot, host), kwargs={"ends": ended.is_set})
                thread.start()
                try:
                    for _ in range(3 if quick else 30):
                        start([], [], False)
                        time.sleep(2.5)
                finally:
                    ended.set()
                    thread.join()
        finally:
            end(node)
    cycles = [math.floor(age / PERIOD) + 1 for age in host.ages]
    yield median("cycles until an answer from Python acts, median", cycles, "", "<= 1")
    yield quantile("cycles until an answer from Python acts, 99 %", cycles, 0.99, "", "<= 2")
    yield median("time until the answer is written, median", [1e3 * age for age in host.ages], "ms")


if __name__ == "__main__":
    main("remote", answers)
