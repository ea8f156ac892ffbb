"""The handover region: where something counts as offered, and what a reach may follow there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from coglab_smach.context.context import Context

LATELY = 0.4
"""s of sights that tell whether something is held still"""
STILL_TIME, STILL = 0.3, 0.025
"""s in which what is held still goes less than so far (m)"""


class HandoverRegion:
    """A box in the base frame, and what was seen there lately. What is held still counts as offered up to
    ``handover.still_margin`` (m) outside; what moves, or is only predicted, has to be within."""

    def __init__(self, ctx: Context, margin: float = 0.0) -> None:
        """``margin`` (m) widens it on all sides: a hand is behind the object it holds or asks for."""
        config = ctx.config
        self.low = np.array(config.get("handover.region_low", [-1.0, -1.0, -1.0]), dtype=float) - margin
        self.high = np.array(config.get("handover.region_high", [1.5, 1.0, 2.0]), dtype=float) + margin
        self._still_margin = float(config.get("handover.still_margin", 0.10))
        self._seen: list[tuple[float, np.ndarray]] = []

    def holds(self, place: Sequence[float] | np.ndarray, wider: float = 0.0) -> bool:
        """Whether a place (m) lies in it, or at most ``wider`` m outside."""
        return bool(np.all(place >= self.low - wider) and np.all(place <= self.high + wider))

    def offers(self, now: float, place: np.ndarray, moving: bool = True) -> bool:
        """Whether what was seen at ``place`` (m) at ``now`` (s, of the sight) is offered; asked at each sight. Without
        ``moving`` only what is held still is."""
        self._seen = [(t, p) for t, p in self._seen if now - t <= LATELY] + [(now, place)]
        since, first = self._seen[0]
        still = now - since > STILL_TIME and float(np.linalg.norm(place - first)) < STILL
        return (moving or still) and self.holds(place, self._still_margin if still else 0.0)

    def limits(self, place: Sequence[float] | np.ndarray) -> dict[str, Any]:
        """What a reach may follow that begins toward ``place`` (m). What is offered outside was held still there, and
        may not go farther than that counts."""
        wider = 0.0 if self.holds(place) else self._still_margin
        return {
            "goal_region_low": (self.low - wider).tolist(),
            "goal_region_high": (self.high + wider).tolist(),
        }


def anything_believed(ctx: Context) -> bool:
    """Whether somebody seems to offer something, or to ask for it."""
    ahead = ctx.perception.ahead()
    return max(ahead.offer, ahead.request) >= float(ctx.config.get("handover.doubt", 0.1))


def ends_outside(ctx: Context, region: HandoverRegion, frame: str) -> bool:
    """Whether the reach that carries ``frame`` (of what is seen) is believed to end outside the region."""
    ahead = ctx.perception.ahead()
    return anything_believed(ctx) and ahead.frame == f"{frame}_ahead" and not region.holds(ahead.place)


def unless_withdrawn(
    ctx: Context, goal: Mapping[str, Any], margin: float = 0.0, may_fall: bool = True
) -> dict[str, Any]:
    """The goal of a motion that ends by itself when what it follows leaves the region, goes back or, where it
    ``may_fall``, falls. The goal holds the place (m) of its frame, as it was offered."""
    margins = {
        "goal_retreat": float(ctx.config.get("handover.retreat", 0.10)),
        "goal_drop": float(ctx.config.get("handover.drop", 0.08)) if may_fall else 0.0,
    }
    limits = HandoverRegion(ctx, margin).limits(goal["place"])
    watch = {"retreat": margins["goal_retreat"], "drop": margins["goal_drop"], "margin": margin}
    # A predicted place goes to and fro as the prediction is corrected: going back and falling are watched in what is
    # seen, by the state that waits for the reach.
    predicted = str(goal["frame"]).endswith("_ahead")
    return {**goal, "limits": {**limits, **(dict.fromkeys(margins, 0.0) if predicted else margins)}, "watch": watch}
