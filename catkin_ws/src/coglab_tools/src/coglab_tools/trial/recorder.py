"""The node /trial_recorder: each handover leaves a folder with a bag and a `trial.yaml`.

It keeps the last seconds of every topic. When the brain leaves its hub, a bag begins with them; a moment after the
action's result the bag ends, `trial.yaml` is written, and the folder gets its name. What is in the making has a name
that begins with a dot. Messages are stored as they come, without being decoded.

Parameters: ~folder (default: out/trials of the checkout, else ~/.ros/coglab_trials), ~topics (names), ~pre_roll,
~post_roll (s). Of the brain's namespace: trial/study, trial/session, trial/participant, trial/condition, trial/notes.
"""

from __future__ import annotations

import json
import shutil
import sys
import threading
import time
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import rosbag
import rospy
from coglab.results import reason_name
from coglab_msgs.msg import MasterState
from coglab_py import parameters
from coglab_py.alone import init_node
from std_msgs.msg import String

from coglab_tools.trial.record import BAG, LEFT_OUT, TrialRecord, default_folder, hash_of, versions

TOPICS = (
    "/tf",
    "/tf_static",
    "/diagnostics",
    "/rosout",
    "lwr/joint_states",
    "lwr/external_torques",
    "lwr/state",
    "lwr/target_joint_states",
    "ih2_hand/hand_status",
    "ih2_hand/fingertip_forces",
    "controller_manager/status",
    "controller_manager/dmp/feedback",
    "controller_manager/feedback/status",
    "controller_manager/feedback/state",
    "contact_detector/signal",
    "coglab/state",
    "coglab/transitions",
    "coglab/results",
    "coglab/contact",
    "perception/belief",
    "coglab/say",
    "perception/recognition",
    "coglab_sim/truth/cell",
    "coglab_sim/real_time_factor",
)
LEAST_SPACE = 300e6  # bytes that must stay free
LONGEST = 600.0  # s, of one record; what takes longer is ended with a note
PARAMETERS_LIMIT = 5.0  # s, to read the parameters of the system


class Stored(NamedTuple):
    """One message as it came."""

    topic: str
    time: rospy.Time
    data: bytes
    header: dict[str, str]


