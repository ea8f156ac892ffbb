"""Records every handover into its own folder: a bag with the seconds before it, and `trial.yaml`.

Messages are stored as received bytes, without deserialising. Only transitions and results of /coglab, which start and
end a recording, are deserialised. The truth of the simulation is optional; if it is published, it is recorded too.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shutil
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from coglab.results import ACTIONS, reason_name
from coglab_msgs.msg import Transition
from coglab_smach.context.requests import HUBS

from coglab_tools.command import CommandError
from coglab_tools.trial.record import BAG, Outcome, TrialRecord

PRE_ROLL = 5.0  # s recorded before the action
POST_ROLL = 1.0  # s recorded after its result
NO_RESULT = 3.0  # s, longest wait for the result after the end of the action
LONGEST = 1800.0  # s, a longer action is cut off
MOST_WAITING = 100_000  # messages that wait for the disk; older ones are lost, with a note in trial.yaml
SET = 0.04  # s of ROS time against the recorder's clock that mean that this computer's clock was set
DISK_CHECK = 1.0  # s between two looks at the free space
NO_ACTIONS = (*HUBS, "stopped", "fault", "preempted")
HIDDEN = ".part-"
TRANSITIONS, RESULTS, NOTE = "coglab/transitions", "coglab/results", "coglab/note"
RUN_SPECIFIC = ("rosdistro", "roslaunch", "rosversion", "run_id", "robot_description")  # parameters


class Raw(NamedTuple):
    """A received message."""

    time: float
    """of receipt by the recorder's clock, which nobody sets, s"""
    topic: str
    """with leading slash"""
    data: bytes
    header: Mapping[str, str]
    """of the connection: type, md5sum, message_definition, callerid, latching"""
    ros: float
    """ROS time of receipt, s"""


@dataclass
class _Trial:
    """A running recording. Its times are of the recorder's clock."""

    action: str
    begun: float
    offset: float
    """from the recorder's clock to the times of the bag and of trial.yaml, s: ROS time as it was at the start"""
    part: Path
    bag: Any
    parameters: Mapping[str, Any]
    result: Mapping[str, Any] | None = None
    left: tuple[float, str, int, str] | None = None
    """end of the action in the machine: s, outcome, code, reason"""
    ends: float = float("inf")
    last: float = 0.0
    """time of the newest message, s"""
    step: float = 0.0
    """s by which this computer's clock was set since the start"""
    notes: list[str] = field(default_factory=list)
    said: list[tuple[float, str]] = field(default_factory=list)
    """notes of the experimenter: s, text"""


