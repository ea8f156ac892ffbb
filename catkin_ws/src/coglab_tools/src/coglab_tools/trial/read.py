"""Reads the measurements of a trial, from a bag of ROS or from arrays of virtual time, into one form."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from coglab.results import ACTIONS, Exchange, reason_name
from coglab.series import Series

from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.trial.record import ARRAYS, BAG, Outcome, TrialRecord

JOINTS = "lwr/joint_states"
MOST_SECONDS = 24 * 3600.0  # kept length of tf
HALVED = (JOINTS, "lwr/external_torques")  # 100 Hz of them are enough for plots, and are read in half the time
TRUTH = "coglab_sim/truth/cell"
WITHOUT_TRUTH = ("tf", "tf_static", "contact_detector/force")
PALM, PERSON = "ih2_palm", "human_hand"
WORLD = "world"


@dataclass
class Measured:
    """One trial in numbers. Times in s on one clock: ROS time for a bag, virtual time for arrays."""

    record: TrialRecord
    start: float
    """start of the action"""
    end: float
    """end of the action"""
    series: Series
    exchanges: tuple[Exchange, ...] = ()
    said: list[tuple[float, str]] = field(default_factory=list)
    """messages of the robot to the person"""
    person_force: list[tuple[float, float]] = field(default_factory=list)
    """N on the person's hand; empty without the simulation's truth"""
    orientations: list[tuple[float, tuple[float, ...], tuple[float, ...]]] = field(default_factory=list)
    """(t, person's hand, object): true quaternions x y z w in the world; empty without the truth"""
    true_hands: bool = False
    """False: paths of the hands and the object come from perception and joints"""
    sources: dict[str, str] = field(default_factory=dict)
    """source of each value, by its name"""

    @property
    def marks(self) -> dict[str, float]:
        """Times of events of all actions, s after the start; the first of each name."""
        found: dict[str, float] = {}
        for mark in self.record.marks:
            found.setdefault(mark["name"], mark["time_s"])
        return found

    def parts(self) -> list[Measured]:
        """One trial per action, where several were recorded together; else this one."""
        if len(self.exchanges) < 2:
            return [self]
        return [
            replace(
                self,
                record=replace(
                    self.record,
                    action=ACTIONS.get(e.what, e.what),
                    object=e.object_id,
                    outcome=Outcome(e.ok, e.code, reason_name(e.code), e.sentence),
                    duration_s=round(e.duration, 3),
                    marks=tuple({"name": name, "time_s": round(when - e.started, 3)} for name, when in e.marks.items()),
                    notes="",
                ),
                start=e.started,
                end=e.ended,
                exchanges=(e,),
            )
            for e in self.exchanges
        ]


def read_trial(folder: str | Path) -> Measured:
    """Read the trial in a folder. UsageError: there is none. CheckFailed: a file of it is unusable."""
    place = Path(folder)
    record = TrialRecord.load(place)
    if (place / BAG).is_file():
        return _from_bag(place / BAG, record)
    if (place / ARRAYS).is_file():
        return _from_arrays(place, record)
    raise CheckFailed(f"{place} has neither {BAG} nor {ARRAYS}: the measurements of this trial are missing")


def messages(file: Path, wanted: Callable[[set[str]], list[str]] = list) -> Iterator[tuple[str, Any, float]]:
    """Topic without leading slash, message and time of receipt (s) of the bag's messages. CheckFailed: it is no bag, or
    a damaged one. `wanted`: returns the topics to read, given those of the bag; of HALVED every second one is read."""
    import rosbag

    if not file.is_file():
        raise UsageError(f"{file} is not there: give the bag of a trial")
    if file.stat().st_size == 0:
        raise CheckFailed(f"{file} is empty: its recording never ended")
    try:
        with rosbag.Bag(str(file)) as bag:
            names = {info.topic.lstrip("/"): info.topic for info in bag._get_connections()}
            chosen = [names[name] for name in wanted(set(names)) if name in names]
            turn = dict.fromkeys(HALVED, False)
            if not chosen:
                return
            for topic, (_, data, _, _, kind), stamp in bag.read_messages(topics=chosen, raw=True):
                name = topic.lstrip("/")
                if name in turn:
                    turn[name] = not turn[name]
                    if not turn[name]:
                        continue
                message = kind()
                message.deserialize(data)
                yield name, message, stamp.to_sec()
    except rosbag.ROSBagUnindexedException:
        raise CheckFailed(
            f"{file} has no index, as its recording was cut off: `rosbag reindex {file}` makes one"
        ) from None
    except GeneratorExit:
        raise
    except Exception as error:  # of rosbag, genpy, struct or the file: a foreign or damaged bag
        raise CheckFailed(
            f"{file} cannot be read as a bag: {' '.join(str(error).split()) or type(error).__name__}"
        ) from None


def _from_arrays(place: Path, record: TrialRecord) -> Measured:
    from coglab.trial import Trial

    try:
        trial = Trial.load(place)
    except (ValueError, FileNotFoundError) as error:
        raise CheckFailed(str(error)) from None
    series = trial.series()
    start = trial.results[0].started if trial.results else trial.start
    end = trial.results[-1].ended if trial.results else trial.end
    forces = np.linalg.norm(trial.person_force, axis=1)
    turns = trial.person_orientation.tolist(), trial.object_orientation.tolist()
    orientations = [(t, tuple(a), tuple(b)) for t, a, b in zip(trial.time.tolist(), *turns, strict=True)]
    return Measured(
        record, start, end, series, trial.results, list(trial.said),
        [(float(t), float(f)) for t, f in zip(trial.time, forces, strict=True)],
        orientations, True,
        {"hands": "truth of the simulation", "force": "truth of the simulation"},
    )  # fmt: skip


class _Reader:
    """Sorts the messages of one bag into a Series."""

    def __init__(self) -> None:
        self.series = Series()
        self.said: list[tuple[float, str]] = []
        self.results: list[dict[str, Any]] = []
        self.person_force: list[tuple[float, float]] = []
        self.force: list[tuple[float, float]] = []
        self.orientations: list[tuple[float, tuple[float, ...], tuple[float, ...]]] = []
        self._buffer: Any = None
        self.person_stamps: list[float] = []
        self.objects: dict[str, list[float]] = {}
        self.take: dict[str, Callable[[Any, float], None]] = {
            JOINTS: self._joints,
            "lwr/external_torques": self._torques,
            TRUTH: self._truth,
            "ih2_hand/hand_status": self._hand,
            "controller_manager/dmp/feedback": self._feedback,
            "coglab/transitions": self._transition,
            "coglab/contact": self._contact,
            "coglab/results": self._result,
            "contact_detector/force": self._detector_force,
            "say": self._say,
            "tf": self._frames,
            "tf_static": self._static,
        }

    def _joints(self, m: Any, t: float) -> None:
        if len(m.position) == 7 and len(m.velocity) == 7:
            self.series.joints.append((t, m.position, m.velocity))

    def _torques(self, m: Any, t: float) -> None:
        if len(m.effort) == 7:
            self.series.external_torques.append((t, m.effort))

    def _truth(self, m: Any, t: float) -> None:
        points = (m.robot_hand.position, m.human_hand.position, m.object.position, m.touch_force)
        robot, human, thing, force = ([p.x, p.y, p.z] for p in points)
        self.series.truth.append((t, robot, human, thing, float(np.linalg.norm(force))))
        h, o = m.human_hand.orientation, m.object.orientation
        self.orientations.append((t, (h.x, h.y, h.z, h.w), (o.x, o.y, o.z, o.w)))
        f = m.human_force
        self.person_force.append((t, float(np.linalg.norm([f.x, f.y, f.z]))))

    def _hand(self, m: Any, t: float) -> None:
        if len(m.motors) == 5:
            self.series.fingers.append((t, [motor.position for motor in m.motors]))

    def _feedback(self, m: Any, t: float) -> None:
        self.series.feedback.append((t, m.state, m.remaining_distance))

    def _transition(self, m: Any, t: float) -> None:
        row = (t, m.path, m.from_state, m.outcome, m.to_state, m.reason, m.reason_code)
        self.series.transitions.append(row)

    def _contact(self, m: Any, t: float) -> None:
        self.series.contacts.append((t, m.contact, m.margin, f"{m.source}: {m.message}"))

    def _result(self, m: Any, _t: float) -> None:
        try:
            row = json.loads(m.data)
        except ValueError:  # from another node
            return
        if isinstance(row, dict) and row not in self.results:
            self.results.append(row)

    def _detector_force(self, m: Any, t: float) -> None:
        self.force.append((t, float(np.linalg.norm([m.vector.x, m.vector.y, m.vector.z]))))

    def _say(self, m: Any, t: float) -> None:
        self.said.append((t, m.text))

    def _tree(self) -> Any:
        if self._buffer is None:
            import genpy
            import tf2_py

            self._buffer = tf2_py.BufferCore(genpy.Duration.from_sec(MOST_SECONDS))
        return self._buffer

    def wanted(self, there: set[str]) -> list[str]:
        """Topics to read; those for the hands only if the bag has no truth."""
        return [name for name in self.take if not (TRUTH in there and name in WITHOUT_TRUTH)]

    def _frames(self, m: Any, _t: float) -> None:
        for each in m.transforms:
            self._tree().set_transform(_own(each), "bag")
            if each.child_frame_id.strip("/") == PERSON:
                self.person_stamps.append(each.header.stamp.to_sec())

    def _static(self, m: Any, _t: float) -> None:
        for each in m.transforms:
            self._tree().set_transform_static(_own(each), "bag")

    def path_of(self, frame: str, stamps: list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Times (s) and positions (m, [n, 3]) of a frame in the world, from tf."""
        if self._buffer is None:
            return np.empty(0), np.empty((0, 3))
        import genpy
        import tf2_py

        times, points = [], []
        for stamp in sorted(set(stamps)):
            try:
                p = self._buffer.lookup_transform_core(WORLD, frame, genpy.Time.from_sec(stamp)).transform.translation
            except tf2_py.TransformException:
                continue
            times.append(stamp)
            points.append([p.x, p.y, p.z])
        return np.array(times), np.array(points).reshape(-1, 3)


def _own(frame: Any) -> Any:
    """Converts a transform of the bag's own type to the installed type, which tf needs."""
    from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

    found, move, turn = TransformStamped(), frame.transform.translation, frame.transform.rotation
    found.header.stamp, found.header.frame_id = frame.header.stamp, frame.header.frame_id.lstrip("/")
    found.child_frame_id = frame.child_frame_id.lstrip("/")
    found.transform.translation = Vector3(move.x, move.y, move.z)
    found.transform.rotation = Quaternion(turn.x, turn.y, turn.z, turn.w)
    return found


def _from_bag(file: Path, record: TrialRecord) -> Measured:
    reader = _Reader()
    for topic, message, received in messages(file, reader.wanted):
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        time = stamp.to_sec() if stamp is not None and stamp.to_sec() > 0.0 else received
        try:
            reader.take[topic](message, time)
        except AttributeError as error:  # a topic of ours with a message of another type
            raise CheckFailed(f"{file}: {topic} holds {message._type}, which lacks a field: {error}") from None
    series = reader.series
    for rows in (
        series.joints,
        series.truth,
        series.external_torques,
        series.transitions,
        series.contacts,
        series.fingers,
    ):
        rows.sort(key=lambda row: row[0])
    exchanges = tuple(found for row in reader.results if (found := _exchange(row)) is not None)
    wanted = [e for e in exchanges if ACTIONS.get(e.what, e.what) in record.action.split("+")][-1:]
    if wanted:
        start, end = wanted[0].started, wanted[0].ended
    else:
        start, end = _span(file, series, record)
    sources = {"hands": "truth of the simulation", "force": "truth of the simulation"}
    true_hands = len(series.truth) > 2
    if not true_hands:
        series.truth = _seen(reader)
        sources = {
            "hands": "tf: the palm by the measured joints, the person's hand as the tracker saw it",
            "force": "contact detector, from joint torques",
        }
    return Measured(
        record,
        start,
        end,
        series,
        tuple(wanted),
        reader.said,
        reader.person_force,
        reader.orientations,
        true_hands,
        sources,
    )


def _span(file: Path, series: Series, record: TrialRecord) -> tuple[float, float]:
    """Start and end of an action without a result: from the transitions, else the whole recording."""
    every = [row[0] for rows in (series.joints, series.truth, series.transitions) for row in rows]
    if not every:
        raise CheckFailed(
            f"{file} has no message of a handover: no {JOINTS}, coglab/transitions or {TRUTH}; `rosbag info` lists "
            "what it has"
        )
    begun = [row[0] for row in series.transitions if row[4] == record.action]
    start = begun[0] if begun else min(every)
    return start, start + record.duration_s if record.duration_s > 0.0 else max(every)


def _exchange(row: dict[str, Any]) -> Exchange | None:
    """Result of an action from its row on coglab/results, in ROS time; None: the row is another node's."""
    try:
        shift = float(row["started_ros"]) - float(row["started"])
        ok, kind = row["outcome"] == "succeeded", str(row["kind"])
        return Exchange(
            next((name for name, action in ACTIONS.items() if action == kind), kind), ok,
            0 if ok else int(row["reason_code"]), str(row["reason"]), tuple(map(str, row["causes"])),
            float(row["started_ros"]), float(row["ended_ros"]), str(row["object_id"]), str(row["outcome"]),
            {str(name): float(when) + shift for name, when in row["marks"].items()},
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError):
        return None


def _seen(reader: _Reader) -> list[tuple[Any, ...]]:
    """Rows like those of the truth, from a real robot's measurements: NaN without a sight."""
    joints = [row[0] for row in reader.series.joints][::2]
    times, palm = reader.path_of(PALM, joints)
    if not len(times):
        return []
    seen, person = reader.path_of(PERSON, reader.person_stamps)
    hand = np.full((len(times), 3), np.nan)
    if len(seen) > 1:
        near = np.abs(seen[np.clip(np.searchsorted(seen, times), 0, len(seen) - 1)] - times) < 0.5
        between = np.column_stack([np.interp(times, seen, axis) for axis in person.T])
        hand[near] = between[near]
    force = np.full(len(times), np.nan)
    if reader.force:
        force = np.interp(times, [t for t, _ in reader.force], [f for _, f in reader.force], left=np.nan, right=np.nan)
    nothing = [np.nan] * 3
    return [(t, list(p), list(h), nothing, float(f)) for t, p, h, f in zip(times, palm, hand, force, strict=True)]
