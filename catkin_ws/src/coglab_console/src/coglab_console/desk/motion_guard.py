"""The two steps after a stop: acknowledge its cause, then press and hold the button of the next motion."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from coglab_py.actions import WAYS_OUT

from .commands import COMMANDS
from .words import button

STANDSTILL = ("stopped", "fault")
HOLD_TIME = 0.8  # s that a button must be held
LONGEST_GAP = 0.25  # s between two messages of a held button
SECOND_THOUGHT = ("feedback", "feedback_order", "contact_learn", "contact_arm", "objects_reload")
"""Commands that need a held button, because nobody sees their effect at once. They change limits, gains or thresholds
(object files hold some, too), so they are refused while an action or a trial is under way."""


@dataclass
class MotionGuard:
    """After a stop, no motion starts until the cause is acknowledged. The first motion then needs a held button."""

    real: bool = False
    cause: str = ""
    unacknowledged: bool = False
    lifted: bool = False
    """The stop is over but was not acknowledged: somebody has reset the robot without the page."""
    needs_hold: bool = field(default=False)
    stops: int = 0
    """Number of stops so far. A motion requested before the newest stop is not the first one after it."""
    _was_stopped: bool = False
    _standstills: int = 0

    def __post_init__(self) -> None:
        self.needs_hold = self.real

    def stop(self, cause: str) -> None:
        """Registers a stop, whatever its source. Its number is `stops`."""
        self.cause, self.unacknowledged, self.needs_hold, self.lifted = cause, True, True, False
        self.stops += 1

    def stop_text(self, actions: Sequence[str] = ()) -> str:
        """Text of the page about the newest stop. `actions`: those that the state machine takes now."""
        if self.lifted:
            return f"This stop is over, it was lifted without this page: {self.cause or 'no reason given'}"
        press = " or ".join(button(name) for name in actions if name in WAYS_OUT)
        return f"{self.cause}; when that is over, press {press}" if self.cause and press else self.cause

    def observe(self, stopped: bool, cause: str, standstills: int = 0) -> bool:
        """Call this several times a second. `stopped`: the robot stands after a stop or fault; `standstills`: see
        Standstills.

        Returns True if a stop has begun since the last call, even right after another one without a motion between."""
        begun = (stopped and not self._was_stopped) or standstills > self._standstills
        ended = self._was_stopped and not stopped
        self._was_stopped, self._standstills = stopped, standstills
        if begun:
            self.stop(cause or self.cause)
            self.lifted = not stopped
        elif ended:
            self.lifted = self.unacknowledged
        elif stopped and cause:
            self.cause = cause
        return begun

    def acknowledge(self, stop: int) -> str:
        """The operator has read the cause of the stop of this number. Returns why that is refused, or an empty text.

        An acknowledgement of an old stop is refused: it must not lift a newer one."""
        if stop != self.stops:
            return (
                f"expected an answer to stop {self.stops}, the newest ({self.cause or 'no reason given'}), "
                f"got one to stop {stop}; read its cause, then acknowledge it"
            )
        self.unacknowledged = False
        return ""

    def moved(self, stops: int) -> None:
        """A motion has begun with a held button. `stops`: number of stops when it was requested."""
        self.needs_hold = self.needs_hold and stops != self.stops

    def guarded(self, name: str, arguments: dict) -> bool:
        """True if this command needs a held button now.

        Calibrations that open the hand even with an object always need it, and so do the commands of SECOND_THOUGHT.
        Switching the contact detector off never does."""
        if name == "calibrate" and (arguments.get("force") or arguments.get("mode") == "complete"):
            return True
        if name in SECOND_THOUGHT:
            return not (name == "contact_arm" and arguments.get("mode") == "off")
        return COMMANDS[name].motion and self.needs_hold


class Standstills:
    """Counts the standstills of the robot after a stop or a fault. It gets every message, so that a short stop counts,
    too."""

    def __init__(self) -> None:
        self.count = 0
        self._leaf = ""
        self._held = False

    def machine(self, state: str) -> None:
        """Gets the path of the machine's active state. If it stops because the arm is held, both are one stop."""
        before, self._leaf = self._leaf, state.rsplit("/", 1)[-1]
        if self._leaf in STANDSTILL and self._leaf != before:
            self.count += self._leaf != "stopped" or not self._held

    def arm(self, held: bool) -> None:
        """Gets whether the arm is held until a reset."""
        self.count += held and not self._held
        self._held = held


class HeldButton:
    """The held button of one browser: a motion begins only after its button was held for HOLD_TIME.

    The page sends a message ten times a second while the button is down. So nothing begins if the browser dies or loses
    its connection. Times in s of the steady clock."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._what: object = None
        self._since = self._last = 0.0

    def held(self, what: object) -> bool:
        """Gets one message of a held button. True exactly once, when `what` was held for long enough without a gap."""
        now = self._now()
        if what != self._what or now - self._last > LONGEST_GAP:
            self._what, self._since = what, now
        self._last = now
        if now - self._since >= HOLD_TIME:
            self._since = float("inf")  # until the button is released
            return True
        return False

    def unfinished(self) -> Any:
        """The command whose button is held down and that has not begun yet, or None."""
        return self._what if self._since != float("inf") else None
