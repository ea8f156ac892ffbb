"""What commands do to the emulated hand: grasps of both dialects, stored levels, waiting grasps, line faults."""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand


class Commanded:
    """A calibrated hand that is told bytes and waited for."""

    def __init__(self, **options: object) -> None:
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, **({"greeting": True} | options))

    def tell(self, text: str, then: float = 0.0) -> str:
        answers = self.hand.receive(bytes.fromhex(text))
        self.clock.sleep(then)
        self.hand.advance()
        return b"".join(answer for _, answer in answers).hex(" ").upper()

    @property
    def modes(self) -> list[str]:
        return [motor.mode for motor in self.hand.motors]

    @property
    def efforts(self) -> list[float]:
        return [motor.goal_effort for motor in self.hand.motors]


@pytest.fixture
def hand() -> Commanded:
    return Commanded()


HELD = [255, 100, 100, 100, 100]


@pytest.mark.parametrize(("code", "level"), [("60", 120), ("61", 240), ("62", 420)])
def test_a_grasp_by_current_closes_with_its_level(hand, code, level):
    hand.tell(code, then=1.3)
    assert hand.efforts == [0.0] + [float(level)] * 4
    assert hand.modes[1] == "current_position"


@pytest.mark.parametrize(("code", "level"), [("50", 100), ("51", 200), ("52", 350)])
def test_a_grasp_by_tension_closes_with_its_level(hand, code, level):
    hand.tell(code, then=1.3)
    assert set(hand.modes[1:]) == {"tension"} and hand.efforts[1:] == [float(level)] * 4


def test_a_hand_as_delivered_is_not_calibrated_and_loses_no_command():
    hand = Commanded(greeting=False)
    assert not EmulatedHand(SteppedClock()).calibrated
    hand.hand.calibrated = True
    hand.tell("48 0A 0A 0A 0A 0A 48 44 02 80")
    assert hand.hand.counters.too_fast == 0 and hand.hand.motors[2].target == 128.0


def test_levels_can_be_stored(hand):
    hand.tell("6D 01 2C 00 00 00 00 00 00 6D 5D 64 00 00 00 5D")
    hand.tell("61", then=1.3)
    assert hand.efforts[1:] == [300.0] * 4
    hand.tell("51", then=1.3)
    assert hand.efforts[1:] == [100.0] * 4


@pytest.mark.parametrize("kind", [1, 2, 3, 4, 5, 6])
def test_a_newer_grasp_closes_with_twice_its_strength(hand, kind):
    hand.tell(f"6F 0{kind} 50 14", then=1.3)
    assert {effort for effort in hand.efforts if effort} <= {160.0}
    known = any(hand.efforts)
    hand.tell("6F 0F 64 14", then=1.3)
    assert {effort for effort in hand.efforts if effort} == ({160.0} if known else set()), "no such type"


@pytest.mark.parametrize("instead", ["41", "C9 40", "4A 02 64", "44 02 0A", "4C", "48 0A 0A 0A 0A 0A 48"])
def test_another_command_before_the_preshape_is_reached_ends_the_grasp(hand, instead):
    hand.tell("61", then=0.05)
    hand.tell(instead, then=3.0)
    assert "current_position" not in hand.modes and hand.hand.motors[1].goal_effort == 0.0


def test_a_calibration_ends_what_the_fingers_did(hand):
    hand.tell("61", then=0.05)
    hand.tell("46")
    assert hand.modes == ["stop"] * 5 and hand.hand.calibrating
    hand.clock.sleep(5.0)
    hand.hand.advance()
    assert not hand.hand.calibrating and hand.modes == ["stop"] * 5
    assert [motor.position for motor in hand.hand.motors] == [0.0] * 5


def test_a_calibration_may_take_no_time_and_leaves_a_stuck_finger():
    hand = Commanded(calibration_scale=0.0, greeting=False, positions=[90] * 5)
    hand.hand.motors[3].stuck = True
    hand.tell("46")
    assert not hand.hand.calibrating and hand.hand.calibrated
    assert [motor.position for motor in hand.hand.motors] == [0.0, 0.0, 0.0, 90.0, 0.0]


@pytest.mark.parametrize("scale", [-0.001, 1000.1, float("nan")])
def test_a_calibration_of_odd_length_is_refused(scale):
    with pytest.raises(ValueError, match="calibration_scale must be 0..1000"):
        EmulatedHand(SteppedClock(), calibration_scale=scale)
    assert EmulatedHand(SteppedClock(), calibration_scale=1000.0).calibration_scale == 1000.0


def test_tension_is_not_set_where_there_is_no_sensor(hand):
    hand.tell("4A 00 64 4A 41 02")
    assert hand.modes == ["stop", "tension", "stop", "stop", "stop"]
    assert hand.hand.motors[1].goal_effort == 258.0


def test_a_relaxed_thumb_stands_where_it_is(hand):
    hand.tell("48 64 64 64 64 64 48", then=1.0)
    hand.tell("6F 00 50 14", then=0.1)
    assert hand.modes == ["stop", "speed", "speed", "speed", "speed"]
    assert hand.hand.motors[1].direction == -1 and hand.hand.motors[0].position == 100.0


def test_a_hand_in_the_cell_opens_at_full_speed_while_it_calibrates():
    hand = Commanded(physical=True)
    hand.tell("46")
    assert hand.hand.orders() == [(1.0, 0.0, 0.0)] * 5


def test_a_command_before_the_posture_is_executed_is_lost():
    hand = Commanded(enforce_spacing=True)
    hand.tell("48 00 00 00 00 00 48 44 02 80")
    assert hand.hand.motors[2].target == 0.0 and hand.hand.counters.too_fast == 1
    hand.clock.sleep(0.003)
    hand.tell("44 02 80")
    assert hand.hand.motors[2].target == 128.0 and hand.hand.counters.too_fast == 1


