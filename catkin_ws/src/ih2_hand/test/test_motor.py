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


def test_a_motor_just_switched_on_stands_and_says_nothing():
    motor = at(100.0)
    run(motor, 1.0)
    assert (motor.status_byte, motor.position, motor.current, motor.tension) == (0x00, 100.0, 0.0, 0)
    assert Motor(2).status_byte == 0x08 and at(255.0).status_byte == 0x04


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


def test_the_current_of_a_free_motor_grows_with_its_speed():
    for speed in (100, 511):
        motor = at(100.0)
        motor.drive(speed, close=True)
        motor.advance(STEP)
        assert motor.current == pytest.approx(40.0 + 60.0 * speed / 511)


def test_a_finger_goes_no_deeper_than_its_drive_can_press():
    motor = at(90.0, contact=100.0)
    motor.drive(128, close=True)
    run(motor, 2.0)
    pressed = STALL_CURRENT * 128 / 511
    assert motor.position == pytest.approx(100.0 + pressed / 20.0, abs=0.01)
    assert motor.effort == pytest.approx(pressed, abs=0.1) and motor.current == pytest.approx(pressed, abs=0.1)
    assert motor.tension == int(0.8 * pressed) and motor.status_byte == 0x20


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


@pytest.mark.parametrize(("position", "status"), [(104.0, 0x51), (96.0, 0x51), (105.0, 0x41), (95.0, 0x41)])
def test_a_position_counts_as_reached_this_near(position, status):
    motor = at(position)
    motor.go_to(100)
    assert motor.status_byte == status
    run(motor, 0.2)
    assert (motor.position, motor.status_byte, motor.current) == (100.0, 0x50, 0.0)


def test_a_blocked_posture_keeps_pushing_below_the_trip():
    motor = at(90.0, contact=100.0)
    motor.go_to(200)
    run(motor, 5.0)
    assert motor.status_byte == 0x40
    assert motor.position == pytest.approx(132.0) and motor.current == pytest.approx(640.0)


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


@pytest.mark.parametrize(("tension", "stiffness", "end"), [(40, 20.0, 102.5), (0, 20.0, 100.0), (160, 1000.0, 100.2)])
def test_a_lower_tension_gives_way_until_it_is_reached(tension, stiffness, end):
    motor = at(105.0, contact=100.0, stiffness=stiffness)
    motor.pull(tension)
    run(motor, 1.5)
    assert motor.position == pytest.approx(end)
    assert motor.status_byte == (0x70 if tension else 0x60), "no tension is nothing to reach"


def test_no_tension_is_reached_without_contact():
    motor = at(0.0)
    motor.pull(0)
    run(motor, 0.5)
    assert motor.position > 100.0 and not motor.reached


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


def test_closing_to_a_current_gives_up_at_the_closed_end():
    motor = at(200.0)
    motor.close_to_current(200, stop_after=False)
    assert motor.status_byte == 0x81
    run(motor, 1.0)
    assert motor.status_byte == 0x04


def test_what_is_met_at_the_closed_end_counts():
    motor = at(240.0, contact=250.0, stiffness=40.0)
    motor.close_to_current(200, stop_after=False)
    run(motor, 1.0)
    assert motor.position == 255.0 and motor.status_byte == 0x94, "met and at the end"


def test_an_end_sensor_sees_the_end_alone_and_no_reading_is_beyond_it():
    assert [at(position).status_byte for position in (0.5, 254.5)] == [0x00, 0x00]
    assert [at(position).position_byte for position in (-5.0, 0.5, 254.5, 300.0)] == [0, 0, 254, 255]
    motor = at(200.0)
    motor.go_to(255)
    run(motor, 0.5)
    assert (motor.position_byte, motor.status_byte) == (255, 0x54), "no fault, so it does not read as 0"


def test_readings_have_ten_and_eight_bits():
    motor = at(200.0, contact=100.0, stiffness=1000.0)
    assert motor.tension == 1023 and motor.position_byte == 200
    motor.position = 99.6
    assert motor.effort == 0.0 and motor.position_byte == 100


def test_a_hard_object_is_held_after_a_fraction_of_a_count():
    motor = at(95.0, contact=100.0, stiffness=1000.0)
    motor.close_to_current(200, stop_after=False)
    run(motor, 0.5)
    assert motor.position == pytest.approx(100.2) and motor.status_byte == 0x90


def test_a_motor_that_is_held_at_its_open_end_draws_nothing():
    motor = at(0.0, contact=0.0)
    motor.pull(0)
    run(motor, 0.1)
    assert (motor.current, motor.status_byte) == (0.0, 0x68)
