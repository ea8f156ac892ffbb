"""Trials of handovers.py and recognition.py: drawn people in the virtual world, and the true state in each period of
the simulated cell. Only the outcome of an action comes from the machines."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import smach
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_sim.person.scene import HandSample
from coglab_smach.context.requests import HUBS
from coglab_trials import Conditions, VirtualTrial
from common import shared_module
from scipy.signal import butter, find_peaks, sosfiltfilt
from scipy.spatial.transform import Rotation

RECEIVE, GIVE = EXCHANGES = ("exchange_human_to_robot", "exchange_robot_to_human")
OBJECTS = ("mug", "bottle", "ball", "tea_box", "screwdriver")
HOLDER = {RECEIVE: "robot", GIVE: "human"}  # holder of the object after a success
DT = 0.005  # s, a period of the world
RATE = 1.0 / DT
MOVES = 0.02  # m/s; a faster hand moves
KEPT = 0.10  # s for which a hand must be faster than MOVES
TOUCH = 0.5  # N on palm and fingers that count as a touch
AT_TOUCH = 0.10  # s after touch in which the largest force counts as force at touch
CALMS = 0.5  # s after the end of a reach in which braking belongs to it
NEAR = 0.005  # m from its goal within which the hand has arrived
LISTENS = 0.5  # s between the request and another motion of the hand
CALM = 0.8  # s after another motion in which the palm may still move because of it


@dataclass(frozen=True)
class Job:
    """One trial. `other`: number of a hand motion that is no offer and no request; None: a handover."""

    seed: int
    conditions: Conditions
    other: int | None = None
    actions: tuple[str, ...] = EXCHANGES


# --- arrays ---------------------------------------------------------------------------------------------------------


def onset(speed: np.ndarray) -> int | None:
    """First index from which a hand moves for KEPT s; None: it does not."""
    run = 0
    for index, moves in enumerate(np.asarray(speed) > MOVES):
        run = run + 1 if moves else 0
        if run >= round(KEPT * RATE):
            return index - run + 1
    return None


def peaks(speed: np.ndarray) -> int:
    """Maxima of a speed (m/s): low-pass 10 Hz, prominence above a tenth of the largest."""
    still = np.zeros(round(0.5 * RATE))
    smooth = sosfiltfilt(butter(2, 10.0, fs=RATE, output="sos"), np.concatenate([still, speed, still]))
    return len(find_peaks(smooth, prominence=0.1 * float(smooth.max()))[0])


def sparc(speed: np.ndarray) -> float:
    """Spectral arc length of a speed (Balasubramanian et al.), 10 Hz, amplitude threshold 0.05; 0 is smoothest."""
    n = int(2 ** (np.ceil(np.log2(len(speed))) + 4))
    frequency = np.arange(n) * RATE / n
    spectrum = np.abs(np.fft.fft(speed, n))
    keep = frequency <= 10.0
    frequency, spectrum = frequency[keep], spectrum[keep] / spectrum.max()
    above = np.flatnonzero(spectrum >= 0.05)
    frequency, spectrum = frequency[above[0] : above[-1] + 1], spectrum[above[0] : above[-1] + 1]
    width = frequency[-1] - frequency[0]
    return -float(np.sum(np.sqrt((np.diff(frequency) / width) ** 2 + np.diff(spectrum) ** 2)))


def human_time(way: float) -> float:
    """Duration (s) of a person's reach over `way` m, as the simulated people take it."""
    return 1.1 * max(0.3, (max(way, 1e-3) / 0.45) ** 0.3)


# --- what truly happened --------------------------------------------------------------------------------------------


@dataclass
class Series:
    """One value of each per FRI period of the robot."""

    time: list[float] = field(default_factory=list)  # s of the machines' clock
    palm: list[np.ndarray] = field(default_factory=list)  # m
    velocity: list[np.ndarray] = field(default_factory=list)  # m/s, of the palm
    reaching: list[float] = field(default_factory=list)  # m/s, the person's own speed
    grip: list[float] = field(default_factory=list)  # of the person, 0 to 1
    force: list[float] = field(default_factory=list)  # N on palm and phalanges
    pull: list[float] = field(default_factory=list)  # N of the object on the robot's hand
    held_by: list[str] = field(default_factory=list)
    moving: list[bool] = field(default_factory=list)  # a DMP motion is under way

    def between(self, begin: int, end: int) -> dict[str, np.ndarray]:
        """The values from `begin` to `end` as arrays."""
        return {name: np.array(values[begin:end]) for name, values in vars(self).items()}


