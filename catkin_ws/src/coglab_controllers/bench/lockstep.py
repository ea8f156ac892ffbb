"""The random reaches through bridge, controller manager and the stand-in for the robot controller, in lockstep.

Needs the robot in virtual time of coglab_sim; without it the bench reports the interpolator alone.
"""

from dataclasses import dataclass

import numpy as np
from core_bench import LIMITS, PRIMITIVES, URDF

try:
    from coglab_sim import _cell, _virtual  # noqa: F401  (_cell knows the types that _virtual uses)
except ImportError:  # optional: the simulated cell is a package of its own
    _virtual = None

PERIOD, FRAME_PERIOD = 0.005, 0.03
START_LIMIT, REACH_LIMIT, WATCHED = 10.0, 6.0, 1.5  # s of simulated time


@dataclass
class LockstepReach:
    """Distance of the hand from its goal when it stands (m), time until it stood (s), largest joint speed over its
    limit: of the set-point that the bridge sends, and of the arm behind its servos."""

    last: float
    duration: float
    over: float
    arm_over: float


def wait(robot, condition, limit: float) -> None:
    """Advances until the condition holds; raises TimeoutError after `limit` s of simulated time."""
    end = robot.now + limit
    while not condition():
        if robot.now > end:
            raise TimeoutError(f"the simulated robot did not get ready within {limit} s")
        robot.advance(PERIOD)


def must(answer: tuple) -> None:
    """Raises what a service refused."""
    if not answer[0]:
        raise RuntimeError(answer[1])


def ready(posture: np.ndarray, manager: str = ""):
    """The whole robot in virtual time, standing in a posture in command mode, with the DMP plug-in active.

    `manager`: YAML text of the controller manager's parameters.
    """
    cell = {"krc/period": PERIOD, "seed": 1, "home": [float(q) for q in posture]}
    robot = _virtual.VirtualRobot(str(URDF), str(LIMITS), cell, manager)
    must(robot.load_controller("dmp", "coglab/DmpController"))
    must(robot.load_dmps(str(PRIMITIVES)))
    wait(robot, lambda: robot.cell.quality == 3, START_LIMIT)
    ticket = robot.submit("start")
    outcomes: list[tuple] = []  # an outcome is told once
    wait(robot, lambda: (o := robot.outcome(ticket)) is not None and not outcomes.append(o), START_LIMIT)
    must(outcomes[0])
    must(robot.switch_controller("dmp"))
    return robot


def reach(posture: np.ndarray, goal: np.ndarray, target: np.ndarray, limit: np.ndarray) -> LockstepReach | str:
    """One DMP motion from rest in a posture to a goal frame that stays; a sentence if it is refused or aborted.

    `limit` (7,): joint speeds, rad/s. The hand is where the simulated arm has it, not where measurement says.
    """
    robot = ready(posture)
    robot.set_frame("goal", goal, target)
    answer = robot.execute_dmp(
        "reach_human", orientation_control=True, target_orientation=[0.0, 0.0, 0.0, 1.0], goal_frame="goal"
    )
    if not answer[0]:
        return answer[1]
    begin, over, arm_over, reached, stood = robot.now, 0.0, 0.0, None, None
    before = robot.report()["commanded_position"]
    while reached is None or robot.now - reached < WATCHED:
        robot.set_frame("goal", goal, target)
        for _ in range(round(FRAME_PERIOD / PERIOD)):
            robot.tick()
            speed = float(np.max(np.abs(robot.cell.velocity) / limit))
            arm_over = max(arm_over, speed)
            report = robot.report()
            set_point = report["commanded_position"]
            over = max(over, float(np.max(np.abs(set_point - before) / (PERIOD * limit))))
            before = set_point
        if report["motion"] == "aborted":
            return report["reason"]
        if report["motion"] == "reached" and reached is None:
            reached = robot.now
        if robot.now - begin > REACH_LIMIT:
            return report["reason"] or "the motion waits at a border of the workspace"
        stood = (stood or robot.now) if speed < 1e-3 else None
    hand = robot.cell.truth()["robot_hand"]["position"]
    return LockstepReach(float(np.linalg.norm(hand - goal)), (stood or robot.now) - begin, over, arm_over)
