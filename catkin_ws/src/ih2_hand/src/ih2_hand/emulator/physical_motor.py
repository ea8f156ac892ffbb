"""A motor of the simulated hand in the simulated cell. The simulation moves it, winds its tendon and stops it at
contact. The electronics are simulated here."""

from __future__ import annotations

from typing import NamedTuple

from ih2_hand.emulator.motor import FREE_CURRENT, FULL_SCALE, POSITION_STALL_CURRENT, STALL_CURRENT, Motor
from ih2_hand.wire_choices import WIRE

END_SHARE = 0.001  # share of the stroke within which an end sensor detects the end


class MotorState(NamedTuple):
    """Simulated state of one motor.

    ``position``: share of the stroke, 0 open .. 1 closed. ``current``: counts of motor current. ``effort``: counts of
    motor current that correspond to the tendon's tension. ``locked``: it met resistance and stands until the next
    command.
    """

    position: float
    current: float
    effort: float
    moving: bool
    locked: bool

    def check(self) -> None:
        """Raise ValueError unless every value is possible for a motor."""
        if 0.0 <= self.position <= 1.0 and 0.0 <= self.current <= 1e4 and 0.0 <= self.effort <= 1e4:
            return
        for name, value, most in (
            ("position", self.position, 1.0),
            ("current", self.current, 1e4),
            ("effort", self.effort, 1e4),
        ):
            if not 0.0 <= value <= most:
                raise ValueError(f"{name} of a motor must be 0..{most:g}; got {value}")


class PhysicalMotor(Motor):
    """The electronics of a motor in the cell. Call ``follow`` before ``advance``; send ``order`` to the simulation."""

    def __init__(self, number: int, position: float = 0.0):
        super().__init__(number, position)
        self.state = MotorState(position / FULL_SCALE, 0.0, 0.0, False, False)

    def follow(self, state: MotorState) -> None:
        """Take over the simulated state."""
        self.state = state
        share = state.position
        self.position = FULL_SCALE * (0.0 if share < END_SHARE else 1.0 if share > 1.0 - END_SHARE else share)

    @property
    def effort(self) -> float:
        """Counts of current that correspond to the tension. They remain when the motor is switched off."""
        return self.state.effort

    def order(self) -> tuple[float, float, float]:
        """(share of the full speed, target as share of the stroke, counts of current at which it stops)."""
        share = self.position / FULL_SCALE
        if self.mode == "stop" or self.stuck:
            return 0.0, share, 0.0
        if self.mode == "speed":
            pace = self.speed / WIRE.speed_max
            return pace, 1.0 if self.direction > 0 else 0.0, FREE_CURRENT + STALL_CURRENT * pace
        if self.mode == "position":
            return 1.0, self.aim / FULL_SCALE, POSITION_STALL_CURRENT
        if self.reached:
            return 0.0, share, 0.0
        goal = self.goal_effort if self.mode != "tension" else self.tension_goal
        return 1.0, 1.0, FREE_CURRENT + goal

    def advance(self, dt: float) -> None:
        """Update mode and flags from the simulated state after `dt` (s)."""
        if self.mode == "stop":
            return
        self.current = self.state.current
        self._moving = self.state.moving
        if self.mode == "speed":
            at_end = self.position >= FULL_SCALE if self.direction > 0 else self.position <= 0.0
            if at_end and WIRE.stop_at_end:
                self.stop()
        elif self.mode == "position":
            self._settle_position()
        elif not self.reached:
            self.reached = self.state.locked and self.position < FULL_SCALE
            if self.position >= FULL_SCALE and self.mode != "tension":
                self.stop()
        self._watch_current(dt)
        self._end_current_position(dt)
