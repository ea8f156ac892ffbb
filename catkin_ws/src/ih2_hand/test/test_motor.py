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


@pytest.mark.parametrize(("close", "end", "status"), [(True, 255.0, 0x04), (False, 0.0, 0x08)])
def test_a_driven_motor_ends_at_its_end_sensor(close, end, status):
    motor = at(100.0)
    motor.drive(511, close)
    assert motor.status_byte == 0x21
    run(motor, 0.2)
    assert abs(motor.position - 100.0) == pytest.approx(51.0, abs=0.6) and motor.status_byte == 0x21
    run(motor, 1.0)
    assert (motor.position, motor.status_byte, motor.current) == (end, status, 0.0)


@pytest.mark.parametrize("how", ["stop", "speed 0"])
def test_a_motor_that_is_stopped_keeps_its_place_and_forgets_its_goal(how):
    motor = at(100.0)
    motor.go_to(102)
    assert motor.status_byte == 0x51, "within what counts as reached"
    motor.stop() if how == "stop" else motor.drive(0, close=True)
    run(motor, 1.0)
    assert (motor.position, motor.status_byte, motor.current) == (100.0, 0x00, 0.0)


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


def test_too_much_current_must_last_without_a_break():
    motor = at(100.0)
    motor.stuck = True
    for _ in range(3):
        motor.drive(511, close=True)
        run(motor, 0.6)
    motor.stuck = False
    motor.advance(STEP)
    motor.stuck = True
    run(motor, 0.9)
    assert not motor.over_current
    run(motor, 0.2)
    assert motor.over_current


@pytest.mark.parametrize(
    ("begin", "target", "end"), [(0, 100, 97), (200, 100, 103), (50, 2, 5), (0, 2, 0), (255, 254, 255)]
)
def test_moves_that_end_short_never_pass_an_end(begin, target, end):
    motor = at(float(begin))
    motor.short_by = 3
    motor.go_to(target)
    run(motor, 1.5)
    assert motor.position == pytest.approx(end) and motor.reached


def test_a_full_close_that_reads_back_as_zero_does_so_until_the_finger_is_driven():
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


def test_tension_is_pulled_to_its_goal():
    motor = at(105.0, contact=100.0)
    motor.pull(160)
    assert motor.status_byte == 0x61
    run(motor, 1.5)
    assert motor.tension == pytest.approx(160, abs=1) and motor.status_byte == 0x70
    assert motor.position == pytest.approx(110.0) and motor.current == pytest.approx(200.0)


def test_closing_to_a_current_ends_a_while_after_it_is_reached():
    motor = at(95.0, contact=100.0)
    motor.close_to_current(200, stop_after=True)
    assert motor.status_byte == 0xC1
    for _ in range(500):
        if not motor.reached:
            motor.advance(STEP)
    assert motor.position == pytest.approx(110.0) and motor.current == pytest.approx(200.0)
    run(motor, 0.19)
    assert motor.status_byte == 0xD0 and motor.current == pytest.approx(200.0)
    run(motor, 0.02)
    assert (motor.status_byte, motor.current) == (0x10, 0.0)
    assert motor.effort == pytest.approx(200.0), "the grip stays"
