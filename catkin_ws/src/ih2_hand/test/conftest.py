"""Fixtures: a driver that talks to the emulated hand in virtual time."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.virtual_link import VirtualLink


@dataclass
class Bench:
    """One driver, one hand, one clock."""

    clock: SteppedClock
    hand: EmulatedHand
    link: VirtualLink
    driver: HandSerialDriver
    faults: Faults

    def sent(self) -> str:
        """Bytes written since the last call, as hex."""
        data, self.link.sent = bytes(self.link.sent), bytearray()
        return data.hex(" ").upper()


@pytest.fixture
def make_bench():
    def make(dialect: str = "legacy", **hand_options) -> Bench:
        clock = SteppedClock()
        hand = EmulatedHand(clock, **({"greeting": True} | hand_options))
        faults = Faults(hand)
        link = VirtualLink(hand, clock, faults=faults)
        bench = Bench(clock, hand, link, HandSerialDriver(transport=link, clock=clock, dialect=dialect), faults)
        bench.sent()
        return bench

    return make


@pytest.fixture
def bench(make_bench) -> Bench:
    return make_bench()