class Memory:
    """The messages of the last seconds, and the last one of each latched topic and publisher."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._lock = threading.Lock()
        self._recent: deque[Stored] = deque()
        self._latched: dict[tuple[str, str], Stored] = {}
        self._tap: deque[Stored] | None = None

    def take(self, stored: Stored) -> None:
        """Keep a message. Any thread."""
        with self._lock:
            if stored.header.get("latching") == "1" or stored.topic == "/tf_static":
                self._latched[stored.topic, stored.header.get("callerid", "")] = stored
            if self._tap is not None:
                self._tap.append(stored)
                return
            self._recent.append(stored)
            oldest = stored.time.to_sec() - self.seconds
            while self._recent and self._recent[0].time.to_sec() < oldest:
                self._recent.popleft()

    def open(self) -> deque[Stored]:
        """From now on messages go to the returned queue, which begins with those that were kept."""
        with self._lock:
            begin = self._recent[0].time if self._recent else rospy.Time.now()
            older = [each._replace(time=begin) for each in self._latched.values() if each.time < begin]
            self._tap = deque([*older, *self._recent])
            self._recent.clear()
            return self._tap

    def close(self) -> None:
        """Keep messages again."""
        with self._lock:
            self._tap = None


class Recorder:
    """Writes the records. `state` and `result` come from the brain; `step` is called many times a second."""

    def __init__(self, folder: Path, memory: Memory, post_roll: float) -> None:
        self.folder, self.memory, self.post_roll = folder, memory, post_roll
        self._lock = threading.Lock()
        self._was_in_hub = False
        self._left_hub = False
        self._result: dict[str, Any] | None = None
        self._bag: rosbag.Bag | None = None
        self._place = folder
        self._queue: deque[Stored] = deque()
        self._begun = self._end_at = 0.0
        self._settings: dict[str, Any] = {}
        self._full = False

    def state(self, message: MasterState) -> None:
        """The brain's state: an action begins when it leaves a hub."""
        with self._lock:
            if self._was_in_hub and not message.in_hub:
                self._left_hub, self._result = True, None
            self._was_in_hub = message.in_hub

    def result(self, message: String) -> None:
        """An action's result."""
        try:
            row = json.loads(message.data)
        except ValueError:
            return
        with self._lock:
            if isinstance(row, dict):
                self._result = row

    def step(self, now: float) -> None:
        """Begin, go on, or end. ``now``: s of the steady clock."""
        with self._lock:
            begins, self._left_hub = self._left_hub, False
        if self._bag is None:
            if begins and self._room():
                self._begin(now)
            return
        try:
            self._write()
            with self._lock:
                result = self._result
            if result is not None and self._end_at == 0.0:
                self._end_at = now + self.post_roll
            if self._end_at and now >= self._end_at:
                self._end(result)
            elif now - self._begun > LONGEST:
                self._end({"outcome": "unfinished", "reason": f"no result within {LONGEST:.0f} s"})
            elif not self._room():
                self._give_up("the disk is nearly full")
        except OSError as error:
            self._give_up(str(error))

    def finish(self) -> None:
        """The system ends: what is being recorded is ended as interrupted."""
        if self._bag is None:
            return
        try:
            self._write()
            with self._lock:
                result = self._result
            self._end(result or {"outcome": "interrupted", "reason": "the system was ended"})
        except OSError as error:
            self._give_up(str(error))

    def _room(self) -> bool:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            free = shutil.disk_usage(self.folder).free
        except OSError as error:
            rospy.logwarn_throttle(60.0, f"trials are not recorded: {error}; name another folder: record:=FOLDER")
            return False
        full = free < LEAST_SPACE
        if full and not self._full:
            rospy.logwarn(
                f"trials are not recorded: {self.folder} has {free / 1e6:.0f} MB left, {LEAST_SPACE / 1e6:.0f} MB are "
                "needed; make room, and the next handover is recorded"
            )
        self._full = full
        return not full

    def _begin(self, now: float) -> None:
        self._place = self.folder / f".recording_{datetime.now(UTC):%Y%m%dT%H%M%S}"
        self._begun, self._end_at, self._settings = now, 0.0, {}
        try:
            self._place.mkdir()
            self._bag = rosbag.Bag(str(self._place / BAG), "w", chunk_threshold=262144)
        except OSError as error:
            self._give_up(str(error))
            return
        threading.Thread(target=self._read_settings, name="settings", daemon=True).start()
        self._queue = self.memory.open()
        self._write()

    def _read_settings(self) -> None:
        """In a thread of its own: a master that does not answer must not keep messages waiting."""
        try:
            self._settings = rospy.get_param(rospy.get_namespace())
        except Exception as error:  # of the master or the network
            rospy.logwarn(f"the settings of this trial are not in its record: {error}")

    def _write(self) -> None:
        assert self._bag is not None
        for _ in range(len(self._queue)):
            one = self._queue.popleft()
            header = one.header
            raw = (header["type"], one.data, header["md5sum"], 0, None)
            self._bag.write(one.topic, raw, one.time, raw=True, connection_header=header)

    def _end(self, result: dict[str, Any] | None) -> None:
        assert self._bag is not None
        self.memory.close()
        self._write()
        self._bag.close()
        self._bag = None
        record = self._record(result or {})
        target = self.folder / record.id
        record.save(self._place)
        self._place.rename(target)
        rospy.loginfo(f"recorded {target}; look at it: ./coglab trial explain {record.id}")

    def _record(self, result: dict[str, Any]) -> TrialRecord:
        ended = float(result.get("ended_ros") or rospy.Time.now().to_sec())
        started = float(result.get("started_ros") or ended - (time.monotonic() - self._begun))
        settings = {key: value for key, value in self._settings.items() if key not in LEFT_OUT}
        about = settings.pop("trial", {})
        about = about if isinstance(about, dict) else {}
        cell = settings.get("coglab_sim", {})
        seed = cell.get("cell", {}).get("seed") if isinstance(cell, dict) else None
        when = datetime.fromtimestamp(started, UTC)
        action, thing = str(result.get("kind", "unknown")), str(result.get("object_id", ""))
        first = float(result.get("started", 0.0))
        marks = sorted((float(t) - first, str(name)) for name, t in dict(result.get("marks", {})).items())
        code = int(result.get("reason_code", 0))
        name = f"{when:%Y%m%dT%H%M%S}_{action}" + (f"_{thing}" if thing else "")
        while (self.folder / name).exists():
            name += "_"
        return TrialRecord(
            id=name,
            started=when.isoformat(timespec="milliseconds"),
            started_ros=started,
            duration_s=round(ended - started, 3),
            action=action,
            object=thing,
            success=result.get("outcome") == "succeeded",
            outcome=str(result.get("outcome", "interrupted")),
            code=code,
            reason=reason_name(code),
            text=str(result.get("reason", "")),
            causes=list(map(str, result.get("causes", []))),
            marks=[{"name": mark, "time_s": round(t, 3)} for t, mark in marks],
            simulated=isinstance(cell, dict) and bool(cell),
            seed=seed if isinstance(seed, int) else None,
            participant=str(about.get("participant", "")),
            condition=str(about.get("condition", "")),
            session=str(about.get("session", "")),
            study=str(about.get("study", "")),
            notes=str(about.get("notes", "")),
            configuration=settings,
            configuration_hash=hash_of(settings),
            versions=versions(),
        )

    def _give_up(self, why: str) -> None:
        rospy.logwarn(f"this trial is not recorded: {why}; nothing of it is kept")
        self.memory.close()
        if self._bag is not None:
            try:
                self._bag.close()
            except (OSError, ValueError):
                pass  # a full disk: what is there is removed now
            self._bag = None
        shutil.rmtree(self._place, ignore_errors=True)


def main() -> int:
    """The node."""
    init_node("trial_recorder")
    folder = parameters.read("~folder", str, "")
    seconds = parameters.read("~pre_roll", float, 5.0, 0.0, 60.0)
    names = [str(name) for name in rospy.get_param("~topics", list(TOPICS))]
    memory = Memory(seconds)
    place = Path(folder).expanduser() if folder else default_folder()
    recorder = Recorder(place, memory, parameters.read("~post_roll", float, 1.0, 0.0, 60.0))

    brain = {"coglab/state": (MasterState, recorder.state), "coglab/results": (String, recorder.result)}
    decoded = {rospy.resolve_name(name): what for name, what in brain.items()}

    def keep(message: rospy.AnyMsg, topic: str) -> None:
        memory.take(Stored(topic, rospy.Time.now(), message._buff, message._connection_header))
        if topic in decoded:  # a second subscription of another type would get raw messages, too
            kind, use = decoded[topic]
            use(kind().deserialize(message._buff))

    for name in dict.fromkeys([*names, *brain]):
        resolved = rospy.resolve_name(name)
        rospy.Subscriber(resolved, rospy.AnyMsg, keep, callback_args=resolved, queue_size=500, buff_size=1 << 20)
    for left in place.glob(".recording_*"):  # of a recorder that was killed
        shutil.rmtree(left, ignore_errors=True)
    while not rospy.is_shutdown():
        recorder.step(time.monotonic())
        time.sleep(0.05)
    recorder.finish()
    return 0


if __name__ == "__main__":
    sys.exit(main())
