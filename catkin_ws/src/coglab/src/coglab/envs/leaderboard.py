"""The table of baselines: success, time, force and falls of policies and of the shipped brain on the same test people.

Results are in one file of JSON lines per environment, split and policy. A stopped run can be continued.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_trials.trial import GIVE as GIVE_ACTION
from coglab_trials.trial import RECEIVE as RECEIVE_ACTION
from coglab_trials.trial import VirtualTrial
from coglab_trials.world import DT, World

from coglab.envs.handover import GiveEnv, HandoverEnv, ReceiveEnv
from coglab.envs.people import OBJECTS, split_named
from coglab.envs.policies import Policy, RandomPolicy, StraightReach
from coglab.envs.referee import GIVE, KEPT, RECEIVE, Referee
from coglab.workers import run_each

ENVIRONMENTS: dict[str, type[HandoverEnv]] = {RECEIVE: ReceiveEnv, GIVE: GiveEnv}
POLICIES = ("brain", "straight", "random")
LIMIT = 20.0  # s, time limit of an episode
LONGEST = 60.0  # s of virtual time, limit of each action of the shipped brain
WALL_LIMIT = 600.0  # s of wall time, limit of an episode

Job = tuple[str, str, str, int]
"""task, split, policy, index of the person"""


def run_policy(policy: Policy, task: str, split: str, person: int, objects: Sequence[str] = OBJECTS) -> dict[str, Any]:
    """Runs one episode with one person. Returns the figures of Referee.info() and ``return`` (sum of rewards)."""
    env = ENVIRONMENTS[task](split=split, objects=objects, time_limit=LIMIT)
    observation, info = env.reset(seed=person, options={"person": person})
    policy.reset()
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy.act(observation))
        total, over = total + reward, terminated or truncated
    env.close()
    return {name: info[name] for name in ("success", "time", "force", "dropped", "gave_up")} | {"return": total}


def run_brain(task: str, split: str, person: int, objects: Sequence[str] = OBJECTS) -> dict[str, Any]:
    """The same with the shipped state machines, for the same person and conditions. Before giving, an accustomed person
    hands over the object; if that fails, the episode has failed."""
    people = split_named(split)
    seed = people.seeds[person]
    conditions = people.conditions(seed, objects)
    action = RECEIVE_ACTION if task == RECEIVE else GIVE_ACTION
    world = World(seed, conditions if task == RECEIVE else replace(conditions, profile="accustomed", person={}))
    trial = VirtualTrial(world=world)
    judge: list[Referee] = []

    def watch(trial: VirtualTrial) -> None:
        if trial.begun[-1:] != [action]:
            return
        if not judge:
            judge.append(Referee(world, task))
        judge[0].look()

    def give(trial: VirtualTrial) -> None:
        trial.ask_for(RECEIVE_ACTION, limit=LONGEST)
        world.human = VirtualHuman(conditions.participant(seed), world.scene, holds_object=False)
        trial.ask_for(GIVE_ACTION, limit=LONGEST)

    trial.beside = watch
    try:
        if task == RECEIVE:
            trial.run(action, limit=LONGEST)
        else:
            trial.run(script=give)
    except TimeoutError:
        pass  # the referee's figures show the failure
    if not judge:
        return {"success": False, "time": math.inf, "force": 0.0, "dropped": False, "gave_up": False}
    for _ in range(round(KEPT / DT) + 1):  # an action may end before the object was kept long enough
        if judge[0].success:
            break
        world.step()
        judge[0].look()
    figures = judge[0].info()
    in_time = figures["success"] and figures["time"] <= LIMIT  # like the truncation of an episode
    return {**figures, "success": in_time, "time": figures["time"] if in_time else math.inf}


def run(job: Job) -> dict[str, Any]:
    """One line of the results."""
    task, split, policy, person = job
    if policy == "brain":
        figures = run_brain(task, split, person)
    else:
        made: Policy = StraightReach(task)
        if policy == "random":
            made = RandomPolicy(person)
        figures = run_policy(made, task, split, person)
    return {"person": person, **figures}


def wilson(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's interval of a share, 95 % by default. Returns (low, high), 0..1; (0, 1) without trials."""
    if count == 0:
        return 0.0, 1.0
    p = successes / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