class Watch:
    """Watches a VirtualTrial from its beginning."""

    def __init__(self, trial: VirtualTrial) -> None:
        self.trial, self.world, self.series = trial, trial.world, Series()
        self.begun: list[int] = []  # index in the series at which each action began
        self.sample: Any = None  # newest HandSample of the person
        trial.beside = self.look
        self.watch_person()

    def watch_person(self) -> None:
        """Keeps the newest sample of the person's hand."""
        step = self.world.human.step

        def watched(t: float, view: Any) -> Any:
            self.sample = step(t, view)
            return self.sample

        self.world.human.step = watched

    def look(self, trial: VirtualTrial) -> None:
        """After each period of the world."""
        robot, cell, series = self.world.robot, self.world.cell, self.series
        if self.sample is None or robot.report["fri_period"] <= 0.0:
            return
        truth = cell.truth()
        series.time.append(float(trial.clock.now()))
        series.palm.append(np.array(truth["robot_hand"]["position"]))
        series.velocity.append(robot.chain.jacobian(truth["position"])[:3] @ truth["velocity"])
        series.reaching.append(float(np.linalg.norm(self.sample.velocity)))
        series.grip.append(float(self.sample.grip))
        series.force.append(float(np.linalg.norm(np.sum(list(cell.touch().values()), axis=0))))
        series.pull.append(float(np.linalg.norm(truth["palm_force"])))
        series.held_by.append(truth["held_by"])
        series.moving.append(robot.virtual.dmp_progress()["motion"] in ("running", "holding"))
        if len(trial.begun) > len(self.begun):
            self.begun.append(len(series.time) - 1)

    def figures(self) -> dict[str, Any]:
        """`directions`: results of each action that began, see `direction`."""
        results = [r for r in self.trial.results if r.action in self.trial.begun]
        found = []
        for k, begin in enumerate(self.begun):
            ended = results[k].ended if k < len(results) else np.inf
            end = max(min(len(self.series.time), int(np.searchsorted(self.series.time, ended)) + 1), begin + 1)
            outcome = results[k].outcome if k < len(results) else "stuck"
            found.append(direction(self.series.between(begin, end), self.trial.begun[k], outcome))
        return {"directions": found}


def direction(part: dict[str, np.ndarray], action: str, outcome: str) -> dict[str, Any]:
    """Plain data about one action: `good` (in truth, too), `late` (s from the person's onset to the arm's; None:
    never), `touch_force` and `pull` (N), and `reaches`."""
    hand, arm = onset(part["reaching"]), onset(np.linalg.norm(part["velocity"], axis=1))
    times, touches = part["time"], np.flatnonzero(part["force"] >= TOUCH)
    touch = touches[0] if len(touches) else None
    pulled = part["pull"][(part["held_by"] == "both") | (part["grip"] > 0.5)]
    return {
        "action": action,
        "good": outcome == "succeeded" and part["held_by"][-1] == HOLDER[action],
        "late": None if hand is None or arm is None else float(times[arm] - times[hand]),
        "touch_force": None if touch is None else float(np.max(part["force"][touch : touch + round(AT_TOUCH * RATE)])),
        "pull": float(np.max(pulled, initial=0.0)),
        "reaches": reaches_of(part),
    }


