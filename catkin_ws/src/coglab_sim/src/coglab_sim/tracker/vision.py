"""The simulated perception without ROS: frames in view, choice of the partner's hand, and queries."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from coglab_perception.frames import FrameNames
from coglab_perception.sights import Board, Sight, Sights
from coglab_py.pose import Pose

from coglab_sim.tracker.tracker import PerceptionSettings, Tracker

SILENCE = "is the simulated cell, or the recording, running?"

IN_HAND = 0.20  # m; an object nearer to a hand counts as held


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
        self.sights = Sights(names, clock, self.board, self._doubt, SILENCE)
        self._hands: list[np.ndarray] = []
        self._partner = ""
        self._trackers: dict[str, Tracker] = {}

    # -- seeing ----------------------------------------------------------------------------------

    def see(
        self,
        hands: Mapping[str, Pose],
        objects: Mapping[str, Pose],
        robot: Pose | None = None,
        captured: float | None = None,
    ) -> list[Sight]:
        """Takes the true state of the world: hands of people by any name, objects by frame name.

        ``captured``: time of this state (s, of the clock); None: now. Returns the sights to be broadcast: the
        partner's hand and the objects.
        """
        now = self.clock() if captured is None else captured
        with self.sights.changed:
            self.people = len(hands)
            self._hands = [hand.position for hand in hands.values()]
            self._partner = self.choice.choose(hands, robot)
            seen = {self.names.human_hand: hands[self._partner]} if self._partner else {}
            seen.update(objects)
            sights = []
            for name, frame in seen.items():
                others = [other for each, other in seen.items() if each != name]
                sights += self._track(name, now, frame, robot, others)
            self.sights.add(sights)
        return sights

    def _track(self, name: str, now: float, frame: Pose, robot: Pose | None, others: list[Pose]) -> list[Sight]:
        if name not in self._trackers:
            self._trackers[name] = Tracker(name, self.settings, self.seed)
        return self._trackers[name].step(now, frame, robot, others)

    # -- queries ---------------------------------------------------------------------------------

    def init_vision(self, timeout: float) -> str:
        """Waits until the world is visible and returns a message. Raises NotSeen."""
        self.sights.wait_until_it_works(timeout, "the cell")
        return "tracker stand-in sees the cell"

    def locate(self, target: str, timeout: float) -> tuple[str, Sight, float]:
        """Waits for a fresh sight of an object (by id), of the partner's hand or of the board.

        Returns its frame, the sight, and its age (s). Raises NotSeen.
        """
        return self.sights.locate(target, timeout)

    def free_places(self, object_id: str, timeout: float) -> list[tuple[str, np.ndarray]]:
        """Returns the free slots of the board, best first. Raises NotSeen.

        The object to be placed, `object_id`, does not occupy a slot.
        """
        self.sights.wait_until_it_works(timeout, "the board")
        return self.sights.free_places(object_id)

    # -- checks ----------------------------------------------------------------------------------

    def _doubt(self, name: str) -> str:
        """Reason if the query concerns the partner's hand and the partner is not clear; else empty."""
        if self.people <= 1 or self._partner or not self.sights.works():
            return ""
        if name != self.names.human_hand and not self._is_held(name):
            return ""
        return f"{self.people} people are in view; one partner is expected: ask the others to step back"

    def _is_held(self, name: str) -> bool:
        sight = self.sights.newest(name)
        if sight is None:
            return False
        place = sight.frame.position
        return any(np.linalg.norm(place - hand) < IN_HAND for hand in self._hands)
