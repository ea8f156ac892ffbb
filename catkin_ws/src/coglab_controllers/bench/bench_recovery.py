#!/usr/bin/python3
"""Part of figure `recovery`: how soon the arm stands after a motion is cancelled, in lockstep.

Bridge, controller manager and stand-in for the robot controller; both controllers, four speeds, seeded starts and
moments: 120 cancels. Time: from the request to the answer, less the time-optimal braking of the set-point as it was, in
cycles. Motions whose joints were all slower than 0.01 rad/s at the request had nothing to brake: they are left out, and
counted. An arm that does not stand within 5 s makes the whole bench missed. Prints a JSON list of rows.
"""

import json
import sys

import lwr_fri_bridge
import numpy as np
from core_bench import LIMITS, row
from lockstep import PERIOD, must, ready

HOME = np.array([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
GOAL = np.array([0.75, 0.0, 0.5])
SPEEDS = (0.2, 0.45, 0.7, 1.0)  # point-to-point: share of the joints' limits; DMP: 1 / dmp_ratio
SEEDS = 15
WAIT = 5.0  # s of simulated time for the arm to stand


def braking_time(report: dict, limits: lwr_fri_bridge.JointLimits) -> float:
    """Time-optimal braking of the set-point as it is, slowest joint, s."""
    state = zip(
        report["commanded_velocity"], report["commanded_acceleration"], limits.acceleration, limits.jerk, strict=True
    )
    return max(lwr_fri_bridge.time_to_velocity(v, a, 0.0, most, jerk) for v, a, most, jerk in state)


def begin(robot: object, controller: str, speed: float, goal: np.ndarray, random: np.random.Generator) -> None:
    """Starts a motion of a controller from wherever the arm stands; `goal` (3,) m of the DMP."""
    must(robot.switch_controller(controller))
    if controller == "ptp":
        limits = lwr_fri_bridge.JointLimits(str(LIMITS))
        most = 0.9 * np.asarray(limits.upper_position)
        target = np.clip(HOME + random.uniform(-0.6, 0.6, 7), -most, most)
        status, _, message = robot.add_ptp(list(target), list(speed * np.asarray(limits.velocity)), [])
        must((status == 0, message))
    else:
        robot.set_frame("goal", goal)
        must(robot.execute_dmp("reach_human", dmp_ratio=1.0 / speed, goal_frame="goal"))


def cancelled(
    robot: object, controller: str, speed: float, seed: int, limits: lwr_fri_bridge.JointLimits
) -> tuple[float, float]:
    """Cycles beyond the braking time until the answer came, and the fastest joint (rad/s) at the cancel."""
    random = np.random.default_rng([seed, int(100 * speed), controller == "ptp"])
    goal = GOAL + random.uniform(-0.15, 0.15, 3)
    begin(robot, controller, speed, goal, random)
    for _ in range(int(random.integers(40, 200))):
        if controller == "dmp":
            robot.set_frame("goal", goal)
        robot.tick()
    report = robot.report()
    best, fastest = braking_time(report, limits), float(np.max(np.abs(report["commanded_velocity"])))
    order, asked = robot.ask_cancel(controller, "bench"), robot.now
    while (answer := robot.cancel_outcome(order)) is None:
        if robot.now - asked > WAIT:
            raise TimeoutError(f"{controller} at speed {speed}, seed {seed}: the arm does not stand after {WAIT} s")
        robot.tick()
    must((answer["success"], answer["message"]))
    cycles = (robot.now - asked - best) / PERIOD
    report = robot.report()
    if np.any(report["commanded_velocity"]) or np.any(report["commanded_acceleration"]):
        raise RuntimeError("the answer came before the set-point stood")
    return cycles, fastest


def main() -> int:
    """Measures and prints the rows."""
    limits = lwr_fri_bridge.JointLimits(str(LIMITS))
    robot = ready(HOME)
    must(robot.load_controller("ptp", "coglab/PtpController"))
    runs: list[tuple[float, float]] = []
    for seed in range(SEEDS):
        for speed in SPEEDS:
            for controller in ("ptp", "dmp"):
                runs.append(cancelled(robot, controller, speed, seed, limits))
    moving = [cycles for cycles, fastest in runs if fastest > 0.01]
    if len(moving) < len(runs) // 2:
        raise RuntimeError(f"only {len(moving)} of {len(runs)} motions were under way when they were cancelled")
    what = f"cancel of {len(moving)} motions under way, both controllers: time until the arm stands, beyond braking"
    rows = [
        row("recovery", f"{what}, median", float(np.median(moving)), "cycles beyond braking", "<= 2"),
        row("recovery", f"{what}, longest", max(moving), "cycles beyond braking"),
        row(
            "recovery",
            f"motions that were under way when they were cancelled, of {len(runs)}, both controllers",
            len(moving),
            "1",
        ),
    ]
    print(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
