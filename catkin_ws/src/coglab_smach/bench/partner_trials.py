"""The trials of bench_partner: whole handovers, people who withdraw, objects that fall, people who pull, and hands that
are about something else. Each runs in a worker process and comes back as plain data. A recogniser watches in all of
them, as in coglab.launch: patterns enter the prediction of where a hand will be, and may switch the primitive."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from campaign import Job, one_trial
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_sim.person.scene import HandSample
from coglab_sim.virtual_world import DT
from scipy.spatial.transform import Rotation
from true_trace import GIVE, RECEIVE, TrueTrace

sys.path.insert(0, str(package_path("coglab_perception", "test")))
from other_motions import KINDS, Motion, other_motion

SHARES = (0.3, 0.95)
"""of the distance between palm and object when the reach began: where a withdrawal or a fall may come"""
BACK = 0.10
"""m by which a hand that goes back has withdrawn its offer"""
VAIN = 4.0
"""s in which a hand waits for a robot that does not come that far, before it is withdrawn or lets fall all the same"""
LISTENS = 0.5
"""s between what a machine was asked for and the other motion"""
CALM = 0.8
"""s after another motion in which the palm may still move because of it"""
GRIP = 20.0
"""N, of a hand that is about something else, on what it carries"""


def handover(job: Job) -> dict[str, Any]:
    """Both directions, or one, of one person; see world_rows."""
    return one_trial(recognised(job), TrueTrace)


class Interrupted(TrueTrace):
    """Somebody gives, but takes the hand back or loses the object while the arm is on its way: when the true distance
    between palm and object has fallen below a share of what it was at the reach's beginning, which is uniform."""

    def __init__(self, trial: Any, falls: bool) -> None:
        super().__init__(trial)
        self._falls = falls
        self._share = float(np.random.default_rng([trial.rig.human.participant.seed, 83]).uniform(*SHARES))
        self._whole: float | None = None
        self._waits: float | None = None
        self._from = np.zeros(3)

    def look(self, trial: Any) -> None:
        super().look(trial)
        if self.event is None and self.begun and self._due():
            self.event, self._from = self.now, self.series.hand[-1]
            if self._falls:
                self.gone = self.event
                self._drop()
            else:
                self.rig.human.command("rest")
        elif self.event is not None and self.gone is None:
            if float(np.linalg.norm(self.series.hand[-1] - self._from)) > BACK:
                self.gone = self.now

    def _due(self) -> bool:
        waiting = self.rig.human.phase == "waiting"
        self._waits = (self._waits or self.now) if waiting else None
        away = float(np.linalg.norm(self.series.thing[-1] - self.series.palm[-1]))
        if self.series.moving[-1] and self._whole is None:
            self._whole = away
        near = self._whole is not None and away < self._share * self._whole
        return near or (self._waits is not None and self.now - self._waits > VAIN)

    def _drop(self) -> None:
        """The fingers open, whatever the person wants of them."""
        step = self.rig.human.step
        self.rig.human.step = lambda t, view: replace(step(t, view), grip=0.0, grip_force=0.0)


def withdrawal(job: Job) -> dict[str, Any]:
    """A giver who takes the hand back."""
    return one_trial(recognised(job), lambda trial: Interrupted(trial, False))


def fall(job: Job) -> dict[str, Any]:
    """A giver who loses the object."""
    return one_trial(recognised(job), lambda trial: Interrupted(trial, True))


class OtherHand:
    """Stands in for the person: a hand that moves as ``motion`` says once it is told to, from ``rest`` (m) on."""

    phase = "idle"

    def __init__(self, human: Any, motion: Motion, rng: np.random.Generator, holds: bool) -> None:
        self.participant, self.rest = human.participant, human.rest
        self._motion, self._turn, self._holds = motion, rng.normal(0.0, 0.2, 3), holds
        self._far = max(0.1, float(np.linalg.norm(motion.segments[0].end - motion.at(0.0))))
        self.begun: float | None = None

    def command(self, text: str) -> None:
        """It is not asked."""

    def hear(self, t: float, code: int) -> None:
        """It does not listen."""

    def _at(self, t: float) -> Pose:
        way = self._motion.at(t) - self._motion.at(0.0) if t > 0.0 else np.zeros(3)
        turned = Rotation.from_rotvec(self._turn * float(np.linalg.norm(way)) / self._far)
        sway = 0.0015 * np.sin(2 * np.pi * 0.4 * t + np.arange(3))
        return Pose(self.rest + way + sway, turned.as_quat())

    def step(self, t: float, view: Any) -> HandSample:
        """As the person's."""
        since = 0.0 if self.begun is None else t - self.begun
        now, soon = self._at(since), self._at(since + DT if self.begun is not None else since)
        spin = (soon.rotation * now.rotation.inv()).as_rotvec() / DT
        grip = 1.0 if self._holds else 0.0
        return HandSample(now, (soon.position - now.position) / DT, grip, GRIP, self.phase, spin)


