"""When a movement counts as done, stalled, blocked or not taken: how long, and how near."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ih2_hand.errors import RefusedError
from ih2_hand.progress import (
    BLOCKED_S,
    LONGEST_S,
    STALL_S,
    START_GRACE_S,
    CloseTask,
    GraspTask,
    OpenTask,
    PreshapeTask,
    shown_empty,
    shown_holding,
)
from ih2_hand.reasons import Reason
from ih2_hand.status import decode_status

TARGETS = (110, 5, 160, 245, 245)


def poll(raws: str, positions) -> list[SimpleNamespace]:
    """Five motors from STATUS bytes in hex and positions."""
    motors = []
    for motor, raw in enumerate(bytes.fromhex(raws)):
        status = {key: bool(value) if value is None else value for key, value in decode_status(motor, raw).items()}
        motors.append(SimpleNamespace(**status, position=positions[motor]))
    return motors


def preshape(is_sent: bool = True) -> tuple[PreshapeTask, list]:
    """A preshape on its way, and what the driver was told."""
    told: list = []
    driver = SimpleNamespace(
        preshapes={"lateral": TARGETS},
        send_preshape=is_sent,
        set_grasp_mode=lambda *arguments: told.append(arguments),
        set_hand_posture=lambda posture: told.append(posture),
    )
    task = PreshapeTask("lateral", "high", False, 7.0)
    task.begin(driver)
    return task, told


@pytest.mark.parametrize(("speed", "seconds"), [(511, 5.0), (146, 10.0), (20, 54.1), (10, LONGEST_S), (1, LONGEST_S)])
def test_a_slower_movement_has_longer_but_no_more_than_a_minute(speed, seconds):
    assert OpenTask(speed).limit == CloseTask(speed).limit == pytest.approx(seconds, abs=0.01)


@pytest.mark.parametrize(
    ("speed", "words"), [(0, "speed 0 moves nothing; give 1..511"), (512, "speed must be 0..511"), (-1, "got -1")]
)
def test_a_speed_that_is_refused_is_refused_with_what_would_do(speed, words):
    with pytest.raises(RefusedError, match=words):
        CloseTask(speed)


@pytest.mark.parametrize(("speed", "seconds"), [(511, STALL_S), (21, STALL_S), (16, 0.5), (4, 2.0)])
def test_a_finger_that_stands_so_long_has_met_something(speed, seconds):
    task = CloseTask(speed)
    raws, positions = "08 20 04 04 04", [0, 90, 254, 254, 254]
    task.judge(poll(raws, positions), 0.0)
    verdict = task.judge(poll(raws, positions), seconds - 0.01)
    assert not verdict.done and verdict.text == "thumb moving" and verdict.status_code is Reason.HAND_MOVING
    verdict = task.judge(poll(raws, positions), seconds)
    assert verdict.done and verdict.ok and verdict.stop and verdict.status_code is Reason.NONE


def test_a_finger_that_moved_on_has_not_stood():
    task = CloseTask(511)
    task.judge(poll("08 20 04 04 04", [0, 90, 254, 254, 254]), 0.0)
    task.judge(poll("08 20 04 04 04", [0, 91, 254, 254, 254]), 0.3)
    assert not task.judge(poll("08 20 04 04 04", [0, 91, 254, 254, 254]), 0.5).done
    assert task.judge(poll("08 20 04 04 04", [0, 91, 254, 254, 254]), 0.71).done


def test_the_thumbs_abduction_takes_no_part_in_closing():
    task = CloseTask(511)
    verdict = task.judge(poll("00 04 04 04 04", [90, 254, 254, 254, 254]), 9.0)
    assert verdict.ok and verdict.holding is False
    told: list = []
    task.begin(SimpleNamespace(move_motor=lambda *arguments: told.append(arguments)))
    OpenTask(300).begin(SimpleNamespace(move_motor=lambda *arguments: told.append(arguments)))
    assert told == [(m, 511, True) for m in (1, 2, 3, 4)] + [(m, 300, False) for m in (0, 1, 2, 3, 4)]


@pytest.mark.parametrize("task", [OpenTask(511), CloseTask(511)])
def test_a_command_has_half_a_second_to_be_taken(task):
    raws, positions = "00 00 00 00 00", [90] * 5
    assert not task.judge(poll(raws, positions), START_GRACE_S - 0.01).done
    verdict = task.judge(poll(raws, positions), START_GRACE_S)
    assert verdict.done and not verdict.ok and verdict.reason is Reason.HAND_STALLED
    assert "index, middle, ring and little" in verdict.text


@pytest.mark.parametrize("is_sent", [True, False])
def test_a_preshape_is_sent_once_by_the_driver_or_by_the_task(is_sent):
    task, told = preshape(is_sent)
    assert told == [("lateral", "high", False)] + ([] if is_sent else [TARGETS])
    assert task.limit == 7.0


@pytest.mark.parametrize("beside", [-12, 12])
def test_a_preshape_may_end_this_far_beside(beside):
    task, _ = preshape()
    farther = beside + (1 if beside > 0 else -1)
    assert not task.judge(poll("50 50 50 50 50", [110, 5, 160 + farther, 245, 245]), 1.0).done
    assert task.judge(poll("50 50 50 50 50", [110, 5, 160 + beside, 245, 245]), 1.1).ok


def test_a_preshape_is_blocked_by_a_finger_that_stands_for_a_second():
    task, _ = preshape()
    raws, positions = "50 50 40 50 50", [110, 5, 100, 245, 245]
    assert not task.judge(poll(raws, positions), 0.0).done
    assert task.judge(poll(raws, positions), BLOCKED_S - 0.01).text == "index moving"
    verdict = task.judge(poll(raws, positions), BLOCKED_S)
    assert verdict.done and verdict.stop and verdict.reason is Reason.HAND_STALLED


def test_a_preshape_ended_by_over_current_says_where():
    task, _ = preshape()
    verdict = task.judge(poll("50 50 02 50 50", [110, 5, 100, 245, 245]), 0.1)
    assert verdict.done and not verdict.ok and verdict.stop and verdict.reason is Reason.HAND_STALLED
    assert verdict.text == "index stopped by over-current at 100 of 160"


def test_a_preshape_has_half_a_second_to_be_taken():
    task, _ = preshape()
    assert not task.judge(poll("50 50 00 50 50", [110, 5, 100, 245, 245]), START_GRACE_S - 0.01).done
    verdict = task.judge(poll("50 50 00 50 50", [110, 5, 100, 245, 245]), START_GRACE_S)
    assert verdict.done and not verdict.ok and verdict.reason is Reason.HAND_NOT_CALIBRATED


def grasp(closing=(1, 2)) -> GraspTask:
    task = GraspTask(closing, 7.0)
    task.begin(SimpleNamespace(grasp_mode_close=lambda: None))
    assert task.limit == 7.0
    return task


def test_a_grasp_that_does_not_begin_is_given_a_second():
    task = grasp()
    for elapsed in (0.0, BLOCKED_S - 0.01):
        assert task.judge(poll("50 40 40 50 50", [9] * 5), elapsed).text == "taking the preshape"
    task.judge(poll("50 40 40 50 50", [9, 9, 10, 9, 9]), BLOCKED_S)
    assert not task.judge(poll("50 40 40 50 50", [9, 9, 10, 9, 9]), BLOCKED_S + 0.01).done, "one still moves"
    verdict = task.judge(poll("50 40 40 50 50", [9, 9, 10, 9, 9]), 2.0 * BLOCKED_S)
    assert verdict.done and not verdict.ok and verdict.stop and verdict.reason is Reason.HAND_NOT_CALIBRATED


@pytest.mark.parametrize(("raws", "ok"), [("50 04 04 50 50", True), ("50 04 50 50 50", False)])
def test_fingers_that_stand_closed_have_met_nothing(raws, ok):
    task = grasp()
    task.judge(poll(raws, [9] * 5), 0.0)
    verdict = task.judge(poll(raws, [9] * 5), BLOCKED_S)
    assert verdict.done and verdict.ok is ok and verdict.holding is (False if ok else None)


def test_a_grasp_begun_anew_waits_for_the_hand_to_take_the_preshape_again():
    task = grasp()
    assert task.judge(poll("50 c1 c1 50 50", [0, 90, 90, 0, 0]), 0.2).text == "thumb, index closing"
    task.begin(SimpleNamespace(grasp_mode_close=lambda: None))
    assert task.judge(poll("50 00 00 50 50", [0, 90, 90, 0, 0]), 0.3).text == "taking the preshape"


def test_a_finger_that_stands_while_it_closes_holds_after_a_second():
    task = grasp()
    raws, positions = "50 c0 04 50 50", [0, 90, 254, 0, 0]
    task.judge(poll(raws, positions), 0.0)
    assert task.judge(poll(raws, positions), BLOCKED_S - 0.01).text == "thumb closing"
    verdict = task.judge(poll(raws, positions), BLOCKED_S)
    assert verdict.ok and verdict.holding and verdict.text == "holding: thumb met the object"


@pytest.mark.parametrize("raw", ["02", "12", "50"])
def test_over_current_ends_a_grasp_and_the_preshape_of_a_finger_does_not(raw):
    task = grasp()
    task.judge(poll("50 c1 d0 50 50", [0, 90, 90, 0, 0]), 0.1)
    verdict = task.judge(poll(f"50 {raw} d0 50 50", [0, 90, 90, 0, 0]), 0.2)
    assert verdict.done is (raw != "50") and verdict.holding is (True if verdict.done else None)


def test_a_grip_is_shown_by_a_finger_at_its_force_before_the_end():
    for raw, shown in (("d0", True), ("70", True), ("90", True), ("d4", False), ("c0", False), ("50", False)):
        assert shown_holding(poll(f"50 08 {raw} 08 08", [0, 0, 90, 0, 0])) is shown, raw
    assert not shown_holding(poll("d0 08 08 08 08", [90, 0, 0, 0, 0])), "the abduction holds nothing"
    assert not shown_empty(poll("50 08 08 08 e8", [90, 0, 0, 0, 0])), "a motor that cannot be read proves nothing"
