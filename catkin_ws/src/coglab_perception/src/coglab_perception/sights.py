"""Newest sights of perception, and the queries of the perception contract. No ROS.

Each query returns within its time limit. A refusal is a sentence that lists the frames in view and says what to do.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose

from coglab_perception.frames import FrameNames

OLDEST = 0.5  # s, largest age of a sight that answers a query
LONGEST_WAIT = 60.0  # s, longest time limit of a query; larger ones are reduced to it


@dataclass(frozen=True)
class Sight:
    """One observation of a frame."""

    name: str
    captured: float
    """time of the capture, s"""
    frame: Pose
    """pose in ``world``"""


@dataclass(frozen=True)
class Board:
    """The storage board: its frame in world and its slots (object positions in the board frame, m)."""

    frame: Pose
    slots: dict[str, np.ndarray]

    def free(self, occupied: list[np.ndarray], clearance: float = 0.10) -> list[str]:
        """Slots farther than ``clearance`` m from every object (world positions, m), best first."""
        return [
            name
            for name, place in self.slots.items()
            if all(np.linalg.norm(self.frame.apply(place) - o) > clearance for o in occupied)
        ]


class NotSeen(Exception):
    """Perception cannot answer a query. The text is the message of the answer, `code` its ReasonCode."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


class Sights:
    """Newest sight of each frame. Thread-safe.

    ``clock``: returns the time (s), also of sights; it never goes back. ``board``: pose and slots; None until it is
    seen. ``doubt(frame)``: reason not to use a sight of this frame, or empty. ``silence``: end of the sentences
    about a tracker that delivers nothing.
    """

    def __init__(
        self,
        names: FrameNames,
        clock: Callable[[], float],
        board: Board | None = None,
        doubt: Callable[[str], str] = lambda frame: "",
        silence: str = "is the tracker running?",
    ) -> None:
        self.names, self.clock, self.board = names, clock, board
        self._doubt, self._silence = doubt, silence
        self._newest: dict[str, Sight] = {}
        self._looked = -math.inf
        self.changed = threading.Condition()

    def add(self, sights: Iterable[Sight]) -> None:
        """Stores sights. The tracker works, even if it sees nothing."""
        with self.changed:
            self._looked = self.clock()
            self._newest.update((sight.name, sight) for sight in sights)
            self.changed.notify_all()

    def newest(self, name: str) -> Sight | None:
        """Returns the newest sight of a frame."""
        return self._newest.get(name)

    def in_view(self) -> list[str]:
        """Returns the frames with a sight younger than OLDEST."""
        return sorted(name for name in list(self._newest) if self._is_fresh(name))

    def works(self) -> bool:
        """True if the tracker has delivered something within OLDEST."""
        return self.clock() - self._looked < OLDEST

    # -- queries ---------------------------------------------------------------------------------

    def wait_until_it_works(self, timeout: float, what: str) -> None:
        """Waits until the tracker delivers. Raises NotSeen. ``what``: name of the missing thing for the message."""
        limit = bounded(timeout)
        with self.changed:
            if self.changed.wait_for(self.works, limit):
                return
        raise NotSeen(f"{what} was not visible within {limit:.1f} s; {self._silence}", ReasonCode.NOT_PERCEIVED)

    def locate(self, target: str, timeout: float) -> tuple[str, Sight, float]:
        """Waits for a fresh sight of an object (by id), of the partner's hand or of the board.

        Returns its frame, the sight, and its age (s). Raises NotSeen.
        """
        if target == self.names.board and self.board is not None:
            return target, Sight(target, self.clock(), self.board.frame), 0.0
        fixed = (self.names.human_hand, self.names.board)
        name = target if target in fixed else self.names.object_frame(target)
        limit = bounded(timeout)
        with self.changed:
            if not self.changed.wait_for(lambda: self._is_fresh(name) and not self._doubt(name), limit):
                doubt = self._doubt(name)
                if doubt:
                    raise NotSeen(doubt, ReasonCode.NOT_PERCEIVED)
                raise NotSeen(
                    f"'{name}' was not seen within {limit:.1f} s; in view: "
                    f"{', '.join(self.in_view()) or 'nothing'}; bring it into view of the tracker",
                    ReasonCode.OBJECT_NOT_SEEN,
                )
            sight = self._newest[name]
            return name, sight, max(0.0, self.clock() - sight.captured)

    def free_places(self, object_id: str) -> list[tuple[str, np.ndarray]]:
        """Returns the free slots of the board (object positions in its frame, m), best first. Raises NotSeen.

        The object to be placed, ``object_id``, does not occupy a slot.
        """
        if self.board is None:
            raise NotSeen(
                f"'{self.names.board}' has not been seen; bring it into view of the tracker", ReasonCode.NOT_PERCEIVED
            )
        own = self.names.object_frame(object_id)
        with self.changed:
            objects = {
                name: sight.frame.position
                for name, sight in self._newest.items()
                if self.names.object_id(name) and name != own
            }
        free = self.board.free(list(objects.values()))
        if not free:
            raise NotSeen(
                f"no place on the board is free: {', '.join(sorted(objects))} lie near "
                f"{', '.join(self.board.slots)}; clear one",
                ReasonCode.NO_FREE_PLACE,
            )
        return [(name, self.board.slots[name]) for name in free]

    def _is_fresh(self, name: str) -> bool:
        sight = self._newest.get(name)
        return sight is not None and self.clock() - sight.captured < OLDEST


def bounded(timeout: float) -> float:
    """Time limit in the range 0 to LONGEST_WAIT (s); 0 for NaN."""
    return 0.0 if math.isnan(timeout) else min(max(timeout, 0.0), LONGEST_WAIT)


def slots_of(places: Mapping[str, Iterable[float]]) -> dict[str, np.ndarray]:
    """Slots of a board from a mapping: name -> x y z (m) in the board's frame. ValueError: not three finite numbers."""
    slots = {name: np.array(list(place), dtype=float) for name, place in places.items()}
    for name, place in slots.items():
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ValueError(f"slot {name}: expected x y z in m, got {place.tolist()}")
    return slots
