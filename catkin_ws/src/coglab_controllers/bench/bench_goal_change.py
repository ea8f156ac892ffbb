#!/usr/bin/python3
"""What a goal that steps, moves or trembles does to the motion, beside PyPI movement_primitives (if it is there).

One reach of 1 s in cycles of 5 ms, watched for 6 s; rows with noise over 60 seeds, none left out.

Definitions. Change of acceleration: largest from one cycle to the next. Within 10 mm: for good, in durations T. Lag:
largest distance to the moving goal from T on, to 2.5 s; where it is seen with noise, of the mean of all seeds in each
cycle, because the noise itself is no lag; the mean lag of one seed is that over the cycles, along the goal's way.
Noise: 4 mm per axis at 30 Hz, white or with a correlation time of 0.5 s; a frame stays until the next one.
Reached: the first cycle from the end of the motion on in which the set-point is slower than 0.02 m/s and within 5 mm of
the goal as estimated; what never happens within 6 s counts as 6 s. The motion says ended once; where that does not hold
in that cycle, it was hasty. Speed that the noise adds: of the set-point, beside the same motion without noise, RMS from
the beginning to the end; goals are those of all seeds' cycles together and of the worst seed alone.
"""

import json
import sys
from dataclasses import dataclass

import coglab_controllers as cc
import numpy as np
from core_bench import Row, minimum_jerk, row

try:
    from movement_primitives.dmp import DMP
except ImportError:  # the peer is optional: its column is then null
    DMP = None

PEER = "movement_primitives" if DMP is not None else None
CYCLE, DURATION = 0.005, 1.0
SEEDS, WATCHED = 60, 1200
"""draws of noise per row; cycles that a motion is watched"""
GOAL = np.array([0.51, 0.0, 0.0])
TIMES = np.linspace(0.0, DURATION, 1001)
DEMONSTRATION = np.outer(minimum_jerk(TIMES / DURATION), GOAL)
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
VELOCITY = np.array([0.0, 0.1, 0.0])
"""m/s, of the goal that moves"""
NOISES = (("white", 0.0), ("wandering for 0.5 s", 0.5))
PRIMITIVE = cc.learn("reach", [(TIMES, DEMONSTRATION)], mapping="similarity")


