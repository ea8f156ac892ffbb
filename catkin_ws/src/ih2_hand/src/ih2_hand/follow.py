"""Runs a hand movement to its end without ROS, with the same rules as the node's actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

from ih2_hand.driver import HandSerialDriver
from ih2_hand.progress import RESENDS, MotorVerdict, Task
from ih2_hand.reasons import Reason

PERIOD_S = 1.0 / 30.0  # s between polls


def follow(
    driver: HandSerialDriver,
    task: Task,
    *,
    period: float = PERIOD_S,
    on_poll: Callable[[MotorVerdict, Sequence[Any]], bool] | None = None,
) -> MotorVerdict:
    """Begin `task` and poll every `period` (s) until it is done or its time limit has passed.

    `on_poll` receives each verdict with the five readings. If it returns True, the movement is
    cancelled. The fingers stop in the same cases as with the node. Time is the driver's clock.
    Errors of the line are raised.
    """
    clock, resends = driver.line.clock, 0
    fillers = driver.counters.fillers
    task.begin(driver)
    begun = clock.monotonic()
    while True:
        clock.sleep(period)
        asked = clock.monotonic()
        if asked - begun > task.limit:
            driver.stop_all()
            return MotorVerdict(
                f"not done within {task.limit:.0f} s; fingers stopped", done=True, reason=Reason.TIME_LIMIT
            )
        motors = [SimpleNamespace(**reading) for reading in driver.read_motors()]
        if driver.counters.fillers != fillers:
            resends += 1
            if resends > RESENDS:
                driver.stop_all()
                return MotorVerdict(
                    f"the line to {driver.port} had to be resynchronised {resends} "
                    "times during the movement: check the cable",
                    done=True,
                    reason=Reason.HAND_LINK_LOST,
                )
            fillers = driver.counters.fillers
            task.begin(driver)
            continue
        verdict = task.judge(motors, asked - begun)
        broken_off = on_poll is not None and on_poll(verdict, motors)
        if verdict.stop or broken_off and not verdict.done:
            driver.stop_all()
        if verdict.done:
            return verdict
        if broken_off:
            return MotorVerdict("broken off; fingers stopped", done=True, reason=Reason.CANCELLED)
