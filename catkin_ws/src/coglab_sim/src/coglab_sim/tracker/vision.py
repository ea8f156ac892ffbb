"""The perception contract without ROS: frames in view, choice of the partner's hand, and queries.

Each query returns within its time limit. A refusal is a sentence that lists the frames in view and says what to do.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_perception.frames import FrameNames
from coglab_py.pose import Pose

from coglab_sim.tracker.tracker import Board, PerceptionSettings, Sight, Tracker

OLDEST = 0.5  # s, largest age of a sight for locate_object, and of the last view of the world

LONGEST_WAIT = 60.0  # s, longest time limit; larger ones are reduced to it

IN_HAND = 0.20  # m; an object nearer to a hand counts as held


class NotSeen(Exception):
    """Perception cannot answer a query. The text is the message of the answer, `code` its ReasonCode."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


class PartnerChoice:
    """Chooses the partner's hand when several are in view.

    A single hand is the partner's. Of several, the hand that is nearer to the robot than all others by at least
    `margin` (m) is chosen. It stays chosen until another is nearer by the margin. With margin 0, none of several hands
    is ever chosen.
    """

    def __init__(self, margin: float = 0.0) -> None:
        if not (math.isfinite(margin) and margin >= 0.0):
            raise ValueError(f"partner_margin must be 0 or more metres, got {margin}")
        self.margin = margin
        self._chosen = ""

    def choose(self, hands: Mapping[str, Pose], robot: Pose | None) -> str:
        """Returns the name of the partner's hand, or an empty string if the choice is not clear."""
        if len(hands) <= 1:
            self._chosen = next(iter(hands), "")
            return self._chosen
        if self.margin <= 0.0 or robot is None:
            self._chosen = ""
            return ""
        far = {name: float(np.linalg.norm(hand.position - robot.position)) for name, hand in hands.items()}
        nearest, second = sorted(far, key=far.__getitem__)[:2]
        kept = self._chosen in far and far[self._chosen] - far[nearest] < self.margin
        if not kept:
            clear = far[second] - far[nearest] >= self.margin
            self._chosen = nearest if clear else ""
        return self._chosen


