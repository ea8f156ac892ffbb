"""What ends a reach for a person: doubt, and what is seen of whom it is for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.awaited import ARM
from coglab_smach.context.hand_track import Sight
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.region import HandoverRegion, anything_believed, ends_outside
from coglab_smach.states.where import GLANCE, hand_name, jumped_from, palm_at, sight_of, sight_or_refusal

PERIOD = 0.03
"""s between two looks"""
DOUBT_TIME = 0.2
"""s for which nothing is believed before a reach ends; a belief that a gap in what is seen broke off is back by then"""
BACKWARD = 0.6
"""share of the way that a hand may go back from which on the arm waits to see whether it does"""
SLIPPED = 0.06
"""m by which an object is lower against the person's hand than at first when it has left it"""
TOGETHER, LOOK = 0.05, 0.4
"""s between a sight of the hand and one of the object that tell how they are apart; s of them that are looked at"""


def target_of(goal: Mapping[str, Any]) -> str:
    """The object that a reach is for, or the person's hand, as perception names it; '' for a place."""
    return str(goal["frame"]).removesuffix("_ahead").removeprefix("object_")


OUTSIDE = (int(ReasonCode.GOAL_AHEAD_OUTSIDE), "the person's reach seems to end outside the handover region")
LEFT = (int(ReasonCode.GOAL_LEFT_REGION), "it is outside the handover region")
"""ReasonCode and sentence of a predicted place, and of one that is seen, that is not followed"""


LOWERED = "it was lowered with the hand that holds it"


class PersonsGrip:
    """Tells an object that falls from one that is lowered fast: whether the person's hand is still at it."""

    def __init__(self, state: CoglabState, target: str) -> None:
        self._state, self._target = state, target
        self._at_first: float | None = None
        self.look()

    def look(self) -> None:
        """Takes how they are apart before anything falls, once they are seen together."""
        if self._at_first is None:
            self._at_first = self._apart()

    def _apart(self) -> float | None:
        """m from the object up to the person's hand. Seen one after the other they would be apart wherever a hand goes
        fast, and so they are aside."""
        at, thing = sight_of(self._state, hand_name(self._state.ctx)), sight_of(self._state, self._target)
        if at is None or thing is None or abs(at.age - thing.age) > TOGETHER:
            return None
        return float(at.xyz[2] - thing.xyz[2])

    def fell_or_withdrawn(self) -> int:
        """ReasonCode of what has gone down. What has left the hand is soon far below it; one that is lowered may seem
        so for a sight or two."""
        clock, found = self._state.ctx.clock, []
        end = clock.now() + LOOK
        while clock.now() < end:
            apart = self._apart()
            found += [] if apart is None else [apart]
            self._state.pause(PERIOD)
        if self._at_first is None or not found or float(np.median(found)) > self._at_first + SLIPPED:
            return int(ReasonCode.GOAL_FELL)
        return int(ReasonCode.GOAL_WITHDRAWN)