def run(goal_at, cycles: int, estimator: float = 0.06) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Positions, commanded velocities, accelerations (cycles, 3) and events of a motion to goal_at(time)."""
    motion = cc.CartesianMotion(estimator)
    motion.start(PRIMITIVE, np.zeros(3), UPRIGHT, goal_at(0.0), UPRIGHT)
    positions, velocities, accelerations, events = [], [], [], []
    for i in range(cycles):
        reference = motion.step(CYCLE, goal_at(i * CYCLE), UPRIGHT)
        positions.append(motion.position)
        velocities.append(reference.velocity)
        accelerations.append(motion.acceleration)
        events.append(motion.event)
    return np.array(positions), np.array(velocities), np.array(accelerations), events


def largest_change(accelerations: np.ndarray) -> float:
    """Largest change of the acceleration from one cycle to the next, m/s^2."""
    return float(np.linalg.norm(np.diff(accelerations, axis=0), axis=1).max())


def settling(positions: np.ndarray, goal: np.ndarray) -> float:
    """Share of the duration after which the distance stays within 10 mm."""
    outside = np.nonzero(np.linalg.norm(positions - goal, axis=1) > 0.01)[0]
    return float((outside[-1] + 2) * CYCLE / DURATION)


def peer_step(moved: np.ndarray) -> tuple[float, float]:
    """Change of acceleration and settling time of the peer for the same goal step."""
    dmp = DMP(n_dims=3, execution_time=DURATION, dt=CYCLE, n_weights_per_dim=20)
    dmp.imitate(TIMES, DEMONSTRATION)
    dmp.configure(start_y=np.zeros(3), goal_y=GOAL)
    position, velocity = np.zeros(3), np.zeros(3)
    positions, velocities = [position], [velocity]
    for i in range(300):
        if i == round(0.3 * DURATION / CYCLE):
            dmp.configure(goal_y=moved)
        position, velocity = (np.array(a) for a in dmp.step(position, velocity))
        positions.append(position)
        velocities.append(velocity)
    accelerations = np.diff(velocities, axis=0) / CYCLE
    return largest_change(accelerations[1:]), settling(np.array(positions[1:]), moved)


def peer_lag() -> float:
    """Lag of the peer behind a goal that moves at 0.1 m/s, mm, as long as its motion lasts."""
    dmp = DMP(n_dims=3, execution_time=DURATION, dt=CYCLE, n_weights_per_dim=20)
    dmp.imitate(TIMES, DEMONSTRATION)
    dmp.configure(start_y=np.zeros(3), goal_y=GOAL)
    position, velocity, goal = np.zeros(3), np.zeros(3), GOAL
    for i in range(round(DURATION / CYCLE)):
        goal = GOAL + np.array([0.0, 0.1 * i * CYCLE, 0.0])
        dmp.configure(goal_y=goal)
        position, velocity = (np.array(a) for a in dmp.step(position, velocity))
    return 1000.0 * float(np.linalg.norm(position - goal))


def step_rows() -> list[Row]:
    """A step of 100 mm to the side at 0.3 of the duration."""
    moved = GOAL + np.array([0.0, 0.1, 0.0])

    def goal_at(t: float) -> np.ndarray:
        return moved if t >= 0.3 * DURATION - 1e-9 else GOAL

    positions, _, accelerations, _ = run(goal_at, 400)
    peer_change, peer_settling = peer_step(moved) if DMP else (None, None)
    plain_positions, _, plain, _ = run(goal_at, 400, estimator=0.0)
    what = "one motion, goal step of 100 mm at 0.3 T"
    change = f"largest change of acceleration from one cycle of {1000.0 * CYCLE:g} ms to the next"
    within = "time until it is within 10 mm of its goal for good"
    without = f"{what}, without the goal estimator"
    return [
        row("goal_change", f"{what}: {change}", largest_change(accelerations), "m/s^2", "< 1", PEER, peer_change,
            below_peer=True),
        row("goal_change", f"{without}: {change}", largest_change(plain), "m/s^2", ""),
        row("goal_change", f"{what}: {within}", settling(positions, moved), "T", "<= 0.95", PEER, peer_settling),
        row("goal_change", f"{without}: {within}", settling(plain_positions, moved), "T", ""),
    ]  # fmt: skip


def moving_rows() -> list[Row]:
    """A goal that moves at 0.1 m/s from the start."""

    def goal_at(t: float) -> np.ndarray:
        return GOAL + VELOCITY * t

    positions, _, _, _ = run(goal_at, 500)
    goals = np.array([goal_at(i * CYCLE) for i in range(500)])
    lag = 1000.0 * np.linalg.norm(positions - goals, axis=1)
    plain, _, _, _ = run(goal_at, 500, estimator=0.0)
    plain_lag = 1000.0 * np.linalg.norm(plain - goals, axis=1)
    end = round(DURATION / CYCLE)
    peer = peer_lag() if DMP else None
    what = "one motion, goal moving at 0.1 m/s, known exactly in every cycle"
    without = f"{what}, without the goal estimator and so without the goal's velocity"
    return [
        row("goal_change", f"{what}: lag from T on, largest", lag[end:].max(), "mm", "<= 2", PEER, peer,
            below_peer=True),
        row("goal_change", f"{without}: lag from T on, largest", plain_lag[end:].max(), "mm", ""),
    ]  # fmt: skip


def noisy_lag_rows() -> list[Row]:
    """The same goal, seen at 30 Hz: exactly, and with noise over SEEDS draws each."""
    way = np.arange(500)[:, None] * CYCLE * VELOCITY
    begin = round(DURATION / CYCLE)

    def off(frames: np.ndarray) -> np.ndarray:
        """(cycles from T on, 3): the goal less the set-point, m."""
        seen = lambda t: frames[int(t * 30.0 + 1e-9)] + VELOCITY * int(t * 30.0 + 1e-9) / 30.0  # noqa: E731
        return (GOAL + way - run(seen, len(way))[0])[begin:]

    exact = 1000.0 * np.linalg.norm(off(np.tile(GOAL, (400, 1))), axis=1)
    what = "one motion, goal moving at 0.1 m/s, seen at 30 Hz without noise: lag from T on, largest"
    rows = [row("goal_change", what, exact.max(), "mm", "")]
    for name, correlation in NOISES:
        every = 1000.0 * np.array([off(noisy_frames(seed, correlation)) for seed in range(SEEDS)])
        behind = every.mean(axis=1) @ VELOCITY / np.linalg.norm(VELOCITY)
        mean, largest = np.linalg.norm(every.mean(axis=0), axis=1), np.linalg.norm(every, axis=2).max()
        what = f"{SEEDS} motions, one per seed, goal moving at 0.1 m/s, 4 mm of noise at 30 Hz, {name}"
        one = f"{what}: mean lag of one motion from T on, along the goal's way"
        rows += [
            row("goal_change", f"{what}: lag from T on, mean of all motions in each cycle, largest of the cycles",
                mean.max(), "mm", "<= 2"),
            row("goal_change", f"{one}, median of the motions", float(np.median(behind)), "mm", "<= 2"),
            row("goal_change", f"{one}, largest of the motions", behind.max(), "mm", ""),
            row("goal_change", f"{what}: distance to the goal from T on, noise and all, largest of all motions and "
                "cycles", largest, "mm", ""),
        ]  # fmt: skip
    return rows


def noisy_frames(seed: int, correlation: float) -> np.ndarray:
    """Sights of a still goal at 30 Hz with 4 mm of noise per axis: white, or wandering with a correlation time in s."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-1.0 / 30.0 / correlation) if correlation else 0.0
    error = rng.normal(scale=0.004, size=3)
    frames = []
    for _ in range(400):
        frames.append(GOAL + error)
        error = keep * error + np.sqrt(1.0 - keep**2) * rng.normal(scale=0.004, size=3)
    return np.array(frames)