class Results:
    """Finished episodes in a folder, one file for each task, split and policy."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, task: str, split: str, policy: str) -> Path:
        """File of these episodes."""
        return self.folder / f"{task}-{split}-{policy}.jsonl"

    def read(self, task: str, split: str, policy: str) -> dict[int, dict[str, Any]]:
        """Episodes by person. An incomplete line is ignored: its episode runs again."""
        path, found = self.path(task, split, policy), {}
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
            try:
                one = json.loads(line)
                found[int(one["person"])] = one
            except (ValueError, KeyError, TypeError):
                continue
        return found

    def add(self, job: Job, line: dict[str, Any]) -> None:
        """Appends one episode."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.path(*job[:3])
        torn = path.exists() and path.stat().st_size > 0 and not path.read_bytes().endswith(b"\n")
        with path.open("a", encoding="utf-8") as stream:
            stream.write(("\n" if torn else "") + json.dumps(line) + "\n")


def play(jobs: Sequence[Job], results: Results, workers: int, say: Callable[[str], None]) -> int:
    """Runs the episodes missing in ``results``, in new processes. An episode that raises, or whose process dies
    or takes longer than WALL_LIMIT twice, is reported and has no result. Returns the number of these."""
    done = {key: results.read(*key) for key in {job[:3] for job in jobs}}
    left = [job for job in jobs if job[3] not in done[job[:3]]]
    if left:
        say(f"{len(left)} of {len(jobs)} episodes to run, {workers} at a time")
    failed = 0
    for count, (index, line) in enumerate(run_each(run, left, workers, WALL_LIMIT), 1):
        if isinstance(line, Exception):
            failed += 1
            task, split, policy, person = left[index]
            say(f"no result of {task}, {split}, {policy}, person {person}: {type(line).__name__}: {line}")
        else:
            results.add(left[index], line)
        if count % 20 == 0 or count == len(left):
            say(f"{count} of {len(left)}")
    return failed


def row(episodes: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Figures of one policy: ``success``, its interval ``low`` and ``high`` (0..1), ``time`` (median s of successes),
    ``force`` (median and 95th percentile, N), ``dropped`` (0..1)."""
    episodes = list(episodes)
    good = [one for one in episodes if one["success"]]
    forces = [one["force"] for one in episodes] or [math.nan]
    low, high = wilson(len(good), len(episodes))
    return {
        "count": len(episodes),
        "success": len(good) / len(episodes) if episodes else math.nan,
        "low": low,
        "high": high,
        "time": float(np.median([one["time"] for one in good])) if good else math.nan,
        "force": float(np.median(forces)),
        "force95": float(np.quantile(forces, 0.95)),
        "dropped": sum(bool(one["dropped"]) for one in episodes) / len(episodes) if episodes else math.nan,
    }


def table(results: Results, tasks: Sequence[str], splits: Sequence[str], policies: Sequence[str], count: int) -> str:
    """The leaderboard as a table in Markdown, over the first ``count`` people of each split."""
    lines = [
        "| environment | split | policy | people | success (95 %) | time, median | force, median (95th) | dropped |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for task in tasks:
        for split in splits:
            for policy in policies:
                r = row(one for person, one in results.read(task, split, policy).items() if person < count)
                cells = [f"coglab/{task.capitalize()}-v0", split, policy, *_cells(r)]
                lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cells(r: dict[str, Any]) -> list[str]:
    if not r["count"]:
        return ["0", "-", "-", "-", "-"]
    return [
        str(r["count"]),
        f"{100 * r['success']:.1f} % ({100 * r['low']:.1f} to {100 * r['high']:.1f})",
        "-" if math.isnan(r["time"]) else f"{r['time']:.1f} s",
        f"{r['force']:.1f} N ({r['force95']:.1f})",
        f"{100 * r['dropped']:.1f} %",
    ]


def leaderboard(
    folder: Path, people: int, workers: int, tasks: Sequence[str], splits: Sequence[str], policies: Sequence[str]
) -> tuple[str, int]:
    """Runs the missing episodes. Returns the table, also written to ``folder``/leaderboard.md, and the number of failed
    episodes."""
    results = Results(folder)
    jobs = [
        (task, split, policy, person)
        for policy in policies
        for task in tasks
        for split in splits
        for person in range(min(people, len(split_named(split).seeds)))
    ]
    failed = play(jobs, results, workers, lambda text: print(text, file=sys.stderr, flush=True))
    text = table(results, tasks, splits, policies, people)
    folder.mkdir(parents=True, exist_ok=True)  # even if every episode has failed
    (folder / "leaderboard.md").write_text(text, encoding="utf-8")
    return text, failed
