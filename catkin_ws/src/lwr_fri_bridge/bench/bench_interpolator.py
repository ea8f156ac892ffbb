#!/usr/bin/python3
"""Time of one interpolator step (7 axes) and its distance from ruckig, if installed. Prints JSON."""

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
STATES = 25_000  # per tick length
BINARY = "lwr_fri_bridge_bench_interpolator"
LIMITS = pathlib.Path(__file__).resolve().parents[2] / "lwr_description/config/joint_limits.yaml"


def step_time() -> float:
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = pathlib.Path(prefix) / "lib" / "lwr_fri_bridge" / BINARY
        if path.is_file():
            out = subprocess.run(
                [str(path), str(LIMITS)], check=True, stdout=subprocess.PIPE, text=True, timeout=120
            ).stdout
            return float(out.split()[0])
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


def main() -> None:
    us = step_time()
    rows = [
        {
            "bench": "interpolator",
            "figure": "step of 7 axes, median",
            "value": round(us, 4),
            "unit": "us",
            "goal": f"<= {LIMIT_US}",
            "peer": None,
            "peer_value": None,
            "ok": us <= LIMIT_US,
        }
    ]
    worst = distance_from_ruckig()
    rows.append(
        {
            "bench": "interpolator",
            "figure": "largest difference, 100 000 random states",
            "value": worst,
            "unit": "rad, rad/s, rad/s^2",
            "goal": f"<= {LIMIT_DIFFERENCE}",
            "peer": "ruckig" if worst is not None else "ruckig (not installed)",
            "peer_value": None,
            "ok": None if worst is None else worst <= LIMIT_DIFFERENCE,
        }
    )
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
