"""State of a hand between requests: calibration, preshape and grip."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ih2_hand.errors import HandCalibratingError, RefusedError
from ih2_hand.memory import HandMemory
from ih2_hand.progress import GraspTask, MotorVerdict
from ih2_hand.reasons import Reason

LEGACY = SimpleNamespace(dialect="legacy")
DONE = MotorVerdict("done", done=True, ok=True)
BROKEN_OFF = MotorVerdict("broken off", done=True)


@pytest.fixture
def memory() -> HandMemory:
    return HandMemory(is_current=True, limit=8.0)


def ask(memory: HandMemory, name: str, **goal):
    return memory.task_for(name, SimpleNamespace(**goal), LEGACY)


def preshaped(memory: HandMemory) -> None:
    memory.task_over(ask(memory, "hand_preshape", mode="tridigit", level="low"), DONE)


def finger(motor: int, **flags) -> SimpleNamespace:
    read = {"fully_open": False, "fully_closed": False, "com_error": False, "target_reached": False, "mode": "stop"}
    return SimpleNamespace(motor=motor, **(read | flags))


OPEN = [finger(motor, fully_open=True) for motor in range(5)]
GRIPPING = [finger(motor, mode="tension", target_reached=True) for motor in range(5)]


def test_a_grasp_can_be_repeated_without_a_new_preshape(memory):
    preshaped(memory)
    for _ in range(2):
        memory.task_over(ask(memory, "hand_preshape_close"), DONE)


def undo_by_opening(memory):
    ask(memory, "hand_open", speed=100)


def undo_by_closing(memory):
    ask(memory, "hand_close", speed=100)


def undo_by_a_preshape_that_fails(memory):
    memory.task_over(ask(memory, "hand_preshape", mode="lateral", level="high"), BROKEN_OFF)


@pytest.mark.parametrize(
    "undo",
    [
        undo_by_opening,
        undo_by_closing,
        undo_by_a_preshape_that_fails,
        HandMemory.forget,
        HandMemory.calibration_began,
    ],
)
def test_other_finger_motions_undo_the_preshape(memory, undo):
    preshaped(memory)
    undo(memory)
    memory.calibrating = False
    with pytest.raises(RefusedError, match="hand_preshape first") as refusal:
        ask(memory, "hand_preshape_close")
    assert refusal.value.reason is Reason.HAND_REFUSED


def test_a_grasp_that_does_not_exist_is_refused_and_leaves_the_preshape(memory):
    preshaped(memory)
    with pytest.raises(RefusedError, match="high"):
        ask(memory, "hand_preshape", mode="lateral", level="low")
    assert isinstance(ask(memory, "hand_preshape_close"), GraspTask)


def test_no_goal_is_taken_during_a_calibration(memory):
    memory.calibrated = True
    memory.calibration_began()
    assert memory.calibrating and not memory.calibrated
    with pytest.raises(HandCalibratingError):
        ask(memory, "hand_open", speed=100)


@pytest.mark.parametrize("name", ["hand_close", "hand_preshape_close", "hand_open", "hand_preshape"])
def test_interrupted_closing_counts_as_holding(memory, name):
    preshaped(memory)
    memory.holding = False
    memory.task_over(ask(memory, name, speed=100, mode="tridigit", level="low"), BROKEN_OFF)
    assert memory.holding is name.endswith("close")


def test_the_hand_is_shown_empty_once_and_gripping_at_any_time(memory):
    assert memory.look(OPEN) and not memory.holding
    assert memory.look(OPEN) is False and not memory.holding, "it was known"
    assert not memory.look(GRIPPING) and memory.holding
    assert not memory.look([finger(motor) for motor in range(5)]) and memory.holding, "nothing is shown"