class ReachWatch:
    """Watches a reach for what a person offers, or for their hand: it may not go back nor fall (cc.GoalWatch, which the
    controller asks of each motion, here from the first of several on), where it will be, or is, has to lie in the
    handover region, and somebody has to go on offering it."""

    def __init__(self, state: CoglabState, goal: Mapping[str, Any], grip: PersonsGrip | None) -> None:
        """``grip``: of the person on the object that the reach is for."""
        self.state, self.goal, self.limits, self.may = state, goal, goal["limits"], goal["watch"]
        self.target, self._grip = target_of(goal), grip
        self._frame = str(goal["frame"]).removesuffix("_ahead")
        self.predicted = self._began_on_belief = self._frame != goal["frame"]
        """whether the arm goes to where the target will be, and not to where it is seen"""
        self._watch: cc.GoalWatch | None = None
        self._sure = state.ctx.clock.now()
        """when it was last believed"""
        self._looked = self._sure - PERIOD
        self._last: Sight | None = None
        """s, m: the newest sight that was no jump"""
        self._from: np.ndarray | None = None
        """m, the palm when the reach began"""
        self._nearest, self._back = np.inf, 0.0
        """m from there to where the target was nearest, and by which it has gone back since"""
        self._hand: cc.GoalWatch | None = None
        """of the person's hand, which is asked where the object is hidden"""
        self._hand_last: Sight | None = None
        """as of the target"""
        self._seen_at = 0.0
        """s, when the target was seen there"""
        self._region = HandoverRegion(state.ctx, self.may["margin"])
        self._outside: tuple[int, str] | None = None
        """ReasonCode and sentence of who offers or asks, but not in the region"""
        self._untold: PortError | None = None
        """why perception cannot tell whose hand is at what the reach is for"""

    def doubt(self) -> tuple[int, str]:
        """ReasonCode and sentence of what is doubted."""
        if self._outside is not None:
            return self._outside
        if self._untold is not None:
            return int(ReasonCode.NOT_PERCEIVED), self._untold.sentence
        return int(ReasonCode.GOAL_WITHDRAWN), "the person does not offer or ask any more"

    def doubted(self) -> bool:
        """Whether nobody has offered or asked for a while, or what the reach is for goes back. TimeLimit, which ends
        the reach, where it went back too far, or fell."""
        now = self.state.ctx.clock.now()
        if now - self._looked >= PERIOD and self.hopeful():
            self._sure = now
        return now - self._sure > DOUBT_TIME or self._goes_back()

    def _goes_back(self) -> bool:
        return self._back > BACKWARD * self.may["retreat"] > 0.0

    def hopeful(self) -> bool:
        """Whether somebody offers or asks now, within the region: it is believed, or seen. TimeLimit as doubted()."""
        ctx = self.state.ctx
        now = ctx.clock.now()
        passed, self._looked = max(0.0, now - self._looked), now
        place = self._look()
        if place is not None:
            self._follow(place, passed)
        self._follow_hand(passed, hidden=place is None)
        held = place is not None and self._region.offers(self._seen_at, place, moving=False)
        if self._goes_back() and held:
            # It is offered there: by as much less may it go back from now on.
            self._nearest, self._back = self._nearest + self._back, 0.0
        if self._goes_back():
            return False
        hope, outside = anything_believed(ctx), ends_outside(ctx, self._region, self._frame)
        # Who passes through the region on the way out of it offers nothing there.
        offered = held or (place is not None and not outside and self._region.holds(place))
        if not offered and not outside:
            # What is hidden may have been taken back where nothing but a belief spoke for it.
            hidden = place is None and (hope or not self._began_on_belief)
            ahead = self._began_on_belief and hope and ctx.perception.ahead().frame == self.goal["frame"]
            offered = hidden or ahead
        self._outside = None
        if not offered and place is not None:
            self._outside = OUTSIDE if outside else None if self._region.holds(place) else LEFT
        elif outside:
            self._outside = OUTSIDE
        return offered

    def goal_now(self) -> dict[str, Any]:
        """What the reach is for: where it will be as long as that is believed, else where it is seen."""
        ahead = self.state.ctx.perception.ahead()
        self.predicted = ahead.frame == self.goal["frame"] and self._region.holds(ahead.place)
        if self.predicted:
            return dict(self.goal)
        watched = {"goal_retreat": self.may["retreat"], "goal_drop": self.may["drop"]}
        limits = self.limits if self._last is None else self._region.limits(self._last[1])
        return {**self.goal, "frame": self._frame, "limits": {**limits, **watched}}

    def forgive(self) -> None:
        """The doubt is over."""
        self._sure = self.state.ctx.clock.now()

    def _look(self) -> np.ndarray | None:
        """m, where the target is seen. Of one that is merely hidden nothing is said: a hand that goes back hides it
        too."""
        seen = sight_or_refusal(self.state, self.target, GLANCE)
        self._untold = None
        if isinstance(seen, PortError):
            self._untold = seen if seen.code == ReasonCode.NOT_PERCEIVED else None
            return None
        if seen is None:
            return None
        self._seen_at = self.state.ctx.clock.now() - seen.age
        return np.array(seen.xyz)

    def _follow_hand(self, passed: float, hidden: bool) -> None:
        """A hand that takes an object back may hide it. One that leaves what the fingers close on has let go."""
        if self._grip is None or self._from is None:
            return
        seen = sight_of(self.state, hand_name(self.state.ctx), GLANCE)
        if seen is None:
            return
        place = np.array(seen.xyz)
        jumped, self._hand_last = jumped_from(self._hand_last, self.state.ctx.clock.now(), place)
        if jumped:
            return
        if self._hand is None:
            nowhere = np.zeros(3)
            self._hand = cc.GoalWatch(nowhere, nowhere, self.may["retreat"], 0.0, self._from, place)
        code, sentence = self._hand.update(passed, place)
        if code and hidden and self.state.ctx.closing is None:
            raise TimeLimit(f"the reach was given up: {sentence}, as the hand that hides it", (), code)

    def _follow(self, place: np.ndarray, passed: float) -> None:
        jumped, self._last = jumped_from(self._last, self.state.ctx.clock.now(), place)
        if jumped:
            return
        if self._watch is None or self._from is None:
            palm = self._from = palm_at(self.state.ctx)
            if palm is not None:
                nowhere = np.zeros(3)
                self._watch = cc.GoalWatch(nowhere, nowhere, self.may["retreat"], self.may["drop"], palm, place)
            return
        distance = float(np.linalg.norm(place - self._from))
        self._nearest = min(self._nearest, distance)
        self._back = distance - self._nearest
        code, sentence = self._watch.update(passed, place)
        if code == ReasonCode.GOAL_FELL and self._grip is not None:
            # The arm goes no further while it is found out.
            resting = self.state.ctx.arm.cancel_motion(sentence)
            self.state.await_pending(resting, "rest of the arm", 3.0, code=ARM)
            code = self._grip.fell_or_withdrawn()
            sentence = sentence if code == ReasonCode.GOAL_FELL else LOWERED
        if code:
            raise TimeLimit(f"the reach was given up: {sentence}", (), code)