class Recorder:
    """The recorder without ROS: `put` takes messages from any thread, `step` does the work in one thread.

    folder: of the trials; parameters: returns all parameters of the system; least_free: bytes of the disk that stay
    free; say: called with a sentence for the log and True if it is an error.
    """

    def __init__(
        self,
        folder: Path,
        parameters: Callable[[], Mapping[str, Any]],
        say: Callable[[str, bool], None],
        least_free: float = 500e6,
        free: Callable[[Path], float] = lambda place: float(shutil.disk_usage(place).free),
    ) -> None:
        self.folder = folder
        self._parameters, self._say, self._least, self._free = parameters, say, least_free, free
        self._waiting: deque[Raw] = deque(maxlen=MOST_WAITING)
        self._ring: deque[Raw] = deque()
        self._latched: dict[tuple[str, str], Raw] = {}
        self._trial: _Trial | None = None
        self._begun = ""  # action that started last
        self._types: dict[str, type] = {}
        self._looked = 0.0
        self._lost = threading.Event()
        self._last: Path | None = None
        """the newest recording"""
        self._early: list[str] = []
        """notes before the first recording"""

    def put(self, message: Raw) -> None:
        """Queue a message. Returns at once; callable from any thread."""
        if len(self._waiting) == MOST_WAITING:
            self._lost.set()
        self._waiting.append(message)

    def step(self, now: float) -> None:
        """Write the messages since the last step. `now`: by the recorder's clock, s. A full disk ends the recording,
        not the node."""
        try:
            self._drain()
            trial = self._trial
            if trial is not None:
                if trial.left is not None and trial.result is None and now > trial.left[0] + NO_RESULT:
                    trial.ends = now
                if now > trial.begun + LONGEST:
                    trial.notes.append(f"cut off after {LONGEST:g} s")
                    trial.ends = now
                if abs(now - self._looked) > DISK_CHECK:
                    self._looked = now
                    if room := self._too_full():
                        trial.notes.append(f"recording stopped before the end: {room}")
                        self._say(f"the recording of {trial.action} stops here: {room}", True)
                        trial.ends = now
                if now >= trial.ends:
                    self._finish()
        except Exception as error:  # from the disk, rosbag, or a strange message
            self._give_up(error)
        while self._ring and self._ring[0].time < now - PRE_ROLL:
            self._ring.popleft()

    def close(self) -> None:
        """End at once; a running recording is finished early."""
        try:
            self._drain()
            if self._trial is not None:
                self._finish()
        except Exception as error:
            self._give_up(error)

    def _drain(self) -> None:
        while self._waiting:
            raw = self._waiting.popleft()
            name = raw.topic.lstrip("/")
            if raw.header.get("latching") == "1" and not name.endswith(NOTE):
                self._latched[raw.topic, raw.header.get("callerid", "")] = raw
            if name.endswith(TRANSITIONS):
                self._transition(raw)
            if self._trial is not None:
                _follow_clock(self._trial, raw)
                self._write(raw.time, raw)
            self._ring.append(raw)
            if name.endswith(RESULTS) and self._trial is not None:
                self._result(raw)
            if name.endswith(NOTE):
                self._note(raw)

    def _transition(self, raw: Raw) -> None:
        message = Transition()
        message.deserialize(raw.data)
        if message.path.count("/") != 1:  # inside an action
            return
        trial = self._trial
        if trial is not None and message.from_state == trial.action and trial.left is None:
            trial.left = (raw.time, message.outcome, int(message.reason_code), message.reason)
        if trial is None and message.from_state in ACTIONS.values() and message.from_state != self._begun:
            words = f"the handover that ended now ({message.from_state}) is not recorded: it began before this node ran"
            self._say(words, True)
        if message.from_state in HUBS and message.to_state not in NO_ACTIONS:
            self._begun = message.to_state
            if trial is not None:
                self._finish()
            self._begin(message.to_state, raw.time, raw.ros - raw.time)

    def _result(self, raw: Raw) -> None:
        from std_msgs.msg import String

        trial, message = self._trial, String()
        message.deserialize(raw.data)
        try:
            row = json.loads(message.data)
            if trial is None or row["kind"] != trial.action:
                return
            for name in ("started_ros", "ended_ros"):  # the brain has converted both by its clock of the end
                if name in row:
                    row[name] = float(row[name]) - trial.step
            fits = row["ended_ros"] > trial.begun + trial.offset
        except (ValueError, KeyError, TypeError):  # of another node
            return
        if fits and trial.result is None:
            trial.result, trial.ends = row, raw.time + POST_ROLL

    def _note(self, raw: Raw) -> None:
        """A note belongs to the running handover, with its time as a mark; otherwise to the last one; before the
        first one, to the first."""
        from std_msgs.msg import String

        message = String()
        message.deserialize(raw.data)
        text = " ".join(str(message.data).split())
        if self._trial is not None:
            self._trial.said.append((raw.time, text))
        elif self._last is None:
            self._early.append(text)
        else:
            try:
                _noted(TrialRecord.load(self._last), [text]).save(self._last)
            except (CommandError, OSError) as error:  # the recording was moved or removed
                self._say(f"a note was not recorded ({error}): {text}", True)

    def _begin(self, action: str, begun: float, offset: float) -> None:
        import rosbag

        self.folder.mkdir(parents=True, exist_ok=True)
        if room := self._too_full():
            self._say(f"this handover ({action}) is not recorded: {room}", True)
            return
        part = self.folder / f"{HIDDEN}{os.getpid()}-{begun:.3f}"
        part.mkdir()
        try:
            bag = rosbag.Bag(str(part / BAG), "w")
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        self._trial = _Trial(action, begun, offset, part, bag, {})
        first = self._ring[0].time if self._ring else begun
        for raw in self._latched.values():
            if raw.time < first:
                self._write(first, raw)
        for raw in self._ring:
            self._write(raw.time, raw)
        self._trial.parameters = self._parameters()

    def _write(self, time: float, raw: Raw) -> None:
        import genpy

        assert self._trial is not None
        header = raw.header
        kind = self._types.get(raw.topic)
        if kind is None:  # rosbag needs a class with these two fields
            text, digest = header["message_definition"], header["md5sum"]
            kind = self._types[raw.topic] = type("Recorded", (), {"_full_text": text, "_md5sum": digest})
        message = (header["type"], raw.data, header["md5sum"], kind)
        connection = {"topic": raw.topic, "type": header["type"], "md5sum": header["md5sum"]}
        connection["message_definition"] = header["message_definition"]
        for name in ("callerid", "latching"):
            if name in header:
                connection[name] = header[name]
        self._trial.last = max(self._trial.last, time)
        stamp = genpy.Time.from_sec(max(0.0, time + self._trial.offset))
        self._trial.bag.write(raw.topic, message, stamp, raw=True, connection_header=connection)

    def _finish(self) -> None:
        trial = self._trial
        assert trial is not None
        trial.bag.close()
        if self._lost.is_set():
            trial.notes.append("messages were lost: the disk was too slow")
            self._lost.clear()
        record = _record_of(trial)
        name = record.id
        for number in range(2, 1000):
            if not (self.folder / name).exists():
                break
            name = f"{record.id}_{number}"
        record = _noted(replace(record, id=name), self._early)
        record.save(trial.part)
        trial.part.rename(self.folder / name)
        self._trial, self._last, self._early = None, self.folder / name, []
        how = "succeeded" if record.outcome.success else f"{record.outcome.reason}: {record.outcome.text}"
        self._say(f"recorded {self.folder / name} ({how})", False)

    def _give_up(self, error: Exception) -> None:
        trial, self._trial = self._trial, None
        why = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
        where = f"{self.folder}: {why}"
        self._say(f"this handover is not recorded, {where}; the robot goes on. Make room or name another folder", True)
        if trial is not None:
            try:
                trial.bag._file.close()  # close() would write its index to a full disk again
            except Exception:
                pass
            shutil.rmtree(trial.part, ignore_errors=True)

    def _too_full(self) -> str:
        """Sentence if the disk has too little room; empty otherwise."""
        left = self._free(self.folder)
        if left >= self._least:
            return ""
        return (
            f"the disk of {self.folder} has {left / 1e6:.0f} MB left, and {self._least / 1e6:.0f} MB stay free; remove "
            "something, or launch with record:=FOLDER on another disk"
        )