@dataclass
class Noisy:
    """One motion to a still goal that is seen with noise. Times in s, speeds in m/s.

    It says that it has ended; it has reached its goal in the first cycle from then on in which the set-point is slower
    than 0.02 m/s and within 5 mm of the goal as estimated. None: not within the time watched.
    """

    ended: float | None
    reached: float | None
    hasty: bool  # said ended in a cycle in which that did not hold
    still: float | None  # from the end until the set-point's speed is zero for good
    after: float  # largest speed from 1 s after the end on
    again: int  # times that it followed again
    added: np.ndarray  # speed that the noise adds in each cycle until the end


def noisy(frames: np.ndarray | None, exact: np.ndarray | None) -> Noisy:
    """One motion; `frames` at 30 Hz, None: the goal is seen exactly. `exact`: positions of the motion without noise."""
    motion = cc.CartesianMotion(0.06)
    goal_at = (lambda t: GOAL) if frames is None else (lambda t: frames[int(t * 30.0)])
    motion.start(PRIMITIVE, np.zeros(3), UPRIGHT, goal_at(0.0), UPRIGHT)
    positions, speeds, there, events = [], [], [], []
    for i in range(WATCHED):
        reference = motion.step(CYCLE, goal_at(i * CYCLE), UPRIGHT)
        positions.append(motion.position)
        speeds.append(float(np.linalg.norm(reference.velocity)))
        there.append(speeds[-1] <= 0.02 and float(np.linalg.norm(motion.position - motion.goal)) <= 0.005)
        events.append(motion.event)
    extra = np.zeros(WATCHED - 1)
    if exact is not None:
        extra = np.linalg.norm(np.diff(np.array(positions) - exact, axis=0), axis=1) / CYCLE
    if "ended" not in events:
        return Noisy(None, None, True, None, max(speeds), events.count("follows_again"), extra)
    end = events.index("ended")
    reached = next((i for i in range(end, WATCHED) if there[i]), None)
    moving = [i for i in range(end, WATCHED) if speeds[i] > 0.0]
    last = moving[-1] + 1 if moving else end
    return Noisy(
        ended=end * CYCLE,
        reached=None if reached is None else reached * CYCLE,
        hasty=not there[end],
        still=None if last >= WATCHED else (last - end) * CYCLE,
        after=max(speeds[end + round(1.0 / CYCLE) :]),
        again=events.count("follows_again"),
        added=extra[: max(1, end)],
    )


def missed_is_worst(values: list[float | None]) -> list[float]:
    """Sorted; what never happened counts as long as was watched."""
    return sorted(WATCHED * CYCLE if value is None else value for value in values)


