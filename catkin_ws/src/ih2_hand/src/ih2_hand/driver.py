"""Driver of the IH2 Azzurra hand: the functions of D4.10 Table 2 on a serial line. Needs pyserial, no ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

from ih2_hand import frames, grasps
from ih2_hand.clock import Clock
from ih2_hand.errors import (
    HandCalibratingError,
    HandCalibrationError,
    HandPortError,
    NoForceSensorError,
    NoGraspModeError,
)
from ih2_hand.line import (
    ANALOGUE_SLACK,
    POSITION_SLACK,
    STATUS_SLACK,
    HandLine,
    LineCounters,
    Slack,
    TraceHook,
    status_request,
)
from ih2_hand.reasons import Reason
from ih2_hand.status import at_rest, decode_status
from ih2_hand.transport import SerialTransport, Transport
from ih2_hand.wire_choices import WIRE

_MOTORS = tuple(range(WIRE.motors))
_STATUS = tuple(status_request(motor) for motor in _MOTORS)
_POSITION = tuple(bytes((frames.GET_POSITION, motor)) for motor in _MOTORS)
_CURRENT = tuple(bytes((frames.GET_CURRENT, motor)) for motor in _MOTORS)
_FORCE = tuple(bytes((motor,)) for motor in _MOTORS)

CALIBRATIONS = {
    "fast": (frames.FAST_CALIBRATION, "calibration_fast_limit_s"),
    "complete": (frames.FIRST_CALIBRATION, "calibration_complete_limit_s"),
}

DIALECTS = ("legacy", "v17")  # grasp commands of older and newer firmware (W1)

# Bounds of the time limit of a read: longer than the hand's own delay (1 ms); two of the longest end before the
# node says that hand_status is missing (1.5 s).
LEAST_READ_TIMEOUT_S = 0.005
LARGEST_READ_TIMEOUT_S = 0.6

MILLIAMPERE_PER_COUNT = (0.81, 1.1, 1.1, 1.1, 1.1)  # mA of motor current, by motor (EH1 guide 2.2.2)


class HandSerialDriver:
    """One IH2 Azzurra hand on one serial port.

    Motors ("fingers" in Table 2): 0 thumb abduction, 1 thumb flexion, 2 index, 3 middle, 4 ring and
    little. Positions are 0 (open) .. 254 (closed). An argument out of range raises ValueError before
    any byte is sent. Every read has a time limit. Module `line` describes how bad answers are handled.
    The hand does not acknowledge commands: poll its status to follow them. Thread-safe.
    """

    def __init__(
        self,
        serial_port: str | None = None,
        *,
        dialect: str | None = None,
        preshapes: Mapping[str, Sequence[int]] | None = None,
        send_preshape: bool = WIRE.send_preshape,
        transport: Transport | None = None,
        clock: Clock | None = None,
        trace: TraceHook | None = None,
        read_timeout: float = WIRE.read_timeout_s,
    ):
        """Open the port, synchronise with the hand's parser, and request one status.

        `serial_port` is a device, a pty or `socket://host:port`; None selects the only serial device
        of the computer. `dialect` is `legacy` or `v17` (W1). `preshapes` replaces grasps.yaml.
        With `send_preshape` False, set_grasp_mode does not move the fingers (W21). `transport`
        replaces the serial port. `read_timeout` (s) limits each wait for an answer.
        Opening the port stops the fingers (W10) and moves nothing.
        Raises HandPortError if the port cannot be opened or no hand answers on it.
        """
        self.dialect = dialect if dialect is not None else WIRE.dialect
        if self.dialect not in DIALECTS:
            raise ValueError(f"dialect must be {' or '.join(DIALECTS)}; got {dialect!r}")
        self.preshapes = {
            mode: tuple(_positions(list(positions)))
            for mode, positions in (preshapes or grasps.load_preshapes()).items()
        }
        if not LEAST_READ_TIMEOUT_S <= read_timeout <= LARGEST_READ_TIMEOUT_S:
            raise ValueError(
                f"read_timeout must be {LEAST_READ_TIMEOUT_S}..{LARGEST_READ_TIMEOUT_S} s; got {read_timeout!r}"
            )
        self.send_preshape = send_preshape
        self._grasp: bytes | None = None
        self._calibrating = False
        self._resting: set[int] = set()
        self.line = HandLine(transport or SerialTransport(serial_port), clock, read_timeout, trace)
        self.port = self.line.port
        try:
            self.line.resynchronise("port opened")
            if not self.line.answers(_STATUS[0], 1) and not self.line.answers(_STATUS[0], 1):
                raise HandPortError(
                    f"no hand answers on {self.port}: check that it is powered, that this is its "
                    "port, and that it is not calibrating"
                )
        except BaseException:
            self.line.close()
            raise
        self.line.counters = LineCounters()

    # -- connection ------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the port. Moving fingers keep moving; call stop_all first to stop them."""
        self.line.close()

    def __enter__(self) -> HandSerialDriver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def counters(self) -> LineCounters:
        """Number of requests, resynchronisations and failures since the port was opened."""
        return self.line.counters

    @property
    def last_byte(self) -> int | None:
        """Last byte received; None if none was received."""
        return self.line.transport.last_byte

    @property
    def calibrating(self) -> bool:
        """True while a calibration started by this driver runs."""
        return self._calibrating

    def _check_free(self) -> None:
        if self._calibrating:
            raise HandCalibratingError(
                f"the hand on {self.port} calibrates and discards every request; wait until `calibrating` is False"
            )

    def _value(self, frame: bytes, length: int, slack: Slack) -> int:
        if self._calibrating:
            self._check_free()
        return self.line.value(frame, length, slack)

    def _command(self, frame: bytes, busy_s: float = 0.0) -> None:
        self._check_free()
        self._something_changes()
        self.line.send(frame, busy_s)

    def _something_changes(self) -> None:
        self._resting.clear()
        self.line.resting = False

    # -- calibration and stop --------------------------------------------------------------------

    def calibration(self, data: str) -> None:
        """Calibrate and wait for the end. `data` is `fast` or `complete`. The hand opens.

        During a calibration other requests raise HandCalibratingError. Only stop_all is sent, but the
        hand discards its byte (W11). Raises HandCalibrationError if the hand does not answer again in
        time (W12), or if it is not fully open at the end (W13).
        """
        if data not in CALIBRATIONS:
            raise ValueError(f"calibration must be fast or complete; got {data!r}")
        code, limit_name = CALIBRATIONS[data]
        limit = getattr(WIRE, limit_name)
        with self.line.lock:
            self._command(bytes((code,)))
            self._calibrating = True
        try:
            self._await_calibration(data, limit)
        finally:
            self._calibrating = False

    def _await_calibration(self, data: str, limit: float) -> None:
        clock, poll = self.line.clock, _STATUS[WIRE.calibration_poll_motor]
        deadline = clock.monotonic() + limit
        answered = 0
        while answered < 2:
            if clock.monotonic() > deadline:
                raise HandCalibrationError(
                    f"the hand on {self.port} did not answer within {limit:.0f} s after the {data} "
                    "calibration began; cycle its power and look for a blocked finger",
                    Reason.TIME_LIMIT,
                )
            clock.sleep(WIRE.calibration_poll_s)
            answered = answered + 1 if self.line.answers(poll, 1) else 0
        wrong = [
            motor
            for motor in _MOTORS
            if self.line.value(_STATUS[motor], 1, STATUS_SLACK) & 0xFE != WIRE.status_after_calibration & 0xFE
        ]
        if wrong:
            raise HandCalibrationError(
                f"the {data} calibration on {self.port} left motor(s) "
                f"{', '.join(map(str, wrong))} not fully open: free the fingers and repeat it",
                Reason.HAND_STALLED,
            )

    def stop_all(self) -> None:
        """Stop every motor where it is. Waits only until a frame in progress is sent, not for its answer."""
        self._something_changes()
        self.line.send(bytes((frames.STOP_ALL,)))

    # -- single motors ---------------------------------------------------------------------------

    def move_motor(self, motor: int, speed: int, is_close_direction: bool) -> None:
        """Move a motor at `speed` 0..511 until its end sensor or a resistance stops it."""
        _motor(motor)
        _whole("speed", speed, WIRE.speed_max)
        if not isinstance(is_close_direction, (bool, int)) or is_close_direction not in (0, 1):
            raise ValueError(f"is_close_direction must be True (close) or False (open); got {is_close_direction!r}")
        self._command(frames.move_motor(motor, speed, bool(is_close_direction)))

    def set_finger_position(self, finger: int, position: int) -> None:
        """Move a motor to `position` 0..254."""
        _motor(finger)
        _whole("position", position, WIRE.position_max)
        self._command(frames.set_finger_position(finger, position))

    def set_finger_force(self, motor: int, force: int) -> None:
        """Pull a finger's tendon with `force` 0..254 (W5). Motor 0 has no force sensor (W6)."""
        _sensed(motor)
        _whole("force", force, 254)
        self._command(frames.set_finger_tension(motor, force * WIRE.force_scale))

    def set_finger_current(self, motor: int, current: int) -> None:
        """Close a motor with `current` 0..1023 counts (not in Table 2)."""
        _motor(motor)
        _whole("current", current, 1023)
        self._command(frames.set_finger_current(motor, current))

    def get_finger_position(self, finger: int) -> int:
        """Position 0..254. Valid after a calibration."""
        return min(self.get_raw_position(finger), WIRE.position_max)

    def get_raw_position(self, finger: int) -> int:
        """Position byte 0..255 as the hand sends it (not in Table 2)."""
        _motor(finger)
        return self._value(_POSITION[finger], 1, POSITION_SLACK)

    def get_finger_force(self, finger: int) -> int:
        """Tendon tension 0..254 (W5). Raises NoForceSensorError for motor 0."""
        _sensed(finger)
        tension = self._value(_FORCE[finger], 2, ANALOGUE_SLACK)
        return min(tension // WIRE.force_scale, 254)

    def get_motor_current(self, motor: int) -> int:
        """Motor current in counts 0..1023. Multiply by MILLIAMPERE_PER_COUNT for mA."""
        _motor(motor)
        return self._value(_CURRENT[motor], 2, ANALOGUE_SLACK)

    def get_finger_status(self, finger: int) -> dict[str, Any]:
        """Status of one motor; see `status.decode_status`."""
        _motor(finger)
        raw = self._value(_STATUS[finger], 1, STATUS_SLACK)
        if not at_rest(raw):
            self._something_changes()
        elif not self.line.resting:
            self._resting.add(finger)
            self.line.resting = len(self._resting) == WIRE.motors
        return decode_status(finger, raw)

    # -- whole hand ------------------------------------------------------------------------------

    def get_all_finger_status(self) -> list[dict[str, Any]]:
        """Status of the five motors, with one request each: the hand has no bulk read."""
        return [self.get_finger_status(motor) for motor in _MOTORS]

    def read_motors(self) -> list[dict[str, Any]]:
        """Status of all motors with `position`, `force` (-1 without a sensor) and `current`."""
        readings = []
        for motor in _MOTORS:
            reading = self.get_finger_status(motor)
            reading["position"] = self.get_finger_position(motor)
            reading["force"] = -1 if motor == WIRE.unsensed_motor else self.get_finger_force(motor)
            reading["current"] = self.get_motor_current(motor)
            readings.append(reading)
        return readings

    def set_hand_posture(self, pos: Sequence[int]) -> None:
        """Move the five motors to positions 0..254. The next command waits until the hand has executed it (3 ms)."""
        self._command(frames.set_hand_posture(_positions(pos)), WIRE.posture_spacing_s)

    def set_grasp_mode(self, mode: str, force_level: str, is_current: bool = True) -> None:
        """Preshape the hand for a grasp (W21). grasp_mode_close closes to this grasp.

        `is_current` True limits the grip by motor current, False by tendon tension. The v17 dialect
        has no such choice (W23). A ValueError lists the modes or levels that exist.
        """
        grasps.check_grasp(mode, force_level, self.dialect)
        if not isinstance(is_current, bool):
            raise ValueError(f"is_current must be True or False; got {is_current!r}")
        if self.send_preshape:
            self.set_hand_posture(self.preshapes[mode])
        else:
            self._check_free()
        self._grasp = frames.grasp(self.dialect, mode, force_level, is_current)

    def grasp_mode_close(self) -> None:
        """Close to the grasp of the last set_grasp_mode. Raises NoGraspModeError if there was none."""
        if self._grasp is None:
            raise NoGraspModeError("no grasp mode is set: call set_grasp_mode first")
        self._command(self._grasp, WIRE.posture_spacing_s)


handSerialDriver = HandSerialDriver


def _whole(name: str, value: int, largest: int) -> None:
    if isinstance(value, bool) or not isinstance(value, Integral) or not 0 <= value <= largest:
        raise ValueError(f"{name} must be a whole number 0..{largest}; got {value!r}")


def _motor(motor: int) -> None:
    if type(motor) is not int or motor not in _MOTORS:
        _whole("motor", motor, WIRE.motors - 1)


def _sensed(motor: int) -> None:
    _motor(motor)
    if motor == WIRE.unsensed_motor:
        raise NoForceSensorError(
            f"motor {motor} (thumb abduction) has no tension sensor: force exists for motors 1..{WIRE.motors - 1} only"
        )


def _positions(pos: Sequence[int]) -> list[int]:
    try:
        positions = list(pos)
    except TypeError:
        positions = []
    if isinstance(pos, (str, bytes)) or len(positions) != WIRE.motors:
        raise ValueError(f"pos must be {WIRE.motors} positions 0..{WIRE.position_max}; got {pos!r}")
    for motor, position in enumerate(positions):
        _whole(f"position of motor {motor}", position, WIRE.position_max)
    return positions
