#!/usr/bin/python3
"""Dynamic movement primitives compared with the Python package movement_primitives.

Imitation: 44 curves of each of five kinds, 20 basis functions and equal start velocity for both; root mean
square error over a curve in percent of its length. Goal: one reach of 1 s in cycles of 5 ms whose goal jumps by 100 mm
to the side at 0.3 s, or moves at 0.1 m/s. Lag: largest distance to the goal from 1 s to 2.5 s. If the goal is seen at
30 Hz with 4 mm of noise: lag of the mean of 60 motions in each cycle.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Iterator

import coglab_controllers as cc
import numpy as np
from common import Row, helper, main, median, minimum_jerk
from movement_primitives.dmp import DMP

PEER = "movement_primitives"
BASIS = 20  # basis functions for each axis
CYCLE = 0.005  # s, period of the control cycle
DURATION = 1.0  # s, of the demonstration
KINDS = ("straight", "curved", "looped", "moving_start", "handwriting")
CURVE = np.linspace(0.0, 1.0, 501)
GOAL = np.array([0.51, 0.0, 0.0])  # m from the start
VELOCITY = np.array([0.0, 0.1, 0.0])  # m/s, of a goal that moves
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
TIMES = np.linspace(0.0, DURATION, 1001)
DEMONSTRATION = np.outer(minimum_jerk(TIMES / DURATION), GOAL)


def curve(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Positions (501, 3) in m of one curve of 1 s."""
    m = minimum_jerk(CURVE)
    goal = rng.uniform(-0.5, 0.5, 3)
    goal *= rng.uniform(0.2, 0.6) / np.linalg.norm(goal)
    path = np.outer(m, goal)
    sides = rng.normal(size=(3, 3))
    if kind == "curved":
        path += 0.15 * np.outer(np.sin(np.pi * m), sides[0]) + 0.05 * np.outer(np.sin(2 * np.pi * m), sides[1])
    elif kind == "looped":
        turns, radius = rng.integers(1, 3), rng.uniform(0.05, 0.15)
        angle = 2.0 * np.pi * turns * m
        one, two = np.linalg.qr(sides)[0][:, :2].T
        path += radius * (np.outer(np.cos(angle) - 1.0, one) + np.outer(np.sin(angle), two))
    elif kind == "moving_start":
        velocity = rng.uniform(-0.6, 0.6, 3)
        path += np.outer(CURVE * (1.0 - CURVE) ** 3, velocity) + 0.1 * np.outer(np.sin(np.pi * m), sides[0])
    elif kind == "handwriting":  # strokes that blend into each other, begun in motion
        points = np.cumsum(rng.normal(scale=0.08, size=(5, 3)), axis=0)
        begins = np.linspace(-0.15, 0.85, 6)[:5]
        for point, before, begin in zip(points, np.vstack([np.zeros(3), points[:-1]]), begins, strict=True):
            path += np.outer(minimum_jerk((CURVE - begin) / 0.35), point - before)
        path -= path[0]
    return path


def error(path: np.ndarray, wanted: np.ndarray) -> float:
    """Root mean square error in percent of the path's length."""
    length = np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum()
    return 100.0 * float(np.sqrt(np.mean(np.sum((path - wanted) ** 2, axis=1)))) / length


def peer_error(wanted: np.ndarray) -> float:
    """The same error for the peer."""
    dt = CURVE[1]
    dmp = DMP(n_dims=3, execution_time=1.0, dt=dt, n_weights_per_dim=BASIS)
    dmp.imitate(CURVE, wanted)
    dmp.configure(start_y=wanted[0], goal_y=wanted[-1], start_yd=(wanted[1] - wanted[0]) / dt)
    return error(dmp.open_loop(run_t=1.0)[1][: len(CURVE)], wanted)


def imitation(quick: bool) -> Iterator[Row]:
    """Error of learnt curves."""
    rng = np.random.default_rng(11)
    wanted = [curve(kind, rng) for kind in KINDS for _ in range(4 if quick else 44)]
    learnt = [cc.learn("curve", [(CURVE, path)], basis_count=BASIS, allow=("moving",)) for path in wanted]
    ours = [error(cc.reproduce(one, CURVE, 1.0), path) for one, path in zip(learnt, wanted, strict=True)]
    peer = float(np.median([peer_error(w) for w in wanted]))
    yield median("error of a learnt primitive, 20 basis functions", ours, "%", f"< {PEER} {peer:.3g}")


