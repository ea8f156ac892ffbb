#!/usr/bin/python3
"""A learning policy: the cross-entropy method tunes the straight-line reach in less than 20 minutes of processor time.
It needs the extras:

    ./coglab extras python3 catkin_ws/src/coglab/examples/20_learn_a_reach.py

Each generation draws parameters around a mean, lets each meet the same people of the split "train", and moves mean and
spread to the best. The people of "validation" select the best generation. Those of "test" are
used once, at the end: they compare the selected mean with the start.
"""

import argparse
import math
import resource
from dataclasses import asdict
from pathlib import Path

import numpy as np
from coglab.envs.leaderboard import row, run_policy
from coglab.envs.policies import Reaching, StraightReach
from coglab.workers import run_each
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

SPREAD = {  # first standard deviation of each parameter, and its range
    "speed": (0.1, 0.1, 0.6),
    "gain": (1.0, 0.5, 8.0),
    "stand_off": (0.015, -0.02, 0.08),
    "across": (0.01, -0.05, 0.05),
    "along": (0.015, -0.06, 0.06),
    "smoothing": (0.2, 0.0, 0.95),
    "touch": (0.7, 0.3, 6.0),
    "patience": (1.0, 0.5, 6.0),
    "lift": (0.02, 0.0, 0.08),
}


def episode(job):
    """One episode. job: (parameters, task, split, person). Returns its figures."""
    parameters, task, split, person = job
    return run_policy(StraightReach(task, Reaching(**parameters)), task, split, person)


def judge(workers, candidates, task, split, people):
    """Figures of each candidate with each of the people: a list of lists."""
    jobs = [(candidate, task, split, person) for candidate in candidates for person in people]
    results = dict(run_each(episode, jobs, workers, limit=600.0))
    for result in results.values():
        if isinstance(result, Exception):
            raise result
    found = [results[index] for index in range(len(jobs))]
    return [found[i : i + len(people)] for i in range(0, len(found), len(people))]


def mean_return(figures):
    """Mean sum of rewards. An episode counts -1 at least, so that a single hard push does not decide."""
    return float(np.mean([max(-1.0, one["return"]) for one in figures]))


def learn(options, rng):
    """Runs the generations. Returns the mean after each, and (mean return of all, of the best) of each."""
    start, names, low, high = asdict(Reaching()), list(SPREAD), *np.array(list(SPREAD.values())).T[1:]
    mean = np.array([start[name] for name in names])
    spread = np.array([SPREAD[name][0] for name in names])
    means, history = [], []
    for generation in range(options.generations):
        drawn = np.clip(mean + spread * rng.standard_normal((options.population, len(names))), low, high)
        drawn[0] = mean
        # Other people in each generation, against overfitting.
        people = range(generation * options.people, (generation + 1) * options.people)
        candidates = [{**start, **dict(zip(names, map(float, row_), strict=True))} for row_ in drawn]
        returns = np.array([mean_return(f) for f in judge(options.workers, candidates, options.task, "train", people)])
        best = np.argsort(returns)[::-1][: max(1, options.population // 4)]
        mean = 0.3 * mean + 0.7 * drawn[best].mean(axis=0)
        spread = 0.3 * spread + 0.7 * np.maximum(drawn[best].std(axis=0), 0.1 * spread)
        history.append((float(returns.mean()), float(returns[best].mean())))
        print(f"generation {generation + 1}: return {history[-1][0]:.2f}, of the best {history[-1][1]:.2f}", flush=True)
        means.append({**start, **dict(zip(names, map(float, mean), strict=True))})
    return means, history


def choose(means, options):
    """Returns the mean with the largest mean return on the people of validation."""
    figures = judge(options.workers, means, options.task, "validation", range(options.validation))
    returns = [mean_return(f) for f in figures]
    print("validation, return after each generation:", ", ".join(f"{one:.2f}" for one in returns), flush=True)
    return means[int(np.argmax(returns))]


def draw(history, before, after, path):
    """Plots the generations, and the test before and after."""
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    number = np.arange(1, len(history) + 1)
    left.plot(number, [one[0] for one in history], "o-", label="all candidates")
    left.plot(number, [one[1] for one in history], "o-", label="the best quarter")
    left.set_xticks(number)
    left.set_xlabel("generation")
    left.set_ylabel("mean return, people of train")
    left.legend()
    for place, name, figures in ((0, "before", before), (1, "after", after)):
        r = row(figures)
        error = [[100 * (r["success"] - r["low"])], [100 * (r["high"] - r["success"])]]
        right.bar(place, 100 * r["success"], yerr=error, capsize=5, width=0.6, label=name)
    right.set_xticks([0, 1], ["before", "after"])
    right.set_ylabel("success, people of test [%]")
    right.set_ylim(0, 100)
    figure.savefig(path, dpi=100)
    print(f"plot: {path}")


def main():
    """Workers import this file, so nothing may run without this function."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", choices=("receive", "give"), default="receive")
    parser.add_argument("--generations", type=int, default=6)
    parser.add_argument("--population", type=int, default=12)
    parser.add_argument("--people", type=int, default=6, help="people that each candidate meets (default 6)")
    parser.add_argument("--validation", type=int, default=40, help="people who choose a generation (default 40)")
    parser.add_argument("--test", type=int, default=200, help="people before and after (default 200, at most 300)")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/examples"), metavar="FOLDER", help="folder of the plot")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)

    means, history = learn(options, np.random.default_rng(1))
    learnt = choose(means[-3:], options)
    print({name: round(learnt[name], 3) for name in SPREAD})
    before, after = judge(options.workers, [asdict(Reaching()), learnt], options.task, "test", range(options.test))
    for name, figures in (("before", before), ("after", after)):
        r = row(figures)
        time = "-" if math.isnan(r["time"]) else f"{r['time']:.1f} s"
        success, low, high = (100 * r[part] for part in ("success", "low", "high"))
        print(f"{name}: success {success:.0f} % (95 %: {low:.0f} to {high:.0f}) of {r['count']} people of test, return "
              f"{mean_return(figures):.2f}, median time {time}, median force {r['force']:.1f} N")  # fmt: skip
    print(f"processor time: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime / 60:.1f} min")
    draw(history, before, after, options.out / f"{Path(__file__).stem}.png")


if __name__ == "__main__":
    main()
