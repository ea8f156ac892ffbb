"""Low-level frames `5F MA cmd [data] MA`: what the electronics of one motor do and answer."""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.hand import EmulatedHand


class Electronics:
    """Motor 2 of a calibrated hand, spoken to in hex without addresses."""

    def __init__(self) -> None:
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, greeting=True)
        self.motor = self.hand.motors[2]

    def ask(self, text: str, motor: int = 2) -> str:
        executed = self.hand.receive(bytes((0x5F, motor)) + bytes.fromhex(text) + bytes((motor,)))
        return b"".join(answer for _, answer in executed).hex(" ").upper()

    def wait(self, seconds: float) -> None:
        self.clock.sleep(seconds)
        self.hand.advance()


@pytest.fixture
def electronics() -> Electronics:
    return Electronics()


@pytest.mark.parametrize("motor", [0, 4])
@pytest.mark.parametrize(
    ("store", "read", "factory", "stored"),
    [
        ("24", "25", "00 00 00 00", "01 02 03 04"),
        ("44", "45", "00 00 00 00", "05 06 07 08"),
        ("64", "65", "00 00 00 00", "09 0A 0B 0C"),
        ("72", "76", "01 FF", "02 58"),
        ("73", "77", "03 FF", "01 2C"),
    ],
)
def test_a_stored_value_is_read_back_and_is_the_motors_own(electronics, motor, store, read, factory, stored):
    assert electronics.ask(read, motor) == factory
    assert electronics.ask(f"{store} {stored}", motor) == ""
    assert electronics.ask(read, motor) == stored
    assert electronics.ask(read) == factory


@pytest.mark.parametrize(("data", "speed", "direction"), [("02 64", 100, 1), ("00 64", 100, -1), ("03 FF", 511, 1)])
def test_drive_has_nine_bits_of_speed_and_one_of_direction(electronics, data, speed, direction):
    electronics.motor.position = 100.0
    electronics.ask(f"74 {data}")
    motor = electronics.motor
    assert (motor.mode, motor.speed, motor.direction) == ("speed", speed, direction)
    electronics.ask("71")
    assert motor.mode == "stop"


@pytest.mark.parametrize(("command", "target"), [("21 9C 40", 100), ("31 38 80", 200), ("21 00 00", 0)])
def test_a_raw_position_has_seventeen_bits(electronics, command, target):
    electronics.motor.position = 50.0
    electronics.ask(command)
    assert (electronics.motor.mode, electronics.motor.target) == ("position", target)


def test_tension_and_current_are_followed_and_read(electronics):
    electronics.hand.set_contacts([255, 255, 100, 255, 255], [20] * 5)
    electronics.ask("41 00 A0")
    assert (electronics.motor.mode, electronics.motor.goal_effort) == ("tension", 160.0)
    electronics.wait(2.0)
    assert int(electronics.ask("42").replace(" ", ""), 16) == pytest.approx(160, abs=2)
    assert int(electronics.ask("62").replace(" ", ""), 16) == pytest.approx(200, abs=2)
    electronics.motor.current = 2000.0
    assert electronics.ask("62") == "03 FF"


@pytest.mark.parametrize(
    ("command", "mode", "later"), [("61", "current", "current"), ("66", "current_position", "stop")]
)
def test_closing_to_a_current_goes_on_or_ends_there(electronics, command, mode, later):
    electronics.hand.set_contacts([255, 255, 100, 255, 255], [20] * 5)
    electronics.ask(f"{command} 00 C8")
    assert (electronics.motor.mode, electronics.motor.goal_effort) == (mode, 200.0)
    electronics.wait(2.0)
    assert electronics.motor.mode == later
    assert electronics.motor.position == pytest.approx(110.0, abs=0.1)
