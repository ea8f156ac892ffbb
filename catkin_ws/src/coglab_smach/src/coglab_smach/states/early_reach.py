"""What ends a reach that began on a belief: doubt, and what is seen of whom it is for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.where import palm_at, seen_at

PERIOD = 0.03
"""s between two looks"""
DOUBT_TIME = 0.2
"""s for which nothing is believed before a reach ends; a belief that a gap in what is seen broke off is back by then"""


class EarlyReach:
    """Watches a reach toward where something will be: the thing itself may not go back nor fall (cc.GoalWatch, the
    rules of a reach toward a goal that is seen), and outside the handover region somebody has to go on offering it."""

    def __init__(self, state: CoglabState, goal: Mapping[str, Any]) -> None:
        self.state, self.limits, self.early = state, goal["limits"], goal["early"]
        self.target = str(goal["frame"]).removesuffix("_ahead").removeprefix("object_")
        self._watch: cc.GoalWatch | None = None
        self._sure = state.ctx.clock.now()
        """when it was last believed"""
        self._looked = self._sure - PERIOD

    def check(self) -> None:
        """TimeLimit, which ends the reach, with the reason."""
        ctx = self.state.ctx
        now = ctx.clock.now()
        if now - self._looked < PERIOD:
            return
        passed, self._looked = now - self._looked, now
        place = seen_at(self.state, self.target)
        if place is not None:
            self._follow(place, passed)
        ahead = ctx.perception.ahead()
        believed = max(ahead.offer, ahead.request) >= float(ctx.config.get("handover.doubt", 0.1))
        if believed or (place is not None and self._offered(place)):
            self._sure = now
        elif now - self._sure > DOUBT_TIME:
            why = "the person does not offer or ask any more"
            raise TimeLimit("the reach was given up", (why,), ReasonCode.GOAL_WITHDRAWN)

    def _follow(self, place: np.ndarray, passed: float) -> None:
        if self._watch is None:
            palm = palm_at(self.state.ctx)
            if palm is not None:
                nowhere = np.zeros(3)
                self._watch = cc.GoalWatch(nowhere, nowhere, self.early["retreat"], self.early["drop"], palm, place)
            return
        code, sentence = self._watch.update(passed, place)
        if code:
            raise TimeLimit(f"the reach was given up: {sentence}", (), code)

    def _offered(self, place: np.ndarray) -> bool:
        low, high = (np.array(self.limits[f"goal_region_{end}"]) for end in ("low", "high"))
        return bool(np.all(place >= low) and np.all(place <= high))
