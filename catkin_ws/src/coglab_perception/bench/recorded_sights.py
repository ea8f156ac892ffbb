"""Sights of simulated people for bench_belief: what the default tracker delivers of hand and object, with the truth.

People are coglab_sim's, drawn as they are; the robot's hand stands at home. Motions of no handover are of
other_motions.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from coglab_py.pose import Pose
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene, WorldView
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_sim.tracker.tracker import PerceptionSettings, Sight, Tracker
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from other_motions import KINDS as KINDS
from other_motions import other_motion

DT = 0.01
"""s, of people and tracker"""
PALM = Pose(np.array([0.58, -0.15, 0.58]), np.array([0.5, 0.5, 0.5, 0.5]))
"""of the robot's hand at home"""
IN_PALM = PALM.position + [0.0, 0.065, -0.05]
"""m, of an object in it"""
LOOK = 1.0
"""s for which the hand waits at the handover before the person withdraws it"""
HAND, OBJECT = "human_hand", "object_mug"
ONSET_SPEED = 0.02


@dataclass
class Recording:
    """``sights`` as delivered: time of delivery (s) and sight. Truth: ``times`` (s), ``hand`` and ``thing`` (T, 3) m,
    ``toward``: the hand is on its way to a handover or waits there. ``onset``, ``begin``, ``end`` of the reach,
    ``back``: the withdrawal has come 0.10 m far, ``fall``: the object leaves the hand (s; infinite: does not
    happen)."""

    kind: str
    robot_holds: bool
    sights: list[tuple[float, Sight]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    hand: list[np.ndarray] = field(default_factory=list)
    thing: list[np.ndarray] = field(default_factory=list)
    toward: list[bool] = field(default_factory=list)
    onset: float = np.inf
    begin: float = np.inf
    end: float = np.inf
    back: float = np.inf
    fall: float = np.inf

    def place(self) -> np.ndarray:
        """m, true place of the object in the person's hand, else of the hand, at the end of the reach."""
        at = int(np.searchsorted(self.times, self.end))
        return self.hand[at] if self.robot_holds else self.thing[at]


class Observer:
    """Two trackers that look at a hand and an object and write down what they deliver."""

    def __init__(self, recording: Recording, seed: int) -> None:
        self.recording = recording
        self.trackers = {name: Tracker(name, PerceptionSettings(), seed) for name in (HAND, OBJECT)}

    def step(self, t: float, hand: Pose, thing: Pose, toward: bool) -> None:
        """What there is at time t (s)."""
        r = self.recording
        r.times.append(t)
        r.hand.append(hand.position)
        r.thing.append(thing.position)
        r.toward.append(toward)
        frames = {HAND: hand, OBJECT: thing}
        for name, frame in frames.items():
            others = [other for each, other in frames.items() if each != name]
            r.sights += [(t, sight) for sight in self.trackers[name].step(t, frame, PALM, others)]


def handover(seed: int, gives: bool, falls: float | None = None) -> Recording:
    """A drawn person who gives or takes, waits in vain and withdraws the hand. ``falls``: share of the reach at which
    the object leaves the hand, 1 and more: so many s after its end."""
    scene = Scene()
    human = VirtualHuman(Participant.draw(seed), scene, gives)
    recording = Recording("offer" if gives else "request", not gives)
    observer = Observer(recording, seed)
    human.command("give mug" if gives else "receive mug")
    hand, t, speed, frozen = Pose(human.rest), 0.0, np.zeros(3), None
    while t < 12.0:
        thing = hand * Pose(scene.object_in_hand, scene.object_turn) if gives else Pose(np.array(IN_PALM))
        if t >= recording.fall:
            drop = 0.5 * 9.81 * (t - recording.fall) ** 2
            frozen = frozen or (thing, speed)
            place = frozen[0].position + frozen[1] * (t - recording.fall) - [0.0, 0.0, drop]
            thing = Pose(np.maximum(place, [-9.0, -9.0, -0.4]), frozen[0].orientation)
        sample = human.step(t, WorldView(PALM, 0.0, thing, np.array([0.0, 0.0, -3.0 if gives else 0.0])))
        hand, speed = sample.frame, sample.velocity
        toward = human.phase in ("reaching", "waiting") and t < recording.fall
        observer.step(t, hand, thing, toward)
        if human.phase == "reaching" and recording.begin == np.inf:
            recording.begin = t
        if recording.onset == np.inf and float(np.linalg.norm(speed)) > ONSET_SPEED:
            recording.onset = t
        if human.phase == "reaching" and human._reach is not None:
            way = (t - human._reach.begin) / human._reach.duration
            if falls is not None and falls < 1.0 and way >= falls and recording.fall == np.inf:
                recording.fall = t + DT
        if human.phase == "waiting" and recording.end == np.inf:
            recording.end = t
            if falls is not None and falls >= 1.0:
                recording.fall = t + falls - 1.0
        if t > recording.end + LOOK and human.phase == "waiting":
            human.command("rest")
        if human.phase == "retreating":
            way = float(
                np.linalg.norm(hand.position - recording.hand[int(np.searchsorted(recording.times, recording.end))])
            )
            if way > 0.10 and recording.back == np.inf:
                recording.back = t
            if t > recording.back + 0.6:
                break
        t += DT
    return recording


def neither(kind: str, number: int, seed: int, robot_holds: bool) -> Recording:
    """A motion of no handover: with an object in the hand that moves, or with one in the robot's hand."""
    rng = np.random.default_rng([seed, number, 71])
    motion = other_motion(kind, rng)
    recording = Recording(kind, robot_holds, onset=motion.onset)
    observer = Observer(recording, int(rng.integers(2**31)))
    turn = rng.normal(0.0, 0.2, 3)
    sway: Callable[[float], np.ndarray] = lambda t: 0.0015 * np.sin(2 * np.pi * 0.4 * t + np.arange(3))  # noqa: E731
    first = motion.at(0.0)
    far = max(0.1, float(np.linalg.norm(motion.segments[0].end - first)))
    for k in range(int((motion.over + 0.8) / DT)):
        t = k * DT
        place = motion.at(t) + sway(t)
        turned = Rotation.from_rotvec(turn * float(np.linalg.norm(place - first)) / far)
        hand = Pose(place, turned.as_quat())
        thing = Pose(np.array(IN_PALM)) if robot_holds else hand * Pose(np.array([-0.08, 0.0, -0.05]))
        observer.step(t, hand, thing, False)
    return recording
