"""A line without a pty: driver and emulator in one process, in real or virtual time."""

from __future__ import annotations

from collections.abc import Callable

from ih2_hand.clock import Clock
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.errors import HandConnectionLost

Tamper = Callable[[bytes], bytes]
"""Changes the bytes of one direction."""


class VirtualLink:
    """A `transport.Transport` to an EmulatedHand.

    `to_hand` and `to_host` change the bytes on their way. A read that finds too few bytes lets its
    time limit pass on the clock. With a SteppedClock this costs no real time.
    """

    def __init__(
        self,
        hand: EmulatedHand,
        clock: Clock,
        port: str = "virtual",
        faults: Faults | None = None,
        to_hand: Tamper | None = None,
        to_host: Tamper | None = None,
    ):
        self.port = port
        self.last_byte: int | None = None
        self.hand = hand
        self.faults = faults
        self.to_hand = to_hand
        self.to_host = to_host
        self.sent = bytearray()
        """Every byte written, before `to_hand` changes it."""
        self.plugged = True
        self._clock = clock
        self._input = bytearray()

    def write(self, data: bytes) -> None:
        self._check()
        self.sent += data
        if self.faults:
            data = self.faults.incoming(data)
        if self.to_hand:
            data = self.to_hand(data)
        for _, answer in self.hand.receive(data):
            if self.faults:
                answer = self.faults.outgoing(answer)
            if self.to_host:
                answer = self.to_host(answer)
            self._input += answer

    def read(self, count: int, timeout: float) -> bytes:
        self._check()
        if self.faults:
            self._input += self.faults.take_stray()
        if len(self._input) < count:
            self._clock.sleep(timeout)
        data = bytes(self._input)
        self._input.clear()
        if data:
            self.last_byte = data[-1]
        return data

    def pending(self) -> bool:
        self._check()
        return bool(self._input)

    def flush_input(self) -> None:
        self._check()
        self._input.clear()

    def close(self) -> None:
        self.plugged = False

    def _check(self) -> None:
        if not self.plugged:
            raise HandConnectionLost(f"the hand's port {self.port} is gone")