def _follow_clock(trial: _Trial, raw: Raw) -> None:
    """Note a step of this computer's clock. The times of the recording do not follow it."""
    step = raw.ros - raw.time - trial.offset
    by, when = step - trial.step, raw.time - trial.begun
    if abs(by) > SET:
        trial.step = step
        trial.notes.append(
            f"this computer's clock was set by {by:+.2f} s, {when:.1f} s after the start; times of this recording are "
            f"of the clock before, and later stamps inside messages differ by {step:+.2f} s"
        )


def _record_of(trial: _Trial) -> TrialRecord:
    row, parameters = trial.result or {}, trial.parameters
    if row:
        ok = row.get("outcome") == "succeeded"
        code = 0 if ok else int(row.get("reason_code", 0))
        outcome = Outcome(ok, code, reason_name(code), "" if ok else str(row.get("reason", "")))
    elif trial.left is not None:
        _, how, code, reason = trial.left
        outcome = Outcome(how == "succeeded", code, reason_name(code), reason)
    else:
        outcome = Outcome(False, 0, "NONE", "the recording ended before the action did")
    begun = float(row.get("started_ros", trial.begun + trial.offset))
    ended = trial.left[0] if trial.left else max(trial.begun, trial.last)
    ended = float(row.get("ended_ros", ended + trial.offset))
    shift = begun - float(row.get("started", begun))
    marks = sorted((float(when) + shift - begun, str(name)) for name, when in dict(row.get("marks", {})).items())
    marks += [(when + trial.offset - begun, f"note: {text}") for when, text in trial.said]
    told = parameters.get("coglab", {})
    told = told.get("trial", {}) if isinstance(told, Mapping) else {}
    told = told if isinstance(told, Mapping) else {}
    thing = str(row.get("object_id", ""))
    words = [f"{datetime.fromtimestamp(begun, UTC):%Y%m%dT%H%M%SZ}", trial.action, thing]
    flat = _flat(parameters)
    seeds = [value for name, value in flat.items() if name.endswith("/seed") and isinstance(value, int)]
    return TrialRecord(
        id="_".join(clean for word in words if (clean := re.sub(r"[^A-Za-z0-9-]+", "_", word).strip("_"))),
        started=datetime.fromtimestamp(begun, UTC).isoformat(timespec="milliseconds"),
        duration_s=round(ended - begun, 3),
        action=trial.action,
        object=thing,
        outcome=outcome,
        condition=str(told.get("condition", "")),
        participant=str(told.get("participant", "")),
        session=str(told.get("session", "")),
        study=str(told.get("study", "")),
        seed=seeds[0] if seeds else None,
        simulated="coglab_sim" in parameters,
        configuration={"hash": configuration_hash(flat), **_short(flat), "files": _files(flat)},
        versions=_versions(),
        marks=tuple({"name": name, "time_s": round(when, 3)} for when, name in sorted(marks)),
        notes="; ".join(filter(None, [str(told.get("notes", "")), *trial.notes, *(text for _, text in trial.said)])),
    )


