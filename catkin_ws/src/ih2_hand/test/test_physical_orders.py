"""One motor turned by the physics: what it orders in each mode, and what it makes of what it is told."""

from __future__ import annotations

import pytest
from ih2_hand.emulator.physical_motor import MotorState, PhysicalMotor


def told(motor: PhysicalMotor, position: float, current: float = 0.0, effort: float = 0.0, **flags: bool) -> None:
    state = MotorState(position, current, effort, **({"moving": False, "locked": False} | flags))
    state.check()
    motor.follow(state)
    motor.advance(0.005)


@pytest.fixture
def motor() -> PhysicalMotor:
    motor = PhysicalMotor(2)
    told(motor, 0.4)
    return motor


def test_a_motor_just_switched_on_stands():
    motor = PhysicalMotor(2, 51.0)
    assert motor.order() == (0.0, 0.2, 0.0)
    assert (motor.effort, motor.tension, motor.current, motor.status_byte) == (0.0, 0, 0.0, 0x00)
    assert motor.state == MotorState(0.2, 0.0, 0.0, False, False)


@pytest.mark.parametrize(
    ("speed", "close", "order"), [(511, True, (1.0, 1.0, 1040.0)), (511, False, (1.0, 0.0, 1040.0))]
)
def test_a_drive_goes_to_the_end_with_all_its_current(motor, speed, close, order):
    motor.drive(speed, close)
    assert motor.order() == order


def test_a_slower_drive_presses_less(motor):
    motor.drive(128, True)
    assert motor.order() == pytest.approx((128 / 511, 1.0, 40.0 + 1000.0 * 128 / 511))


def test_a_position_is_gone_to_at_full_speed(motor):
    motor.go_to(204)
    assert motor.order() == pytest.approx((1.0, 0.8, 640.0))
    motor.short_by = 4
    assert motor.order() == pytest.approx((1.0, 200 / 255, 640.0))


def test_current_and_tension_are_closed_to(motor):
    motor.close_to_current(200, stop_after=False)
    assert motor.order() == (1.0, 1.0, 240.0)
    motor.pull(80)
    assert motor.order() == pytest.approx((1.0, 1.0, 140.0))


@pytest.mark.parametrize("why", ["stopped", "stuck", "reached"])
def test_what_stands_is_ordered_to_stand_where_it_is(motor, why):
    motor.close_to_current(200, stop_after=False)
    if why == "stopped":
        motor.stop()
    elif why == "stuck":
        motor.stuck = True
    else:
        told(motor, 0.4, locked=True)
        assert motor.reached
    assert motor.order() == (0.0, pytest.approx(0.4), 0.0)


@pytest.mark.parametrize(
    ("share", "position"),
    [(0.0, 0.0), (0.0009, 0.0), (0.0015, 0.3825), (0.9985, 254.6175), (0.9991, 255.0), (1.0, 255.0)],
)
def test_an_end_sensor_sees_the_last_thousandth(motor, share, position):
    told(motor, share)
    assert motor.position == pytest.approx(position)


@pytest.mark.parametrize(("close", "before", "end", "status"), [(True, 0.9, 1.0, 0x04), (False, 0.1, 0.0, 0x08)])
def test_a_drive_ends_at_its_own_end(motor, close, before, end, status):
    told(motor, 1.0 - end)
    motor.drive(511, close)
    told(motor, 1.0 - end, current=100.0, moving=True)
    assert motor.mode == "speed" and motor.current == 100.0
    told(motor, before, current=100.0, moving=True)
    assert motor.status_byte == 0x21
    told(motor, end)
    assert (motor.mode, motor.status_byte, motor.current) == ("stop", status, 0.0)


def test_a_position_is_reached_by_where_the_motor_is_and_not_by_being_locked(motor):
    motor.go_to(204)
    told(motor, 0.5, locked=True)
    assert motor.status_byte == 0x40
    told(motor, 0.8)
    assert motor.status_byte == 0x50


@pytest.mark.parametrize(("begin", "ends"), [("current", True), ("tension", False)])
def test_closing_ends_at_the_closed_end_without_having_met_anything(motor, begin, ends):
    motor.pull(80) if begin == "tension" else motor.close_to_current(200, stop_after=False)
    told(motor, 0.9, locked=False)
    assert not motor.reached and motor.mode == begin
    told(motor, 1.0, locked=True)
    assert not motor.reached and (motor.mode == "stop") is ends


def test_what_was_reached_stays_reached_and_ends_a_while_later(motor):
    motor.close_to_current(200, stop_after=True)
    told(motor, 0.5, current=200.0, effort=160.0, locked=True)
    assert motor.status_byte == 0xD0 and motor.tension == 128
    for _ in range(38):
        told(motor, 0.5, current=10.0, effort=160.0)
    assert motor.status_byte == 0xD0
    for _ in range(3):
        told(motor, 0.5, current=10.0, effort=160.0)
    assert (motor.status_byte, motor.current, motor.tension) == (0x10, 0.0, 128)


def test_too_much_current_for_a_second_switches_off(motor):
    motor.drive(511, True)
    for _ in range(199):
        told(motor, 0.4, current=731.0)
    assert motor.mode == "speed"
    for _ in range(3):
        told(motor, 0.4, current=731.0)
    assert motor.status_byte == 0x02


@pytest.mark.parametrize("field", ["position", "current", "effort"])
def test_figures_that_no_motor_can_have_are_refused_by_name(field):
    most = 1.0 if field == "position" else 1e4
    good = MotorState(0.5, 1.0, 1.0, False, False)
    for value in (0.0, most):
        good._replace(**{field: value}).check()
    for value in (-0.001, 1.0001 * most, float("nan")):
        with pytest.raises(ValueError, match=f"{field} of a motor must be 0..{most:g}; got {value}"):
            good._replace(**{field: value}).check()
