"""One simulated motor of the hand: position, control modes, contact, current, STATUS byte.

Plausible, not validated: real speeds and currents of the IH2 are not public. Positions are counts
0..255, currents and tensions are counts 0..1023, times are seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

from ih2_hand.status import CLOSED_END, MODES, OPEN_END, OVER_CURRENT, REACHED
from ih2_hand.wire_choices import WIRE

FULL_SCALE = 255.0  # counts
FREE_CURRENT = 40.0  # counts of current of a slow, free motion
SPEED_CURRENT = 60.0  # counts added at full speed
STALL_CURRENT = 1000.0  # counts at standstill under full PWM; proportional to the speed setting
# Counts at standstill in position mode. Below the over-current limit, so a blocked posture keeps pushing.
POSITION_STALL_CURRENT = 640.0
# Over-current limit in counts by motor: 0.41 A x 1230 for the abduction, 0.81 A x 901 for flexion.
TRIP_COUNTS = (504.0, 730.0, 730.0, 730.0, 730.0)
TRIP_TIME_S = 1.0  # s
REACHED_HOLD_S = 0.2  # s for which current/position mode reports D0 before the motor is switched off (10)
TENSION_PER_CURRENT = 0.8  # counts of tendon tension per count of contact current
DEFAULT_STIFFNESS = 25.0  # counts of current per count of penetration
FREE = 255  # contact position that means: no object


@dataclass
class Contact:
    """Contact of a finger with an object: position (255: no object) and stiffness (counts per count)."""

    position: float = FREE
    stiffness: float = DEFAULT_STIFFNESS


class Motor:
    """State and motion of one motor. `advance` integrates the motion."""

    def __init__(self, number: int, position: float = 0.0):
        self.number = number
        self.position = position
        self.mode = "stop"
        self.target = 0.0
        self.speed = 0
        self.direction = 1
        self.goal_effort = 0.0
        self.reached = False
        self.over_current = False
        self.current = 0.0
        self.contact = Contact()
        self.stuck = False
        self.short_by = 0
        self.wrap = False
        self.wrapped = False
        self._moving = False
        self._over_s = 0.0
        self._reached_s = 0.0

    # -- commands --------------------------------------------------------------------------------

    def _begin(self, mode: str) -> None:
        self.mode, self.reached, self.over_current = mode, False, False
        self._over_s = self._reached_s = 0.0
        self._moving = True

    def stop(self) -> None:
        """Switch the motor off. The finger keeps its place (W29)."""
        self.mode, self.reached, self._moving, self.current = "stop", False, False, 0.0
        self.over_current = False

    def drive(self, speed: int, close: bool) -> None:
        """Drive with PWM `speed` 0..511 in one direction; 0 stops the motor."""
        if speed == 0:
            self.stop()
            return
        self.speed, self.direction = speed, 1 if close else -1
        self._begin("speed")

    def go_to(self, target: int) -> None:
        """Start position control to `target` 0..255."""
        self.target, self.speed = float(target), WIRE.position_speed
        self._begin("position")
        self._settle_position()

    def pull(self, tension: int) -> None:
        """Start tension control to `tension` 0..1023."""
        self.goal_effort, self.speed = float(tension), WIRE.position_speed
        self._begin("tension")

    def close_to_current(self, current: int, stop_after: bool) -> None:
        """Close until `current` 0..1023. `stop_after` selects current/position mode."""
        self.goal_effort, self.speed = float(current), WIRE.position_speed
        self._begin("current_position" if stop_after else "current")

    # -- readings --------------------------------------------------------------------------------

    @property
    def penetration(self) -> float:
        """Counts by which the finger presses into the object."""
        return max(0.0, self.position - self.contact.position)

    @property
    def effort(self) -> float:
        """Contact effort as counts of motor current. It remains when the motor is switched off."""
        return self.penetration * self.contact.stiffness

    @property
    def tension(self) -> int:
        """Tendon tension, 0..1023 counts."""
        return min(1023, int(self.effort * TENSION_PER_CURRENT))

    @property
    def position_byte(self) -> int:
        """Position as the hand sends it, with the errors at the ends that real hands have (W16)."""
        if self.wrapped:
            return 0
        return max(0, min(255, round(self.position)))

    @property
    def status_byte(self) -> int:
        """STATUS byte (EH1 guide 2.4.3)."""
        raw = MODES.index(self.mode) << 5
        raw |= REACHED if self.reached else 0
        raw |= OPEN_END if self.position <= 0.0 else 0
        raw |= CLOSED_END if self.position >= FULL_SCALE else 0
        raw |= OVER_CURRENT if self.over_current else 0
        return raw | (WIRE.moving_bit if self._moving else 0)

    # -- motion ----------------------------------------------------------------------------------

    def advance(self, dt: float) -> None:
        """Advance by `dt` (s). Small steps resolve contact and over-current times."""
        if self.mode == "stop":
            return
        before = self.position
        rate = FULL_SCALE / WIRE.full_stroke_s * self.speed / WIRE.speed_max
        {"speed": self._speed_step, "position": self._position_step, "tension": self._tension_step}.get(
            self.mode, self._current_step
        )(rate * dt)
        if self.mode == "stop":
            return
        self._moving = abs(self.position - before) > 1e-9
        self._measure_current(rate)
        self._watch_current(dt)
        self._end_current_position(dt)

    def _end_current_position(self, dt: float) -> None:
        """In current/position mode, switch the motor off REACHED_HOLD_S after it reached its goal."""
        if self.mode == "current_position" and self.reached:
            self._reached_s += dt
            if self._reached_s >= REACHED_HOLD_S:
                self.mode, self.current, self._moving = "stop", 0.0, False

    def _move(self, step: float, limit_effort: float) -> None:
        """Move by `step` counts, but only until `limit_effort` presses the finger into the object."""
        if self.stuck:
            return
        position = self.position + step
        if step > 0.0:
            deepest = self.contact.position + limit_effort / max(self.contact.stiffness, 1e-6)
            position = max(self.position, min(position, deepest))
        self.position = max(0.0, min(FULL_SCALE, position))

    def _speed_step(self, step: float) -> None:
        self.wrapped = False
        self._move(self.direction * step, STALL_CURRENT * self.speed / WIRE.speed_max)
        at_end = self.position >= FULL_SCALE if self.direction > 0 else self.position <= 0.0
        if at_end and WIRE.stop_at_end:
            self.stop()

    @property
    def aim(self) -> float:
        """Position at which position control ends. The fault "short" moves it: real hands stop up to 4 counts
        before the target."""
        target = self.target + (self.short_by if self.target < self.position else -self.short_by)
        return max(0.0, min(FULL_SCALE, target))

    @property
    def tension_goal(self) -> float:
        """Goal of tension control as counts of motor current."""
        return self.goal_effort / TENSION_PER_CURRENT

    def _position_step(self, step: float) -> None:
        error = self.aim - self.position
        self._move(max(-step, min(step, error)), POSITION_STALL_CURRENT)
        self._settle_position()

    def _settle_position(self) -> None:
        self.reached = abs(self.target - self.position) <= WIRE.reached_counts
        self.wrapped = self.wrap and self.target >= FULL_SCALE and self.reached

    def _tension_step(self, step: float) -> None:
        goal = self.tension_goal
        too_deep = self.penetration - goal / max(self.contact.stiffness, 1e-6)
        self._move(step if too_deep <= 0.0 else -min(step, too_deep), goal)
        self.reached = self.penetration > 0.0 and abs(self.effort - goal) < 1.0

    def _current_step(self, step: float) -> None:
        if not self.reached:
            self._move(step, self.goal_effort)
            self.reached = self.penetration > 0.0 and self.effort >= self.goal_effort - 1e-6
        if self.position >= FULL_SCALE and not self.reached:
            self.stop()

    def _measure_current(self, rate: float) -> None:
        if self.stuck and not self.reached:
            self.current = STALL_CURRENT * self.speed / WIRE.speed_max
        elif self._moving or self.mode != "position":
            free = FREE_CURRENT + SPEED_CURRENT * self.speed / WIRE.speed_max
            self.current = max(free if self._moving else 0.0, self.effort)
        else:
            self.current = 0.0 if self.reached else self.effort

    def _watch_current(self, dt: float) -> None:
        if self.current <= TRIP_COUNTS[self.number]:
            self._over_s = 0.0
            return
        self._over_s += dt
        if self._over_s > TRIP_TIME_S:
            self.stop()
            self.over_current = True