def noise_rows() -> list[Row]:
    """A still goal seen at 30 Hz with 4 mm of noise per axis, over SEEDS draws each; nothing is left out: what never
    happens within 6 s counts as 6 s.
    """
    still_goal = run(lambda t: GOAL, WATCHED)[0]
    exact = noisy(None, None)
    assert exact.reached is not None
    what = "one motion, still goal seen exactly: time until it is reached"
    rows = [row("goal_change", what, exact.reached / DURATION, "T", "")]
    for name, correlation in NOISES:
        motions = [noisy(noisy_frames(seed, correlation), still_goal) for seed in range(SEEDS)]
        late = [value - exact.reached for value in missed_is_worst([m.reached for m in motions])]
        rest = missed_is_worst([m.still for m in motions])
        added = 1000.0 * np.array([np.sqrt(np.mean(m.added**2)) for m in motions])
        what = f"{SEEDS} motions, one per seed, still goal, 4 mm of noise at 30 Hz, {name}"
        rest_words = f"{what}: time from the end until the set-point's speed is zero for good"
        extra = f"{what}: speed that the noise adds to the set-point during the motion, RMS"
        rows += [
            row("goal_change", f"{what}: time until it is reached, beyond that of a goal seen exactly, median",
                late[SEEDS // 2], "s", "<= 0.25"),
            row("goal_change", f"{what}: time until it is reached, the latest", (late[-1] + exact.reached) / DURATION,
                "T", "<= 2"),
            row("goal_change", f"{what}: motions that said ended faster than 0.02 m/s or more than 5 mm from the goal "
                "as estimated", sum(m.hasty for m in motions), "1", "<= 0"),
            row("goal_change", f"{what}: motions that did not reach it within {WATCHED * CYCLE:g} s",
                sum(m.reached is None for m in motions), "1", "<= 0"),
            row("goal_change", f"{rest_words}, median", rest[SEEDS // 2], "s", "<= 0"),
            row("goal_change", f"{rest_words}, longest", rest[-1], "s", "<= 0"),
            row("goal_change", f"{what}: speed of the set-point from 1 s after the end on, largest of all motions",
                1000.0 * max(m.after for m in motions), "mm/s", "<= 0"),
            row("goal_change", f"{what}: times that the goal was followed again after an end, of all motions",
                sum(m.again for m in motions), "1", "<= 0"),
            row("goal_change", f"{extra}, the cycles of all motions together",
                1000.0 * float(np.sqrt(np.mean(np.concatenate([m.added for m in motions]) ** 2))), "mm/s", "<= 15"),
            row("goal_change", f"{extra}, median motion", float(np.median(added)), "mm/s", ""),
            row("goal_change", f"{extra}, 95th percentile of the motions",
                float(np.percentile(added, 95, method="higher")), "mm/s", ""),
            row("goal_change", f"{extra}, worst motion", added.max(), "mm/s", "<= 15"),
        ]  # fmt: skip
    return rows


def switch_rows() -> list[Row]:
    """Another primitive and another ratio in mid-motion."""
    other = cc.learn(
        "other", [(1.6 * TIMES, DEMONSTRATION + 0.1 * np.outer(np.sin(np.pi * minimum_jerk(TIMES)), [0, 0, 1]))]
    )
    worst = 0.0
    rng = np.random.default_rng(4)
    switches = 500
    for _ in range(switches):
        dmp = cc.Dmp(PRIMITIVE, np.zeros(3), GOAL)
        for _ in range(rng.integers(1, 200)):
            dmp.step(CYCLE, GOAL)
        position, velocity, phase = dmp.position, dmp.velocity, dmp.phase
        dmp.switch_to(other, GOAL, rng.uniform(0.5, 2.0))
        worst = max(
            worst, np.abs(dmp.position - position).max(), np.abs(dmp.velocity - velocity).max(), abs(dmp.phase - phase)
        )
    what = f"{switches} motions, other primitive and ratio by switch_dmp at a random moment"
    words = f"{what}: largest step in position, velocity or phase"
    return [row("goal_change", words, worst, "m, m/s, 1", "<= 1e-9")]


def main() -> None:
    """Prints the rows as JSON."""
    json.dump(step_rows() + moving_rows() + noisy_lag_rows() + noise_rows() + switch_rows(), sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
