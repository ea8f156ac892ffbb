"""When a task is done: motor status polls, typed by hand, against the verdicts."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ih2_hand.errors import RefusedError
from ih2_hand.grasps import check_grasp
from ih2_hand.progress import (
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


def test_open_ends_at_the_open_sensors():
    task = OpenTask(511)
    assert not task.judge(poll("21 21 21 21 21", [9] * 5), 0.1).done
    assert not task.judge(poll("08 08 08 21 08", [0, 0, 0, 9, 0]), 0.2).done
    verdict = task.judge(poll("08 08 08 08 08", [0] * 5), 0.3)
    assert verdict.done and verdict.ok and verdict.holding is False


def test_open_blocked_by_something():
    task = OpenTask(511)
    task.judge(poll("08 08 20 08 08", [0, 0, 90, 0, 0]), 0.1)
    verdict = task.judge(poll("08 08 20 08 08", [0, 0, 90, 0, 0]), 0.6)
    assert verdict.done and not verdict.ok and "index" in verdict.text and verdict.stop
    assert verdict.reason is Reason.HAND_STALLED


@pytest.mark.parametrize("raw", ["02", "20"])
def test_close_on_an_object_counts_as_closed(raw):
    task = CloseTask(300)
    raws = f"08 04 {raw} 04 04"
    positions = [0, 254, 130, 254, 254]
    task.judge(poll(raws, positions), 0.1)
    verdict = task.judge(poll(raws, positions), 0.6)
    assert verdict.done and verdict.ok and verdict.holding and "index" in verdict.text


def test_close_on_nothing():
    verdict = CloseTask(300).judge(poll("08 04 04 04 04", [0, 254, 254, 254, 254]), 1.0)
    assert verdict.done and verdict.ok and verdict.holding is False


def test_slow_fingers_are_not_taken_for_stalled():
    task = CloseTask(2)  # one count a second
    for step in range(30):
        verdict = task.judge(poll("08 21 21 21 21", [0] + [step // 10] * 4), step * 0.1)
        assert not verdict.done


def test_motor_stopped_by_somebody_else():
    task = CloseTask(300)
    assert not task.judge(poll("08 00 00 00 00", [0] + [90] * 4), 0.1).done
    verdict = task.judge(poll("08 00 00 00 00", [0] + [90] * 4), 0.6)
    assert verdict.done and not verdict.ok and "without a reason" in verdict.text


@pytest.mark.parametrize("speed", [-1, 0, 512, 100000])
def test_speed_range(speed):
    with pytest.raises(ValueError, match="speed"):
        OpenTask(speed)


def preshape() -> PreshapeTask:
    task = PreshapeTask("lateral", "high", True, 10.0)
    task.targets = (110, 5, 160, 245, 245)
    return task


def test_preshape_is_reached_by_status_and_position():
    task = preshape()
    assert not task.judge(poll("41 50 41 41 41", [50, 5, 50, 50, 50]), 0.1).done
    verdict = task.judge(poll("50 50 50 50 50", [110, 5, 160, 245, 245]), 1.0)
    assert verdict.done and verdict.ok and verdict.holding is None


def test_an_old_reached_bit_is_not_believed():
    task = preshape()
    assert not task.judge(poll("50 50 50 50 50", [0, 0, 0, 0, 0]), 0.05).done


def test_preshape_a_few_counts_short_is_reached():
    assert preshape().judge(poll("50 50 50 50 50", [107, 9, 157, 241, 241]), 1.0).ok


def test_blocked_preshape():
    task = preshape()
    task.judge(poll("50 50 40 50 50", [110, 5, 100, 245, 245]), 1.0)
    verdict = task.judge(poll("50 50 40 50 50", [110, 5, 100, 245, 245]), 2.1)
    assert verdict.done and not verdict.ok and "index stands at 100 of 160" in verdict.text


def test_preshape_ignored_by_an_uncalibrated_hand():
    task = preshape()
    assert not task.judge(poll("08 08 08 08 08", [0] * 5), 0.1).done
    verdict = task.judge(poll("08 08 08 08 08", [0] * 5), 0.6)
    assert verdict.done and not verdict.ok and "not calibrated" in verdict.text


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


@pytest.mark.parametrize("ends", ["04 04", "64 64"])
def test_grasp_of_nothing(ends):
    task = GraspTask((1, 2), 10.0)
    task.judge(poll("50 c1 61 50 50", [0, 90, 90, 0, 0]), 0.3)
    verdict = task.judge(poll(f"50 {ends} 50 50", [0, 254, 254, 0, 0]), 1.5)
    assert verdict.done and verdict.ok and verdict.holding is False
    assert "without meeting an object" in verdict.text


def test_grasp_stalled_on_an_object_counts_as_closed():
    task = GraspTask((1,), 10.0)
    task.judge(poll("50 c1 50 50 50", [0, 90, 0, 0, 0]), 0.3)
    verdict = task.judge(poll("50 c0 50 50 50", [0, 90, 0, 0, 0]), 1.4)
    assert verdict.done and verdict.ok and verdict.holding


def test_grasp_interrupted_by_a_stop():
    task = GraspTask((1,), 10.0)
    task.judge(poll("50 c1 50 50 50", [0, 90, 0, 0, 0]), 0.3)
    verdict = task.judge(poll("00 00 00 00 00", [0, 95, 0, 0, 0]), 0.4)
    assert verdict.done and not verdict.ok and "interrupted" in verdict.text


def test_grasp_ignored():
    task = GraspTask((1,), 10.0)
    task.begin(SimpleNamespace(grasp_mode_close=lambda: None))
    task.judge(poll("50 50 50 50 50", [0] * 5), 0.1)
    verdict = task.judge(poll("50 50 50 50 50", [0] * 5), 1.2)
    assert verdict.done and not verdict.ok and "did not begin" in verdict.text


def test_bus_error_ends_every_task():
    verdict = OpenTask(100).judge(poll("08 e0 08 08 08", [0] * 5), 0.1)
    assert verdict.done and not verdict.ok and "bus error of thumb" in verdict.text


def test_what_shows_an_empty_hand():
    assert shown_empty(poll("50 08 08 08 08", [90, 0, 0, 0, 0]))
    assert not shown_empty(poll("08 08 08 08 00", [0, 0, 0, 0, 9]))
    assert not shown_empty([])
    assert shown_holding(poll("08 08 d0 08 08", [0, 0, 90, 0, 0]))
    assert not shown_holding(poll("50 50 50 50 50", [90] * 5))


FREE = {"calibrated": False, "holding": False, "busy": None}


@pytest.mark.parametrize(
    ("words", "state", "reason"),
    [
        ("fast", {}, None),
        ("complete", {}, None),
        ("fast force", {}, None),
        ("complete force", {"calibrated": True, "holding": True}, None),
        ("fast", {"calibrated": True}, "calibrated already"),
        ("complete", {"holding": True}, "may hold an object"),
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
def test_a_failure_says_to_programs_what_it_is(task, raw, reason):
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
def test_a_refusal_says_to_programs_what_it_is(call, reason):
    with pytest.raises(RefusedError) as refusal:
        call()
    assert refusal.value.reason is reason


def test_a_message_repeats_no_more_than_the_beginning_of_a_foreign_text():
    with pytest.raises(RefusedError) as refusal:
        check_grasp("x" * 1_000_000, "low", "legacy")
    assert len(str(refusal.value)) < 200
    said = refuse_calibration(["x" * 1_000_000], calibrated=False, holding=False, busy=None)
    assert len(said) < 200
