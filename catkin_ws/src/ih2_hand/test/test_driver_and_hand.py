"""Driver and emulated hand together in virtual time: pacing, calibration, grasps, slips."""

from __future__ import annotations

import pytest
from ih2_hand.errors import HandCalibrationError, HandInconsistentError
from ih2_hand.wire_choices import TABLE, WIRE


def test_postures_are_spaced(make_bench):
    bench = make_bench(enforce_spacing=True)
    for position in range(20):
        bench.driver.set_hand_posture([position] * 5)
    bench.driver.move_motor(1, 100, True)
    assert bench.hand.counters.too_fast == 0
    assert bench.clock.now >= 20 * 0.003


def test_opening_takes_no_longer_than_bringing_the_line_in_step(bench):
    assert WIRE.resync_wait_s < bench.clock.now < 0.05


def test_calibration_polls_until_the_hand_answers(make_bench):
    bench = make_bench(greeting=False, positions=[90] * 5)
    bench.driver.calibration("fast")
    assert 1.5 <= bench.clock.now < 2.1
    assert bench.hand.calibrated
    bench.driver.calibration("complete")
    assert 11.5 <= bench.clock.now < 12.7


def test_calibration_that_never_ends(make_bench):
    bench = make_bench(calibration_scale=100.0)
    with pytest.raises(HandCalibrationError, match="did not answer within 10 s"):
        bench.driver.calibration("fast")
    assert not bench.driver.calibrating


def test_calibration_with_a_blocked_finger(make_bench):
    bench = make_bench(greeting=False, positions=[90] * 5)
    bench.hand.motors[3].stuck = True
    with pytest.raises(HandCalibrationError, match=r"motor\(s\) 3 not fully open"):
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
    assert bench.driver.grasp_mode == ("cylindrical", "high")


def test_read_motors_has_every_field(bench):
    readings = bench.driver.read_motors()
    assert [reading["force"] for reading in readings] == [-1, 0, 0, 0, 0]
    assert set(readings[0]) == {
        "motor",
        "raw",
        "mode",
        "mode_code",
        "target_reached",
        "fully_open",
        "fully_closed",
        "over_current",
        "moving",
        "com_error",
        "position",
        "force",
        "current",
    }


def test_bus_error_says_nothing_else(bench):
    bench.link.to_host = lambda data: b"\xff" if len(data) == 1 else data
    status = bench.driver.get_finger_status(1)
    assert status["com_error"] and status["mode"] == "bus_error"
    assert status["target_reached"] is None and status["moving"] is None


def test_contradicting_readings_are_an_error(bench):
    values = iter(range(0, 100000, 50))
    bench.link.to_host = lambda data: bytes((next(values) % 256,)) if len(data) == 1 else data
    with pytest.raises(HandInconsistentError, match="contradict each other"):
        bench.driver.get_raw_position(2)
    assert bench.driver.counters.resynchronisations >= 1


def test_resynchronisation_completes_what_the_hand_waits_for(bench):
    for stump in ("44", "44 02", "48 01 02", "5F", "5F 01 24 00", "45", "80", "6C 00 00", "6F"):
        bench.hand.receive(bytes.fromhex(stump))
        bench.driver.line.resynchronise("test")
        assert bench.hand.parser.waiting == b"", stump
        assert bench.driver.get_finger_status(2)["mode"] == "stop"
        assert bench.driver.get_finger_position(2) == 0


def test_resting_hand_is_asked_once_for_each_value(bench):
    bench.driver.read_motors()
    bench.driver.read_motors()
    bench.sent()
    bench.driver.read_motors()
    assert len(bench.sent().split()) == 5 * 6 + 4


def test_every_wire_choice_is_there_once():
    ids = {choice.id for choice in TABLE}
    assert {f"W{number}" for number in range(1, 30)} <= ids
    names = [choice.name for choice in TABLE]
    assert len(set(names)) == len(names)
    assert len(WIRE.resync_filler) == 13 and set(WIRE.resync_filler) == {0x41}