def step_time(quick: bool) -> Iterator[Row]:
    """Time of one step, three axes."""
    command = [helper("control_cycle"), "--benchmark_filter=dmp_step", "--benchmark_format=json"]
    command += [f"--benchmark_repetitions={3 if quick else 15}", "--benchmark_report_aggregates_only=true"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=600).stdout)
    ours = next(one["cpu_time"] for one in found["benchmarks"] if one["aggregate_name"] == "median") / 1000.0
    dmp = DMP(n_dims=3, execution_time=1.0, dt=0.005, n_weights_per_dim=BASIS)
    dmp.configure(start_y=np.zeros(3), goal_y=np.ones(3))
    position, velocity, spent = np.zeros(3), np.zeros(3), []
    for _ in range(150):
        begin = time.perf_counter()
        position, velocity = dmp.step(position, velocity)
        spent.append(time.perf_counter() - begin)
    yield Row("one step of a primitive, three axes", ours, "us", f"< {PEER} {1e6 * float(np.median(spent)):.3g}")


def run(goal_at: Callable[[float], np.ndarray], cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and accelerations (cycles, 3) of a motion to goal_at(time)."""
    motion = cc.CartesianMotion(0.06)
    primitive = cc.learn("reach", [(TIMES, DEMONSTRATION)], mapping="similarity")
    motion.start(primitive, np.zeros(3), UPRIGHT, goal_at(0.0), UPRIGHT)
    positions, accelerations = [], []
    for i in range(cycles):
        motion.step(CYCLE, goal_at(i * CYCLE), UPRIGHT)
        positions.append(motion.position)
        accelerations.append(motion.acceleration)
    return np.array(positions), np.array(accelerations)


def run_peer(goal_at: Callable[[float], np.ndarray], cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """The same motion of the peer."""
    dmp = DMP(n_dims=3, execution_time=DURATION, dt=CYCLE, n_weights_per_dim=BASIS)
    dmp.imitate(TIMES, DEMONSTRATION)
    dmp.configure(start_y=np.zeros(3), goal_y=GOAL)
    position, velocity = np.zeros(3), np.zeros(3)
    positions, velocities = [], [velocity]
    for i in range(cycles):
        dmp.configure(goal_y=goal_at(i * CYCLE))
        position, velocity = (np.array(a) for a in dmp.step(position, velocity))
        positions.append(position)
        velocities.append(velocity)
    return np.array(positions), np.diff(velocities, axis=0)[1:] / CYCLE


def noisy_frames(seed: int) -> np.ndarray:
    """Errors (400, 3) in m of sights at 30 Hz: 4 mm per axis, white."""
    return np.random.default_rng(seed).normal(scale=0.004, size=(400, 3))


def moving_goals(quick: bool) -> Iterator[Row]:
    """A goal that jumps, and one that moves."""

    def jump(t: float) -> np.ndarray:
        return GOAL + (np.array([0.0, 0.1, 0.0]) if t >= 0.3 * DURATION - 1e-9 else 0.0)

    def moves(t: float) -> np.ndarray:
        return GOAL + VELOCITY * t

    def largest(accelerations: np.ndarray) -> float:
        return float(np.linalg.norm(np.diff(accelerations, axis=0), axis=1).max())

    ours, peer = largest(run(jump, 400)[1]), largest(run_peer(jump, 300)[1])
    what = "largest jump of acceleration when the goal jumps by 100 mm"
    yield Row(what, ours, "m/s^2", f"< {PEER} {peer:.3g}")

    end, cycles = round(DURATION / CYCLE), 500
    goals = np.array([moves(i * CYCLE) for i in range(cycles)])
    lag = 1000.0 * float(np.linalg.norm(run(moves, cycles)[0] - goals, axis=1)[end:].max())
    peer_lag = 1000.0 * float(np.linalg.norm(run_peer(moves, end)[0][-1] - goals[end - 1]))
    yield Row("lag behind a goal that moves at 0.1 m/s, seen exactly", lag, "mm", f"< {PEER} {peer_lag:.3g}")

    off = []
    for seed in range(6 if quick else 60):
        frames = noisy_frames(seed)
        seen = lambda t, frames=frames: moves(int(t * 30.0 + 1e-9) / 30.0) + frames[int(t * 30.0 + 1e-9)]  # noqa: E731
        off.append((goals - run(seen, cycles)[0])[end:])
    mean = 1000.0 * float(np.linalg.norm(np.mean(off, axis=0), axis=1).max())
    yield Row("lag behind the moving goal with 4 mm of noise at 30 Hz", mean, "mm", "<= 2", f"n = {len(off)}")


if __name__ == "__main__":
    main("primitives", imitation, step_time, moving_goals)
