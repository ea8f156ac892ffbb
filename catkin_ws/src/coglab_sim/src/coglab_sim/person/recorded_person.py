"""A person whose hand follows a recording, with the object in it, through a whole handover to the robot.

The reach is the recorded one. Three variants follow:

* ``wait``: the hand waits at the end of its reach until the person trusts the robot's hand. Then it places and lets go
  like the simulated person.
* ``no_wait``: the hand follows the recording to the point of release. It holds the object there until load and felt
  grip show that the robot has it.
* ``leave``: the hand follows the recording to its end. If the robot does not hold the object, it leaves with the hand.
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
SLOW = 0.05  # m/s; a slower recorded hand has arrived
STEP = 0.02  # s, sampling period for the analysis of a recording
LEFT = 0.05  # m; an object that moved farther in the recorded hand was let go
FARTHEST = 0.30  # m, largest distance between hand and held object at the beginning
SHORTEST = 0.10  # m, shortest reach
LEAVES_CLOSED = 0.05  # with `leave`: seen change of the fingers' closure (0..1) above which they count as closed


class RecordedHand:
    """The recorded hand in the robot's world: poses, times of arrival and release (s of the recording).

    Raises RecordingError if the recording has no hand, no object in it, or no reach.
    """

    def __init__(self, playback: Playback, object_frame: str | None) -> None:
        """``object_frame``: frame of the object that is handed over; None: the recording has the hand only."""
        file, names = playback.settings.file, sorted(playback.names)
        for name in (HAND, object_frame):
            if name is not None and name not in names:
                raise RecordingError(
                    f"{file}: a handover needs the frame '{name}', the recording has {', '.join(names)}; rename a "
                    f"frame, or set `object: in_hand` for a hand that was recorded without its object"
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
        """Returns the hand's pose at a time of the recording (s)."""
        return self.playback.at(HAND, seconds)


def open_recorded_hand(settings: Mapping[str, Any], object_frame: str) -> tuple[RecordedHand, str]:
    """Returns the hand of a recording and its variant. RecordingError for settings that cannot be used.

    ``settings``: fields of PlaybackSettings; ``person`` (wait, no_wait, leave); ``object``: with `recorded` the
    recording must contain the object, with `in_hand` it has the hand only, which holds the object like the simulated
    person.
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
    """Returns the scene with the recorded pose of the object in the hand, if the object was recorded."""
    if hand.object_in_hand is None:
        return scene
    return replace(scene, object_in_hand=hand.object_in_hand.position, object_turn=hand.object_in_hand.orientation)


class RecordedPerson(VirtualHuman):
    """VirtualHuman with a recorded reach. It gives objects but does not take them."""

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
        self._go("reaching", t)  # the recording includes the reaction time

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
        """On the way back: the fingers open if the robot has the object."""
        closed = seen.hand_closure > self._closure + LEAVES_CLOSED and seen.closing_speed < CLOSING
        if self._grip < 1.0 or self._signs(t, seen, closed) >= 1.0:
            self._grip = max(0.0, self._grip - dt / self.participant.release_time)

    def _show(self, seconds: float) -> None:
        """Sets pose and velocity of the hand from the recording at ``seconds``."""
        pose, next_pose = self.recorded.at(seconds), self.recorded.at(seconds + STEP)
        pace = STEP * self._scale
        self._hand, self._turn = pose.position.copy(), pose.rotation
        self._velocity = (next_pose.position - pose.position) / pace
        self._spin = (next_pose.rotation * pose.rotation.inv()).as_rotvec() / pace
