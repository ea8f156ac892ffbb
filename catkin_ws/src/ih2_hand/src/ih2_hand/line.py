"""Requests and answers on a line without checksums: time limits, resynchronisation, confirmation.

The protocol has no lengths and no checksums. Three rules replace them:

* Too many bytes, or bytes without a request, make the answer invalid. The input is flushed (counted as a
  resynchronisation) and the request is repeated.
* If an answer is missing, the hand's parser may still wait for bytes. It is filled with StopALL (W10, counted;
  this stops the fingers). The request is repeated once; then HandTimeoutError is raised.
* A value is valid if AGREE readings are equal, so that fewer corrupted bytes cannot produce a wrong value. While
  the hand is at rest (`resting`), one reading that equals the last confirmed value is sufficient. A value that
  changes between readings is their median, if the readings differ by no more than a finger can move in that time.
  Otherwise HandInconsistentError is raised. AGREE equal wrong readings cannot be detected without a checksum.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from ih2_hand import frames
from ih2_hand.clock import Clock, SteadyClock
from ih2_hand.errors import HandConnectionLost, HandInconsistentError, HandTimeoutError
from ih2_hand.transport import Transport, format_byte
from ih2_hand.wire_choices import WIRE

TraceHook = Callable[[str, bytes], None]
"""Called with the direction (">" to the hand, "<" from the hand) and the bytes."""

AGREE = 3  # equal readings that confirm a value: two corrupted bytes cannot produce a wrong value
READINGS = 5  # readings of one value, without resynchronisation between them, before the median is used
ATTEMPTS = 8  # requests for one value, resynchronisations included, before its readings count as contradictory
QUIET_S = 0.002  # s of silence on the line after a flush (20 byte times)


@dataclass(frozen=True)
class Slack:
    """Largest accepted difference of readings of one value: `counts` + `rate` (counts/s) x elapsed time (s)."""

    counts: float
    rate: float


# A finger moves 255 counts/s at full speed (W15); the rate includes a margin of half of that.
POSITION_SLACK = Slack(2.0, 400.0)
# Current and tension are noisy and rise quickly at contact.
ANALOGUE_SLACK = Slack(24.0, 5000.0)
STATUS_SLACK = Slack(0.0, 0.0)  # flags must be equal


@dataclass
class LineCounters:
    """Events on the line since it was opened."""

    requests: int = 0
    resynchronisations: int = 0
    """All resynchronisations: input flushed, or parser filled."""
    fillers: int = 0
    """Resynchronisations with StopALL; these stopped the fingers."""
    retries: int = 0
    failures: int = 0
    reasons: dict[str, int] = field(default_factory=dict)


class HandLine:
    """Thread-safe requests and answers on a transport."""

    def __init__(
        self,
        transport: Transport,
        clock: Clock | None = None,
        read_timeout: float = WIRE.read_timeout_s,
        trace: TraceHook | None = None,
    ):
        self.transport = transport
        self.port = transport.port
        self.clock: Clock = clock or SteadyClock()
        self.read_timeout = read_timeout
        self.trace = trace
        self.counters = LineCounters()
        self.lock = threading.RLock()
        """Held from a request to the end of its answer."""
        self._write_lock = threading.Lock()
        self._not_before = 0.0
        self._known: dict[bytes, int] = {}
        self._resting = False
        self._closed = False

    # -- sending ---------------------------------------------------------------------------------

    def send(self, frame: bytes, busy_s: float = 0.0) -> None:
        """Send a frame. The next frame waits for `busy_s` (s), the time that the hand needs for this one.

        Frames are never interleaved. Raises HandConnectionLost.
        """
        with self._write_lock:
            if self._closed:
                raise HandConnectionLost(f"the hand's port {self.port} was closed; open it again")
            if self._not_before:
                self.clock.sleep(max(0.0, self._not_before - self.clock.monotonic()))
                self._not_before = 0.0
            self.transport.write(frame)
            if busy_s:
                self._not_before = self.clock.monotonic() + busy_s
            if self.trace:
                self.trace(">", frame)

    def close(self) -> None:
        """Close the port; later requests raise HandConnectionLost.

        A request in progress ends first, within its read's time limit. Otherwise the operating system could
        give its descriptor number to another file during the read.
        """
        with self._write_lock:
            self._closed = True
        with self.lock:
            self.transport.close()

    # -- one request -----------------------------------------------------------------------------

    def request(self, frame: bytes, length: int) -> bytes:
        """Return an answer of exactly `length` bytes, after at most one resynchronisation and one retry."""
        with self.lock:
            if self.transport.pending():
                self._flush("bytes without a request")
            for attempt in (1, 2):
                self.counters.requests += 1
                self.send(frame)
                data = self.transport.read(length, self.read_timeout)
                if self.trace and data:
                    self.trace("<", data)
                if len(data) == length:
                    return data
                if len(data) > length:
                    self._flush("answer too long")
                else:
                    self.resynchronise("answer too short" if data else "answer missing")
                self.counters.retries += attempt == 1
            self.counters.failures += 1
            last = format_byte(self.transport.last_byte)
            raise HandTimeoutError(
                f"the hand on {self.port} gave no complete answer to `{frame.hex(' ')}` "
                f"({length} byte(s) within {self.read_timeout * 1000:.0f} ms, twice); last byte "
                f"received {last}; check power, cable and that no calibration runs"
            )

    # -- resynchronisation -----------------------------------------------------------------------

    def resynchronise(self, reason: str) -> None:
        """Complete a frame that the hand may wait for with StopALL bytes (W10), then flush the input."""
        with self.lock:
            self.counters.fillers += 1
            self.send(WIRE.resync_filler)
            self.clock.sleep(WIRE.resync_wait_s)
            self._flush(reason)

    def _flush(self, reason: str) -> None:
        counters = self.counters
        counters.resynchronisations += 1
        counters.reasons[reason] = counters.reasons.get(reason, 0) + 1
        self._known.clear()
        for _ in range(50):
            self.transport.flush_input()
            self.clock.sleep(QUIET_S)
            if self._closed or not self.transport.pending():  # close() need not wait for silence
                return

    def answers(self, frame: bytes, length: int) -> bool:
        """True if one request is answered with exactly `length` bytes. No retry; the input is flushed.

        For polling a hand that discards requests while it calibrates (W11).
        """
        with self.lock:
            self.transport.flush_input()
            self.send(frame)
            data = self.transport.read(length, self.read_timeout)
            if self.trace and data:
                self.trace("<", data)
            self._known.clear()
            return len(data) == length

    # -- values ----------------------------------------------------------------------------------

    @property
    def resting(self) -> bool:
        """True while no motor moves, so that confirmed values stay valid."""
        return self._resting

    @resting.setter
    def resting(self, resting: bool) -> None:
        if resting and not self._resting:
            self._known.clear()  # these values were read while motors moved
        self._resting = resting

    def value(self, frame: bytes, length: int, slack: Slack) -> int:
        """Confirmed value of a reading: 8 bits for a one-byte answer, 10 bits for a two-byte answer."""
        with self.lock:
            first = self._number(frame, length)
            if self._resting and first is not None and first == self._known.get(frame):
                return first
            value = self._confirm(frame, length, slack, first)
            self._known[frame] = value
            return value

    def _number(self, frame: bytes, length: int) -> int | None:
        data = self.request(frame, length)
        if length == 1:
            return data[0]
        # The protocol allows ten bits: a larger number is not the answer to this request.
        return data[0] << 8 | data[1] if data[0] < 4 else None

    def _confirm(self, frame: bytes, length: int, slack: Slack, first: int | None) -> int:
        start = self.clock.monotonic()
        for last_round in (False, True):
            readings = [] if first is None else [first]
            for _ in range(ATTEMPTS):
                resynchronisations = self.counters.resynchronisations
                number = self._number(frame, length)
                if self.counters.resynchronisations != resynchronisations:
                    readings.clear()  # readings before a resynchronisation may belong to another request
                if number is None:
                    continue
                readings.append(number)
                if readings.count(number) == AGREE:
                    return number
                if len(readings) == READINGS:
                    break
            span = slack.counts + slack.rate * (self.clock.monotonic() - start)
            if len(readings) == READINGS and max(readings) - min(readings) <= span:
                return sorted(readings)[READINGS // 2]
            if not last_round:
                self._flush("readings contradict each other")
                first = None
        self.counters.failures += 1
        seen = ", ".join(str(number) for number in readings) or "no valid one"
        raise HandInconsistentError(
            f"readings of `{frame.hex(' ')}` on {self.port} contradict each other ({seen}; last "
            f"byte received {format_byte(self.transport.last_byte)}): the line is disturbed; check "
            "cable, ground and supply"
        )


def status_request(motor: int) -> bytes:
    """Frame of GetFingerStatus."""
    return bytes((frames.GET_STATUS, motor))
