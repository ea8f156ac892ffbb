"""Decides from the status of the motors whether a hand movement is done (D4.10 section 2.2). No ROS.

The hand does not acknowledge commands. A task sends its command once, then evaluates every poll of the
five motors. Motor readings are objects with the fields of coglab_msgs/MotorStatus.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from ih2_hand.driver import HandSerialDriver
from ih2_hand.errors import RefusedError
from ih2_hand.grasps import quoted
from ih2_hand.reasons import Reason
from ih2_hand.wire_choices import WIRE

FLEXION = (1, 2, 3, 4)  # motors that bend fingers; motor 0 moves the thumb sideways
POSITION_TOLERANCE = 12  # counts between a target and a position that counts as reached
START_GRACE_S = 0.5  # s after a command; a motor that still has its old mode did not accept the command
STALL_S = 0.4  # s at one position after which a driven motor counts as stalled
BLOCKED_S = 1.0  # s at one position before its target after which a position move counts as blocked
RESENDS = 2  # repetitions of a command after resynchronisations, which stop the fingers
LONGEST_S = 60.0  # s, upper bound of every goal's time limit

MOTOR_NAMES = ("thumb abduction", "thumb", "index", "middle", "ring and little")


class MotorReading(Protocol):
    """The fields of coglab_msgs/MotorStatus that the tasks evaluate."""

    motor: int
    mode: str
    target_reached: bool
    fully_open: bool
    fully_closed: bool
    over_current: bool
    com_error: bool
    position: int


@dataclass(frozen=True)
class MotorVerdict:
    """Result of one poll.

    If `done`, `ok` is True for success, and `holding` states whether the fingers hold an object (None: the movement
    does not show it). `text` is for feedback and result. `reason` is the code of a failure. `stop` requests StopALL.
    """

    text: str
    done: bool = False
    ok: bool = False
    holding: bool | None = None
    stop: bool = False
    reason: Reason = Reason.NONE

    @property
    def status_code(self) -> Reason:
        """Reason code of the feedback: HAND_MOVING, or the reason of the end."""
        return self.reason if self.done else Reason.HAND_MOVING


def _failed(text: str, reason: Reason) -> MotorVerdict:
    return MotorVerdict(text, done=True, stop=True, reason=reason)


class StallWatch:
    """Measures how long each motor has stood at its position."""

    def __init__(self) -> None:
        self._since: dict[int, tuple[int, float]] = {}

    def update(self, motors: Sequence[MotorReading], elapsed: float) -> None:
        """Process a poll made `elapsed` s after the command."""
        for motor in motors:
            known = self._since.get(motor.motor)
            if known is None or known[0] != motor.position:
                self._since[motor.motor] = (motor.position, elapsed)

    def standing(self, motor: int, elapsed: float) -> float:
        """Time (s) since the motor moved last."""
        return elapsed - self._since[motor][1]


def _names(motors: Sequence[int]) -> str:
    return ", ".join(MOTOR_NAMES[motor] for motor in motors)


@dataclass
class Task(ABC):
    """One goal. `begin` sends the command, `judge` evaluates a poll, `limit` (s) is the time limit."""

    name: str
    limit: float
    _stall: StallWatch = field(default_factory=StallWatch)

    @abstractmethod
    def begin(self, driver: HandSerialDriver) -> None:
        """Send the command. Called again after a resynchronisation, which stops the fingers."""

    def judge(self, motors: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        """Verdict on a poll that began `elapsed` s after the command."""
        bus = [motor.motor for motor in motors if motor.com_error]
        if bus:
            return _failed(f"internal bus error of {_names(bus)}: cycle the hand's power", Reason.DRIVE_ERROR)
        self._stall.update(motors, elapsed)
        return self._judge(motors, elapsed)

    @abstractmethod
    def _judge(self, motors: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        """Verdict on motors without bus errors."""


def _speed_limit_s(speed: int) -> float:
    stroke = WIRE.full_stroke_s * WIRE.speed_max / speed
    return min(LONGEST_S, 3.0 + 2.0 * stroke)


def check_speed(speed: int) -> None:
    """Raise RefusedError unless `speed` is 1..511. The protocol permits 0, but then nothing moves."""
    if not 0 <= speed <= WIRE.speed_max:
        raise RefusedError(f"speed must be 0..{WIRE.speed_max}; got {speed}", Reason.OUT_OF_RANGE)
    if speed == 0:
        raise RefusedError(f"speed 0 moves nothing; give 1..{WIRE.speed_max}", Reason.OUT_OF_RANGE)


class SpeedTask(Task):
    """Base of open and close: MoveMotor at the goal's speed until an end sensor or a resistance."""

    close: bool
    motors: tuple[int, ...]

    def __init__(self, name: str, speed: int):
        check_speed(speed)
        super().__init__(name, _speed_limit_s(speed))
        self.speed = speed
        # At low speed a count takes 2/speed seconds: a stall needs four of them without motion.
        self.stall_s = max(STALL_S, 8.0 / speed)

    def begin(self, driver: HandSerialDriver) -> None:
        for motor in self.motors:
            driver.move_motor(motor, self.speed, self.close)

    def _judge(self, motors: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        at_end: list[int] = []
        met: list[int] = []
        moving: list[int] = []
        lost: list[int] = []
        for motor in motors:
            number = motor.motor
            if number not in self.motors:
                continue
            if motor.fully_closed if self.close else motor.fully_open:
                at_end.append(number)
            elif motor.over_current:
                met.append(number)
            elif motor.mode == "speed":
                stalled = self._stall.standing(number, elapsed) >= self.stall_s
                (met if stalled else moving).append(number)
            elif elapsed < START_GRACE_S:
                moving.append(number)
            else:
                lost.append(number)
        if moving:
            return MotorVerdict(f"{_names(moving)} moving")
        if lost:
            return _failed(f"{_names(lost)} stopped on the way without a reason on the status", Reason.HAND_STALLED)
        return self._ended(at_end, met)

    @abstractmethod
    def _ended(self, at_end: list[int], met: list[int]) -> MotorVerdict:
        """Verdict when no finger moves: `at_end` reached their end sensors, `met` met an object."""


class OpenTask(SpeedTask):
    """hand_open: moves all five motors to their open ends."""

    close = False
    motors = (0, *FLEXION)

    def __init__(self, speed: int):
        super().__init__("hand_open", speed)

    def _ended(self, at_end: list[int], met: list[int]) -> MotorVerdict:
        if met:
            return _failed(f"{_names(met)} blocked before the open end: free the fingers", Reason.HAND_STALLED)
        return MotorVerdict("open", done=True, ok=True, holding=False)


class CloseTask(SpeedTask):
    """hand_close: closes the fingers (motors 1..4) to their closed ends or onto an object."""

    close = True
    motors = FLEXION

    def __init__(self, speed: int):
        super().__init__("hand_close", speed)

    def _ended(self, at_end: list[int], met: list[int]) -> MotorVerdict:
        if met:
            return MotorVerdict(
                f"closed on an object: {_names(met)} met it", done=True, ok=True, holding=True, stop=True
            )
        return MotorVerdict("closed without meeting an object", done=True, ok=True, holding=False)


class PreshapeTask(Task):
    """hand_preshape: moves every motor to the mode's preshape. Done in position mode with bit 4 set."""

    def __init__(self, mode: str, level: str, is_current: bool, limit: float):
        super().__init__("hand_preshape", limit)
        self.mode, self.level, self.is_current = mode, level, is_current
        self.targets: tuple[int, ...] = ()

    def begin(self, driver: HandSerialDriver) -> None:
        self.targets = tuple(driver.preshapes[self.mode])
        driver.set_grasp_mode(self.mode, self.level, self.is_current)
        if not driver.send_preshape:
            driver.set_hand_posture(self.targets)

    def _judge(self, motors: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        waiting, ignored = [], []
        for motor in motors:
            number, target = motor.motor, self.targets[motor.motor]
            if motor.mode == "position":
                near = abs(motor.position - target) <= POSITION_TOLERANCE
                if motor.target_reached and near:
                    continue
                if self._stall.standing(number, elapsed) >= BLOCKED_S:
                    return _failed(
                        f"{MOTOR_NAMES[number]} stands at {motor.position} of {target}: something is in the way",
                        Reason.HAND_STALLED,
                    )
                waiting.append(number)
            elif motor.over_current:
                return _failed(
                    f"{MOTOR_NAMES[number]} stopped by over-current at {motor.position} of {target}",
                    Reason.HAND_STALLED,
                )
            elif elapsed < START_GRACE_S:
                waiting.append(number)
            else:
                ignored.append(number)
        if ignored:
            return _failed(
                "the hand did not take the preshape: it is probably not calibrated; publish `fast` on hand_calibration",
                Reason.HAND_NOT_CALIBRATED,
            )
        if waiting:
            return MotorVerdict(f"{_names(waiting)} moving")
        return MotorVerdict(f"preshape {self.mode} reached", done=True, ok=True)


class GraspTask(Task):
    """hand_preshape_close: closes the motors of the mode until their force, an object or their closed ends."""

    def __init__(self, closing: Sequence[int], limit: float):
        super().__init__("hand_preshape_close", limit)
        self.closing = tuple(closing)
        self._started = False

    def begin(self, driver: HandSerialDriver) -> None:
        self._started = False
        driver.grasp_mode_close()

    def _judge(self, motors: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        closing = [motor for motor in motors if motor.motor in self.closing]
        in_grasp = ("current_position", "current", "tension")
        if any(motor.mode in in_grasp for motor in closing):
            self._started = True
        if not self._started:
            return self._not_started(closing, elapsed)
        met: list[int] = []
        moving: list[int] = []
        for motor in closing:
            number = motor.motor
            if motor.fully_closed:
                continue
            stalled = self._stall.standing(number, elapsed) >= BLOCKED_S
            if motor.target_reached and motor.mode != "position" or motor.over_current:
                met.append(number)
            elif motor.mode in in_grasp or motor.mode == "position":
                (met if stalled else moving).append(number)
            else:
                return _failed(
                    f"{MOTOR_NAMES[number]} stopped at {motor.position} before it met "
                    "anything: the grasp was interrupted",
                    Reason.HAND_STALLED,
                )
        if moving:
            return MotorVerdict(f"{_names(moving)} closing")
        if met:
            return MotorVerdict(f"holding: {_names(met)} met the object", done=True, ok=True, holding=True)
        return MotorVerdict("closed without meeting an object", done=True, ok=True, holding=False)

    def _not_started(self, closing: Sequence[MotorReading], elapsed: float) -> MotorVerdict:
        # The hand finishes the preshape first, so a motor may move in position mode for a while.
        if all(self._stall.standing(motor.motor, elapsed) >= BLOCKED_S for motor in closing):
            if all(motor.fully_closed for motor in closing):
                return MotorVerdict("closed without meeting an object", done=True, ok=True, holding=False)
            return _failed(
                "the hand did not begin to close: it is probably not calibrated; publish `fast` on hand_calibration",
                Reason.HAND_NOT_CALIBRATED,
            )
        return MotorVerdict("taking the preshape")


def shown_empty(motors: Sequence[Any]) -> bool:
    """True if a poll proves that the hand holds nothing: every finger is at its open end."""
    flexion = [motor for motor in motors if motor.motor in FLEXION]
    return bool(flexion) and all(motor.fully_open and not motor.com_error for motor in flexion)


def shown_holding(motors: Sequence[Any]) -> bool:
    """True if a poll proves a grip: a finger reached its closing force before its closed end."""
    return any(
        motor.motor in FLEXION
        and motor.target_reached
        and not motor.fully_closed
        and motor.mode in ("current_position", "tension", "current")
        for motor in motors
    )


def refuse_calibration(words: Sequence[str], *, calibrated: bool, holding: bool, busy: str | None) -> str | None:
    """Reason to refuse a calibration request, or None. `words` are `fast` or `complete`, then optionally `force`.

    `busy` names the running goal or calibration. Calibration opens the fingers. So it needs `force` if the hand
    is calibrated already, or if it holds or may hold an object.
    """
    if not words or words[0] not in ("fast", "complete") or list(words[1:]) not in ([], ["force"]):
        return f"calibration must be fast, complete, fast force or complete force; got {quoted(' '.join(words))}"
    if busy:
        return f"{busy}: calibrate when it has ended"
    if len(words) == 2:
        return None
    if holding:
        return (
            f"the hand may hold an object and calibration opens it: open it first (hand_open), "
            f"or send `{words[0]} force`"
        )
    if calibrated:
        return f"the hand is calibrated already: send `{words[0]} force` to repeat it"
    return None
