"""One recorded handover between people, in the axes of its recording, and its mapping to the robot's world.

In the robot's world the robot takes the place of one of the two. The person's hand moves along -x and meets the robot's
hand at the place of handovers; up stays up. The hand's rotation is relative to that at the handover, where the frame
`human_hand` is parallel to the world, like that of the simulated person.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.dmp.cut import reaches, smooth
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.files import write_whole

REST = 0.5  # s, rest before the reach in a recording
MEETING = np.array([0.86, 0.03, 0.44])  # m, base frame: palm of the (simulated) person at a handover
BEFORE = 0.6  # s; a reach may end this long before the touch
AFTER = 0.6  # s; a reach may end this long after the touch


@dataclass(frozen=True, eq=False)
class Handover:
    """Hands and object of one handover. z is up."""

    name: str
    hands: dict[str, Demonstration]
    """by role: "giver", "taker"; whole recordings with one clock"""
    object: Demonstration | None = None
    toward_giver: Array | None = None
    """horizontal direction from taker to giver, (3,); None: not recorded, taken from the reach"""
    touch: float | None = None
    """s, when both hold the object first; None: not recorded"""
    source: str = ""
    """source and licence"""
    notes: tuple[str, ...] = field(default=())

    def whole(self, role: str) -> Demonstration:
        """The recording of a hand. UsageError if this role was not recorded."""
        if role not in self.hands:
            raise UsageError(f"{self.name} has no {role}; recorded: {', '.join(self.hands)}")
        return self.hands[role]

    def reach(self, role: str) -> Demonstration:
        """The reach of a hand to the handover: smoothed, from time 0, in the axes of the recording."""
        begin, end = self.span(role)
        whole = smooth(self.whole(role))
        part = (whole.times >= begin - 1e-9) & (whole.times <= end + 1e-9)
        t = whole.times[part]
        return Demonstration(
            f"{self.name}_{role}",
            t - t[0],
            whole.positions[part],
            None if whole.orientations is None else whole.orientations[part],
            notes=(*whole.notes, f"reach from {t[0]:.2f} s to {t[-1]:.2f} s"),
            noise=whole.noise,
        )

    def span(self, role: str) -> tuple[float, float]:
        """Begin and end (s) of the reach to the handover: the one that ends nearest to the touch, else the longest
        that is no way back."""
        found = reaches(self.whole(role), back=self.touch is not None)
        spans = [(part.begin, part.begin + part.duration) for part in found]
        if self.touch is None:
            return spans[int(np.argmax([part.way for part in found]))]
        touch = self.touch
        near = [span for span in spans if span[0] < touch - 0.3 and touch - BEFORE < span[1] < touch + AFTER]
        if not near:
            raise CheckFailed(f"{self.name}: no reach of the {role} ends near the touch at {touch:.2f} s")
        return min(near, key=lambda span: abs(span[1] - touch))

    def recording(self, role: str = "giver", object_frame: str = "", turn_deg: float = 0.0) -> dict[str, Demonstration]:
        """Tracks by frame in the robot's world for `recording:=`; the person is the one of this role.

        `object_frame`: name of the object's frame; empty: without the object. `turn_deg`: more turn about the vertical.
        """
        from scipy.spatial.transform import Rotation

        begin, end = self.span(role)
        hand = smooth(self.whole(role))
        at_end = int(np.argmin(np.abs(hand.times - end)))
        toward = hand.positions[np.argmin(np.abs(hand.times - begin))] - hand.positions[at_end]
        if self.toward_giver is not None:
            toward = self.toward_giver if role == "giver" else -self.toward_giver
        yaw = np.radians(turn_deg) - np.arctan2(toward[1], toward[0])
        turn = Rotation.from_euler("z", yaw)
        from_ = max(float(hand.times[0]), begin - REST)
        to = min(float(hand.times[-1]), end + 2.0)
        origin = hand.positions[at_end]

        def placed(track: Demonstration, straight: bool) -> Demonstration:
            part = (track.times >= from_) & (track.times <= to)
            q = track.orientations
            if q is not None:
                turned = turn * Rotation.from_quat(q)
                if straight:
                    turned = turned * turned[int(np.argmin(np.abs(track.times - end)))].inv()
                q = turned.as_quat()[part]
            places = turn.apply(track.positions[part] - origin) + MEETING
            return Demonstration(track.name, track.times[part] - from_, places, q, notes=track.notes)

        tracks = {"human_hand": placed(hand, True)}
        if object_frame:
            if self.object is None:
                raise UsageError(f"{self.name} has no object; leave --object out and use recorded_object:=in_hand")
            tracks[object_frame] = placed(smooth(self.object), False)
        return tracks


def write_recording(path: Path, tracks: dict[str, Demonstration]) -> None:
    """Write a CSV that `recording:=` plays; with several frames each line names its own."""
    lines = ["t,x,y,z,qx,qy,qz,qw,frame"]
    for frame, track in tracks.items():
        turns = (
            np.tile([0.0, 0.0, 0.0, 1.0], (len(track.times), 1)) if track.orientations is None else track.orientations
        )
        rows = np.column_stack([track.times, track.positions, turns])
        lines += [",".join(f"{value:.6g}" for value in row) + f",{frame}" for row in rows]
    write_whole(path, "\n".join(lines) + "\n")
