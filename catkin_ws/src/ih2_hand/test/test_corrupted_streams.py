"""Corrupted byte streams (12 000; a million with --long): no wrong value is accepted, and the driver never hangs.

A stream is a handful of calls during which bytes anywhere, in either direction, are lost, doubled,
flipped or preceded by a stray byte: one or two apart from each other, or a burst of neighbours. The
truth is read from the emulated motors at every request, and most requests must be answered,
because a driver that refuses everything is never wrong either. A value needs three equal readings, so one or two
corruptions cannot forge one. Three that forge the same lie can, and no driver can tell.
"""

from __future__ import annotations

import os
import random
from collections import deque

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.errors import HandError
from ih2_hand.line import LineCounters

LONG = bool(os.environ.get("COGLAB_LONG"))
STREAMS = 1_000_000 if LONG else 12_000
HARD_STREAMS = 100_000 if LONG else 3_000  # of each kind that is worse
PARTS = 4
CALLS = 4
FIRST_LENGTH = 48
"""bytes of a stream, both directions, before any has been seen"""
WIRE_S = 0.0005


class Corrupter:
    """Corrupts bytes at planned places of the two directions."""

    KINDS = ("lost", "doubled", "flipped", "inserted")

    def __init__(self, rng: random.Random, clock: SteppedClock):
        self.rng, self.clock = rng, clock
        self.plan: dict[int, str] = {}
        self.lengths: deque[int] = deque([FIRST_LENGTH], maxlen=500)
        self.passed = self.done = 0
        self.sample = lambda: None

    def arm(self, events: int, burst: bool = False) -> None:
        """Plan so many corruptions: anywhere, or (burst) of bytes that follow each other. How long the stream will be
        nobody knows, since corruptions lengthen it: the places are drawn over the length of one of those before."""
        self.passed = 0
        length = max(self.rng.choice(self.lengths), events)
        places = self.rng.sample(range(length), events)
        if burst:
            first = self.rng.randrange(length - events + 1)
            places = range(first, first + events)
        self.plan = {place: self.rng.choice(self.KINDS) for place in places}

    def to_hand(self, data: bytes) -> bytes:
        self.clock.sleep(WIRE_S)
        self.sample()
        return self.tamper(data)

    def tamper(self, data: bytes) -> bytes:
        if not self.plan:
            self.passed += len(data)
            return data
        out = bytearray()
        for byte in data:
            kind = self.plan.pop(self.passed, None)
            self.passed += 1
            self.done += kind is not None
            if kind == "lost":
                continue
            if kind == "flipped":
                byte ^= 1 << self.rng.randrange(8)
            elif kind == "doubled":
                out.append(byte)
            elif kind == "inserted":
                out.append(self.rng.randrange(256))
            out.append(byte)
        return bytes(out)