def reaches_of(part: dict[str, np.ndarray]) -> list[dict[str, float]]:
    """For each DMP motion in which the palm moves: `detour` (path / straight line), speed `peaks`, `sparc`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], part["moving"].astype(int), [0]])))
    found = []
    for begin, stop in zip(edges[::2], edges[1::2], strict=True):
        after = np.linalg.norm(part["velocity"][stop : stop + round(CALMS * RATE)], axis=1)
        calm = np.flatnonzero(after <= MOVES)
        end = min(stop + (int(calm[0]) if len(calm) else len(after)) + 1, len(part["time"]))
        path, speed = part["palm"][begin:end], np.linalg.norm(part["velocity"][begin:end], axis=1)
        straight = float(np.linalg.norm(path[-1] - path[0]))
        if onset(speed) is not None and straight > 0.0:
            length = float(np.sum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
            found.append({"detour": length / straight, "peaks": peaks(speed), "sparc": sparc(speed)})
    return found


def arrives_late(reach: Any) -> float | None:
    """Delay (s) of a ReachRecord compared with a person, until the arm stays within 5 mm of its goal or meets the
    person; None: never."""
    if not (reach.stood or reach.met) or len(reach.path) < 20:
        return None
    times, palm, goal = (np.array(column) for column in zip(*reach.path, strict=True))
    told = reach.reached if reach.stood else reach.over
    inside = times <= told
    human = human_time(float(np.linalg.norm(palm[inside][-1] - palm[0])))
    if not reach.stood:
        return told - times[0] - human
    far = np.flatnonzero(np.linalg.norm(palm[inside] - goal[inside], axis=1) > NEAR)
    if len(far) and far[-1] == np.count_nonzero(inside) - 1:
        return None
    there = float(times[far[-1]]) if len(far) else reach.begin
    return there - times[0] - human


# --- hands that are about something else ----------------------------------------------------------------------------


class OtherHand:
    """Replaces the person: a hand that performs `motion` from the time `begun` on."""

    phase = "idle"

    def __init__(self, human: Any, motion: Any, rng: np.random.Generator, holds: bool) -> None:
        self.participant, self.rest = human.participant, human.rest
        self._motion, self._turn, self._holds = motion, rng.normal(0.0, 0.2, 3), holds
        self._far = max(0.1, float(np.linalg.norm(motion.segments[0].end - motion.at(0.0))))
        self.begun: float | None = None

    def command(self, text: str) -> None:
        """Ignored."""

    def hear(self, t: float, code: int) -> None:
        """Ignored."""

    def _at(self, t: float) -> Pose:
        way = self._motion.at(t) - self._motion.at(0.0) if t > 0.0 else np.zeros(3)
        turned = Rotation.from_rotvec(self._turn * float(np.linalg.norm(way)) / self._far)
        sway = 0.0015 * np.sin(2 * np.pi * 0.4 * t + np.arange(3))
        return Pose(self.rest + way + sway, turned.as_quat())

    def step(self, t: float, view: Any) -> HandSample:
        """Same as VirtualHuman.step."""
        since = 0.0 if self.begun is None else t - self.begun
        now, soon = self._at(since), self._at(since + DT if self.begun is not None else since)
        spin = (soon.rotation * now.rotation.inv()).as_rotvec() / DT
        grip = 1.0 if self._holds else 0.0
        return HandSample(now, (soon.position - now.position) / DT, grip, 20.0, self.phase, spin)


class OtherWatch(Watch):
    """Measures how far the palm moves because of an OtherHand. If `robot_holds`, the person first gives the object to
    the robot; otherwise the hand carries the object."""

    def __init__(self, trial: VirtualTrial, motion: Any, rng: np.random.Generator, robot_holds: bool) -> None:
        super().__init__(trial)
        self.motion, self._rng, self._robot_holds = motion, rng, robot_holds
        self._span = (0, 0)
        self.hand: OtherHand | None = None
        if not self._robot_holds:
            self._replace(True)

    def _replace(self, holds: bool) -> None:
        self.world.human = self.hand = OtherHand(self.world.human, self.motion, self._rng, holds)
        self.watch_person()

    def walk(self, trial: VirtualTrial) -> None:
        """Script of the trial: gives the robot an object if it must hold one, then request and motion, until a hub."""
        trial.wait_hub("wait_without_object")
        if self._robot_holds:
            trial.submit(RECEIVE)
            self._until(trial, lambda: trial.hub != "" and self.world.human.phase == "idle")
            if trial.hub != "wait_with_object":
                return
            self._replace(False)
        assert self.hand is not None
        trial.submit(GIVE if self._robot_holds else RECEIVE)
        trial.clock.sleep(LISTENS)
        self.hand.begun, begin = self.world.t, len(self.series.time)
        trial.clock.sleep(self.motion.over + CALM)
        self._span = (begin, len(self.series.time))
        self._until(trial, lambda: trial.hub != "")

    def _until(self, trial: VirtualTrial, condition: Callable[[], bool], limit: float = 40.0) -> None:
        end = trial.clock.now() + limit
        trial.clock.sleep(0.1)
        while not condition():
            if trial.clock.now() > end:
                raise TimeoutError(f"no hub within {limit:.0f} s")
            trial.clock.sleep(0.05)

    def figures(self) -> dict[str, Any]:
        """`moved`: largest displacement of the palm, m; None: the motion was not carried out."""
        palm = np.array(self.series.palm[slice(*self._span)])
        return {"moved": float(np.linalg.norm(palm - palm[0], axis=1).max()) if len(palm) else None}


# --- trials ---------------------------------------------------------------------------------------------------------


def run_trial(job: Job, watch_of: Callable[[VirtualTrial], Watch] = Watch) -> dict[str, Any]:
    """One trial as plain data: figures of its watch, `stuck`, `fell`, `speed` (virtual over processor time), `late`
    (of the reaches of receiving, see `arrives_late`). A recogniser watches, as in coglab.launch."""
    smach.set_loggers(*[lambda *a: None] * 4)
    begin = time.process_time()
    patterns = load_patterns(str(package_path("coglab_perception", "config", "patterns.json")))
    conditions = job.conditions
    if job.other is not None:
        motions, rng = shared_module("other_motions"), np.random.default_rng([job.seed, 71])
        motion = motions.other_motion(motions.KINDS[job.other % len(motions.KINDS)], rng, LISTENS)
        conditions = replace(conditions, person={"left_handed": bool(motion.segments[0].start[1] < 0.0)})
    trial = VirtualTrial(seed=job.seed, conditions=conditions, recogniser=Recogniser(*patterns))
    watch = watch_of(trial) if job.other is None else OtherWatch(trial, motion, rng, job.other % 2 == 1)
    stuck = ""
    try:
        trial.run(*job.actions, script=getattr(watch, "walk", None))
    except Exception as error:  # the script's own limit, or the physics has ended
        stuck = f"{type(error).__name__}: {error}"
    if not stuck and trial.last_hub not in HUBS:
        stuck = f"the machine waits in '{trial.last_hub}': {trial.why()}"
    return {
        "stuck": stuck,
        "fell": bool(trial.world.cell.truth()["dropped"]),
        "speed": trial.clock.now() / (time.process_time() - begin),
        "late": [arrives_late(reach) for reach in trial.reaches if reach.action == RECEIVE],
        **watch.figures(),
    }
