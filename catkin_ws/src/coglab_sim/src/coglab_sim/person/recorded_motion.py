"""Recorded motion that replaces the simulated person: reads CSV, npz and bag files and plays them.

A recording holds stamps (s, increasing), positions (m, world axes) and orientations (unit quaternions x y z w) of each
frame. The three file formats hold the same data:

* CSV: a header line with `t,x,y,z`, optionally `qx,qy,qz,qw` and `frame`; then one line per sample;
* npz: arrays `t`, `position` (N, 3), optionally `orientation` (N, 4). With several frames, each array name begins with
  its frame, as in `human_hand.t`. Pickled data is never read;
* bag: the transforms of `/tf` whose parent is the world frame, with the stamps of their headers.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from coglab_py.pose import IDENTITY, Pose, about_z
from coglab_py.rotation import Rotation

MOST_SAMPLES = 1_000_000  # largest number of samples in one file: a day at 10 Hz
FASTEST = 10.0  # m/s between two samples; at a higher speed the tracker lost the frame or confused it with another


class RecordingError(ValueError):
    """A recording cannot be used. The message names file, place in the file and expected value."""


@dataclass(frozen=True)
class Track:
    """One recorded frame: stamps (N,) in s, positions (N, 3) in m, orientations (N, 4) as x y z w."""

    stamps: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray

    def at(self, t: float) -> Pose:
        """Returns the frame at time t (s of the recording), interpolated. Outside the track its first or last pose."""
        t = min(max(t, float(self.stamps[0])), float(self.stamps[-1]))
        i = min(max(int(np.searchsorted(self.stamps, t, side="right")) - 1, 0), max(0, len(self.stamps) - 2))
        j = min(i + 1, len(self.stamps) - 1)
        span = float(self.stamps[j] - self.stamps[i])
        share = (t - float(self.stamps[i])) / span if span > 0.0 else 0.0
        position = (1.0 - share) * self.positions[i] + share * self.positions[j]
        a, b = Rotation.from_quat(self.orientations[i]), Rotation.from_quat(self.orientations[j])
        turned = a * Rotation.from_rotvec(share * (a.inv() * b).as_rotvec())
        return Pose(position, turned.as_quat())


@dataclass(frozen=True)
class Recording:
    """Tracks by frame name. Time 0 is the first sample of all tracks."""

    tracks: dict[str, Track]

    @property
    def duration(self) -> float:
        """s, time of the last sample of all tracks."""
        return max(float(track.stamps[-1]) for track in self.tracks.values())


def load_recording(path: str, frame: str = "human_hand", world: str = "world", topic: str = "/tf") -> Recording:
    """Reads a .csv, .npz or .bag file.

    `frame`: name of the track if the file has no frame names. `world` and `topic`: parent frame and topic of the
    transforms in a bag. Raises RecordingError.
    """
    readers = {
        ".csv": lambda: _read_csv(path, frame),
        ".npz": lambda: _read_npz(path, frame),
        ".bag": lambda: _read_bag(path, world, topic),
    }
    kind = Path(path).suffix.lower()
    if kind not in readers:
        raise RecordingError(f"{path}: a recording is a .csv, .npz or .bag file, got '{kind}'")
    if not Path(path).is_file():
        raise RecordingError(f"{path}: no such file")
    samples = readers[kind]()
    if not samples:
        raise RecordingError(f"{path}: no samples in it")
    begin = min(track[0][0] for track in samples.values())
    return Recording({name: _track(f"{path}: frame '{name}'", rows, begin) for name, rows in samples.items()})


def _require_no_jump(where: str, track: Track) -> None:
    steps = np.linalg.norm(np.diff(track.positions, axis=0), axis=1)
    speeds = steps / np.diff(track.stamps)
    if len(speeds) and float(np.max(speeds)) > FASTEST:
        worst = int(np.argmax(speeds))
        raise RecordingError(
            f"{where}: jumps by {steps[worst]:.2f} m after {track.stamps[worst]:.2f} s ({speeds[worst]:.0f} m/s, "
            f"allowed {FASTEST:.0f}); cut the recording, or set allow_jumps: true"
        )


Rows = dict[str, list[tuple[float, ...]]]
"""Samples by frame: (t, x, y, z, qx, qy, qz, qw)."""


def _track(where: str, rows: list[tuple[float, ...]], begin: float) -> Track:
    data = np.array(rows, dtype=float)
    if not np.all(np.isfinite(data)):
        raise RecordingError(f"{where}: sample {int(np.argmin(np.isfinite(data).all(axis=1))) + 1} is not finite")
    falls = np.flatnonzero(np.diff(data[:, 0]) <= 0.0)
    if len(falls):
        raise RecordingError(f"{where}: time must increase, sample {int(falls[0]) + 2} does not")
    lengths = np.linalg.norm(data[:, 4:], axis=1)
    if np.any(np.abs(lengths - 1.0) > 0.05):
        raise RecordingError(
            f"{where}: sample {int(np.argmax(np.abs(lengths - 1.0))) + 1} has a "
            f"quaternion of length {lengths[np.argmax(np.abs(lengths - 1.0))]:.2f}"
            ", expected 1 (x y z w)"
        )
    return Track(data[:, 0] - begin, data[:, 1:4], data[:, 4:] / lengths[:, None])


def _read_csv(path: str, frame: str) -> Rows:
    rows: Rows = {}
    with open(path, newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        names = [name.strip() for name in reader.fieldnames or []]
        missing = [name for name in ("t", "x", "y", "z") if name not in names]
        if missing:
            raise RecordingError(
                f"{path}:1: the header must name t,x,y,z[,qx,qy,qz,qw][,frame]; missing: {', '.join(missing)}"
            )
        reader.fieldnames = names
        turned = all(name in names for name in ("qx", "qy", "qz", "qw"))
        columns = ("t", "x", "y", "z", *(("qx", "qy", "qz", "qw") if turned else ()))
        for count, line in enumerate(reader):
            if count >= MOST_SAMPLES:
                raise RecordingError(f"{path}: more than {MOST_SAMPLES} samples")
            try:
                values = tuple(float(line[name]) for name in columns)
            except (TypeError, ValueError):
                raise RecordingError(
                    f"{path}:{reader.line_num}: expected numbers for {','.join(columns)}, got {list(line.values())}"
                ) from None
            rows.setdefault(line.get("frame") or frame, []).append(values if turned else (*values, *IDENTITY))
    return rows


def _read_npz(path: str, frame: str) -> Rows:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], dtype=float) for name in file.files}
    except Exception as error:  # zip, header and value errors alike
        raise RecordingError(f"{path}: not an npz file of plain arrays: {error}") from None
    rows: Rows = {}
    for name, stamps in arrays.items():
        prefix, _, last = name.rpartition(".")
        if last != "t":
            continue
        before = f"{prefix}." if prefix else ""
        positions = arrays.get(f"{before}position")
        n = len(stamps) if stamps.ndim == 1 else -1
        orientations = arrays.get(f"{before}orientation", np.tile(IDENTITY, (max(n, 0), 1)))
        if positions is None or positions.shape != (n, 3) or orientations.shape != (n, 4):
            raise RecordingError(
                f"{path}: '{name}' needs '{before}position' of shape (N, 3), and "
                f"'{before}orientation', where it is given, of shape (N, 4)"
            )
        if not 0 < n <= MOST_SAMPLES:
            raise RecordingError(f"{path}: '{name}' has {n} samples, expected 1..{MOST_SAMPLES}")
        rows[prefix or frame] = [tuple(row) for row in np.column_stack([stamps, positions, orientations])]
    if not rows:
        raise RecordingError(f"{path}: no array 't' in it; it has {', '.join(arrays) or 'none'}")
    return rows


def _read_bag(path: str, world: str, topic: str) -> Rows:
    import rosbag  # only here: the rest needs no ROS

    rows: Rows = {}
    parents: set[str] = set()
    try:
        with rosbag.Bag(path) as bag:
            for _, message, _ in bag.read_messages(topics=[topic]):
                for item in message.transforms:
                    parent = item.header.frame_id.lstrip("/")
                    parents.add(parent)
                    if parent != world:
                        continue
                    p, q = item.transform.translation, item.transform.rotation
                    track = rows.setdefault(item.child_frame_id.lstrip("/"), [])
                    stamp = item.header.stamp.to_sec()
                    if len(track) >= MOST_SAMPLES:
                        raise RecordingError(f"{path}: more than {MOST_SAMPLES} samples")
                    if not track or stamp != track[-1][0]:  # tf repeats transforms
                        track.append((stamp, p.x, p.y, p.z, q.x, q.y, q.z, q.w))
    except rosbag.ROSBagException as error:
        raise RecordingError(f"{path}: not a readable bag ({error}); try `rosbag reindex`") from None
    if not rows:
        seen = ", ".join(sorted(parents)) or "none"
        raise RecordingError(f"{path}: no transforms from '{world}' on {topic}; parents seen: {seen}")
    for track in rows.values():
        track.sort()
    return rows


@dataclass(frozen=True)
class PlaybackSettings:
    """Settings of the playback of a recording. Times in s, lengths in m."""

    file: str = ""
    frame: str = "human_hand"
    """name of the track if the file has no frame names"""
    rename: Mapping[str, str] = field(default_factory=dict)
    """new names by recorded frame; other frames keep their names"""
    time_scale: float = 1.0
    """factor on the duration: 2.0 takes twice as long"""
    mirror: bool = False
    """True: exchanges left and right (y of world)"""
    turn_deg: float = 0.0
    """rotation about the vertical into the robot's axes, after mirroring"""
    end_at: tuple[float, float, float] | None = None
    """end position of the first frame in the robot's world; None: the recording is not moved"""
    at_end: str = "hold"
    """hold: the last poses stay; loop: starts again; vanish: no frame is visible any more"""
    wait_at: float | None = None
    """time of the recording at which playback waits for the robot; None: no waiting"""
    wait_distance: float = 0.15
    """playback continues when the robot's hand is this near to the first frame"""
    wait_limit: float = 10.0
    """longest waiting"""
    allow_jumps: bool = False
    """True: frames may be faster than FASTEST"""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.time_scale) and self.time_scale > 0.0):
            raise RecordingError(f"time_scale must be above 0, got {self.time_scale}")
        if self.at_end not in ("hold", "loop", "vanish"):
            raise RecordingError(f"at_end must be hold, loop or vanish, got '{self.at_end}'")
        if self.end_at is not None and (len(self.end_at) != 3 or not np.all(np.isfinite(self.end_at))):
            raise RecordingError(f"end_at needs three finite numbers (m), got {self.end_at}")
        if self.wait_distance <= 0.0 or self.wait_limit < 0.0:
            raise RecordingError("wait_distance must be above 0 m and wait_limit not negative")

    @staticmethod
    def from_mapping(data: Mapping[str, Any]) -> PlaybackSettings:
        """Reads a parameter mapping. RecordingError for unknown fields."""
        known = [f.name for f in fields(PlaybackSettings)]
        unknown = sorted(set(data) - set(known))
        if unknown:
            raise RecordingError(f"recording: unknown fields {', '.join(unknown)}; known: {', '.join(known)}")
        return PlaybackSettings(**{k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})