class Vision:
    """View of the simulated perception. Thread-safe.

    `board`: true pose. The board stands still and is seen once, with the tracker's calibration error.
    `clock` returns the time (s), also of sights. It never goes back.
    """

    def __init__(
        self,
        names: FrameNames,
        settings: PerceptionSettings,
        board: Board,
        seed: int,
        clock: Callable[[], float],
        partner_margin: float = 0.0,
    ) -> None:
        self.names, self.settings, self.seed = names, settings, seed
        self.board = Board(settings.calibration(seed) * board.frame, board.slots)
        self.clock = clock
        self.choice = PartnerChoice(partner_margin)
        self.people = 0
        self._hands: list[np.ndarray] = []
        self._partner = ""
        self._changed = threading.Condition()
        self._trackers: dict[str, Tracker] = {}
        self._visible = -math.inf

    # -- seeing ----------------------------------------------------------------------------------

    def see(self, hands: Mapping[str, Pose], objects: Mapping[str, Pose], robot: Pose | None = None) -> list[Sight]:
        """Takes the true state of the world: hands of people by any name, objects by frame name.

        Returns the sights to be broadcast: the partner's hand and the objects.
        """
        now = self.clock()
        with self._changed:
            self._visible = now
            self.people = len(hands)
            self._hands = [hand.position for hand in hands.values()]
            self._partner = self.choice.choose(hands, robot)
            seen = {self.names.human_hand: hands[self._partner]} if self._partner else {}
            seen.update(objects)
            sights = []
            for name, frame in seen.items():
                others = [other for each, other in seen.items() if each != name]
                sights += self._track(name, now, frame, robot, others)
            self._changed.notify_all()
        return sights

    def _track(self, name: str, now: float, frame: Pose, robot: Pose | None, others: list[Pose]) -> list[Sight]:
        if name not in self._trackers:
            self._trackers[name] = Tracker(name, self.settings, self.seed)
        return self._trackers[name].step(now, frame, robot, others)

    # -- queries ---------------------------------------------------------------------------------

    def init_vision(self, timeout: float) -> str:
        """Waits until the world is visible and returns a message. Raises NotSeen."""
        limit = _limit(timeout)
        with self._changed:
            if self._changed.wait_for(self._world_is_visible, limit):
                return "tracker stand-in sees the cell"
        raise NotSeen(
            f"the cell was not visible within {limit:.1f} s; is the simulated cell, or the recording, running?",
            ReasonCode.NOT_PERCEIVED,
        )

    def locate(self, target: str, timeout: float) -> tuple[str, Sight, float]:
        """Waits for a fresh sight of an object (by id), of the partner's hand or of the board.

        Returns its frame, the sight, and its age (s). Raises NotSeen.
        """
        if target == self.names.board:
            return target, Sight(target, self.clock(), self.board.frame), 0.0
        name = target if target == self.names.human_hand else self.names.object_frame(target)
        limit = _limit(timeout)
        with self._changed:
            found = self._changed.wait_for(lambda: self._is_fresh(name) and not self._doubt(name), limit)
            if not found:
                doubt = self._doubt(name)
                if doubt:
                    raise NotSeen(doubt, ReasonCode.NOT_PERCEIVED)
                raise NotSeen(self._absence(name, limit), ReasonCode.OBJECT_NOT_SEEN)
            sight = self._trackers[name].newest
            assert sight is not None
            return name, sight, max(0.0, self.clock() - sight.captured)

    def free_places(self, object_id: str, timeout: float) -> list[tuple[str, np.ndarray]]:
        """Returns the free slots of the board, best first. Raises NotSeen.

        The object to be placed, `object_id`, does not occupy a slot.
        """
        limit = _limit(timeout)
        own = self.names.object_frame(object_id)
        with self._changed:
            if not self._changed.wait_for(self._world_is_visible, limit):
                raise NotSeen(
                    f"the board was not visible within {limit:.1f} s; is the simulated "
                    "cell, or the recording, running?",
                    ReasonCode.NOT_PERCEIVED,
                )
            objects = {
                name: tracker.newest.frame.position
                for name, tracker in self._trackers.items()
                if tracker.newest is not None and name not in (self.names.human_hand, own)
            }
        free = self.board.free(list(objects.values()))
        if not free:
            raise NotSeen(
                f"no place on the board is free: {', '.join(sorted(objects))} lie near "
                f"{', '.join(self.board.slots)}; clear one",
                ReasonCode.NO_FREE_PLACE,
            )
        return [(name, self.board.slots[name]) for name in free]

    # -- checks ----------------------------------------------------------------------------------

    def _world_is_visible(self) -> bool:
        return self.clock() - self._visible < OLDEST

    def _is_fresh(self, name: str) -> bool:
        tracker = self._trackers.get(name)
        if tracker is None or tracker.newest is None:
            return False
        return self.clock() - tracker.newest.captured < OLDEST

    def _doubt(self, name: str) -> str:
        """Reason if the query concerns the partner's hand and the partner is not clear; else empty."""
        if self.people <= 1 or self._partner or not self._world_is_visible():
            return ""
        if name != self.names.human_hand and not self._is_held(name):
            return ""
        return f"{self.people} people are in view; one partner is expected: ask the others to step back"

    def _is_held(self, name: str) -> bool:
        tracker = self._trackers.get(name)
        if tracker is None or tracker.newest is None:
            return False
        place = tracker.newest.frame.position
        return any(np.linalg.norm(place - hand) < IN_HAND for hand in self._hands)

    def _absence(self, name: str, limit: float) -> str:
        seen = sorted(n for n in self._trackers if self._is_fresh(n))
        return (
            f"'{name}' was not seen within {limit:.1f} s; in view: "
            f"{', '.join(seen) or 'nothing'}; bring it into view of the tracker"
        )


def _limit(timeout: float) -> float:
    """Time limit in the range 0 to LONGEST_WAIT (s); 0 for NaN."""
    return 0.0 if math.isnan(timeout) else min(max(timeout, 0.0), LONGEST_WAIT)