def test_nobody_answers_to_the_address_behind_the_last_motor(hand):
    assert hand.tell("45 05 4B 05 45 04") == "00" and hand.hand.counters.wrong_motor == 2
    hand.tell("44 05 64")
    assert hand.hand.counters.wrong_motor == 3 and hand.modes == ["stop"] * 5


@pytest.mark.parametrize(("positions", "stiffness"), [(4, 5), (5, 4), (6, 5)])
def test_a_contact_for_another_number_of_motors_is_refused(hand, positions, stiffness):
    with pytest.raises(ValueError, match=f"5 positions and stiffnesses; got {positions} and {stiffness}"):
        hand.hand.set_contacts([100.0] * positions, [1.0] * stiffness)


@pytest.mark.parametrize("motor", range(5))
@pytest.mark.parametrize(("way", "direction"), [(0x80, -1), (0xC0, 1)])
@pytest.mark.parametrize("speed", [1, 255, 256, 511])
def test_each_motor_is_driven_both_ways(motor, way, direction, speed):
    hand = Commanded(positions=[100] * 5)
    hand.tell(bytes((way + 4 * motor + (speed >> 8), speed & 0xFF)).hex())
    driven = hand.hand.motors[motor]
    assert hand.modes == ["speed" if other == motor else "stop" for other in range(5)]
    assert (driven.direction, driven.speed) == (direction, speed)


def test_readings_are_counted_and_clipped(hand):
    hand.hand.motors[2].current = 4000.0
    assert hand.tell("49 02 49 03 4B 01 45 01") == "03 FF 00 00 08 00"
    assert hand.hand.counters.requests == 4 and hand.hand.counters.wrong_motor == 0


def test_long_silence_is_made_up_in_steps_short_enough_for_contact(hand):
    hand.hand.set_contacts(HELD, [20] * 5)
    hand.tell("C8 80", then=60.0)
    assert hand.hand.motors[2].position == pytest.approx(100.0 + 1000.0 * 128 / 511 / 20.0)


@pytest.mark.parametrize(("contact", "stiffness"), [([0.0] * 5, [0.0] * 5), ([255.0] * 5, [1e6] * 5)])
def test_contacts_reach_from_the_open_end_to_free_and_from_soft_to_hard(hand, contact, stiffness):
    hand.hand.set_contacts(contact, stiffness)
    assert [motor.contact.position for motor in hand.hand.motors] == contact
    with pytest.raises(ValueError, match="stiffness 0..1e\\+06"):
        hand.hand.set_contacts(contact, [1.001e6] * 5)
    for wrong in (contact[0] - 256.0, contact[0] + 255.5):
        with pytest.raises(ValueError, match="for motor 0"):
            hand.hand.set_contacts([wrong] * 5, stiffness)


# -- faults of the line --------------------------------------------------------------------------


@pytest.fixture
def faults(hand) -> Faults:
    return Faults(hand.hand)


def test_a_line_without_a_fault_changes_nothing(faults):
    assert faults.incoming(b"ab") == faults.outgoing(b"ab") == b"ab"
    assert faults.take_stray() == b"" and faults.delay_s == 0.0


def test_bytes_are_lost_in_both_directions_and_then_no_more(faults):
    assert faults.command("lose 3") == "lose: next 3" and faults.command("lose_in 1") == "lose_in: next 1"
    assert [faults.outgoing(b"ab"), faults.outgoing(b"cd"), faults.outgoing(b"ef")] == [b"", b"d", b"ef"]
    assert [faults.incoming(b"ab"), faults.incoming(b"cd")] == [b"b", b"cd"]


def test_answers_are_doubled_and_silence_is_not(faults):
    assert faults.command("double 2") == "double: next 2"
    told = [faults.outgoing(answer) for answer in (b"a", b"", b"b", b"c")]
    assert told == [b"aa", b"", b"bb", b"c"]


def test_garbage_comes_once_and_not_from_a_mute_hand(faults):
    assert faults.command("garbage 5") == "garbage: 5 byte(s)"
    assert len(faults.take_stray()) == 5 and faults.take_stray() == b""
    assert faults.command("mute") == "the hand answers nothing"
    faults.command("garbage 5")
    assert faults.outgoing(b"a") == b"" and faults.take_stray() == b""


def test_clear_undoes_every_fault(faults, hand):
    told: list[object] = []
    faults.on_replug = lambda: told.append("replug")
    faults.on_unplug = told.append
    for command in ("lose 1", "lose_in 1", "double 1", "garbage 1", "slow 20", "mute", "stuck 2", "short 3", "wrap"):
        faults.command(command)
    assert faults.delay_s == 0.02 and hand.hand.motors[2].stuck
    assert all(motor.wrap and motor.short_by == 3 for motor in hand.hand.motors)
    assert faults.command("clear") == "no faults" and told == ["replug"]
    assert (faults.lose, faults.lose_in, faults.double, faults.delay_s, faults.mute, faults.stray) == (
        0,
        0,
        0,
        0.0,
        False,
        b"",
    )
    for motor in hand.hand.motors:
        assert (motor.stuck, motor.short_by, motor.wrap, motor.wrapped) == (False, 0, False, False)
    assert faults.outgoing(b"a") == b"a"


def test_a_cable_is_pulled_for_a_while_or_for_good(faults):
    told: list[object] = []
    faults.on_unplug, faults.on_replug = told.append, lambda: told.append("replug")
    for command in ("unplug", "unplug 0", "unplug 3600", "replug"):
        faults.command(command)
    assert told == [None, 0.0, 3600.0, "replug"]
    with pytest.raises(ValueError, match="no such fault"):
        faults.command("unplug 3600.1")
