"""The record of a trial: results, phases, and traces of hands, object and forces."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from coglab_smach.context.journal import TransitionRecord
from coglab_trials import Conditions, VirtualTrial
from coglab_trials.world import DT

from coglab.fluency import (
    FINGER_SPEED,
    PALM_SPEED,
    PERSON_SPEED,
    TOUCH,
    Fluency,
    active_intervals,
    fluency_of,
    speed_of,
)
from coglab.results import Exchange
from coglab.series import Series, state_intervals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HOLDERS = ("nobody", "human", "robot", "board")
"""values of ``Trial.held_by``"""
VERSION = 1  # of the files that save() writes
SAMPLE = 2  # periods between two samples: 10 ms

ARRAYS = {
    "time": (),
    "palm_position": (3,),
    "palm_orientation": (4,),
    "person_position": (3,),
    "person_orientation": (4,),
    "object_position": (3,),
    "object_orientation": (4,),
    "joints": (7,),
    "joint_velocity": (7,),
    "external_torque": (7,),
    "fingers": (5,),
    "hand_force": (3,),
    "person_force": (3,),
    "held_by": (),
}
"""arrays of a Trial, with the shape of one sample"""


@dataclass(frozen=True)
class Phase:
    """One state of the machines while it was active. Times in s."""

    path: str
    """its container, such as "/coglab_master/take" """
    state: str
    start: float
    end: float


@dataclass(frozen=True, eq=False, repr=False)
class Trial:
    """Record of one trial in a World. Arrays have one row per sample, every 10 ms. Poses in the base frame: positions
    in m, orientations as quaternions x y z w. All values are true ones of the simulation, not the robot's measurements.

    Read it, ``plot()`` it, ``save()`` it; ``Trial.load()`` reads it again. ``bool(trial)``: all actions succeeded.
    """

    seed: int
    conditions: dict[str, Any]
    """fields of coglab_trials.Conditions"""
    results: tuple[Exchange, ...]
    """one per action"""
    start: float
    """s of virtual time"""
    end: float
    phases: tuple[Phase, ...]
    """the phase timeline, in the order of their ends"""
    transitions: tuple[tuple[float, str, str, str, str, str, int], ...]
    """(s, container, from, outcome, to, reason, reason code)"""
    contacts: tuple[tuple[float, bool, float, str], ...]
    """events of the contact detector: (s, True: contact or load, False: load taken over; margin, text)"""
    said: tuple[tuple[float, str], ...]
    """messages to the person: (s, name of coglab_msgs/Say)"""
    time: np.ndarray
    """s, shape (n,)"""
    palm_position: np.ndarray
    palm_orientation: np.ndarray
    person_position: np.ndarray
    """the person's hand"""
    person_orientation: np.ndarray
    object_position: np.ndarray
    object_orientation: np.ndarray
    joints: np.ndarray
    """rad, shape (n, 7), wire order a1 a2 e1 a3 a4 a5 a6, as measured"""
    joint_velocity: np.ndarray
    """rad/s, shape (n, 7)"""
    external_torque: np.ndarray
    """Nm, shape (n, 7), as the robot controller estimates it"""
    fingers: np.ndarray
    """positions of five motors, 0 open .. 254 closed, shape (n, 5); NaN before the first reading"""
    hand_force: np.ndarray
    """N, shape (n, 3), on palm and fingers of the robot, base frame"""
    person_force: np.ndarray
    """N, shape (n, 3), on the person's hand, base frame; includes the weight of an object in it"""
    held_by: np.ndarray
    """index into HOLDERS, shape (n,)"""
    labels: Mapping[str, str] = field(default_factory=dict)
    """participant, condition, study, session, notes, as in the trial.yaml of a recorded handover"""

    def __repr__(self) -> str:
        said = "; ".join(map(str, self.results)) or "no action"
        thing = self.conditions.get("object_id", "")
        return f"<coglab.Trial seed={self.seed} {thing}, {self.end - self.start:.1f} s: {said}>"

    def __bool__(self) -> bool:
        return bool(self.results) and all(result.ok for result in self.results)

    def fluency(self) -> Fluency:
        """Objective fluency (Hoffman 2019) from the first action's start to the last one's end.

        The person is active while their hand moves faster than 0.05 m/s; the robot while its palm does, or while its
        fingers move. See ``coglab.fluency`` for the definitions.
        """
        start = self.results[0].started if self.results else self.start
        end = self.results[-1].ended if self.results else self.end
        return fluency_of(self.person_activity(), self.robot_activity(), start, end)

    def person_activity(self) -> list[tuple[float, float]]:
        """Intervals (s) in which the person is active."""
        return active_intervals(self.time, speed_of(self.time, self.person_position) > PERSON_SPEED)

    def robot_activity(self) -> list[tuple[float, float]]:
        """Intervals (s) in which the robot is active."""
        moving = speed_of(self.time, self.palm_position) > PALM_SPEED
        fingers = np.nan_to_num(self.fingers, nan=0.0)
        closing = np.abs(np.gradient(fingers, self.time, axis=0)).max(axis=1) if len(self.time) > 1 else moving
        return active_intervals(self.time, moving | (closing > FINGER_SPEED))

    @property
    def peak_force(self) -> float:
        """N, largest force on the robot's hand while the person touches the object too; 0 if never."""
        shared = np.linalg.norm(self.person_force, axis=1) > TOUCH
        return float(np.linalg.norm(self.hand_force[shared], axis=1).max(initial=0.0))

    def series(self) -> Series:
        """The record as rows, as in plots and reports of running systems."""
        rows = range(len(self.time))
        forces = np.linalg.norm(self.hand_force, axis=1)
        truth: list[tuple[Any, ...]] = [
            (t, palm, person, thing, float(force))
            for t, palm, person, thing, force in zip(
                self.time, self.palm_position, self.person_position, self.object_position, forces, strict=True
            )
        ]
        seen = ~np.isnan(self.fingers).any(axis=1) if len(self.time) else []
        return Series(
            joints=[(self.time[i], self.joints[i], self.joint_velocity[i]) for i in rows],
            external_torques=[(self.time[i], self.external_torque[i]) for i in rows],
            truth=truth,
            fingers=[(self.time[i], self.fingers[i]) for i in rows if seen[i]],
            transitions=list(self.transitions),
            contacts=list(self.contacts),
        )

    def plot(self, title: str = "") -> Figure:
        """Draw phases, paths, speeds, torques, fingers and force on one time axis. Returns a matplotlib Figure:
        ``trial.plot().savefig("trial.png")``."""
        from coglab.plot import figure_of

        words = ", ".join(str(result) for result in self.results)
        return figure_of(self.series(), title or f"seed {self.seed}; {words}", self.start, self.end)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write ``trial.npz`` (arrays) and ``trial.yaml`` (all else) into a new folder, completely or not at all.
        Returns the folder. FileExistsError: it exists and is not empty."""
        target = Path(folder)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise FileExistsError(f"{target} exists: give save() a new folder, or remove that one")
        target.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        try:
            np.savez_compressed(part / "trial.npz", **{name: getattr(self, name) for name in ARRAYS})
            data = {"version": VERSION, **_plain({f.name: getattr(self, f.name) for f in fields(self)})}
            text = yaml.safe_dump({k: v for k, v in data.items() if k not in ARRAYS}, sort_keys=False)
            (part / "trial.yaml").write_text(text, encoding="utf-8")
            part.chmod(0o755)
            if target.exists():
                target.rmdir()
            part.rename(target)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        return target

    @staticmethod
    def load(folder: str | os.PathLike[str]) -> Trial:
        """Read the files of ``save()``. ValueError names the file and the error."""
        place = Path(folder)
        words, numbers = place / "trial.yaml", place / "trial.npz"
        for file in (words, numbers):
            if not file.is_file():
                raise FileNotFoundError(f"{file} is not there: give the folder that Trial.save() returned")
        try:
            data: dict[str, Any] = yaml.safe_load(words.read_text(encoding="utf-8"))
            version = data.pop("version")
            if version != VERSION:
                raise ValueError(f"its version is {version}, this program reads version {VERSION}")
            with np.load(numbers, allow_pickle=False) as stored:
                arrays: dict[str, Any] = {name: stored[name] for name in ARRAYS}
            count = len(arrays["time"])
            for name, shape in ARRAYS.items():
                if arrays[name].shape != (count, *shape):
                    raise ValueError(f"{name} has the shape {arrays[name].shape}, {(count, *shape)} is expected")
            data["results"] = tuple(_exchange(row) for row in data["results"])
            data["phases"] = tuple(Phase(**row) for row in data["phases"])
            for name in ("transitions", "contacts", "said"):
                data[name] = tuple(map(tuple, data[name]))
            return Trial(**data, **arrays)
        except FileNotFoundError:
            raise
        except Exception as error:  # from yaml, zip, numpy, or a missing field
            raise ValueError(f"{place} has no trial that can be read: {error}") from None


def _exchange(row: dict[str, Any]) -> Exchange:
    values: dict[str, Any] = {**row, "causes": tuple(row["causes"])}
    return Exchange(**values)


class Recording:
    """A record in the making, from World.record(). ``trial`` is there when the block has ended."""

    def __init__(self, trial: VirtualTrial, seed: int, conditions: Conditions) -> None:
        self._virtual, self._seed, self._conditions = trial, seed, conditions
        self._begun = trial.clock.now()
        self._rows: dict[str, list[Any]] = {name: [] for name in ARRAYS}
        self._contacts: list[tuple[float, bool, float, str]] = []
        self._event: Any = None
        self._trial: Trial | None = None

    @property
    def trial(self) -> Trial:
        """The finished record. RuntimeError inside the block."""
        if self._trial is None:
            raise RuntimeError("the record is not finished: read it after its with block")
        return self._trial

    def _look(self) -> None:
        """Take a sample; called after each period."""
        world, now = self._virtual.world, self._virtual.clock.now() + DT  # the period that has just ended
        event = self._virtual.contact.event()
        if event is not None and event is not self._event:
            self._contacts.append((now, bool(event.contact), float(event.margin), f"{event.source}: {event.message}"))
        self._event = event
        if world.ticks % SAMPLE:
            return
        truth, report = world.truth, world.robot.report
        positions = world.hand.positions
        sample = {
            "time": now,
            "palm_position": truth["robot_hand"]["position"],
            "palm_orientation": truth["robot_hand"]["rotation"],
            "person_position": truth["human_hand"]["position"],
            "person_orientation": truth["human_hand"]["rotation"],
            "object_position": truth["object"]["position"],
            "object_orientation": truth["object"]["rotation"],
            "joints": report["position"],
            "joint_velocity": report["measured_velocity"],
            "external_torque": report["external_torque"],
            "fingers": positions if len(positions) == 5 else (np.nan,) * 5,
            "hand_force": truth["touch_force"],
            "person_force": truth["human_force"],
            "held_by": HOLDERS.index(truth["held_by"]) if truth["held_by"] in HOLDERS else 0,
        }
        for name, value in sample.items():
            self._rows[name].append(value)

    def _end(self) -> None:
        from coglab.world import exchange_of, say_name

        virtual, end = self._virtual, self._virtual.clock.now()
        records: Sequence[TransitionRecord] = virtual.ctx.journal.transitions
        all_rows = [
            (float(r.stamp), r.path, r.from_state, r.outcome, r.to_state, r.reason, int(r.code)) for r in records
        ]
        before = DT / 2
        phases = [
            Phase(path, state, max(since, self._begun), min(until, end))
            for path, intervals in state_intervals(all_rows, end).items()
            for since, until, state in intervals
            if until >= self._begun - before and since <= end
        ]
        arrays: dict[str, Any] = {
            name: np.array(rows, dtype=int if name == "held_by" else float).reshape(len(rows), *ARRAYS[name])
            for name, rows in self._rows.items()
        }
        self._trial = Trial(
            self._seed,
            _plain(asdict(self._conditions)),
            tuple(exchange_of(r) for r in virtual.results if r.started >= self._begun - before),
            self._begun,
            end,
            tuple(sorted(phases, key=lambda phase: (phase.end, phase.start))),
            tuple(row for row in all_rows if row[0] >= self._begun - before),
            tuple(self._contacts),
            tuple((float(t), say_name(code)) for t, code in virtual.said if t >= self._begun - before),
            **arrays,
        )


def _plain(value: Any) -> Any:
    """The value made of dicts, lists, numbers and text, for a YAML file."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Exchange | Phase):
        return _plain(asdict(value))
    return value
