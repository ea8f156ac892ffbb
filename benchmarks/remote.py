#!/usr/bin/python3
"""Own controllers in Python (coglab.control): in the cycle of a World, and in a process beside the running robot.

In real time: the robot node with its ideal arm, and a Python process that answers at 200 Hz. An answer before the next
cycle is one cycle late, the smallest possible delay. In lockstep: processes are stopped and killed at random moments,
and each cycle is checked (coglab/test/remote_process.py).
"""

from __future__ import annotations

import math
import random
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import coglab
import ctrl_more
import numpy as np
import numpy.typing as npt
import rospy
from coglab.control import slot as wire
from coglab.control.feedback_host import FeedbackHost
from coglab.control.host import MotionHost, serve
from coglab_msgs.srv import FeedbackSelect, LoadController, LwrCommand, StartMotion, SwitchController
from common import URDF, Row, end, main, median, quantile, share, shared_module

PERIOD = 0.005  # s
LIMIT = 60.0  # s
MOTION, FEEDBACK = "python_motion", "python_feedback"


class Yields(ctrl_more.FeedbackController):
    """The law of EeAdmittance for translation: a mass on a spring and a damper, integrated by Euler's method."""

    def describe(self) -> ctrl_more.Description:
        """Inputs, corrected signals and gains."""
        d = ctrl_more.Description("lets the hand yield to force")
        d.measured("wrench", size=6, max_age=0.1)
        d.modifies("taskSpaceReferencePose", "ee", limit=ctrl_more.CorrectionLimit(size=0.5))
        d.modifies("taskSpaceReferenceVel", "ee", limit=ctrl_more.CorrectionLimit(size=5.0))
        for name, value in (("mass", 4.0), ("damping", 60.0), ("stiffness", 200.0)):
            d.gain(name, [value] * 3, low=0.0, high=1e5)
        d.gain("dead_band", 3.0, low=0.0, high=100.0)
        return d

    def initialize(self, setup: ctrl_more.Setup) -> None:
        """Handles."""
        self.wrench, self.pose = setup.read("wrench"), setup.modify("taskSpaceReferencePose/ee")
        self.twist = setup.modify("taskSpaceReferenceVel/ee")
        self.mass, self.damping, self.stiffness = (setup.gain(name) for name in ("mass", "damping", "stiffness"))
        self.dead_band = setup.gain("dead_band")
        self.gains_changed()
        self.reset()

    def gains_changed(self) -> None:
        """Updates the matrix of the differential equation, and the effect of a force."""
        self.lightness, self.least = 1.0 / self.gain(self.mass), self.scalar(self.dead_band)
        spring, damper = self.gain(self.stiffness) * self.lightness, self.gain(self.damping) * self.lightness
        self.rates = np.block([[np.zeros((3, 3)), np.eye(3)], [np.diag(-spring), np.diag(-damper)]])

    def reset(self) -> None:
        """At rest, without an offset."""
        self.state = np.zeros(6)  # offset, velocity

    def update(
        self,
        cycle: ctrl_more.Cycle,
        robot: ctrl_more.RobotView,
        original: ctrl_more.ControlView,
        modified: ctrl_more.ModifiedControlStates,
    ) -> None:
        """One cycle."""
        force = robot.view(self.wrench)[:3]
        size = math.sqrt(force.dot(force))
        rate = self.rates @ self.state
        if size > self.least:
            rate[3:] += force * (self.lightness * (1.0 - self.least / size))
        self.state += cycle.dt * rate
        modified[self.pose][:3] += self.state[:3]
        modified[self.twist][:3] += self.state[3:]


def in_the_cycle(quick: bool) -> Iterator[Row]:
    """Time of a law in Python in the cycle of a World, less that of the same law in C++: medians of 200 cycles."""
    with coglab.World(seed=1, person="patient") as world:
        manager, robot = world.feedback, world.cell.robot.virtual
        manager.add_controller(Yields(), "yields")
        spent: dict[str, list[float]] = {"ee_admittance": [], "yields": []}
        for _ in range(10 if quick else 100):
            for name, times in spent.items():
                manager.disable()
                manager.enable(name)
                for _ in range(60):  # until the blending of both has ended
                    robot.tick()
                ticks = []
                for _ in range(200):
                    before = time.perf_counter()
                    robot.tick()
                    ticks.append(time.perf_counter() - before)
                times.append(float(np.median(ticks)))
                if manager.status(name).activity != "running":
                    raise RuntimeError(f"{name} does not run: {manager.status(name).fault_text}")
    more = [1e6 * (python - cpp) for cpp, python in zip(*spent.values(), strict=True)]
    yield median("extra time of a Python admittance in World, compared with C++, per cycle", more, "us", "<= 20")


