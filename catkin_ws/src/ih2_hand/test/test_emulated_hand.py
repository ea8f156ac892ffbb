"""The emulated hand against raw bytes: framing, status walks, calibration, contact, faults."""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.wire_choices import WIRE


class Raw:
    """A hand with requests and answers in hex."""

    def __init__(self, **options):
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, **({"greeting": True} | options))

    def ask(self, text: str) -> str:
        answers = self.hand.receive(bytes.fromhex(text))
        return b"".join(answer for _, answer in answers).hex(" ").upper()

    def tell(self, text: str, then: float = 0.0) -> None:
        """Send bytes, and let so many seconds pass."""
        self.ask(text)
        self.clock.sleep(then)
        self.hand.advance()

    @property
    def modes(self) -> list[str]:
        return [motor.mode for motor in self.hand.motors]

    def status(self, motor: int) -> str:
        return self.ask(f"4B 0{motor}")

    def walk(self, motor: int, seconds: float, step: float = 0.01) -> list[str]:
        """Different STATUS bytes in the order they appear."""
        seen: list[str] = []
        for _ in range(round(seconds / step)):
            status = self.status(motor)
            if not seen or seen[-1] != status:
                seen.append(status)
            self.clock.sleep(step)
        return seen


@pytest.fixture(name="hand")
def _hand(raw: Raw) -> Raw:
    return raw


@pytest.fixture
def raw() -> Raw:
    return Raw()


UNASSIGNED = (0x40, 0x4D, 0x72, 0x7F)


def test_incomplete_frame_waits_for_ever(raw):
    assert raw.ask("45") == ""
    raw.clock.sleep(3600.0)
    assert raw.ask("02") == "00"


def test_wrong_closing_byte_drops_the_frame(raw):
    raw.ask("48 64 64 64 64 64 49")
    assert raw.hand.parser.counters.bad_closing == 1
    raw.clock.sleep(1.0)
    assert raw.ask("45 02") == "00"
    raw.ask("5F 01 61 00 64 02")
    assert raw.hand.parser.counters.bad_closing == 2


@pytest.mark.parametrize("byte", [f"{value:02X}" for value in UNASSIGNED])
def test_unknown_first_byte_is_dropped_alone(raw, byte):
    assert raw.ask(f"{byte} 4B 00") == "08"
    assert raw.hand.parser.counters.unknown == 1


def test_motor_above_four_is_consumed_silently(raw):
    assert raw.ask("45 07 4B 09 C5") == ""
    assert raw.hand.counters.wrong_motor == 2
    assert raw.ask("FF 4B 00") == "08"


def test_force_of_motor_0():
    assert Raw().ask("00") == "00 00"
    assert Raw(strict_force=True).ask("00 4B 00") == "08"


def test_newer_grasp_byte_in_strict_legacy_runs_its_arguments():
    strict = Raw(dialect="legacy")
    assert strict.ask("6F 04 C8 14") == "00 00"  # 04 reads a force, C8 14 drives motor 2
    assert strict.status(2) == "29"
    assert Raw(dialect="both").ask("6F 04 C8 14") == ""


def test_position_move_walk(raw):
    raw.ask("44 02 80")
    assert raw.walk(2, 1.0) == ["49", "41", "51", "50"]
    assert raw.ask("45 02") == "80"


def test_grasp_walk_on_an_object(raw):
    raw.hand.set_contacts([255, 100, 100, 100, 100], [20] * 5)
    raw.ask("61")
    assert raw.walk(2, 2.5, step=0.001)[-4:] == ["C1", "D1", "D0", "10"]
    assert raw.ask("45 02") == "70"  # 240 counts of current at 20 counts per count beyond 100
    assert raw.status(0) == "50", "the thumb's abduction only takes the preshape"


def test_stop_keeps_the_grip(raw):
    raw.hand.set_contacts([255, 255, 100, 255, 255], [20] * 5)
    raw.ask("C9 80")
    raw.clock.sleep(2.0)
    raw.ask("41")
    before = raw.hand.motors[2].effort
    assert raw.status(2) == "00"
    raw.clock.sleep(1.0)
    raw.hand.advance()
    assert raw.hand.motors[2].effort == before > 0.0


def test_open_all_leaves_the_abduction(raw):
    raw.ask("48 64 64 64 64 64 48")
    raw.clock.sleep(1.0)
    raw.ask("4C")
    raw.clock.sleep(1.5)
    assert [raw.ask(f"45 0{motor}") for motor in range(5)] == ["64", "00", "00", "00", "00"]


@pytest.mark.parametrize(("code", "seconds"), [("46", 1.5), ("42", 10.0)])
def test_calibration_discards_everything(code, seconds):
    raw = Raw(greeting=False, positions=[200] * 5)
    raw.ask(code)
    raw.clock.sleep(seconds - 0.01)
    assert raw.ask("4B 02 41") == ""
    assert raw.hand.counters.discarded == 3
    raw.clock.sleep(0.02)
    assert [raw.status(motor) for motor in range(5)] == ["08"] * 5
    assert [raw.ask(f"45 0{motor}") for motor in range(5)] == ["00"] * 5
    assert raw.hand.calibrated