class OtherWatch(TrueTrace):
    """How far the palm moves because of a hand that neither offers nor asks."""

    def __init__(self, trial: Any, motion: Motion, rng: np.random.Generator, robot_holds: bool, hub: bool) -> None:
        super().__init__(trial)
        self.motion, self.rng, self.robot_holds, self.hub = motion, rng, robot_holds, hub
        self.begin = self.end = 0
        if not robot_holds:
            self._replace(True)

    def _replace(self, holds: bool) -> None:
        self.rig.human = self.hand = OtherHand(self.rig.human, self.motion, self.rng, holds)
        self.watch_person()

    def walk(self, trial: Any) -> None:
        """The script: an object for the robot, if it has to hold one; then the motion, asked for nothing or something
        else; then until the machine waits again."""
        object_id = trial.object_id
        trial.wait_hub("wait_without_object")
        if self.robot_holds:
            trial.ctx.requests.submit(RECEIVE, object_id)
            self._until(trial, lambda: trial.ctx.requests.hub() != "" and self.rig.human.phase == "idle")
            if trial.ctx.requests.hub() != "wait_with_object":
                return
            self._replace(False)
        if not self.hub:
            trial.ctx.requests.submit(GIVE if self.robot_holds else RECEIVE, object_id)
        trial.clock.sleep(LISTENS)
        self.hand.begun, self.begin = self.rig.t, len(self.series.time)
        trial.clock.sleep(self.motion.over + CALM)
        self.end = len(self.series.time)
        self._until(trial, lambda: trial.ctx.requests.hub() != "")

    def _until(self, trial: Any, condition: Callable[[], bool], limit: float = 40.0) -> None:
        end = trial.clock.now() + limit
        trial.clock.sleep(0.1)
        while not condition():
            assert trial.clock.now() < end, f"no hub: {trial.ctx.journal.transitions[-1].sentence()}"
            trial.clock.sleep(0.05)

    def figures(self) -> dict[str, Any]:
        """``moved_mm``: farthest that the palm was from where it stood; None where the motion was not carried out."""
        palm = np.array(self.series.palm[self.begin : self.end])
        away = np.linalg.norm(palm - palm[0], axis=1) if len(palm) else np.array([np.nan])
        moved = 1000.0 * float(np.max(away)) if len(palm) else None
        return {"moved_mm": moved, "kind": self.motion.kind, "robot_holds": self.robot_holds}


def other(job: Job, kind: type[OtherWatch] = OtherWatch) -> dict[str, Any]:
    """A hand that is about something else; ``number`` of its arguments says what, ``hub`` that nobody has asked for an
    action: then it is recognition that may leave the hub."""
    number, hub = job.arguments["number"], job.arguments["hub"]
    rng = np.random.default_rng([job.seed, 71])
    motion = other_motion(KINDS[number % len(KINDS)], rng, LISTENS)
    robot_holds = number % 2 == 1
    conditions = job.arguments["conditions"]
    left = bool(motion.segments[0].start[1] < 0.0)
    arguments: dict[str, Any] = {"conditions": replace(conditions, person={"left_handed": left})}
    if hub:
        arguments["recognition_trigger.enabled"] = True
    watches: list[OtherWatch] = []

    def watch(trial: Any) -> OtherWatch:
        watches.append(kind(trial, motion, rng, robot_holds, hub))
        return watches[0]

    return one_trial(recognised(replace(job, arguments=arguments)), watch, lambda trial: watches[0].walk(trial))


def recognised(job: Job) -> Job:
    """The same trial, watched by a recogniser of its own: one remembers what it has seen."""
    return replace(job, arguments={**job.arguments, "recogniser": shipped_recogniser()})


def shipped_recogniser() -> Recogniser:
    """A fresh one with the patterns that ship."""
    return Recogniser(*load_patterns(str(package_path("coglab_perception", "config", "patterns.json"))))
