"""Requests and answers on a line without checksums: counters, accepted values, durations."""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.errors import HandInconsistentError, HandTimeoutError
from ih2_hand.line import ANALOGUE_SLACK, POSITION_SLACK, STATUS_SLACK, HandLine

ASK = b"\x45\x02"
FILLER = b"\x41" * 13
READ_S = 0.001


class Script:
    """A line whose answers are written down; each read takes a millisecond, silence its time limit."""

    port = "scripted"

    def __init__(self, clock: SteppedClock) -> None:
        self.clock, self.answers, self.sent = clock, [], []
        self.last_byte: int | None = None
        self.stray = 0
        self.closed = False

    def write(self, data: bytes) -> None:
        self.sent.append((round(self.clock.now, 6), data))

    def read(self, count: int, timeout: float) -> bytes:
        assert count in (1, 2) and timeout == 0.05
        answer = bytes.fromhex(self.answers.pop(0)) if self.answers else b""
        self.clock.sleep(READ_S if answer else timeout)
        if answer:
            self.last_byte = answer[-1]
        return answer

    def pending(self) -> bool:
        return self.stray > 0

    def flush_input(self) -> None:
        self.stray = max(0, self.stray - 1)

    def close(self) -> None:
        self.closed = True


class Bench:
    """One line and its script."""

    def __init__(self) -> None:
        self.clock = SteppedClock(50.0)
        self.script = Script(self.clock)
        self.traced: list[tuple[str, bytes]] = []
        self.line = HandLine(self.script, self.clock, trace=lambda way, data: self.traced.append((way, data)))

    def value(self, *answers: str, length: int = 1, slack=POSITION_SLACK) -> int:
        self.script.answers = list(answers)
        value = self.line.value(ASK, length, slack)
        assert self.script.answers == [], "no answer is left over"
        return value

    @property
    def counted(self) -> tuple[int, int, int, int, int]:
        counters = self.line.counters
        return counters.requests, counters.resynchronisations, counters.fillers, counters.retries, counters.failures


@pytest.fixture
def bench() -> Bench:
    return Bench()


# -- one request ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "reason", "fillers"),
    [("", "answer missing", 1), ("01", "answer too short", 1), ("01 02 03", "answer too long", 0)],
)
def test_a_bad_answer_is_asked_for_once_more(bench, first, reason, fillers):
    bench.script.answers = [first, "01 F4"]
    assert bench.line.request(ASK, 2) == b"\x01\xf4"
    assert bench.counted == (2, 1, fillers, 1, 0) and bench.line.counters.reasons == {reason: 1}
    assert [data for _, data in bench.script.sent] == [ASK, *[FILLER] * fillers, ASK]


def test_a_second_bad_answer_is_an_error_that_says_where_to_look(bench):
    bench.script.answers = ["01"]
    with pytest.raises(HandTimeoutError) as error:
        bench.line.request(ASK, 2)
    assert bench.counted == (2, 2, 2, 1, 1)
    assert bench.line.counters.reasons == {"answer too short": 1, "answer missing": 1}
    for words in ("scripted", "`45 02`", "2 byte(s)", "50 ms", "0x01"):
        assert words in str(error.value)


def test_a_resynchronisation_waits_and_listens_for_silence(bench):
    bench.line.resynchronise("test")
    assert bench.clock.now == pytest.approx(50.022)
    bench.script.stray = 4
    bench.line.resynchronise("test")
    assert bench.clock.now == pytest.approx(50.022 + 0.020 + 4 * 0.002)
    assert bench.line.counters.reasons == {"test": 2} and bench.counted == (0, 2, 2, 0, 0)


def test_a_line_that_never_falls_silent_does_not_hold_up_for_ever(bench):
    bench.script.stray = 10_000
    bench.line.resynchronise("test")
    assert bench.clock.now < 50.2


def test_nothing_follows_a_posture_before_it_is_executed(bench):
    bench.line.send(b"\x48", busy_s=0.5)
    bench.line.send(b"\x41")
    bench.line.send(b"\x41")
    bench.line.send(b"\x48", busy_s=0.5)
    bench.clock.sleep(2.0)
    bench.line.send(b"\x41")
    assert [moment for moment, _ in bench.script.sent] == [50.0, 50.5, 50.5, 50.5, 52.5]


@pytest.mark.parametrize(("answer", "is_good"), [("08", True), ("08 08", False), ("", False)])
def test_a_poll_is_asked_once_whatever_comes(bench, answer, is_good):
    bench.script.answers, bench.script.stray = [answer], 1
    assert bench.line.answers(ASK, 1) is is_good
    assert len(bench.script.sent) == 1 and bench.script.stray == 0 and bench.counted == (0, 0, 0, 0, 0)


# -- values --------------------------------------------------------------------------------------


def test_a_value_counts_when_three_readings_agree(bench):
    assert bench.value("64", "64", "64") == 100
    assert bench.value("64", "65", "64", "65", "64") == 100
    assert bench.counted == (8, 0, 0, 0, 0)


def test_a_known_value_of_a_resting_hand_needs_one_reading(bench):
    bench.line.resting = True
    assert bench.line.resting
    assert bench.value("64", "64", "64") == 100 and bench.value("64") == 100
    assert bench.value("65", "65", "65") == 101, "another one has to be confirmed"
    bench.line.resting = True
    assert bench.value("65") == 101, "it has been resting all the time"
    bench.line.resting = False
    assert bench.value("65", "65", "65") == 101
    bench.line.resting = True
    assert bench.value("65", "65", "65") == 101, "what was read on the way is not known"
    bench.line.resynchronise("test")
    assert bench.value("65", "65", "65") == 101


@pytest.mark.parametrize(
    ("slack", "readings", "median"),
    [
        (POSITION_SLACK, (10, 11, 13, 12, 13), 12),
        (POSITION_SLACK, (10, 11, 14, 12, 13), None),
        (ANALOGUE_SLACK, (100, 143, 120, 110, 130), 120),
        (ANALOGUE_SLACK, (100, 145, 120, 110, 130), None),
        (STATUS_SLACK, (0, 1, 0, 1, 2), None),
    ],
)
def test_values_that_move_settle_by_their_median_within_what_a_finger_can_do(bench, slack, readings, median):
    answers = [f"{reading:04X}" for reading in readings]
    if median is not None:
        assert bench.value(*answers, length=2, slack=slack) == median
        return
    assert bench.value(*answers, "0005", "0005", "0005", length=2, slack=slack) == 5
    assert bench.line.counters.reasons == {"readings contradict each other": 1} and bench.counted == (8, 1, 0, 0, 0)


def test_readings_that_contradict_each_other_twice_are_an_error(bench):
    with pytest.raises(HandInconsistentError, match=r"scripted .*\(1, 90, 2, 80, 3;"):
        bench.value(*["01", "5A", "02", "50", "03"] * 2)
    assert bench.counted == (10, 1, 0, 0, 1)


def test_readings_before_a_resynchronisation_do_not_count(bench):
    # With the two readings before the slip, the first one after it would confirm 100.
    assert bench.value("64", "64", "64 64", "64", "65", "65", "65") == 101
    assert bench.counted == (7, 1, 0, 1, 0)
