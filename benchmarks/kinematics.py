#!/usr/bin/python3
"""Inverse kinematics and the control cycle compared with KDL, and the ends of random reaches.

Times: processor time of a call, median of repetitions by google-benchmark, interleaved with those of the peer. Reaches:
300 random ones of 0.3 to 0.6 m, with rotations up to 60 degrees, through bridge, controller manager and simulated arm
in lockstep. A reach counts as missed if it is refused, aborted, or ends over 1 mm or 3 degrees from its goal.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import coglab_controllers as cc
import numpy as np
from coglab_sim import _cell, _virtual  # noqa: F401  (_cell knows the types that _virtual uses)
from common import DEVEL, LIMITS, SOURCES, URDF, Row, helper, in_parallel, main
from scipy.spatial.transform import Rotation

PACKAGE = SOURCES / "coglab_controllers"
PERIOD = 0.005  # s, of the control cycle
FRAME_PERIOD = 0.03  # s between two frames of the goal
START_LIMIT = 10.0  # s of simulated time, longest wait for a step of the start
REACH_LIMIT = 6.0  # s of simulated time, longest reach
SETTLED = 1.5  # s of simulated time between the end of a reach and its measurement
NEAR = 0.001  # m, largest distance of the hand from the goal
TURNED = 3.0  # degrees, largest angle of the hand to the goal


def times(quick: bool) -> Iterator[Row]:
    """Inverse kinematics and the whole control cycle."""
    command = [helper("control_cycle"), "--benchmark_filter=two_task_ik|kdl_wdls|cycle_", "--benchmark_format=json"]
    command += [f"--benchmark_repetitions={3 if quick else 15}", "--benchmark_enable_random_interleaving=true"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=1200).stdout)
    us = {
        one["run_name"]: one["cpu_time"] / 1000.0
        for one in found["benchmarks"]
        if one.get("aggregate_name") == "median"
    }
    yield Row("two-task inverse kinematics", us["two_task_ik"], "us", f"< KDL-wdls {us['kdl_wdls']:.3g}")
    name, peer = min(("KDL-pinv", us["cycle_KdlPinv"]), ("KDL-wdls", us["cycle_KdlWdls"]), key=lambda one: one[1])
    yield Row("whole control cycle", us["cycle_Dmp"], "us", f"< {name} {peer:.3g}")


def forbidden_calls(_quick: bool) -> Iterator[Row]:
    """Allocations, locks and system calls in 100 000 cycles while services are called, as counted by the package's
    test, if that is built."""
    for program in sorted((DEVEL / "lib" / "coglab_controllers").glob("coglab_controllers_test_*")):
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.xml"
            command = [str(program), "--gtest_filter=Cycle.Neither*", f"--gtest_output=xml:{report}"]
            subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=600, check=False)
            found = ElementTree.parse(report).iter("property") if report.is_file() else []
            counts = {one.get("name"): int(one.get("value") or -1) for one in found}
        if {"allocations", "locks", "system_calls"} <= set(counts):
            total = sum(counts[name] for name in ("allocations", "locks", "system_calls"))
            yield Row("allocations, locks and system calls in 100 000 control cycles", total, "", "<= 0")
            return
    print("not measured, not built: ./coglab test coglab_controllers builds the test that counts allocations")


@dataclass
class Reach:
    """Start posture (7,), goal (3,) in m and orientation (4,) at the end."""

    posture: np.ndarray
    goal: np.ndarray
    target: np.ndarray


def draw_reaches(number: int) -> list[Reach]:
    """Random reaches that stay within the arm's length."""
    chain, limits = cc.Chain(URDF.read_text()), cc.load_joint_limits(str(LIMITS))
    rng = np.random.default_rng(11)
    shoulder = chain.joint_origins(np.zeros(7))[1]
    reaches: list[Reach] = []
    while len(reaches) < number:
        posture = rng.uniform(0.75 * limits.lower_position, 0.75 * limits.upper_position)
        position, orientation = chain.fk(posture)
        way = rng.normal(size=3)
        goal = position + way / np.linalg.norm(way) * rng.uniform(0.3, 0.6)
        axis = rng.normal(size=3)
        turn = axis / np.linalg.norm(axis) * rng.uniform(0.0, np.radians(60.0))
        before = Rotation.from_quat(orientation)
        after = Rotation.from_quat(cc.exp_rotation(turn)) * before
        wrist = chain.joint_origins(posture)[5]
        goal_wrist = goal + after.apply(before.inv().apply(wrist - position))
        distances = [np.linalg.norm(w - shoulder) for w in (wrist, goal_wrist, 0.5 * (wrist + goal_wrist))]
        if min(distances) >= 0.3 and max(distances) <= 0.75 and min(position[2], goal[2]) >= 0.05:
            reaches.append(Reach(posture, goal, after.as_quat()))
    return reaches


