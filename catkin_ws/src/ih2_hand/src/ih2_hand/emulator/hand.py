"""The simulated hand: executes frames with five motors and answers like the firmware."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ih2_hand import frames, grasps
from ih2_hand.clock import Clock, SteadyClock
from ih2_hand.emulator.low_level import LowLevel
from ih2_hand.emulator.motor import FREE, Contact, Motor
from ih2_hand.emulator.parser import FrameParser
from ih2_hand.emulator.physical_motor import MotorState, PhysicalMotor
from ih2_hand.wire_choices import WIRE

STIFFEST = 1e6  # counts of current per count of position, upper bound of an object's stiffness
STEP_S = 0.002  # s, longest integration step

# Closing current and tension of the automatic grasps in counts. The values are guesses: those of the factory are not
# public.
GRASP_CURRENT = {"low": 120, "medium": 240, "high": 420}
GRASP_TENSION = {"low": 100, "medium": 200, "high": 350}

V17_CURRENT_PER_GF = 2  # counts of closing current per unit of GF


@dataclass
class HandCounters:
    """Events that the hand counted."""

    requests: int = 0
    wrong_motor: int = 0
    ignored_uncalibrated: int = 0
    discarded: int = 0
    """Bytes that arrived during a calibration."""
    too_fast: int = 0
    """Frames that arrived before the last posture was executed, and were lost."""


class EmulatedHand:
    """Five motors, one parser, one clock. Not thread-safe: the caller must use a lock.

    `calibration_scale` multiplies the calibration times of W12. 0 ends calibrations at once; above 1.2 the
    fast calibration lasts longer than the 2.0 s that published drivers wait. `greeting` starts calibrated, as
    the EH1 does. `dialect` is `both`, `legacy` or `v17` (strict). `strict_force` leaves a force read of motor 0
    unanswered (W6). `enforce_spacing` loses commands that arrive before a posture is executed (only in virtual
    time: a pty has no arrival times). With `physical` the simulated cell moves the motors, see `follow` and
    `orders`; otherwise the emulator moves them, against the contacts of `set_contacts`.
    """

    def __init__(
        self,
        clock: Clock | None = None,
        *,
        dialect: str = "both",
        calibration_scale: float = 1.0,
        greeting: bool = False,
        strict_force: bool = False,
        enforce_spacing: bool = False,
        positions: Sequence[int] = (0,) * WIRE.motors,
        physical: bool = False,
        preshapes: Mapping[str, Sequence[int]] | None = None,
    ):
        if not 0.0 <= calibration_scale <= 1000.0:
            raise ValueError(f"calibration_scale must be 0..1000; got {calibration_scale}")
        self.clock = clock or SteadyClock()
        self.parser = FrameParser(dialect)
        kind = PhysicalMotor if physical else Motor
        self.motors = [kind(number, float(positions[number])) for number in range(WIRE.motors)]
        self.physical = physical
        self._physical_motors = [motor for motor in self.motors if isinstance(motor, PhysicalMotor)]
        self.counters = HandCounters()
        self.calibration_scale = calibration_scale
        self.strict_force = strict_force
        self.enforce_spacing = enforce_spacing
        self.calibrated = greeting
        self.preshapes = {mode: tuple(values) for mode, values in (preshapes or grasps.load_preshapes()).items()}
        self.grasp_current = dict(GRASP_CURRENT)
        self.grasp_tension = dict(GRASP_TENSION)
        self.low_level = LowLevel(self.motors)
        self._calibration_end: float | None = None
        self._busy_until = 0.0
        self._after_preshape: list[tuple[int, str, int]] = []
        self._now = self.clock.monotonic()

    # -- interface to the cell -------------------------------------------------------------------

    @property
    def calibrating(self) -> bool:
        """True while a calibration runs."""
        return self._calibration_end is not None

    @property
    def at_rest(self) -> bool:
        """True if all motors are switched off and no calibration runs: `orders` does not change until a command."""
        return self._calibration_end is None and self._all_off()

    def _all_off(self) -> bool:
        for motor in self.motors:  # a loop, because this runs 200 times per second
            if motor.mode != "stop":
                return False
        return True

    def set_contacts(self, positions: Sequence[float], stiffness: Sequence[float]) -> None:
        """Set the object for each motor: contact position 0..254 (255: no object) and stiffness (counts per count)."""
        if len(positions) != WIRE.motors or len(stiffness) != WIRE.motors:
            raise ValueError(
                f"contact needs {WIRE.motors} positions and stiffnesses; got {len(positions)} and {len(stiffness)}"
            )
        for motor, position, stiff in zip(self.motors, positions, stiffness, strict=True):
            if not 0 <= position <= FREE or not 0.0 <= stiff <= STIFFEST:
                raise ValueError(
                    f"contact position must be 0..255 and stiffness 0..{STIFFEST:g}; got "
                    f"{position} and {stiff} for motor {motor.number}"
                )
            motor.contact = Contact(float(position), float(stiff))

    def follow(self, states: Sequence[MotorState]) -> None:
        """Take the simulated states of the five motors. Raises ValueError for impossible values."""
        physical = self._physical_motors
        if len(states) != len(physical) or not physical:
            raise ValueError(f"states of {WIRE.motors} motors turned by the physics are expected; got {len(states)}")
        for state in states:
            state.check()
        for motor, state in zip(physical, states, strict=True):
            motor.follow(state)

    def orders(self) -> list[tuple[float, float, float]]:
        """Commands to the simulation for each motor: share of the full speed, target as share of the stroke, and
        counts of current at which it stops."""
        if self.calibrating:  # all motors open at full speed
            return [(1.0, 0.0, 0.0)] * WIRE.motors
        return [motor.order() for motor in self._physical_motors]

    # -- time ------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Advance motors and calibration to the current time."""
        now = self.clock.monotonic()
        if self._calibration_end is not None and now >= self._calibration_end:
            self._end_calibration()
        elapsed = now - self._now
        if elapsed <= 0.0:
            return
        self._now = now
        if self._all_off():
            return
        steps = max(1, int(elapsed / STEP_S + 0.999))
        for _ in range(min(steps, 10000)):
            for motor in self.motors:
                motor.advance(elapsed / steps)
            if self._after_preshape:
                self._close_if_preshaped()

    def _close_if_preshaped(self) -> None:
        if all(motor.reached or motor.mode == "stop" for motor in self.motors):
            closing, self._after_preshape = self._after_preshape, []
            for number, mode, effort in closing:
                if mode == "tension":
                    self.motors[number].pull(effort)
                else:
                    self.motors[number].close_to_current(effort, stop_after=True)

    def _begin_calibration(self, duration: float) -> None:
        self._after_preshape = []
        self._calibration_end = self.clock.monotonic() + duration * self.calibration_scale
        for motor in self.motors:
            motor.stop()
        if self.calibration_scale == 0.0:
            self._end_calibration()

    def _end_calibration(self) -> None:
        self._calibration_end = None
        self.calibrated = True
        for motor in self.motors:
            motor.stop()
            motor.wrapped = False
            if not motor.stuck and not self.physical:
                motor.position = 0.0

    # -- bytes -----------------------------------------------------------------------------------

    def receive(self, data: bytes) -> list[tuple[bytes, bytes]]:
        """Process bytes from the host. Returns the executed frames, each with its answer (may be empty).

        Bytes that arrive during a calibration are discarded (W11).
        """
        self.advance()
        executed = []
        for byte in data:
            if self.calibrating:
                self.counters.discarded += 1
                self.parser.clear()
                continue
            frame = self.parser.feed(byte)
            if frame is not None:
                executed.append((frame, self._execute(frame)))
        return executed

    def _execute(self, frame: bytes) -> bytes:
        first = frame[0]
        if first < 0x40 or first in (frames.GET_POSITION, frames.GET_STATUS, frames.GET_CURRENT):
            return self._read(frame)
        if self.enforce_spacing and self.clock.monotonic() < self._busy_until:
            self.counters.too_fast += 1
            return b""
        if first == frames.LLMC:
            motor = self._motor(frame[1])
            return b"" if motor is None else self.low_level.execute(motor, frame)
        self._command(frame)
        return b""

    def _motor(self, address: int) -> Motor | None:
        number = address & 0x0F
        if number < WIRE.motors:
            return self.motors[number]
        self.counters.wrong_motor += 1
        return None

    def _read(self, frame: bytes) -> bytes:
        self.counters.requests += 1
        first = frame[0]
        motor = self._motor(first if first < 0x40 else frame[1])
        if motor is None:
            return b""
        if first == frames.GET_POSITION:
            return bytes((motor.position_byte,))
        if first == frames.GET_STATUS:
            return bytes((motor.status_byte,))
        if first == frames.GET_CURRENT:
            return min(1023, int(motor.current)).to_bytes(2, "big")
        if motor.number == WIRE.unsensed_motor:
            return b"" if self.strict_force else WIRE.unsensed_force_reply
        return motor.tension.to_bytes(2, "big")

    def _command(self, frame: bytes) -> None:
        first = frame[0]
        if first == frames.STOP_ALL:
            self._after_preshape = []
            for motor in self.motors:
                motor.stop()
        elif first == frames.FAST_CALIBRATION:
            self._begin_calibration(WIRE.calibration_fast_s)
        elif first == frames.FIRST_CALIBRATION:
            self._begin_calibration(WIRE.calibration_complete_s)
        elif first == frames.OPEN_ALL:
            self._after_preshape = []
            for number in WIRE.open_all_motors:
                self.motors[number].drive(WIRE.position_speed, close=False)
        elif first >= 0x80:
            self._move_motor(frame)
        elif first in frames.MEM_PRESHAPE:
            self.preshapes[frames.MEM_PRESHAPE[first]] = tuple(frame[1:-1])
        elif first in frames.MEM_CURRENT:
            self.grasp_current[frames.MEM_CURRENT[first]] = (frame[1] & 3) << 8 | frame[2]
        elif first in frames.MEM_TENSION:
            self.grasp_tension[frames.MEM_TENSION[first]] = frame[1]
        else:
            self._position_command(frame)

    def _move_motor(self, frame: bytes) -> None:
        motor = self._motor(frame[0] >> 2 & 0x0F)
        if motor is not None:
            self._after_preshape = []
            motor.drive((frame[0] & 1) << 8 | frame[1], (frame[0] >> 6 & 1) == WIRE.close_direction)

    def _position_command(self, frame: bytes) -> None:
        """Execute a command that needs a calibrated hand (W14)."""
        first = frame[0]
        if first == frames.SET_TENSION:
            motor = self._motor(frame[1])
            if motor is not None and motor.number != WIRE.unsensed_motor:
                self._after_preshape = []
                motor.pull((frame[1] >> 6) << 8 | frame[2])
            return
        if not self.calibrated and WIRE.uncalibrated_ignores_positions:
            self.counters.ignored_uncalibrated += 1
            return
        self._after_preshape = []
        if first == frames.SET_POSITION:
            motor = self._motor(frame[1])
            if motor is not None:
                motor.go_to(frame[2])
        elif first == frames.SET_POSTURE:
            self._posture(frame[1:-1])
        elif first == frames.GRASP_V17:
            self._grasp_v17(frame)
        else:
            mode, level, is_current = frames.LEGACY_GRASPS[first]
            self._grasp(
                mode,
                "current" if is_current else "tension",
                (self.grasp_current if is_current else self.grasp_tension)[level],
            )

    def _posture(self, positions: Sequence[int]) -> None:
        self._busy_until = self.clock.monotonic() + WIRE.posture_spacing_s
        for motor, position in zip(self.motors, positions, strict=True):
            motor.go_to(position)

    def _grasp_v17(self, frame: bytes) -> None:
        kind, strength = frame[1], frame[2]
        modes = {code: mode for mode, code in WIRE.v17_types.items()}
        if kind == 0:
            self.motors[WIRE.unsensed_motor].stop()
            for number in WIRE.open_all_motors:
                self.motors[number].drive(WIRE.relax_speed, close=False)
        elif kind in modes:
            self._grasp(modes[kind], "current", strength * V17_CURRENT_PER_GF)

    def _grasp(self, mode: str, by: str, effort: int) -> None:
        self._posture(self.preshapes[mode])
        self._after_preshape = [(number, by, effort) for number in grasps.CLOSING_MOTORS[mode]]
        self._close_if_preshaped()