def _noted(record: TrialRecord, texts: Sequence[str]) -> TrialRecord:
    return replace(record, notes="; ".join(filter(None, [record.notes, *texts])))


def _flat(tree: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Parameters by full name, without those of a single run."""
    found: dict[str, Any] = {}
    for name, value in tree.items():
        full = f"{above}/{name}"
        if not above and name in RUN_SPECIFIC or full.startswith("/coglab/trial"):
            continue
        if isinstance(value, Mapping):
            found.update(_flat(value, full))
        else:
            found[full] = value
    return found


def configuration_hash(flat: Mapping[str, Any]) -> str:
    """SHA-256 of the parameters by name, 16 hexadecimal digits. The same settings give the same hash."""
    settings = {name: value for name, value in flat.items() if "port" not in name}
    text = json.dumps(settings, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _short(flat: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters that a person can read: no long texts or tables."""
    return {name: value for name, value in sorted(flat.items()) if len(str(value)) <= 200}


def _files(flat: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 of each configuration file that a parameter names, 16 hexadecimal digits, by the parameter's name."""
    found = {}
    for name, value in sorted(flat.items()):
        if isinstance(value, str) and value.endswith((".yaml", ".xml", ".json")) and len(value) < 4096:
            try:
                found[name] = hashlib.sha256(Path(value).read_bytes()).hexdigest()[:16]
            except OSError:
                continue
    return found


def _versions() -> dict[str, str]:
    import rospkg

    try:
        own = str(rospkg.RosPack().get_manifest("coglab_tools").version)
    except (rospkg.ResourceNotFound, rospkg.InvalidManifest):
        own = "unknown"
    try:
        debian = Path("/etc/debian_version").read_text(encoding="utf-8").strip()
    except OSError:
        debian = "unknown"
    return {"coglab": own, "python": platform.python_version(), "debian": debian}
