"""The driver on the emulated hand, in virtual time."""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.errors import (
    HandCalibratingError,
    HandCalibrationError,
    HandConnectionLost,
    HandPortError,
)


def test_postures_are_spaced(make_bench):
    bench = make_bench(enforce_spacing=True)
    for position in range(20):
        bench.driver.set_hand_posture([position] * 5)
    bench.driver.move_motor(1, 100, True)
    assert bench.hand.counters.too_fast == 0
    assert bench.clock.now >= 20 * 0.003


def test_calibration_that_never_ends(make_bench):
    bench = make_bench(calibration_scale=100.0)
    with pytest.raises(HandCalibrationError, match="10 s"):
        bench.driver.calibration("fast")
    assert not bench.driver.calibrating


def test_calibration_with_a_blocked_finger(make_bench):
    bench = make_bench(greeting=False, positions=[90] * 5)
    bench.hand.motors[3].stuck = True
    with pytest.raises(HandCalibrationError, match=r"motor\(s\) 3\b"):
        bench.driver.calibration("fast")


@pytest.mark.parametrize("dialect", ["legacy", "v17"])
def test_grasp_holds_an_object(make_bench, dialect):
    bench = make_bench(dialect=dialect)
    bench.hand.set_contacts([255, 100, 100, 100, 100], [20] * 5)
    bench.driver.set_grasp_mode("cylindrical", "high")
    bench.clock.sleep(1.5)
    bench.driver.grasp_mode_close()
    bench.clock.sleep(2.0)
    for status in bench.driver.get_all_finger_status()[1:]:
        assert (status["mode"], status["target_reached"]) == ("stop", True)
    assert bench.driver.get_finger_force(2) > 0


def test_bus_error_says_nothing_else(bench):
    bench.link.to_host = lambda data: b"\xff" if len(data) == 1 else data
    status = bench.driver.get_finger_status(1)
    assert status["com_error"] and status["mode"] == "bus_error"
    assert status["target_reached"] is None and status["moving"] is None


def test_resynchronisation_completes_what_the_hand_waits_for(bench):
    for stump in ("44", "44 02", "48 01 02", "5F", "5F 01 24 00", "45", "80", "6C 00 00", "6F"):
        bench.hand.receive(bytes.fromhex(stump))
        bench.driver.line.resynchronise("test")
        assert bench.hand.parser.waiting == b"", stump
        assert bench.driver.get_finger_status(2)["mode"] == "stop"
        assert bench.driver.get_finger_position(2) == 0


def link_that_loses(count: int) -> VirtualLink:
    clock = SteppedClock()
    hand = EmulatedHand(clock, greeting=True)
    return VirtualLink(hand, clock, faults=Faults(hand, lose=count))


def opened(link: VirtualLink, **options: object) -> HandSerialDriver:
    return HandSerialDriver(transport=link, clock=link.hand.clock, **options)


def test_one_lost_answer_does_not_keep_the_port_from_being_opened():
    driver = opened(link_that_loses(1))
    assert driver.get_finger_status(0)["mode"] == "stop" and driver.counters.fillers == 0


def test_port_without_answer_is_closed():
    link = link_that_loses(2)
    with pytest.raises(HandPortError, match="virtual"):
        opened(link)
    assert not link.plugged and bytes(link.sent).endswith(bytes.fromhex("4B 00 4B 00"))


def test_a_port_is_closed_with_its_block():
    link = link_that_loses(0)
    with opened(link) as driver:
        assert driver.get_finger_position(1) == 0 and driver.last_byte == 0
        assert driver.get_finger_status(1)["raw"] == driver.last_byte == 0x08
        assert link.plugged
    assert not link.plugged
    with pytest.raises(HandConnectionLost):
        driver.get_finger_position(1)
    with pytest.raises(HandConnectionLost, match="virtual"):
        link.pending()


def test_unrequested_bytes_are_flushed_before_a_request(bench):
    bench.link.write(bytes.fromhex("45 01"))  # nobody reads the position that it returns
    assert bench.driver.get_finger_status(1)["raw"] == 0x08
    assert bench.driver.counters.reasons == {"bytes without a request": 1}


# -- what is known of a hand at rest ---------------------------------------------------------------


def test_a_hand_rests_when_all_five_motors_have_been_seen_to(bench):
    for motor in range(4):
        bench.driver.get_finger_status(motor)
        assert not bench.driver.line.resting
    bench.driver.get_finger_status(3)
    assert not bench.driver.line.resting, "the same one twice"
    bench.driver.get_finger_status(4)
    assert bench.driver.line.resting
    bench.hand.motors[1].drive(100, close=True)
    bench.driver.get_finger_status(1)
    assert not bench.driver.line.resting


# -- calibration ---------------------------------------------------------------------------------


def test_while_it_calibrates_the_driver_says_so_and_refuses(make_bench):
    bench = make_bench(greeting=False)
    seen: list[bool] = []
    answers = bench.driver.line.answers

    def look(frame: bytes, length: int) -> bool:
        seen.append(bench.driver.calibrating)
        for request in (lambda: bench.driver.move_motor(1, 100, True), lambda: bench.driver.get_finger_position(1)):
            with pytest.raises(HandCalibratingError):
                request()
        return answers(frame, length)

    bench.driver.line.answers = look
    assert not bench.driver.calibrating
    bench.driver.calibration("fast")
    assert seen and all(seen) and not bench.driver.calibrating


def test_a_calibration_has_ended_with_two_answers_in_a_row(make_bench):
    bench = make_bench(greeting=False)
    answers = iter([False, True, False, True, True])
    asked: list[bytes] = []
    bench.driver.line.answers = lambda frame, length: asked.append(frame) or next(answers)
    bench.hand.calibration_scale = 0.0
    bench.driver.calibration("fast")
    assert asked == [b"\x4b\x02"] * 5 and next(answers, None) is None
