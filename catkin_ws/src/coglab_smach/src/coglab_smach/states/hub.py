"""States in which the machine waits for somebody: the trigger of the initialisation and the hubs of the master."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..context import Context
from .base import CoglabState, Interrupted


class WaitForTrigger(CoglabState):
    """Wait for the operator's go-ahead before anything moves; with ``auto_trigger`` in the configuration it
    is not awaited."""

    def __init__(self, ctx: Context, action: str = "initialise") -> None:
        super().__init__(ctx)
        self.action = action

    def time_limit(self) -> float:
        return float(self.ctx.config.get("trigger_timeout", 3600.0))

    def run(self, ud: Any) -> str:
        if bool(self.ctx.config.get("auto_trigger", False)):
            self.reason = "auto_trigger is set"
            return "succeeded"
        self.ctx.requests.open(self.label, [self.action])
        try:
            self.wait_for(lambda: self.ctx.requests.take() is not None, f"trigger '{self.action}' on /coglab/start")
        finally:
            self.ctx.requests.close()
        return "succeeded"


class Hub(CoglabState):
    """wait_without_object and wait_with_object: left by a trigger or, where the configuration allows it, on
    recognition.

    Outcomes are the actions this hub takes, and 'stopped' when STOP is pressed while waiting.
    """

    def __init__(self, ctx: Context, actions: Sequence[str], with_object: bool) -> None:
        super().__init__(ctx, outcomes=[*actions, "stopped"], io_keys=["object_id"])
        self.actions = tuple(actions)
        self.with_object = with_object

    def time_limit(self) -> float:
        # A hub is the place to wait in: it has no end of its own.
        return math.inf

    def run(self, ud: Any) -> str:
        if not self.with_object:
            self.ctx.holding = ""
        self.ctx.requests.open(self.label, self.actions)
        try:
            while True:
                try:
                    self.check()
                except Interrupted as interrupt:
                    if interrupt.stop:
                        self.reason = str(interrupt)
                        return "stopped"
                    raise
                request = self.ctx.requests.take()
                if request is not None:
                    break
                self._watch_partner()
                self.ctx.clock.sleep(0.02)
        finally:
            self.ctx.requests.close()
        # With an object in the hand the action is about that object, whatever else was named.
        if not self.with_object:
            ud.object_id = request.object_id or str(self.ctx.config.get("default_object", "mug"))
        elif request.object_id and request.object_id != ud.object_id:
            self.reason = f"asked for '{request.object_id}', but the hand holds '{ud.object_id}': that one is meant. "
        self.reason += f"{request.source} asked for {request.action} of '{ud.object_id}'"
        return request.action

    def _watch_partner(self) -> None:
        """A recognised motion of the partner is a trigger like the operator's, if the configuration maps it
        to an action."""
        if not bool(self.ctx.config.get("recognition_trigger.enabled", False)):
            return
        seen = self.ctx.perception.recognition()
        actions = dict(self.ctx.config.get("recognition_trigger.actions", {}))
        action = actions.get(seen.pattern)
        if seen.decided and action in self.actions:
            self.ctx.requests.submit(action, "", f"recognition of '{seen.pattern}' ({seen.confidence:.2f})")


class Stopped(CoglabState):
    """After STOP: nothing moves until the operator asks for 'reset'. Then the arm is enabled again; the hand
    keeps what it holds."""

    ignores_stop = True

    def time_limit(self) -> float:
        return math.inf

    def run(self, ud: Any) -> str:
        self.ctx.requests.open(self.label, ["reset"])
        try:
            while self.ctx.requests.take() is None:
                self.check()
                self.ctx.clock.sleep(0.05)
        finally:
            self.ctx.requests.close()
        self.await_pending(self.ctx.arm.lwr_command("reset"), "LWR command 'reset'", 5.0)
        self.ctx.stop.reset()
        return "succeeded"


class Fault(CoglabState):
    """Something is broken that recovery could not mend: says why and waits for 'initialise'; nothing moves
    by itself."""

    ignores_stop = True

    def time_limit(self) -> float:
        return math.inf

    def run(self, ud: Any) -> str:
        self.reason = self.ctx.journal.why()
        self.ctx.requests.open(self.label, ["initialise"])
        try:
            while self.ctx.requests.take() is None:
                self.check()
                self.ctx.clock.sleep(0.05)
        finally:
            self.ctx.requests.close()
        if self.ctx.stop.pressed():
            self.await_pending(self.ctx.arm.lwr_command("reset"), "LWR command 'reset'", 5.0)
            self.ctx.stop.reset()
        self.reason = "the operator asked for a new initialisation"
        return "succeeded"