def truth(hand: EmulatedHand, call: str, motor: int) -> int:
    hand.advance()
    model = hand.motors[motor]
    return {
        "get_raw_position": lambda: model.position_byte,
        "get_finger_force": lambda: min(254, model.tension // 4),
        "get_motor_current": lambda: min(1023, int(model.current)),
        "get_finger_status": lambda: model.status_byte,
    }[call]()


READS = ("get_raw_position", "get_finger_force", "get_motor_current", "get_finger_status")


class Campaign:
    """One driver, one hand, many streams."""

    def __init__(self, seed: int):
        self.rng = random.Random(seed)
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, greeting=True)
        self.corrupter = Corrupter(self.rng, self.clock)
        self.link = VirtualLink(self.hand, self.clock, to_hand=self.corrupter.to_hand, to_host=self.corrupter.tamper)
        self.driver = HandSerialDriver(transport=self.link, clock=self.clock)
        self.wrong: list[tuple] = []
        self.wrong_but_counted = self.refused = self.read = self.asked = self.unspent = 0

    def new_scene(self) -> None:
        """Another posture, object and driver state."""
        rng = self.rng
        self.hand.calibrated = True
        self.hand.set_contacts(
            [rng.choice((255, rng.randrange(40, 250))) for _ in range(5)], [rng.uniform(5, 60) for _ in range(5)]
        )
        self.driver.close()
        self.link.plugged = True
        self.driver = HandSerialDriver(transport=self.link, clock=self.clock)
        self.driver.set_hand_posture([rng.randrange(255) for _ in range(5)])
        if rng.random() < 0.5:
            self.driver.move_motor(rng.randrange(5), rng.randrange(40, 512), rng.random() < 0.5)
        self.clock.sleep(rng.choice((0.0, 0.2, 2.0)))

    def check_read(self, call: str, motor: int) -> None:
        counters: LineCounters = self.driver.counters
        resyncs = counters.resynchronisations
        seen: list[int] = []
        self.corrupter.sample = lambda: seen.append(truth(self.hand, call, motor))
        self.asked += 1
        try:
            value = getattr(self.driver, call)(motor)
        except HandError:
            self.refused += 1
            return
        finally:
            self.corrupter.sample()
            self.corrupter.sample = lambda: None
        if call == "get_finger_status":
            right = value["raw"] in seen
        else:
            right = min(seen) <= value <= max(seen)
        self.read += 1
        if right:
            return
        # Counted separately to find the cause of a wrong value; a resynchronisation is no excuse for one.
        if counters.resynchronisations > resyncs:
            self.wrong_but_counted += 1
        else:
            self.wrong.append((call, motor, value, seen))

    def stream(self, events: int, burst: bool = False) -> None:
        self.corrupter.arm(events, burst)
        for _ in range(CALLS):
            motor = self.rng.randrange(1, 5)
            if self.rng.random() < 0.1:
                try:
                    self.driver.set_finger_position(motor, self.rng.randrange(255))
                except HandError:
                    self.refused += 1
            else:
                self.check_read(self.rng.choice(READS), motor)
        self.corrupter.lengths.append(self.corrupter.passed)
        self.unspent += len(self.corrupter.plan)
        self.corrupter.plan = {}
        self.check_not_stuck()

    def check_not_stuck(self) -> None:
        """On a clean line the next call answers, at the latest when a calibration that a flipped
        byte may have started is over."""
        for _ in range(2):
            try:
                self.driver.get_finger_status(2)
                return
            except HandError:
                self.clock.sleep(11.0)
        assert self.driver.get_finger_status(2)["raw"] == truth(self.hand, "get_finger_status", 2)


def run(seed: int, streams: int, events: tuple[int, ...], burst: bool = False) -> Campaign:
    campaign = Campaign(seed)
    for number in range(streams):
        if number % 50 == 0:
            campaign.new_scene()
        campaign.stream(campaign.rng.choice(events), burst)
    print(
        f"{campaign.corrupter.done} corruptions ({campaign.unspent} not met), {campaign.asked} asked, "
        f"{campaign.read} values, {campaign.refused} "
        f"refused, {campaign.wrong_but_counted} wrong with a resynchronisation counted, "
        f"{len(campaign.wrong)} wrong"
    )
    return campaign


@pytest.mark.parametrize("part", range(PARTS))
def test_corrupted_streams(part):
    campaign = run(1000 + part, STREAMS // PARTS, (1, 1, 2))
    assert campaign.corrupter.done > STREAMS // PARTS
    assert campaign.wrong == [] and campaign.wrong_but_counted == 0
    assert campaign.read >= 0.98 * campaign.asked, "the line is good enough for nearly all of them"


def test_two_corruptions():
    campaign = run(2000, HARD_STREAMS, (2,))
    assert campaign.wrong == [] and campaign.wrong_but_counted == 0
    assert campaign.read >= 0.96 * campaign.asked


def test_bursts_of_two():
    campaign = run(2500, HARD_STREAMS, (2,), burst=True)
    assert campaign.wrong == [] and campaign.wrong_but_counted == 0
    assert campaign.read >= 0.96 * campaign.asked


def test_longer_bursts_anywhere():
    """Neighbours in a row, from a few bytes to whole requests with their answers: counted, too."""
    campaign = run(4000, HARD_STREAMS, (3, 4, 8, 12, 20), burst=True)
    assert campaign.corrupter.done > HARD_STREAMS * 5
    assert (len(campaign.wrong) + campaign.wrong_but_counted) * 2_000 <= campaign.read
    assert campaign.read >= 0.80 * campaign.asked


class Forger:
    """Flips one bit of the first `lies` answers to a position request."""

    def __init__(self, lies: int):
        self.lies = lies

    def __call__(self, data: bytes) -> bytes:
        self.lies -= 1
        return bytes(byte ^ 8 for byte in data) if self.lies >= 0 else data


@pytest.mark.parametrize("lies", [1, 2])
def test_fewer_equal_lies_than_readings_are_found_out(lies):
    clock = SteppedClock()
    hand = EmulatedHand(clock, greeting=True, positions=[0, 100, 0, 0, 0])
    link = VirtualLink(hand, clock)
    driver = HandSerialDriver(transport=link, clock=clock)
    link.to_host = Forger(lies)
    assert driver.get_raw_position(1) == 100
