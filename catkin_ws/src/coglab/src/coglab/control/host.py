"""Loads a controller from a file and answers the questions of the robot's control cycle with it."""

from __future__ import annotations

import importlib.util
import math
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
from ctrl_more import FeedbackController

from coglab.control import slot as wire
from coglab.control.motion import (
    ControlError,
    Motion,
    MotionCycle,
    MotionSetup,
    MotionStart,
    Reference,
    SetPoint,
    is_done,
)

POLL = 0.0005  # s between two looks for a question; a wake-up would cost the robot's cycle a system call
ALIVE = 0.5  # s between two checks that the robot still runs
LONGEST = 1.0  # s, longer calls of the controller are reported
SILENT = 1.0  # s without a question, after which that is reported
MOTION_METHODS = ("start", "reference", "done")
FEEDBACK_METHODS = ("describe", "initialize", "update")


def load_module(file: Path) -> ModuleType:
    """Run a Python file as a module. Raises ControlError with the place of the error."""
    if not file.is_file():
        raise ControlError(f"there is no file {file}")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise ControlError(f"{file} is no Python file; its name must end with .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    sys.path.insert(0, str(file.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
        line = error.lineno if isinstance(error, SyntaxError) else frames[-1].lineno if frames else 1
        raise ControlError(f"{file}:{line}: {type(error).__name__}: {error}") from error
    return module


def find_class(module: ModuleType, name: str = "") -> tuple[type, int]:
    """Returns the controller class of a module and its kind (`slot.MOTION` or `slot.FEEDBACK`).

    Raises ControlError if there is none, or several and no name.
    """
    found: dict[str, tuple[type, int]] = {}
    underived = ""
    for key, value in vars(module).items():
        if not isinstance(value, type) or value.__module__ != module.__name__ or value is Motion:
            continue
        if issubclass(value, FeedbackController):
            found[key] = (value, wire.FEEDBACK)
        elif _has(value, MOTION_METHODS):
            found[key] = (value, wire.MOTION)
        elif _has(value, FEEDBACK_METHODS):
            underived = key
    if name:
        if name not in found:
            raise ControlError(f"the file has no controller class '{name}'; it has: {', '.join(found) or 'none'}")
        return found[name]
    if not found and underived:
        raise ControlError(f"class {underived} must derive from ctrl_more.FeedbackController")
    if not found:
        raise ControlError(
            f"the file has no class with the methods {', '.join(MOTION_METHODS)} (a motion), and none derived from "
            f"ctrl_more.FeedbackController with {', '.join(FEEDBACK_METHODS)} (a feedback controller)"
        )
    if len(found) > 1:
        raise ControlError(f"the file has {len(found)} controllers: {', '.join(found)}; choose one with --class")
    return next(iter(found.values()))


def _has(value: type, methods: tuple[str, ...]) -> bool:
    return all(callable(getattr(value, method, None)) for method in methods)


class MotionHost:
    """One motion object and the arguments of its next start."""

    def __init__(self, motion: Any, given: Mapping[str, Any], robot: Any = None) -> None:
        """Configure the motion. Raises ControlError for invalid arguments."""
        self.motion = motion
        setup = MotionSetup(robot)
        configure = getattr(motion, "configure", None)
        if configure is not None:
            configure(setup)
        self._setup = setup
        self.arguments = setup.values(given)
        self._run = 0
        self._failed = False

    def set(self, given: Mapping[str, Any]) -> None:
        """Change arguments of the next start; the others stay. Raises ControlError."""
        self.arguments = self._setup.values({**self.arguments, **given})

    def answer(self, question: np.void, answer: npt.NDArray[np.void]) -> bool:
        """Fill in the answer to a question. Return false if there is nothing to answer.

        An exception of the motion ends it: the answer is GIVE_UP, and the traceback is printed.
        """
        run = int(question["run"])
        if not question["running"]:
            return False
        if run != self._run:
            self._run, self._failed = run, False
            begin = True
        else:
            begin = False
        if self._failed:
            return False
        answer["stamp_ns"], answer["run"], answer["time"] = question["stamp_ns"], run, question["time"]
        answer["done"], answer["values"] = 0, 0.0
        try:
            if begin:
                self.motion.start(MotionStart(self.arguments, set_point(question)))
            cycle = MotionCycle(float(question["time"]), float(question["next"]), question["joints"].copy())
            reference = self.motion.reference(cycle)
            if not isinstance(reference, Reference):
                raise ControlError(f"reference() returned {reference!r}; a coglab.control.Reference is expected")
            fill(answer, reference)
            answer["done"] = int(is_done(self.motion))
        except Exception:
            traceback.print_exc()
            print("the motion has ended; correct the file and run it again", file=sys.stderr, flush=True)
            self._failed = True
            answer["kind"] = wire.GIVE_UP
        return True


def set_point(question: np.void) -> SetPoint:
    """Returns the set-point at the start of the run of this question."""
    return SetPoint(
        joints=question["from_joints"].copy(),
        joint_velocity=question["from_joint_velocity"].copy(),
        position=question["from_pose"][:3].copy(),
        orientation=question["from_pose"][3:].copy(),
        twist=question["from_twist"].copy(),
    )


def fill(answer: npt.NDArray[np.void], reference: Reference) -> None:
    """Write a reference into an answer."""
    values = answer["values"][0]
    if reference.joints is not None and reference.joint_velocity is not None:
        answer["kind"] = wire.JOINTS
        values[:7], values[7:] = reference.joints, reference.joint_velocity
    elif reference.position is not None and reference.orientation is not None and reference.twist is not None:
        answer["kind"] = wire.POSE
        values[:3], values[3:7], values[7:13] = reference.position, reference.orientation, reference.twist
    else:
        answer["kind"] = wire.REST


class Latencies:
    """Times from the question of a cycle to the answer, since the last report."""

    def __init__(self) -> None:
        """Begin with none."""
        self._times: list[float] = []
        self._late = self._refused = self._run = 0

    def add(self, question: np.void) -> None:
        """Note an answer that has just been written."""
        self._times.append(1e-6 * (time.monotonic_ns() - int(question["written_ns"])))

    def note(self, question: np.void) -> tuple[int, int]:
        """Returns the numbers of late cycles and refused answers since the last call."""
        if int(question["run"]) != self._run:
            self._run, self._late, self._refused = int(question["run"]), 0, 0
        late, refused = int(question["late"]) - self._late, int(question["refused"]) - self._refused
        self._late, self._refused = int(question["late"]), int(question["refused"])
        return late, refused

    def report(self) -> str:
        """Returns median and 99th percentile (ms) as a sentence and resets; empty if there was no answer."""
        if not self._times:
            return ""
        median, high = np.percentile(self._times, [50, 99])
        count = len(self._times)
        self._times = []
        return f"{count} answers, after {median:.2f} ms (median) and {high:.2f} ms (99 %)"


class Watch:
    """A thread that reports a call of the controller longer than `LONGEST`."""

    def __init__(self, report: Callable[[str], None]) -> None:
        """`report`: called with the sentence."""
        self._report, self._ended = report, threading.Event()
        self.began = math.inf  # s, start of the running call; infinite: none runs
        threading.Thread(target=self._look, name="watch", daemon=True).start()

    def end(self) -> None:
        """End the thread."""
        self._ended.set()

    def _look(self) -> None:
        last_reported = math.inf
        while not self._ended.wait(LONGEST / 4):
            began = self.began
            if time.monotonic() - began > LONGEST and began != last_reported:
                last_reported = began
                self._report(
                    f"the controller has not returned for {LONGEST:g} s: the robot has let its correction fade, or has "
                    "braked. Ctrl-C ends this process"
                )


def serve(
    slot: wire.Slot,
    host: Any,
    *,
    ends: Callable[[], bool] = lambda: False,
    period: float = math.inf,
    report: Callable[[str], None] = print,
    silent: str = "",
) -> None:
    """Answer the questions of a slot until the robot lets go or `ends()` is true.

    Each `period` s it reports the delay of the answers and the number of late ones. `silent`: the report if no question
    has come for `SILENT`.
    """
    watch = Watch(report)
    try:
        _serve(slot, host, watch, ends, period, report, silent)
    finally:
        watch.end()


def _serve(
    slot: wire.Slot,
    host: Any,
    watch: Watch,
    ends: Callable[[], bool],
    period: float,
    report: Callable[[str], None],
    silent: str,
) -> None:
    answer = np.zeros(1, dtype=wire.ANSWER)
    latencies = Latencies()
    late = refused = 0
    looked = last_report = asked = time.monotonic()
    while not ends():
        question = slot.question()
        if question is not None:
            watch.began = time.monotonic()
            answered = host.answer(question, answer)
            watch.began = math.inf
            if answered:
                slot.answer(answer)
                latencies.add(question)
            if asked < 0.0:
                report("the robot sends questions again")
            asked = time.monotonic()
            more = latencies.note(question)
            late, refused = late + more[0], refused + more[1]
        now = time.monotonic()
        if now - looked > ALIVE:
            looked = now
            if not slot.alive():
                report("the robot has closed the slot: it has ended, or its controller was unloaded")
                return
        if silent and asked > 0.0 and now - asked > SILENT:
            asked = -1.0
            report(silent)
        if now - last_report > period:
            last_report = now
            words = latencies.report()
            if words:
                report(f"{words}; {late} cycles late, {refused} answers refused")
            late = refused = 0
        if question is None:
            time.sleep(POLL)
