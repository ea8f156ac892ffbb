"""One motor of the emulated hand: ends, contact, current, over-current, faults."""

from __future__ import annotations

import pytest
from ih2_hand.emulator.motor import (
    STALL_CURRENT,
    TRIP_TIME_S,
    Contact,
    Motor,
)

STEP = 0.002


def run(motor: Motor, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        motor.advance(STEP)


def at(position: float, number: int = 2, contact: float = 255, stiffness: float = 20.0) -> Motor:
    motor = Motor(number, position)
    motor.contact = Contact(contact, stiffness)
    return motor


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize(("share", "trips"), [(0.99, False), (1.01, True)])
def test_a_motor_is_switched_off_when_it_draws_too_much_for_a_second(number, share, trips):
    speed = round(share * 511 * (0.504 if number == 0 else 0.730))
    motor = at(100.0, number=number)
    motor.stuck = True
    motor.drive(speed, close=True)
    run(motor, TRIP_TIME_S - 0.02)
    assert motor.mode == "speed" and motor.position == 100.0
    assert motor.current == pytest.approx(STALL_CURRENT * speed / 511)
    run(motor, 0.04)
    assert motor.status_byte == (0x02 if trips else 0x20)
    motor.drive(100, close=True)
    assert not motor.over_current, "a new command clears it"


@pytest.mark.parametrize(
    ("begin", "target", "end"), [(0, 100, 97), (200, 100, 103), (50, 2, 5), (0, 2, 0), (255, 254, 255)]
)
def test_moves_that_end_short_never_pass_an_end(begin, target, end):
    motor = at(float(begin))
    motor.short_by = 3
    motor.go_to(target)
    run(motor, 1.5)
    assert motor.position == pytest.approx(end) and motor.reached


def test_full_close_reads_zero_until_the_finger_is_driven():
    motor = at(0.0)
    motor.wrap = True
    motor.go_to(200)
    run(motor, 1.2)
    assert motor.position_byte == 200
    motor.go_to(255)
    assert motor.position_byte == 200, "not there yet"
    run(motor, 1.2)
    assert (motor.position, motor.position_byte) == (255.0, 0)
    motor.drive(100, close=False)
    motor.advance(STEP)
    assert motor.position_byte == 255
