"""A robot in virtual time with slots, and real Python processes that hold them: for tests and benchmarks.

Time passes only in `Slots.step`, which may wait for the process's answer. So the computer has no influence on results.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from coglab.control import slot as wire
from coglab.control.host import MotionHost, find_class, load_module, serve

HERE = Path(__file__).resolve().parent
LIMIT = 60.0  # s, limit of each wait
PERIOD = 0.005  # s, a cycle
MOTION, FEEDBACK = "python_motion", "python_feedback"
# Gains of RemoteFeedback as it describes them.
MAX_AGE, FADE_TIME, RATE, TURNING_RATE, MAX_OFFSET = 0.03, 0.5, 0.2, 0.8, 0.05
BRAKING = 400  # cycles within which the arm must stand


class Counted(wire.Slot):
    """A slot that counts its answers in memory shared with the robot's process."""

    count: Any

    def answer(self, answer: npt.NDArray[np.void]) -> None:
        """Publish an answer and count it."""
        super().answer(answer)
        self.count.value += 1


def answer_questions(robot: int, slot: str, file: str, name: str, count: Any) -> None:
    """Do the same as `./coglab controller run FILE --class NAME`, in its own process."""
    from coglab.control.feedback_host import FeedbackHost

    controller, kind = find_class(load_module(Path(file)), name)
    host: Any = FeedbackHost(controller(), {}) if kind == wire.FEEDBACK else MotionHost(controller(), {})
    with Counted(wire.Address(robot, slot), kind) as connection:
        connection.count = count
        serve(connection, host)


def soon(condition: Callable[[], object], what: str) -> None:
    """Wait until ``condition()``; fail with the text ``what``."""
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, f"not within {LIMIT} s: {what}"
        time.sleep(0.0001)


class Process:
    """A Python process that holds a slot of this process's robot, with a class of remote_controllers.py."""

    _context = multiprocessing.get_context("forkserver")
    _context.set_forkserver_preload(["numpy"])

    def __init__(self, slot: str, name: str) -> None:
        self.count = self._context.Value("Q", 0, lock=False)
        file = str(HERE / "remote_controllers.py")
        self.process = self._context.Process(
            target=answer_questions, args=(os.getpid(), slot, file, name, self.count), daemon=True
        )
        self.process.start()

    def send(self, what: signal.Signals) -> None:
        """Send a signal."""
        assert self.process.pid
        os.kill(self.process.pid, what)

    def end(self) -> None:
        """Kill the process if it still runs."""
        self.process.kill()
        self.process.join(LIMIT)


class Slots:
    """The robot of a coglab.World with a slot of each kind. Every cycle is checked against the bounds."""

    def __init__(self, world: Any) -> None:
        self.world = world
        self.robot = world.cell.robot.virtual
        for slot, kind in ((MOTION, "coglab/RemoteMotion"), (FEEDBACK, "RemoteFeedback")):
            loaded, why = self.robot.load_controller(slot, kind)
            assert loaded, why
        self.correction = np.zeros(6)  # m and rad, applied to the hand's reference

    def step(self, process: Process | None = None) -> None:
        """Run one cycle. With a process, wait for its answer."""
        before = process.count.value if process else 0
        cycles = self.robot.report()["cycles"]
        self.world.step(PERIOD)
        assert self.robot.report()["cycles"] == cycles + 1, "the control cycle missed a period"
        assert self.robot.limits()["commanded"] == 0, "a command was outside of the arm's limits"
        states = self.world.feedback.last_cycle().states.get(FEEDBACK)
        now = np.array(states[:6]) if states else np.zeros(6)
        moved = np.abs(now - self.correction) / PERIOD
        assert moved[:3].max() <= RATE + 1e-9 and moved[3:].max() <= TURNING_RATE + 1e-9, f"{moved} is too fast"
        assert np.linalg.norm(now[:3]) <= MAX_OFFSET + 1e-9
        self.correction = now
        if process:
            soon(lambda: process.count.value != before, "an answer")

    @contextmanager
    def feedback(self, name: str) -> Iterator[Process]:
        """Yields a process with an enabled feedback controller that has corrected at least 5 mm."""
        process = Process(FEEDBACK, name)
        try:
            self.world.feedback.enable(FEEDBACK)
            soon(lambda: self.step() or process.count.value, "the first answer")
            soon(lambda: self.step(process) or np.linalg.norm(self.correction[:3]) > 0.005, "a correction")
            yield process
        finally:
            process.end()

    @contextmanager
    def motion(self, name: str) -> Iterator[Process]:
        """Yields a process with a running motion."""
        process = Process(MOTION, name)

        def started() -> bool:
            accepted, _, _ = self.robot.start_motion(MOTION)
            self.step()
            self.step()
            return bool(accepted) and self.robot.motion_progress(MOTION)["state"] == "running"

        try:
            soon(started, "the start of the motion")
            soon(lambda: process.count.value, "the first answer")  # without cycles, which would make it late
            yield process
        finally:
            process.end()

    def fades(self) -> None:
        """Let the correction fade, and check that it does in time."""
        for _ in range(round((MAX_AGE + FADE_TIME) / PERIOD) + 2):
            self.step()
        assert not self.correction.any(), f"{self.correction} is left"

    def brakes(self) -> None:
        """Let the arm brake, and check that it stands in time."""
        for _ in range(BRAKING):
            self.step()
            if self.robot.motion_progress(MOTION)["state"] == "aborted" and self.robot.report()["standing"]:
                return
        raise AssertionError(f"the arm moves: {self.robot.motion_progress(MOTION)}")

    def disturb(self, kind: str, draw: random.Random) -> None:
        """Stop or kill a process of that kind (MOTION or FEEDBACK) at a random moment, and check the result."""
        with self.motion("Sway") if kind == MOTION else self.feedback("Jump") as process:
            for _ in range(draw.randrange(1, 60)):
                self.step(process)
            self.step()
            time.sleep(draw.random() * 1e-3)  # while it waits, computes or writes
            process.send(draw.choice([signal.SIGSTOP, signal.SIGKILL]))
            self.brakes() if kind == MOTION else self.fades()
