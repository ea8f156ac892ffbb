#!/usr/bin/python3
"""Limits and stopping under loss of datagrams (docs/limits_under_loss.md), in lockstep and without ROS.

Every joint moves to the ends of its range at full speed, at FRI periods of 1 to 20 ms, with 0, 1, 5 and 10 % of the
cycles lost, singly and in bursts of up to 5; half of them lose the measurement, half the answer. A run that did not
start or lost command mode counts as a violation. Interpolator: 100 000 random states at each of four periods beside
ruckig.
"""

from __future__ import annotations

import random
import subprocess
from collections.abc import Iterator

import lwr_fri_bridge
import ruckig
from common import Row, helper, main


def losses(quick: bool) -> Iterator[Row]:
    """Violations of the set-points, and stopping angles."""
    seeds = 5 if quick else 1000
    run = subprocess.run([helper("loss_campaign"), str(seeds)], stdout=subprocess.PIPE, text=True, check=True)
    lines = [(words[0], [float(word) for word in words[1:]]) for words in map(str.split, run.stdout.splitlines())]
    approaches = [values for kind, values in lines if kind == "approach"]
    violations = sum(crossed + failed for *_, crossed, failed in approaches)
    violations += sum(max(speed, acceleration) > 1e-6 for _, _, speed, acceleration, *_ in approaches)
    what = "position, speed or acceleration beyond a limit, 0 to 10 % of datagrams lost"
    yield Row(what, violations, "", "<= 0", f"{seeds} seeds, 1 to 20 ms")
    slow = sum(values[-1] for kind, values in lines if kind == "stop")
    if slow:
        raise RuntimeError(f"{slow:.0f} stops did not begin at full speed")
    at_20 = next(values[1] for kind, values in lines if kind == "stop" and values[0] == 0.02)
    what = "stopping angle with bursts of loss at 20 ms over that without, largest"
    yield Row(what, at_20, "", "<= 1.5", f"{seeds} seeds")


def interpolator(quick: bool) -> Iterator[Row]:
    """Largest difference of one step to ruckig: rad, rad/s, rad/s^2."""
    rng = random.Random(1)
    generator, trajectory = ruckig.Ruckig(1), ruckig.Trajectory(1)
    asked = ruckig.InputParameter(1)
    asked.control_interface = ruckig.ControlInterface.Velocity
    asked.target_acceleration, asked.max_velocity = [0.0], [10.0]
    worst, states = 0.0, 2000 if quick else 100_000
    for tick in (0.001, 0.005, 0.020, 0.100):
        for _ in range(states):
            most_a, most_j = rng.uniform(0.5, 20.0), rng.uniform(5.0, 1000.0)
            p, v, a = rng.uniform(-3, 3), rng.uniform(-2.5, 2.5), rng.uniform(-1, 1) * most_a
            target = rng.uniform(-2.5, 2.5)
            asked.current_position, asked.current_velocity, asked.current_acceleration = [p], [v], [a]
            asked.target_velocity, asked.max_acceleration, asked.max_jerk = [target], [most_a], [most_j]
            generator.calculate(asked, trajectory)
            theirs = [entry[0] for entry in trajectory.at_time(tick)[:3]]
            ours = lwr_fri_bridge.step_axis(p, v, a, target, most_a, most_j, tick)
            worst = max(worst, *(abs(x - y) for x, y in zip(ours, theirs, strict=True)))
    yield Row("interpolator against ruckig, largest difference", worst, "", "<= 1e-12", f"{4 * states} random states")


if __name__ == "__main__":
    main("limits", losses, interpolator)
