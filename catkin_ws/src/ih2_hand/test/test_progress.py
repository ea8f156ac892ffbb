"""Verdicts of tasks (done, stalled, blocked, not accepted) on hand-written polls of the motors."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ih2_hand.errors import RefusedError
from ih2_hand.grasps import check_grasp
from ih2_hand.progress import (
    BLOCKED_S,
    STALL_S,
    START_GRACE_S,
    CloseTask,
    GraspTask,
    OpenTask,
    PreshapeTask,
    refuse_calibration,
    shown_empty,
    shown_holding,
)
from ih2_hand.reasons import Reason
from ih2_hand.status import decode_status


def poll(raws: str, positions: list[int]) -> list[SimpleNamespace]:
    """Five motors from STATUS bytes in hex and positions."""
    motors = []
    for motor, raw in enumerate(bytes.fromhex(raws)):
        status = {key: bool(value) if value is None else value for key, value in decode_status(motor, raw).items()}
        motors.append(SimpleNamespace(**status, position=positions[motor]))
    return motors


@pytest.mark.parametrize("raw", ["02", "20"])
def test_close_on_an_object_counts_as_closed(raw):
    task = CloseTask(300)
    raws = f"08 04 {raw} 04 04"
    positions = [0, 254, 130, 254, 254]
    task.judge(poll(raws, positions), 0.1)
    verdict = task.judge(poll(raws, positions), 0.6)
    assert verdict.done and verdict.ok and verdict.holding and "index" in verdict.text


def preshape() -> PreshapeTask:
    task = PreshapeTask("lateral", "high", True, 10.0)
    task.targets = (110, 5, 160, 245, 245)
    return task


def test_an_old_reached_bit_is_not_believed():
    task = preshape()
    assert not task.judge(poll("50 50 50 50 50", [0, 0, 0, 0, 0]), 0.05).done


def test_grasp_ends_at_force():
    task = GraspTask((1, 2, 3), 10.0)
    assert not task.judge(poll("50 50 50 50 50", [0] * 5), 0.1).done
    assert not task.judge(poll("50 c1 c1 c1 50", [0] * 5), 0.2).done
    assert not task.judge(poll("50 d0 10 c1 50", [0, 90, 90, 80, 0]), 0.4).done
    verdict = task.judge(poll("50 10 10 d0 50", [0, 90, 90, 90, 0]), 0.5)
    assert verdict.done and verdict.ok and verdict.holding


def test_grasp_by_tension_keeps_regulating():
    task = GraspTask((1, 2), 10.0)
    verdict = task.judge(poll("50 70 70 50 50", [0, 90, 90, 0, 0]), 0.5)
    assert verdict.done and verdict.ok and verdict.holding and not verdict.stop


def test_grasp_interrupted_by_a_stop():
    task = GraspTask((1,), 10.0)
    task.judge(poll("50 c1 50 50 50", [0, 90, 0, 0, 0]), 0.3)
    verdict = task.judge(poll("00 00 00 00 00", [0, 95, 0, 0, 0]), 0.4)
    assert verdict.done and not verdict.ok and "interrupted" in verdict.text


def test_bus_error_ends_every_task():
    verdict = OpenTask(100).judge(poll("08 e0 08 08 08", [0] * 5), 0.1)
    assert verdict.done and verdict.reason is Reason.DRIVE_ERROR and "thumb" in verdict.text


FREE = {"calibrated": False, "holding": False, "busy": None}


@pytest.mark.parametrize(
    ("words", "state", "reason"),
    [
        ("fast", {}, None),
        ("complete", {}, None),
        ("fast force", {}, None),
        ("complete force", {"calibrated": True, "holding": True}, None),
        ("fast", {"calibrated": True}, "calibrated already"),
        ("complete", {"holding": True}, "object"),
        ("fast", {"busy": "hand_open runs"}, "hand_open runs"),
        ("fast force", {"busy": "a calibration runs"}, "a calibration runs"),
        ("", {}, "must be fast"),
        ("slow", {}, "must be fast"),
        ("fast now", {}, "must be fast"),
        ("fast force force", {}, "must be fast"),
    ],
)
def test_calibration_rules(words, state, reason):
    answer = refuse_calibration(words.split(), **(FREE | state))
    assert answer is None if reason is None else reason in answer


@pytest.mark.parametrize(
    "task, raw, reason",
    [
        (OpenTask(511), "e8", Reason.DRIVE_ERROR),
        (CloseTask(511), "00", Reason.HAND_STALLED),
        (GraspTask((1, 2, 3, 4), 10.0), "00", Reason.HAND_NOT_CALIBRATED),
    ],
)
def test_failures_have_reason_codes(task, raw, reason):
    task.judge(poll(" ".join([raw] * 5), [9] * 5), 0.0)
    verdict = task.judge(poll(" ".join([raw] * 5), [9] * 5), 2.0)
    assert verdict.done and not verdict.ok and verdict.reason is reason, verdict


@pytest.mark.parametrize(
    "call, reason",
    [
        (lambda: OpenTask(512), Reason.OUT_OF_RANGE),
        (lambda: OpenTask(0), Reason.OUT_OF_RANGE),
        (lambda: OpenTask(-(2**31)), Reason.OUT_OF_RANGE),
        (lambda: check_grasp("power", "low", "legacy"), Reason.UNKNOWN_NAME),
        (lambda: check_grasp("lateral", "", "legacy"), Reason.UNKNOWN_NAME),
        (lambda: check_grasp("lateral", "low", "legacy"), Reason.NOT_SUPPORTED),
    ],
)
def test_refusals_have_reason_codes(call, reason):
    with pytest.raises(RefusedError) as refusal:
        call()
    assert refusal.value.reason is reason


def test_a_message_repeats_no_more_than_the_beginning_of_a_foreign_text():
    with pytest.raises(RefusedError) as refusal:
        check_grasp("x" * 1_000_000, "low", "legacy")
    assert len(str(refusal.value)) < 200
    said = refuse_calibration(["x" * 1_000_000], calibrated=False, holding=False, busy=None)
    assert len(said) < 200


TARGETS = (110, 5, 160, 245, 245)


def sent_preshape(is_sent: bool = True) -> tuple[PreshapeTask, list]:
    """A running preshape, and the calls of the driver."""
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


@pytest.mark.parametrize(("speed", "seconds"), [(511, STALL_S), (21, STALL_S), (16, 0.5), (4, 2.0)])
def test_a_finger_that_stands_so_long_has_met_something(speed, seconds):
    task = CloseTask(speed)
    raws, positions = "08 20 04 04 04", [0, 90, 254, 254, 254]
    task.judge(poll(raws, positions), 0.0)
    verdict = task.judge(poll(raws, positions), seconds - 0.01)
    assert not verdict.done and "thumb" in verdict.text and verdict.status_code is Reason.HAND_MOVING
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
def test_command_must_take_effect_within_half_a_second(task):
    raws, positions = "00 00 00 00 00", [90] * 5
    assert not task.judge(poll(raws, positions), START_GRACE_S - 0.01).done
    verdict = task.judge(poll(raws, positions), START_GRACE_S)
    assert verdict.done and not verdict.ok and verdict.reason is Reason.HAND_STALLED
    assert "index, middle, ring and little" in verdict.text


@pytest.mark.parametrize("is_sent", [True, False])
def test_a_preshape_is_sent_once_by_the_driver_or_by_the_task(is_sent):
    task, told = sent_preshape(is_sent)
    assert told == [("lateral", "high", False)] + ([] if is_sent else [TARGETS])
    assert task.limit == 7.0


def test_a_preshape_is_blocked_by_a_finger_that_stands_for_a_second():
    task, _ = sent_preshape()
    raws, positions = "50 50 40 50 50", [110, 5, 100, 245, 245]
    assert not task.judge(poll(raws, positions), 0.0).done
    assert "index" in task.judge(poll(raws, positions), BLOCKED_S - 0.01).text
    verdict = task.judge(poll(raws, positions), BLOCKED_S)
    assert verdict.done and verdict.stop and verdict.reason is Reason.HAND_STALLED


def grasp(closing=(1, 2)) -> GraspTask:
    task = GraspTask(closing, 7.0)
    task.begin(SimpleNamespace(grasp_mode_close=lambda: None))
    assert task.limit == 7.0
    return task


def test_grasp_must_begin_within_a_second():
    task = grasp()
    for elapsed in (0.0, BLOCKED_S - 0.01):
        assert task.judge(poll("50 40 40 50 50", [9] * 5), elapsed).status_code is Reason.HAND_MOVING
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


def test_a_finger_that_stands_while_it_closes_holds_after_a_second():
    task = grasp()
    raws, positions = "50 c0 04 50 50", [0, 90, 254, 0, 0]
    task.judge(poll(raws, positions), 0.0)
    assert not task.judge(poll(raws, positions), BLOCKED_S - 0.01).done
    verdict = task.judge(poll(raws, positions), BLOCKED_S)
    assert verdict.ok and verdict.holding and "thumb" in verdict.text


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
