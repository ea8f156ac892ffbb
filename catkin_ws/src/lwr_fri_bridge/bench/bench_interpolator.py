#!/usr/bin/python3
"""The interpolator: time of a step, distance from ruckig (if installed), limits, braking. Prints JSON.

1e5 random states at each of four periods; distance and excess are the largest of all of them, nothing is left out.
"""

from __future__ import annotations

import json
import os
import pathlib
import random
import subprocess
import sys

import lwr_fri_bridge

LIMIT_US = 0.5
LIMIT_DIFFERENCE = 1e-12
LIMIT_EXCESS = 1e-9
WIRE_SPEED, WIRE_ACCELERATION = 5e-4, 1.0  # rad/s, rad/s^2 that float32 positions may add
STATES = 100_000  # per tick length
BINARY = "lwr_fri_bridge_time_interpolator"
LIMITS = pathlib.Path(__file__).resolve().parents[2] / "lwr_description/config/joint_limits.yaml"


def helper(mode: str) -> list[float]:
    """The numbers that the helper binary of the sourced workspace prints."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = pathlib.Path(prefix) / "lib" / "lwr_fri_bridge" / BINARY
        if path.is_file():
            out = subprocess.run(
                [str(path), mode, str(LIMITS)],
                check=True,
                stdout=subprocess.PIPE,
                text=True,
                timeout=300,
            ).stdout
            return [float(word) for word in out.split()]
    sys.exit(f"{BINARY} not found: build the workspace and source its setup.bash")


def distance_from_ruckig() -> float | None:
    try:
        import ruckig
    except ImportError:
        return None
    rng = random.Random(1)
    generator, trajectory = ruckig.Ruckig(1), ruckig.Trajectory(1)
    parameters = ruckig.InputParameter(1)
    parameters.control_interface = ruckig.ControlInterface.Velocity
    parameters.target_acceleration = [0.0]
    parameters.max_velocity = [10.0]
    worst = 0.0
    for tick in (0.001, 0.005, 0.020, 0.100):
        for _ in range(STATES):
            max_a, max_j = rng.uniform(0.5, 20.0), rng.uniform(5.0, 1000.0)
            p, v, a = rng.uniform(-3, 3), rng.uniform(-2.5, 2.5), rng.uniform(-1, 1) * max_a
            target = rng.uniform(-2.5, 2.5)
            parameters.current_position, parameters.current_velocity = [p], [v]
            parameters.current_acceleration, parameters.target_velocity = [a], [target]
            parameters.max_acceleration, parameters.max_jerk = [max_a], [max_j]
            generator.calculate(parameters, trajectory)
            theirs = [entry[0] for entry in trajectory.at_time(tick)[:3]]
            ours = lwr_fri_bridge.step_axis(p, v, a, target, max_a, max_j, tick)
            worst = max(worst, *(abs(x - y) for x, y in zip(ours, theirs, strict=True)))
    return worst


def row(
    figure: str,
    value: float | None,
    unit: str,
    limit: float,
    peer: str | None = None,
    goal: str | None = None,
) -> dict[str, object]:
    return {
        "bench": "interpolator",
        "figure": figure,
        "value": value,
        "unit": unit,
        "goal": goal or f"<= {limit}",
        "peer": peer,
        "peer_value": None,
        "ok": None if value is None else value <= limit,
    }


def main() -> None:
    rows = [row("step of 7 axes, median", round(helper("time")[0], 4), "us", LIMIT_US)]
    worst = distance_from_ruckig()
    rows.append(
        row(
            f"largest difference, {STATES} random states at each of 1, 5, 20, 100 ms",
            worst,
            "rad, rad/s, rad/s^2",
            LIMIT_DIFFERENCE,
            "ruckig" if worst is not None else "ruckig (not installed)",
        )
    )
    speed, acceleration, jerk, wire_speed, wire_acceleration = helper("limits")
    for name, value in (("speed", speed), ("acceleration", acceleration), ("jerk", jerk)):
        rows.append(row(f"{name} beyond its limit, 400 000 steps", value, "share", LIMIT_EXCESS))
    rows.append(row("speed beyond its limit on the wire", wire_speed, "rad/s", WIRE_SPEED))
    rows.append(
        row(
            "acceleration beyond its limit on the wire",
            wire_acceleration,
            "rad/s^2",
            WIRE_ACCELERATION,
        )
    )
    states, beyond = helper("braking")
    rows.append(
        row(
            f"way beyond a position limit at top speed, {int(states)} random states",
            beyond,
            "rad",
            1e-9,
        )
    )
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
