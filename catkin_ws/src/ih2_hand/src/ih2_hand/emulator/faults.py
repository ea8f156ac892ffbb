"""Faults of the line and the hand, switched on by one-line commands."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.grasps import quoted
from ih2_hand.wire_choices import WIRE

HELP = """\
lose N          lose the next N bytes of the hand's answers
lose_in N       lose the next N bytes that come from the host
garbage N       send N random bytes now
double N        send the next N answers twice
slow MS         delay every answer by MS milliseconds (0: off)
mute            answer nothing any more (power lost, cable intact)
stuck M         motor M does not move any more
short N         position moves end N counts (0..4) before the target
wrap            a full close reads back as 0
unplug [S]      close the port, for S seconds or until replug
replug          open a port again
clear           undo every fault (and replug)"""


@dataclass
class Faults:
    """State of the line faults. The motor faults are stored in the motors."""

    hand: EmulatedHand
    seed: int = 1
    lose: int = 0
    lose_in: int = 0
    double: int = 0
    delay_s: float = 0.0
    mute: bool = False
    stray: bytes = b""
    on_unplug: Callable[[float | None], None] = lambda _seconds: None
    on_replug: Callable[[], None] = lambda: None
    _random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def command(self, text: str) -> str:
        """Execute one command of HELP and return a text that describes it. A ValueError lists the commands."""
        words = text.split()
        try:
            return self._run(words[0], words[1:])
        except (IndexError, KeyError, ValueError) as error:
            raise ValueError(f"no such fault {quoted(text)}; there are:\n{HELP}") from error

    def _run(self, name: str, arguments: list[str]) -> str:
        if name in ("lose", "lose_in", "double"):
            count = _count(arguments[0], 10000)
            setattr(self, name, count)
            return f"{name}: next {count}"
        if name == "garbage":
            self.stray += self._random.randbytes(_count(arguments[0], 10000))
            return f"garbage: {len(self.stray)} byte(s)"
        if name == "slow":
            self.delay_s = _count(arguments[0], 60000) / 1000.0
            return f"answers delayed by {self.delay_s * 1000:.0f} ms"
        if name == "mute":
            self.mute = True
            return "the hand answers nothing"
        if name == "stuck":
            motor = self.hand.motors[_count(arguments[0], WIRE.motors - 1)]
            motor.stuck = True
            return f"motor {motor.number} is stuck"
        if name == "short":
            counts = _count(arguments[0], WIRE.reached_counts)
            for motor in self.hand.motors:
                motor.short_by = counts
            return f"moves end {counts} counts short"
        if name == "wrap":
            for motor in self.hand.motors:
                motor.wrap = True
            return "a full close reads 0"
        if name == "unplug":
            self.on_unplug(_seconds(arguments[0]) if arguments else None)
            return "unplugged"
        if name == "replug":
            self.on_replug()
            return "plugged in"
        if name == "clear":
            return self._clear()
        raise KeyError(name)

    def _clear(self) -> str:
        self.lose = self.lose_in = self.double = 0
        self.delay_s, self.mute, self.stray = 0.0, False, b""
        for motor in self.hand.motors:
            motor.stuck, motor.short_by, motor.wrap, motor.wrapped = False, 0, False, False
        self.on_replug()
        return "no faults"

    def incoming(self, data: bytes) -> bytes:
        """Bytes from the host that arrive at the hand."""
        lost = min(self.lose_in, len(data))
        self.lose_in -= lost
        return data[lost:]

    def outgoing(self, answer: bytes) -> bytes:
        """Bytes of an answer that leave the hand."""
        if self.mute:
            return b""
        if answer and self.double:
            self.double -= 1
            answer = answer * 2
        lost = min(self.lose, len(answer))
        self.lose -= lost
        return answer[lost:]

    def take_stray(self) -> bytes:
        """Garbage to send now."""
        stray, self.stray = self.stray, b""
        return b"" if self.mute else stray


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 3600.0:
        raise ValueError(text)
    return value


def _count(text: str, largest: int) -> int:
    value = int(text)
    if not 0 <= value <= largest:
        raise ValueError(text)
    return value