class Timed:
    """A host that records the age (s) of each question when its answer is complete."""

    def __init__(self, host: Any) -> None:
        self.host, self.ages = host, []  # type: ignore[var-annotated]

    def answer(self, question: np.void, answer: npt.NDArray[np.void]) -> bool:
        """As its host."""
        made = bool(self.host.answer(question, answer))
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


def serving(address: wire.Address, kind: int, host: Any, act: Callable[[], None]) -> list[float]:
    """Answers the questions of a slot while `act` runs. Returns the ages of the answers, s."""
    timed, ended = Timed(host), threading.Event()
    with wire.Slot(address, kind) as slot:
        thread = threading.Thread(target=serve, args=(slot, timed), kwargs={"ends": ended.is_set})
        thread.start()
        try:
            act()
        finally:
            ended.set()
            thread.join()
    return timed.ages


def answers(quick: bool) -> Iterator[Row]:
    """Delay of answers and corrections in cycles: the worse of both."""
    master = shared_module("own_master")
    sway = shared_module("my_sway").Sway
    seconds = 7.5 if quick else 75.0
    with master.own_master() as names:
        names.setParam("/robot_description", URDF.read_text())
        names.setParam("/lwr", {"arm": "ideal", "rt_priority": 0})
        names.setParam("/controller_manager", {"cycle_time": PERIOD, "load": {MOTION: "coglab/RemoteMotion"}})
        node = subprocess.Popen([master.node_path("robot_node"), "__name:=robot"], stdout=subprocess.DEVNULL)
        try:
            wait(lambda: any(one.robot == node.pid for one in wire.offered()), "the slot")
            rospy.init_node("benchmark_remote", disable_signals=True)
            rospy.wait_for_service("/lwr/command", LIMIT)
            wait(lambda: bool(rospy.ServiceProxy("/lwr/command", LwrCommand)("start").success), "the arm's start")
            rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)(MOTION)
            start = rospy.ServiceProxy(f"/controller_manager/{MOTION}/start_motion", StartMotion)

            def move() -> None:
                for _ in range(round(seconds / 2.5)):
                    start([], [], False)
                    time.sleep(2.5)

            moved = serving(wire.Address(node.pid, MOTION), wire.MOTION, MotionHost(sway(), {"duration": 2.0}), move)
            rospy.ServiceProxy("/controller_manager/load_controller", LoadController)(FEEDBACK, "RemoteFeedback")
            rospy.ServiceProxy("/controller_manager/feedback/enable", FeedbackSelect)([FEEDBACK], "")
            corrected = serving(
                wire.Address(node.pid, FEEDBACK), wire.FEEDBACK, FeedbackHost(Yields(), {}), lambda: time.sleep(seconds)
            )
        finally:
            end(node)
    words = "cycles until an answer or a correction from Python acts, 99 %"
    both = ([math.floor(age / PERIOD) + 1 for age in ages] for ages in (moved, corrected))
    yield max((quantile(words, cycles, 0.99, "", "<= 2") for cycles in both), key=lambda row: row.value)


def disturbed(quick: bool) -> Iterator[Row]:
    """Correction and motion after their process was stopped or killed at a random moment."""
    remote = shared_module("remote_process")
    draw = random.Random(4)
    with coglab.World(seed=1, person="patient") as world:
        slots = remote.Slots(world)
        for kind, words in ((FEEDBACK, "corrections gone in time"), (MOTION, "motions that brake within limits")):
            good = []
            for _ in range(5 if quick else 200):
                try:
                    slots.disturb(kind, draw)
                    good.append(True)
                except AssertionError as error:
                    print(error)
                    good.append(False)
            yield share(f"{words}, process stopped or killed at a random moment", good, ">= 100")


if __name__ == "__main__":
    main("remote", in_the_cycle, answers, disturbed)
