"""A person whose hand goes as one was recorded, with the object in it, through a whole handover to the robot.

The reach is the recorded one. After it there are three ways: ``wait``: the hand waits at the end of its reach until it
trusts the robot's hand, then places and lets go as the simulated person does; ``no_wait``: it goes on as recorded to
where the object was let go, and holds it there until load and grip say that the robot has it; ``leave``: everything
happens at its recorded time, and an object that the robot does not hold then goes away with the hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_sim.person.participant import Participant
from coglab_sim.person.recorded_motion import Playback, PlaybackSettings, RecordingError
from coglab_sim.person.scene import Scene
from coglab_sim.person.senses import Percept
from coglab_sim.person.virtual_human import CLOSING, VirtualHuman

WAYS = ("wait", "no_wait", "leave")
HAND = "human_hand"
SLOW = 0.05
"""m/s below which the recorded hand has arrived"""
STEP = 0.02
"""s, at which a recording is looked through"""
LEFT = 0.05
"""m by which the recorded object has moved in the hand when it was let go"""
FARTHEST = 0.30
"""m between hand and object at the beginning: farther away it is in nobody's hand"""
SHORTEST = 0.10
"""m, of a reach"""
LEAVES_CLOSED = 0.05
"""share of their way that the robot's fingers are seen to close before a person lets go who leaves as recorded"""


class RecordedHand:
    """The recorded hand in the robot's world: poses, and when it arrived and let go (s of the recording).

    Raises RecordingError where there is no hand, no object in it, or no reach.
    """

    def __init__(self, playback: Playback, object_frame: str | None) -> None:
        """``object_frame``: of the object that is handed over; None: the recording is of a hand alone."""
        file, names = playback.settings.file, sorted(playback.names)
        for name in (HAND, object_frame):
            if name is not None and name not in names:
                raise RecordingError(
                    f"{file}: a handover needs the frame '{name}', the recording has {', '.join(names)}; rename what "
                    f"is meant, or say `object: in_hand` for a hand that was recorded without its object"
                )
        self.playback = playback
        self.end = float(playback.recording.duration)
        times = np.arange(0.0, self.end + STEP / 2, STEP)
        places = np.array([self.at(s).position for s in times])
        away = np.linalg.norm(places - places[0], axis=1)
        if away.max() < SHORTEST:
            raise RecordingError(f"{file}: '{HAND}' moves {away.max():.3f} m, a reach is at least {SHORTEST} m long")
        speed = np.linalg.norm(np.gradient(places, STEP, axis=0), axis=1)
        there = np.flatnonzero((away > 0.6 * away.max()) & (speed < SLOW))
        self.arrived = float(times[there[0]] if len(there) else times[int(np.argmax(away))])
        self.released = float(times[there[-1]] if len(there) else self.arrived)
        self.object_in_hand: Pose | None = None
        if object_frame is not None:
            held = [self.at(s).inverse() * playback.at(object_frame, s) for s in times]
            distance = float(np.linalg.norm(held[0].position))
            if distance > FARTHEST:
                raise RecordingError(
                    f"{file}: '{object_frame}' begins {distance:.2f} m from the hand, at most {FARTHEST} m are accepted"
                )
            self.object_in_hand = held[0]
            moved = [float(np.linalg.norm(each.position - held[0].position)) > LEFT for each in held]
            if any(moved):
                self.released = max(self.arrived, float(times[moved.index(True)]))

    def at(self, seconds: float) -> Pose:
        """The hand at a time of the recording (s)."""
        return self.playback.at(HAND, seconds)


def open_recorded_hand(settings: Mapping[str, Any], object_frame: str) -> tuple[RecordedHand, str]:
    """The hand of a recording and which of the three ways it goes. RecordingError for anything that cannot be used.

    ``settings``: fields of PlaybackSettings, ``person`` (wait, no_wait, leave), ``object`` (recorded: the recording has
    to have it; in_hand: a hand alone, the object is put into it as the simulated person holds it).
    """
    rest = dict(settings)
    way, source = str(rest.pop("person", "wait")), str(rest.pop("object", "recorded"))
    if way not in WAYS:
        raise RecordingError(f"recording: person must be {', '.join(WAYS)}, got '{way}'")
    if source not in ("recorded", "in_hand"):
        raise RecordingError(f"recording: object must be recorded or in_hand, got '{source}'")
    playback = Playback.open(PlaybackSettings.from_mapping(rest))
    return RecordedHand(playback, object_frame if source == "recorded" else None), way


def scene_of(scene: Scene, hand: RecordedHand) -> Scene:
    """The scene with the object in the hand as it was recorded, where it was."""
    if hand.object_in_hand is None:
        return scene
    return replace(scene, object_in_hand=hand.object_in_hand.position, object_turn=hand.object_in_hand.orientation)


class RecordedPerson(VirtualHuman):
    """VirtualHuman whose reach is a recorded one; it gives, and does not take."""

    def __init__(self, participant: Participant, scene: Scene, hand: RecordedHand, way: str = "wait") -> None:
        super().__init__(replace(participant, sway=0.0, tremor=0.0, behaviour="normal"), scene_of(scene, hand), True)
        self.recorded, self.way = hand, way
        begin = hand.at(0.0)
        self.rest, self.rest_turn = begin.position.copy(), begin.rotation
        self._hand, self._turn = self.rest.copy(), self.rest_turn
        self._scale = hand.playback.settings.time_scale

    def command(self, text: str) -> None:
        if not text.startswith("receive"):
            super().command(text)

    def _understand(self, t: float) -> None:
        super()._understand(t)
        if self._pending == "receive":
            self._pending = None

    def _reacting(self, t: float, dt: float, seen: Percept) -> None:
        self._go("reaching", t)  # the recording has a reaction of its own

    def _reaching(self, t: float, dt: float, seen: Percept) -> None:
        seconds = (t - self._since) / self._scale
        self._show(seconds)
        if seconds < self.recorded.arrived:
            self._held_load, self._closure = seen.load, seen.hand_closure
        elif self.way == "wait":
            self._go("waiting", t)
        if self.way == "no_wait" and seconds >= self.recorded.released:
            self._go("holding", t)
        if self.way == "leave" and seconds >= self.recorded.released:
            self._leave_it(t, dt, seen)
        if seconds >= self.recorded.end:
            self._task = "rest"
            self._go("idle", t)

    def _leave_it(self, t: float, dt: float, seen: Percept) -> None:
        """On the way back: the fingers open if the robot has the object, now or never."""
        closed = seen.hand_closure > self._closure + LEAVES_CLOSED and seen.closing_speed < CLOSING
        if self._grip < 1.0 or self._signs(t, seen, closed) >= 1.0:
            self._grip = max(0.0, self._grip - dt / self.participant.release_time)

    def _show(self, seconds: float) -> None:
        """The hand as it was recorded, and as fast as it went."""
        pose, next_pose = self.recorded.at(seconds), self.recorded.at(seconds + STEP)
        pace = STEP * self._scale
        self._hand, self._turn = pose.position.copy(), pose.rotation
        self._velocity = (next_pose.position - pose.position) / pace
        self._spin = (next_pose.rotation * pose.rotation.inv()).as_rotvec() / pace
