"""Where a contract of a port is checked, and with what words."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

from coglab_smach.ports.pending import PortError

CONTROLLERS = {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController"}


@dataclass
class Place:
    """Where a suite runs."""

    port: Any
    now: Callable[[], float]
    sleep: Callable[[float], None]
    freeze: Callable[[], None]
    """the node behind the port stops as it stands"""
    thaw: Callable[[], None]
    library: str = ""
    """file of primitives, as the node reads it"""
    push: Callable[[float], None] = lambda force: None
    """somebody lifts the hand with so many N from now on, or presses it down if negative; 0 lets go"""
    arm_rests: AbstractContextManager = field(default_factory=nullcontext)
    """within it nobody else moves the arm"""
    arm: Any = None
    """ArmPort of the arm whose contacts the port finds"""
    believe: Callable[[float], None] = lambda offer: None
    """from now on it is believed with this probability that the mug is offered"""
    show_hand: Callable[[bool], None] = lambda seen: None
    """whether the person's hand is seen from now on"""
    patience: float = 1.0
    """how many times as long everything may take: in real time the computer may be busy"""
    slow: Callable[[float], None] | None = None
    """somebody sets the arm's speed scale, 0..1; None: nobody can here"""


class Contract:
    """Methods named test_* run in the order in which they are written."""

    def __init__(self, place: Place) -> None:
        self.place, self.port = place, place.port

    def begin(self) -> None:
        """Before each test."""

    def until(self, condition, limit=5.0, what="it"):
        end = self.place.now() + limit * self.place.patience
        while not condition():
            assert self.place.now() < end, f"{what} did not happen within {limit} s"
            self.place.sleep(0.01)

    def settle(self, pending, limit=5.0):
        """The value of a call, which has to come in time."""
        self.until(pending.done, limit, "the answer")
        return pending.result()

    def refused(self, pending, *codes, limit=5.0):
        """The error of a call that must not succeed, with one of these codes."""
        try:
            value = self.settle(pending, limit)
        except PortError as error:
            assert error.sentence, "a refusal says why"
            assert not codes or error.code in codes, f"code {error.code}, expected one of {codes}: {error.sentence}"
            return error
        raise AssertionError(f"it succeeded with {value!r}")

    def enable(self, arm):
        """Its controllers are loaded, and it is in command mode."""
        for name, kind in CONTROLLERS.items():
            self.settle(arm.load_controller(name, kind), 20.0)
        if arm.motion_allowed().ok:
            return
        self.settle(arm.lwr_command("reset"))
        if not arm.motion_allowed().ok:
            self.settle(arm.lwr_command("position"))
            self.settle(arm.lwr_command("start"), 20.0)
        self.until(lambda: arm.motion_allowed().ok, 10.0, "command mode")

    def stays(self, condition, duration):
        end = self.place.now() + duration
        while self.place.now() < end:
            assert condition()
            self.place.sleep(0.01)