class Playback:
    """Plays the frames of a recording in the robot's world."""

    def __init__(self, recording: Recording, settings: PlaybackSettings = PlaybackSettings()):
        self.settings = settings
        self.recording = Recording({settings.rename.get(name, name): track for name, track in recording.tracks.items()})
        self.first = next(iter(self.recording.tracks))
        self._world = Pose(orientation=about_z(np.radians(settings.turn_deg)))
        if settings.end_at is not None:
            end = self._placed(self.recording.tracks[self.first].at(np.inf)).position
            self._world = Pose(np.array(settings.end_at, dtype=float) - end, self._world.orientation)
        self._playhead = 0.0
        self._then: float | None = None
        self._waited = 0.0

    @staticmethod
    def open(
        settings: PlaybackSettings, world: str = "world", wanted: Callable[[str], bool] = lambda name: True
    ) -> Playback:
        """Loads the file of the settings. Keeps the frames whose new name is `wanted`.

        A bag also holds frames that no tracker sees. Raises RecordingError.
        """
        recording = load_recording(settings.file, settings.frame, world)
        kept = {name: track for name, track in recording.tracks.items() if wanted(settings.rename.get(name, name))}
        if not kept:
            raise RecordingError(
                f"{settings.file}: none of its frames "
                f"({', '.join(recording.tracks)}) is one that perception shows; "
                "see rename"
            )
        if not settings.allow_jumps:
            for name, track in kept.items():
                _require_no_jump(f"{settings.file}: frame '{name}'", track)
        return Playback(Recording(kept), settings)

    @property
    def names(self) -> Iterable[str]:
        """Names of the played frames."""
        return self.recording.tracks.keys()

    def frames(self, now: float, robot: Pose | None = None) -> dict[str, Pose]:
        """Returns the frames at time `now` (s, any origin, not decreasing); `robot`: pose of the robot's hand."""
        dt = max(0.0, now - self._then) if self._then is not None else 0.0
        self._then = now
        self._advance(dt, robot)
        s = self.settings
        if self._playhead > self.recording.duration:
            if s.at_end == "vanish":
                return {}
            if s.at_end == "loop":
                self._playhead %= self.recording.duration or 1.0
                self._waited = 0.0
        return {name: self.at(name, self._playhead) for name in self.names}

    def at(self, name: str, seconds: float) -> Pose:
        """Returns a frame at a time of the recording (s), in the robot's world."""
        return self._placed(self.recording.tracks[name].at(seconds))

    def _advance(self, dt: float, robot: Pose | None) -> None:
        s = self.settings
        ahead = self._playhead + dt / s.time_scale
        if s.wait_at is not None and self._playhead <= s.wait_at < ahead and not self._met(robot):
            self._waited += dt
            if self._waited < s.wait_limit:
                ahead = s.wait_at
        self._playhead = ahead

    def _met(self, robot: Pose | None) -> bool:
        if robot is None:
            return False
        hand = self._placed(self.recording.tracks[self.first].at(self._playhead))
        return float(np.linalg.norm(hand.position - robot.position)) <= self.settings.wait_distance

    def _placed(self, frame: Pose) -> Pose:
        position, q = frame.position, frame.orientation
        if self.settings.mirror:
            position = position * np.array([1.0, -1.0, 1.0])
            q = q * np.array([-1.0, 1.0, -1.0, 1.0])
        return self._world * Pose(position, q)
