"""The interpolator against ruckig (velocity interface, no synchronisation), an independent generator."""

from __future__ import annotations

import random

import lwr_fri_bridge
import pytest

ruckig = pytest.importorskip("ruckig", reason="oracle: pip install ruckig==0.19.4")

STATES = 100_000
TICKS = (0.001, 0.005, 0.020, 0.100)


def test_equal_to_ruckig() -> None:
    """100 000 random states per tick length: position, velocity and acceleration within 1e-12, duration too."""
    rng = random.Random(20)
    generator = ruckig.Ruckig(1)
    parameters = ruckig.InputParameter(1)
    parameters.control_interface = ruckig.ControlInterface.Velocity
    parameters.synchronization = ruckig.Synchronization.No
    parameters.target_acceleration = [0.0]
    trajectory = ruckig.Trajectory(1)
    worst = {"position": 0.0, "velocity": 0.0, "acceleration": 0.0, "duration": 0.0}
    for tick in TICKS:
        for _ in range(STATES):
            max_a = rng.uniform(0.5, 20.0)
            max_j = rng.uniform(5.0, 1000.0)
            p, v = rng.uniform(-3, 3), rng.uniform(-2.5, 2.5)
            a = rng.uniform(-1, 1) * max_a
            target = rng.choice([0.0, rng.uniform(-2.5, 2.5)])
            parameters.current_position = [p]
            parameters.current_velocity = [v]
            parameters.current_acceleration = [a]
            parameters.target_velocity = [target]
            parameters.max_acceleration = [max_a]
            parameters.max_jerk = [max_j]
            parameters.max_velocity = [10.0]
            result = generator.calculate(parameters, trajectory)
            assert result in (ruckig.Result.Working, ruckig.Result.Finished)
            expected = [entry[0] for entry in trajectory.at_time(tick)[:3]]
            got = lwr_fri_bridge.step_axis(p, v, a, target, max_a, max_j, tick)
            duration = lwr_fri_bridge.time_to_velocity(v, a, target, max_a, max_j)
            worst["duration"] = max(worst["duration"], abs(duration - trajectory.duration))
            for name, ours, theirs in zip(("position", "velocity", "acceleration"), got, expected, strict=True):
                worst[name] = max(worst[name], abs(ours - theirs))
    assert max(worst.values()) <= 1e-12, worst