def test_uncalibrated_hand_ignores_positions_but_answers():
    raw = Raw(greeting=False)
    raw.ask("44 02 80 48 64 64 64 64 64 48 61")
    raw.clock.sleep(1.0)
    assert raw.ask("45 02 4B 02") == "00 08"
    assert raw.hand.counters.ignored_uncalibrated == 3
    raw.ask("C9 FF")
    assert raw.status(2) == "29"


def test_stored_preshape_is_used(raw):
    raw.ask("58 0A 14 1E 28 32 58 61")
    raw.clock.sleep(0.15)
    raw.hand.advance()
    assert [motor.target for motor in raw.hand.motors] == [10, 20, 30, 40, 50]


@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.15, 0.3])
@pytest.mark.parametrize("then", ["48 0A 14 1E 28 32 48", "44 02 1E", "4B 00"])
def test_command_two_seconds_after_calibration_start_is_executed(late_s, then):
    """As published drivers do. A busy machine may bring it the order late; the client waits from
    when it has written."""
    raw = Raw(greeting=False)
    raw.clock.sleep(late_s)
    raw.ask("46")
    raw.clock.sleep(2.0 - late_s)
    assert raw.ask(then) == ("08" if then.startswith("4B") else "")
    assert raw.hand.counters.discarded == 0
    raw.clock.sleep(2.0)
    raw.hand.advance()
    if not then.startswith("4B"):
        assert raw.hand.motors[2].position == pytest.approx(30.0, abs=WIRE.reached_counts)


def test_a_relaxed_hand_gives_way(raw):
    raw.hand.set_contacts([255, 100, 100, 100, 100], [25.0] * 5)
    raw.ask("61")
    raw.walk(2, 3.0)
    assert all(motor.effort > 200.0 for motor in raw.hand.motors[1:])
    raw.ask("6F 00 50 14")
    raw.clock.sleep(0.3)
    raw.hand.advance()
    assert all(motor.effort < 1.0 for motor in raw.hand.motors[1:])
    raw.clock.sleep(3.0)
    raw.hand.advance()
    assert [motor.position for motor in raw.hand.motors[1:]] == [0.0] * 4
    assert [raw.status(motor) for motor in range(1, 5)] == ["08"] * 4


@pytest.mark.parametrize(
    "positions, stiffness",
    [
        ([100] * 5, [float("inf")] * 5),
        ([100] * 5, [float("nan")] * 5),
        ([100] * 5, [-1.0] * 5),
        ([100] * 5, [1e300] * 5),
        ([float("nan")] * 5, [1.0] * 5),
        ([-1] * 5, [1.0] * 5),
        ([256] * 5, [1.0] * 5),
        ([], []),
        ([100] * 1000, [1.0] * 1000),
    ],
)
def test_no_contact_can_break_the_hand(raw, positions, stiffness):
    with pytest.raises(ValueError, match="contact"):
        raw.hand.set_contacts(positions, stiffness)
    raw.ask("61")
    assert len(raw.walk(2, 2.0)) > 1


NO_FAULTS = ["", " ", "unplug nan", "unplug -1", "unplug inf", "lose -1", "garbage 99999999999999999999", "stuck x"]


@pytest.mark.parametrize("command", [*NO_FAULTS, "x" * 100_000])
def test_no_fault_command_can_break_the_hand(raw, command):
    with pytest.raises(ValueError, match="fault"):
        Faults(raw.hand).command(command)


HELD = [255, 100, 100, 100, 100]


@pytest.mark.parametrize("instead", ["41", "C9 40", "4A 02 64", "44 02 0A", "4C", "48 0A 0A 0A 0A 0A 48"])
def test_another_command_before_the_preshape_is_reached_ends_the_grasp(hand, instead):
    hand.tell("61", then=0.05)
    hand.tell(instead, then=3.0)
    assert "current_position" not in hand.modes and hand.hand.motors[1].goal_effort == 0.0


# -- faults of the line --------------------------------------------------------------------------


@pytest.fixture
def faults(hand) -> Faults:
    return Faults(hand.hand)


def test_clear_undoes_every_fault(faults, hand):
    told: list[object] = []
    faults.on_replug = lambda: told.append("replug")
    faults.on_unplug = told.append
    for command in ("lose 1", "lose_in 1", "double 1", "garbage 1", "slow 20", "mute", "stuck 2", "short 3", "wrap"):
        faults.command(command)
    assert faults.delay_s == 0.02 and hand.hand.motors[2].stuck
    assert all(motor.wrap and motor.short_by == 3 for motor in hand.hand.motors)
    assert faults.command("clear") and told == ["replug"]
    for motor in hand.hand.motors:
        assert (motor.stuck, motor.short_by, motor.wrap, motor.wrapped) == (False, 0, False, False)
    assert faults.outgoing(b"a") == b"a"
