"""Python processes in the slots of a robot in virtual time: corrections act, and fade after a fault."""

from __future__ import annotations

import random
import signal
from collections.abc import Iterator
from typing import Any

import coglab
import ctrl_more
import numpy as np
import pytest
from coglab.control import ControlError
from coglab.control.feedback_host import FeedbackHost
from remote_controllers import Shift
from remote_process import FEEDBACK, MOTION, Slots


@pytest.fixture(name="slots", scope="module")
def virtual_slots() -> Iterator[Slots]:
    with coglab.World(seed=1, person="patient") as world:
        yield Slots(world)


def test_correction_of_a_process_moves_the_palm(slots: Slots) -> None:
    before = slots.world.cell.robot.palm().position[2]
    with slots.feedback("Shift") as process:
        for _ in range(300):
            slots.step(process)
        assert slots.correction.tolist() == pytest.approx([0, 0, 0.03, 0, 0, 0])
        assert slots.world.cell.robot.palm().position[2] - before == pytest.approx(0.03, abs=0.004)


@pytest.mark.parametrize("kind", [FEEDBACK, MOTION])
def test_stopped_or_killed_process_never_holds_the_arm(slots: Slots, kind: str) -> None:
    draw = random.Random(2)
    for _ in range(4):
        slots.disturb(kind, draw)


@pytest.mark.parametrize(("wrong", "last"), [("Raises", 40), ("Nan", 40), ("Endless", 39)])
def test_correction_fades_when_the_controller_goes_wrong(slots: Slots, wrong: str, last: int) -> None:
    with slots.feedback(wrong) as process:
        while process.count.value < last:
            slots.step(process)
        slots.fades()


def test_controller_that_holds_pythons_lock_is_late_and_recovers(slots: Slots) -> None:
    with slots.feedback("Late") as process:
        while process.count.value < 39:
            slots.step(process)
        before = slots.correction[2]
        for _ in range(100):
            slots.step()
            if slots.correction[2] < before - 0.001:
                break
        assert slots.correction[2] < before - 0.001, "no cycle waited for Python, and the old answer was kept"
        for _ in range(50):
            slots.step(process)
        assert slots.correction[2] == pytest.approx(0.03)


def test_briefly_late_motion_continues_within_limits(slots: Slots) -> None:
    with slots.motion("Sway") as process:
        for _ in range(100):
            slots.step(process)
        process.send(signal.SIGSTOP)
        for _ in range(40):  # 0.2 s, shorter than silent_time
            slots.step()
        assert np.abs(slots.robot.report()["velocity"]).max() < 1e-3, "it must brake"
        process.send(signal.SIGCONT)
        for _ in range(60):
            slots.step(process)
        assert slots.robot.motion_progress(MOTION)["state"] == "running"
        assert np.abs(slots.robot.report()["velocity"]).max() > 0.01


class Needy(Shift):
    """Declares more than a slot carries."""

    def __init__(self, more: Any) -> None:
        super().__init__()
        self.more = more

    def describe(self) -> ctrl_more.Description:
        d = super().describe()
        self.more(d)
        return d


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (lambda d: d.measured("imu", size=9), "Needy.*measuredData/imu"),
        (lambda d: d.measured("wrench", size=3), "'wrench'.*6"),
        (lambda d: d.reads("jointSpaceReference", "Position"), "jointSpaceReference/Position"),
        (lambda d: d.modifies("zmp", "zmp"), "zmp/zmp"),
    ],
)
def test_controller_that_needs_more_than_a_slot_carries_is_refused(more: Any, named: str) -> None:
    with pytest.raises(ControlError, match=named):
        FeedbackHost(Needy(more), {})


@pytest.mark.parametrize(
    ("gains", "named"), [({"height": 0.2}, r"0\.1 m.*0\.2"), ({"hight": 0.1}, "height"), ({"height": [1, 2]}, "")]
)
def test_gains_out_of_range_are_refused(gains: dict[str, Any], named: str) -> None:
    with pytest.raises(ControlError, match=named):
        FeedbackHost(Shift(), gains)