def wait(robot: _virtual.LockstepRobot, condition, limit: float = START_LIMIT) -> None:
    """Advances until the condition holds."""
    end = robot.now + limit
    while not condition():
        if robot.now > end:
            raise TimeoutError(f"the simulated robot is not ready after {limit} s")
        robot.advance(PERIOD)


def must(answer: tuple) -> None:
    """Raises RuntimeError with the message if a service refused."""
    if not answer[0]:
        raise RuntimeError(answer[1])


def ready(posture: np.ndarray) -> _virtual.LockstepRobot:
    """A whole robot in virtual time, in command mode at a posture, with the DMP plug-in active."""
    text = (PACKAGE / "config" / "controllers.yaml").read_text()
    manager = re.sub(r"package://(\w+)", lambda found: str(SOURCES / found.group(1)), text)
    cell = {"krc/period": PERIOD, "seed": 1, "home": [float(q) for q in posture]}
    robot = _virtual.LockstepRobot(str(URDF), str(LIMITS), cell, manager)
    must(robot.load_controller("dmp", "coglab/DmpController"))
    must(robot.load_dmps(str(PACKAGE / "config" / "primitives.xml")))
    wait(robot, lambda: robot.cell.quality == 3)
    ticket = robot.submit("start")
    outcomes: list[tuple] = []  # an outcome is returned only once
    wait(robot, lambda: (outcome := robot.outcome(ticket)) is not None and not outcomes.append(outcome))
    must(outcomes[0])
    must(robot.switch_controller("dmp"))
    return robot


def off_goal(reach: Reach) -> bool:
    """True if a reach is refused, aborted, or ends off its goal."""
    robot = ready(reach.posture)
    robot.set_frame("goal", reach.goal, reach.target)
    upright = [0.0, 0.0, 0.0, 1.0]
    answer = robot.execute_dmp("reach_human", orientation_control=True, target_orientation=upright, goal_frame="goal")
    begin, ended = robot.now, None
    while answer[0] and (ended is None or robot.now - ended < SETTLED):
        robot.set_frame("goal", reach.goal, reach.target)
        for _ in range(round(FRAME_PERIOD / PERIOD)):
            robot.tick()
        motion = robot.report()["motion"]
        if motion == "aborted" or robot.now - begin > REACH_LIMIT + SETTLED:
            return True
        if motion == "reached" and ended is None:
            ended = robot.now
    hand = robot.cell.truth()["robot_hand"]
    turned = np.degrees(np.linalg.norm(cc.rotation_between(hand["rotation"], reach.target)))
    return not answer[0] or np.linalg.norm(hand["position"] - reach.goal) > NEAR or turned > TURNED


def reaches(quick: bool) -> Iterator[Row]:
    """Random reaches, many of which lead to a joint limit."""
    missed = in_parallel(off_goal, draw_reaches(8 if quick else 300))
    yield Row("random reaches that end off their goal", sum(missed), "", "<= 0", f"of {len(missed)}")


if __name__ == "__main__":
    main("kinematics", times, forbidden_calls, reaches)
