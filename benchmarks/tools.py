#!/usr/bin/python3
"""Waiting time of a user for the researcher's daily commands (coglab_tools) and for the virtual world.

Commands are timed from the start of Python to the last written file. Demonstrations: minimum-jerk reaches at
120 Hz. Noisy recordings: 0.5 and 1 mm of noise per axis, without 3 % of the samples and three longer gaps; the error
compares the reproduced path with the path without noise. Trials on workers: `study run` on one worker and on two.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import coglab
import coglab_controllers as cc
import numpy as np
import numpy.typing as npt
from coglab_tools.dmp import cut
from coglab_tools.dmp.demonstration import Demonstration
from coglab_tools.dmp.train import train
from common import Row, main, median, minimum_jerk

Floats = npt.NDArray[np.float64]
RATE = 120.0  # Hz of recordings
REST = 0.6  # s at rest before and after a reach
START = np.array([0.45, -0.2, 0.35])  # m
WAY = np.array([0.28, 0.22, 0.12])  # m


def command(*words: object) -> float:
    """Wall time of a command of coglab_tools, s."""
    begin = time.monotonic()
    subprocess.run(
        [sys.executable, "-m", "coglab_tools", *map(str, words)], check=True, stdout=subprocess.DEVNULL, timeout=3600
    )
    return time.monotonic() - begin


def reach(rng: np.random.Generator, spread: float = 0.02) -> tuple[Floats, Floats]:
    """Times (s) and positions (m) of a reach."""
    duration = float(rng.uniform(0.9, 1.4))
    times = np.arange(0.0, duration + 2.0 * REST, 1.0 / RATE)
    way = WAY + rng.normal(0.0, spread, 3)
    return times, START + np.outer(minimum_jerk((times - REST) / duration), way)


def teaching(quick: bool) -> Iterator[Row]:
    """From files to a primitive with its picture."""
    count = 5 if quick else 50
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for seed in range(count):
            times, places = reach(np.random.default_rng(seed))
            np.savetxt(
                folder / f"d{seed:02}.csv", np.column_stack([times, places]), "%.6f", ",", header="t,x,y,z", comments=""
            )
        spent = []
        for turn in range(1 if quick else 5):
            taken = command("dmp", "import", *sorted(folder.glob("d*.csv")), "--out", folder / f"in{turn}")
            files = sorted((folder / f"in{turn}").glob("*.csv"))
            spent.append(taken + command("dmp", "train", *files, "--id", "mine", "-o", folder / f"mine{turn}.xml"))
    yield median("50 demonstrations imported, trained and plotted", spent, "s", "<= 10")


def imitation(quick: bool) -> Iterator[Row]:
    """Error of noisy recordings that were learnt."""
    for noise in (0.0005, 0.001):
        errors = []
        for seed in range(10 if quick else 100):
            rng = np.random.default_rng(seed)
            times, truth = reach(rng, 0.0)
            kept = rng.random(len(times)) > 0.03
            for at in rng.integers(20, len(times) - 20, 3):
                kept[at : at + int(rng.integers(4, 12))] = False
            raw = Demonstration("a", times[kept], truth[kept] + rng.normal(0.0, noise, (int(kept.sum()), 3)))
            whole, part = cut.smooth(raw), cut.reaches(raw)[0]
            begin = whole.times[int(np.argmin(np.linalg.norm(whole.positions - part.positions[0], axis=1)))]
            path = cc.reproduce(train("a", [part], 20, "none").primitive, part.times)
            true = np.column_stack([np.interp(begin + part.times, times, column) for column in truth.T])
            errors.append(1e3 * float(np.sqrt(np.mean(np.sum((path - true) ** 2, axis=1)))))
        yield median(f"error of imitated recordings with gaps and {1e3 * noise:g} mm of noise", errors, "mm", "<= 0.6")


def reports(quick: bool) -> Iterator[Row]:
    """The report of a long trial."""
    with tempfile.TemporaryDirectory() as place, coglab.World(seed=3, person="patient") as world:
        actions = ["receive", "give"] * (1 if quick else 4)
        trial = world.trial(*actions)
        length = trial.results[-1].ended - trial.results[0].started
        trial.save(Path(place) / "long")
        spent = [command("trial", "report", Path(place) / "long") for _ in range(1 if quick else 5)]
    yield median(f"report of {length:.0f} s with eight handovers", spent, "s", "<= 5")


def workers(quick: bool) -> Iterator[Row]:
    """Speed of virtual trials on two workers / on one."""
    plan = "version: 1\nname: pilot\nconditions: {usual: {timing: natural}}\nrepetitions: 4\ntrial: [receive, give]\n"
    plan += "participants: %d\n"
    spent = []
    with tempfile.TemporaryDirectory() as place:
        for count in (1, 2):
            study = Path(place) / f"study{count}"
            command("study", "init", study)
            (study / "study.yaml").write_text(plan % (2 if quick else 16), encoding="utf-8")
            spent.append(command("study", "run", study, "--workers", count))
    yield Row(
        "speed of virtual trials on two workers (one: 1)",
        spent[0] / spent[1],
        "x",
        ">= 1.8",
        f"of {8 if quick else 64}",
    )


def environment(quick: bool) -> Iterator[Row]:
    """Simulated time of an environment without the shipped brain / processor time of one core."""
    import coglab.envs  # noqa: F401  (registers the environments)
    import gymnasium
    from coglab.envs.policies import StraightReach
    from coglab.envs.referee import RECEIVE

    speeds = []
    env = gymnasium.make("coglab/Receive-v0")
    policy = StraightReach(RECEIVE)
    for seed in range(3 if quick else 30):
        observation, _ = env.reset(seed=seed)
        policy.reset()
        steps, over, before = 0, False, time.process_time()
        while not over:
            observation, _, ended, truncated, _ = env.step(policy.act(observation))
            steps, over = steps + 1, ended or truncated
        speeds.append(steps / 20.0 / (time.process_time() - before))
    env.close()
    yield median("speed of an environment on one core (real time: 1)", speeds, "x", ">= 20")


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "agg")
    main("tools", teaching, imitation, reports, workers, environment)
