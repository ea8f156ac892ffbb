"""Reads motions from CSV, npz and bag files, and checks units, gaps and impossible samples.

Columns of a CSV, arrays of an npz (each (n,), or `position` (n, 3) and `orientation` (n, 4)) and topics of a bag:

* time: `t` or `time`;
* place: `x`, `y`, `z`; or the joints of the arm, `lwr_a1` .. `lwr_a6`, which give the palm;
* turn: `qx`, `qy`, `qz`, `qw`, or `roll`, `pitch`, `yaw` (about the fixed axes x, y, z);
* fingers: `closing`, 0 open .. 1 closed, or in percent, or as the hand's bytes 0 .. 254;
* `frame`: several hands or objects in one file.

A name may end with a unit: `x_mm`, `x [in]`, `t_ms`, `yaw_deg`; each column has its own. Without units, they are
guessed from the numbers, with a note. A CSV may have commas, semicolons or tabs between its columns;
with the latter two, a comma in a number is a decimal comma.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coglab_tools.command import CheckFailed, NotThere, UsageError
from coglab_tools.dmp.cut import FASTEST
from coglab_tools.dmp.demonstration import Array, Demonstration

BRIEF_JUMP = 0.1  # s; a jump that ends within this time is left out
MOST_SAMPLES = 1_000_000
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
LONG_REACH = 1.2  # m; a longer motion is rare for a person at a table, and may be in feet
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ANGLE = {"rad": 1.0, "deg": np.pi / 180.0}
CLOSING = {"percent": 100.0, "%": 100.0}  # values of a closed hand
JOINTS = tuple(f"lwr_{name}" for name in ("a1", "a2", "e1", "a3", "a4", "a5", "a6"))
TURNS = ("roll", "pitch", "yaw", "qx", "qy", "qz", "qw")
UNITS = ((("t",), TIME), (("x", "y", "z"), LENGTH), (TURNS[:3] + JOINTS, ANGLE), (("closing",), CLOSING))
MOTOR_CLOSED = 254.0  # position of a closed motor of the IH2 hand

Table = dict[str, Array]
"""Numbers by column name, each (n,)"""
Place = Callable[[int], str]
"""function: index of a sample -> its place in the file, as text"""


@dataclass(frozen=True)
class Source:
    """Data to read from a file, and its units. Empty: guess it."""

    frame: str = ""
    """frame or name of the hand; empty: the only one, or `human_hand`"""
    topic: str = ""
    """of a bag: tf, PoseStamped, PoseWithCovarianceStamped, TransformStamped or JointState"""
    world: str = "world"
    """parent frame of the transforms in a bag"""
    length: str = ""
    time: str = ""
    angle: str = ""

    def __post_init__(self) -> None:
        for given, known in ((self.length, LENGTH), (self.time, TIME), (self.angle, ANGLE)):
            if given and given not in known:
                raise UsageError(f"unit '{given}' is unknown; expected one of {', '.join(known)}")


def read(path: Path, source: Source = Source()) -> Demonstration:
    """Read a file: its samples in order of time. CheckFailed or NotThere with file and place of the fault."""
    readers = {".csv": _read_csv, ".npz": _read_npz, ".bag": _read_bag}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise UsageError(f"{path}: expected a .csv, .npz or .bag file")
    if not path.is_file():
        raise NotThere(f"{path}: no such file")
    try:
        table, units, place = reader(path, source)
    except OSError as error:
        raise CheckFailed(f"{path} cannot be read: {error.strerror or error}") from None
    return _judge(path, table, units, place, source)


# --- three kinds of files: numbers by column name, units by column name, and place of sample i in the file ---


def _read_csv(path: Path, source: Source) -> tuple[Table, dict[str, str], Place]:
    with open(path, newline="", encoding="utf-8-sig", errors="replace") as stream:
        first = stream.readline()
        stream.seek(0)
        between = max(",;\t", key=first.count)
        rows = csv.reader(stream, delimiter=between)
        header = next(rows, None)
        if header is None:
            raise CheckFailed(f"{path}: the file is empty; expected a header line t,x,y,z and samples")
        names, units = _named(header)
        if "t" not in names:
            got = ascii(",".join(header))[:80]
            raise CheckFailed(f"{path}:1: expected a header with t,x,y,z or t and seven joints, got {got}")
        double = [name for name in names if name and names.count(name) > 1]
        if double:
            raise CheckFailed(f"{path}:1: two columns have the name '{double[0]}'")
        frame_column = names.index("frame") if "frame" in names else -1
        kept: list[list[str]] = []
        frames: set[str] = set()
        wanted = source.frame
        for row in rows:
            if not row or not "".join(row).strip():
                continue
            if len(row) != len(names):
                raise CheckFailed(f"{path}:{rows.line_num}: expected {len(names)} columns, got {len(row)}")
            if frame_column >= 0:
                frame = row[frame_column].strip()
                frames.add(frame)
                wanted = wanted or ("human_hand" if "human_hand" in frames else frame)
                if frame != wanted:
                    continue
            if len(kept) >= MOST_SAMPLES:
                raise CheckFailed(f"{path}: more than {MOST_SAMPLES} samples; cut the file")
            if between != ",":
                row = [word.replace(",", ".") for word in row]
            kept.append([*row, str(rows.line_num)])
    if not kept:
        seen = f" of {wanted} in it; choose one of {', '.join(sorted(frames))} with --frame" if frames else " in it"
        raise CheckFailed(f"{path}: no samples{seen}")
    table = {}
    for i, name in enumerate(names):
        if name == "frame" or not name:
            continue
        try:
            table[name] = np.array([float(row[i]) if row[i].strip() else np.nan for row in kept])
        except ValueError:
            bad = next(row for row in kept if not _is_number(row[i]))
            raise CheckFailed(f"{path}:{bad[-1]}: expected a number for {header[i]}, got '{bad[i]}'") from None
    return table, units, lambda i: f"line {kept[i][-1]}"


def _is_number(text: str) -> bool:
    try:
        float(text or "nan")
    except ValueError:
        return False
    return True


def _named(header: list[str]) -> tuple[list[str], dict[str, str]]:
    """Known column names without their units, and the units by name."""
    names, units = [], {}
    for word in header:
        match = re.fullmatch(r"(.+?)[\s_]*[\[(_]\s*(m|cm|mm|in|s|ms|us|ns|rad|deg|percent|%)\s*[\])]?", word.strip())
        name, unit = (match.group(1), match.group(2)) if match else (word.strip(), "")
        name = {"time": "t", "stamp": "t"}.get(name.lower(), name)
        name = name if name in JOINTS else name.lower()
        names.append(name)
        if unit:
            units[name] = unit
    return names, units


def _read_npz(path: Path, source: Source) -> tuple[Table, dict[str, str], Place]:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], dtype=float) for name in file.files}
    except Exception:  # zip, header and value errors alike
        raise CheckFailed(f"{path}: no npz file of plain numbers; write it with numpy.savez") from None
    frames = sorted({name.rpartition(".")[0] for name in arrays if name.endswith(".t")})
    frame = source.frame or ("human_hand" if "human_hand" in frames else frames[0] if frames else "")
    if frame in frames:
        arrays = {name[len(frame) + 1 :]: value for name, value in arrays.items() if name.startswith(f"{frame}.")}
    elif source.frame:
        raise CheckFailed(f"{path}: no frame '{frame}' in it; its frames are {', '.join(frames) or 'not named'}")
    table: Table = {}
    known, units = _named(list(arrays))
    for name, value in zip(known, arrays.values(), strict=True):
        columns = {"position": ("x", "y", "z"), "orientation": ("qx", "qy", "qz", "qw"), "joints": JOINTS}.get(name)
        if columns is not None and value.ndim == 2 and value.shape[1] == len(columns):
            table.update(zip(columns, value.T, strict=True))
            units.update(dict.fromkeys(columns, units[name]) if name in units else {})
        elif value.ndim == 1:
            table[name] = value
    shapes = ", ".join(f"{name} {value.shape}" for name, value in sorted(arrays.items()))
    if "t" not in table:
        raise CheckFailed(f"{path}: expected an array t and position (n, 3), got {shapes or 'none'}")
    if "x" not in table and JOINTS[0] not in table:
        raise CheckFailed(f"{path}: expected position (n, 3), or x, y and z, or joints (n, 7), got {shapes}")
    n = len(table["t"])
    wrong = [f"{name} has {len(value)}" for name, value in table.items() if len(value) != n]
    if wrong:
        raise CheckFailed(f"{path}: expected {n} values in each array as in t, but {', '.join(wrong)}")
    return table, units, lambda i: f"sample {i + 1}"


def _read_bag(path: Path, source: Source) -> tuple[Table, dict[str, str], Place]:
    try:
        import rosbag
    except ImportError as error:
        raise NotThere(
            f"{path}: bags are read with Debian's python3-rosbag ({error}); ./coglab install gets it"
        ) from None
    try:
        with rosbag.Bag(str(path)) as bag:
            info = bag.get_type_and_topic_info().topics
            topic = source.topic or _topic_of(path, {name: entry.msg_type for name, entry in info.items()}, source)
            if topic not in info:
                there = ", ".join(sorted(info)) or "none"
                raise CheckFailed(f"{path}: no topic {topic} in it; there are: {there}; choose with --topic")
            rows: list[dict[str, float]] = []
            frames: set[str] = set()
            for _, message, when in bag.read_messages(topics=[topic]):
                rows += _rows(message, when, source)
                each = getattr(message, "transforms", ())
                frames.update(f"'{i.header.frame_id}' -> '{i.child_frame_id}'" for i in each)
            fingers = _fingers(bag, info)
    except rosbag.ROSBagException as error:
        raise CheckFailed(f"{path}: no readable bag ({error}); if it was cut off: rosbag reindex {path}") from None
    except CheckFailed:
        raise
    except Exception as error:  # from rosbag, genpy, struct or the file: a foreign or damaged bag
        raise CheckFailed(f"{path}: no readable bag ({' '.join(str(error).split())})") from None
    if not rows:
        what = f"'{source.world}' -> '{source.frame or 'human_hand'}'" if "tf" in topic else "pose and no seven joints"
        seen = f"; there are: {', '.join(sorted(frames))}" if frames else ""
        raise CheckFailed(f"{path}: {topic} has no {what}; choose with --frame, --world or --topic{seen}")
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    if len(fingers):
        order = np.argsort(fingers[:, 0])
        table["closing"] = np.interp(table["t"], fingers[order, 0], fingers[order, 1])
    return table, {"t": "s"}, lambda i: f"message {i + 1}"


POSES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/TransformStamped")


def _topic_of(path: Path, types: Mapping[str, str], source: Source) -> str:
    """The topic that has the motion: /tf for a named frame, else the only pose topic, /tf, or the arm's joints."""
    if source.frame and "/tf" in types:
        return "/tf"
    poses = [name for name, kind in types.items() if kind in POSES]
    if len(poses) == 1:
        return poses[0]
    if "/tf" in types and not poses:
        return "/tf"
    joints = [name for name, kind in types.items() if kind == "sensor_msgs/JointState"]
    if not poses and joints:
        return "/lwr/joint_states" if "/lwr/joint_states" in joints else joints[0]
    raise CheckFailed(
        f"{path}: which topic has the motion? Choose with --topic; there are: {', '.join(sorted(types)) or 'none'}"
    )


def _rows(message: Any, when: Any, source: Source) -> list[dict[str, float]]:
    """Samples of one message by column name."""
    if hasattr(message, "transforms"):
        frame = source.frame or "human_hand"
        found = [
            item
            for item in message.transforms
            if item.child_frame_id.lstrip("/") == frame and item.header.frame_id.lstrip("/") == source.world
        ]
        return [_pose_row(i.header.stamp, when, i.transform.translation, i.transform.rotation) for i in found]
    if hasattr(message, "transform"):
        return [_pose_row(message.header.stamp, when, message.transform.translation, message.transform.rotation)]
    if hasattr(message, "pose"):
        pose = getattr(message.pose, "pose", message.pose)
        return [_pose_row(message.header.stamp, when, pose.position, pose.orientation)]
    if hasattr(message, "position") and hasattr(message, "name"):
        by_name = dict(zip(message.name, message.position, strict=False))
        if all(name in by_name for name in JOINTS):
            return [{"t": message.header.stamp.to_sec() or when.to_sec(), **{name: by_name[name] for name in JOINTS}}]
    return []


def _pose_row(stamp: Any, when: Any, p: Any, q: Any) -> dict[str, float]:
    return {
        "t": stamp.to_sec() or when.to_sec(),
        "x": p.x,
        "y": p.y,
        "z": p.z,
        "qx": q.x,
        "qy": q.y,
        "qz": q.z,
        "qw": q.w,
    }


def _fingers(bag: Any, info: Mapping[str, Any]) -> Array:
    """Times (s) and closing 0..1 of the robot's hand, (n, 2); empty without a hand in the bag."""
    topics = [name for name, entry in info.items() if entry.msg_type == "coglab_msgs/HandStatus"]
    if not topics:
        return np.empty((0, 2))
    rows = [
        (m.header.stamp.to_sec(), float(np.mean([motor.position for motor in m.motors[1:]])) / MOTOR_CLOSED)
        for _, m, _ in bag.read_messages(topics=topics)
        if len(m.motors) == 5
    ]
    return np.array(rows).reshape(-1, 2)


# --- checks ---


def _judge(path: Path, table: Table, units: dict[str, str], place: Place, source: Source) -> Demonstration:
    notes: list[str] = []
    n = len(table["t"])
    joints = all(name in table for name in JOINTS)
    if not joints and any(name not in table for name in "xyz"):
        raise CheckFailed(f"{path}: expected x, y, z or the joints {', '.join(JOINTS)}, got {', '.join(table)}")
    used = [name for name in ("t", *("xyz" if not joints else JOINTS), *_turn_names(table)) if name in table]
    whole = np.isfinite(np.column_stack([table[name] for name in used])).all(axis=1)
    if not whole.all():
        first = int(np.argmin(whole))
        notes.append(f"{n - int(whole.sum())} of {n} samples are not finite and were left out, first {place(first)}")
    if whole.sum() < 10:
        raise CheckFailed(f"{path}: expected at least 10 finite samples, got {int(whole.sum())}")
    table, index = {name: value[whole] for name, value in table.items()}, np.flatnonzero(whole)
    if len(np.unique(table["t"])) < 10:
        raise CheckFailed(f"{path}: expected at least 10 different times, got {len(np.unique(table['t']))}")
    for name, unit in units.items():
        known = next((k for names, k in UNITS if name in names), None)
        if name in table and known is not None and unit not in known:
            raise CheckFailed(f"{path}: the column {name} is in {unit}; expected {', '.join(known)}, or no unit")
    unread = [name for name in table if name not in ("t", "x", "y", "z", "closing", *TURNS, *JOINTS)]
    if unread:
        notes.append(f"not used: {', '.join(unread)}")
    lonely = [name for name in TURNS if name in table and name not in used]
    if lonely:
        notes.append(f"{', '.join(lonely)} left out: a turn needs qx, qy, qz and qw, or roll, pitch and yaw")

    _convert_named(path, table, units, source, notes)
    times = table["t"] * _time_unit(table["t"], source.time or units.get("t", ""), notes)
    if np.any(np.diff(times) < 0.0):
        at = int(np.argmax(np.diff(times) < 0.0))
        where, by = place(int(index[at + 1])), times[at] - times[at + 1]
        raise CheckFailed(f"{path}: {where}: time goes back by {by:.4f} s; cut the file there")
    if joints:
        table.update(_palm_of(path, np.column_stack([table[name] for name in JOINTS]), source, units, notes))
    places = np.column_stack([table[name] for name in "xyz"])
    places = places * _length_unit(path, places, source.length or units.get("x", "m" if joints else ""), notes)
    turns = _turns(path, table, source.angle or units.get("roll", ""), notes, lambda i: place(int(index[i])))

    same = np.zeros(len(times), dtype=bool)
    same[1:] = (np.diff(times) <= 0.0) | (np.all(np.diff(places, axis=0) == 0.0, axis=1) & _moves(places)[1:])
    if same.any():
        notes.append(f"{int(same.sum())} samples repeat the one before and were left out")
    kept = _without_jumps(path, times, places, ~same, notes)
    closing = _closing(path, table, units.get("closing", ""), notes)
    return Demonstration(
        path.stem,
        times[kept] - times[kept][0],
        places[kept],
        None if turns is None else turns[kept],
        None if closing is None else closing[kept],
        tuple(notes),
    )


def _moves(places: Array) -> Array:
    """True where the hand moves within 5 samples on both sides: only there a repeated sample is a lost one."""
    at, last = np.arange(len(places)), len(places) - 1
    far = np.linalg.norm(places[np.minimum(at + 5, last)] - places[np.maximum(at - 5, 0)], axis=1)
    return np.asarray(far > 1e-6)


def _turn_names(table: Table) -> tuple[str, ...]:
    for names in (("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw")):
        if all(name in table for name in names):
            return names
    return ()


def _convert_named(path: Path, table: Table, units: dict[str, str], source: Source, notes: list[str]) -> None:
    """Bring columns of one kind whose names have units to m and rad, each by its own unit. Nothing to do if no name
    has one, or if the caller gave the unit. CheckFailed: some of them have one, others have none."""
    for names, known, given in (
        (("x", "y", "z"), LENGTH, source.length),
        (("roll", "pitch", "yaw"), ANGLE, source.angle),
        (JOINTS, ANGLE, source.angle),
    ):
        named = {name: units[name] for name in names if units.get(name) in known}
        if given or not named:
            continue
        bare = [name for name in names if name in table and name not in named]
        option = "--length" if known is LENGTH else "--angle"
        if bare and all(name in table for name in names):
            raise CheckFailed(
                f"{path}: {', '.join(named)} have a unit in their names, {', '.join(bare)} none: write one behind each "
                f"name, or name the unit of all with {option}"
            )
        base = next(iter(known))
        for name, unit in named.items():
            if name in table and all(each in table for each in names):
                table[name] = table[name] * known[unit]
                units[name] = base
                if unit != base:
                    notes.append(f"{name} is in {unit}, converted to {base}")


def _time_unit(t: Array, given: str, notes: list[str]) -> float:
    if given:
        return TIME[given]
    step = float(np.median(np.diff(t)))
    unit = "s" if step < 0.5 else "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
    if unit != "s":
        notes.append(f"time is in {unit} (a sample every {step:g}), converted to s")
    return TIME[unit]


def _length_unit(path: Path, places: Array, given: str, notes: list[str]) -> float:
    """Guess the unit from the extent of the motion: between 0.1 m, the shortest reach, and 3 m."""
    if given:
        if given != "m":
            notes.append(f"lengths are in {given}, converted to m")
        return LENGTH[given]
    extent = float(np.linalg.norm(np.percentile(places, 99, axis=0) - np.percentile(places, 1, axis=0)))
    if extent <= 3.0:
        if extent > LONG_REACH:
            notes.append(f"lengths are taken as m (the hand moves over {extent:.1f}); if they are feet: --length ft")
        return 1.0
    unit = "cm" if 10.0 <= extent < 90.0 else "mm" if 200.0 <= extent <= 3000.0 else ""
    if not unit:
        raise CheckFailed(
            f"{path}: the hand moves over {extent:.3g}; expected up to 3 (m), 10 to 90 (cm) or 200 to 3000 (mm); name "
            "the unit with --length"
        )
    inches = "; if they are inches: --length in" if unit == "cm" else ""
    notes.append(f"lengths are in {unit} (the hand moves over {extent:.0f}), converted to m{inches}")
    return LENGTH[unit]


def _angle_unit(path: Path, angles: Array, given: str, what: str, notes: list[str]) -> float:
    """Angles go up to half a turn in either unit. Values that fit neither rad nor degrees clearly are refused."""
    most = float(np.abs(angles).max())
    if not given and 3.2 < most <= 2.0 * np.pi + 0.1:
        raise CheckFailed(f"{path}: {what} go up to {most:.1f}: rad or degrees? Name the unit with --angle")
    degrees = given == "deg" or (not given and most > 3.2)
    if degrees:
        notes.append(f"{what} are in degrees (up to {most:.0f}), converted to rad")
    elif not given and what == "turns" and most > 0.0:
        notes.append(f"turns are taken as rad (up to {most:.2g}); if they are degrees: --angle deg")
    return ANGLE["deg" if degrees else "rad"]


def _palm_of(path: Path, joints: Array, source: Source, units: dict[str, str], notes: list[str]) -> Table:
    """Pose of the palm by forward kinematics from joint positions (n, 7)."""
    from coglab_smach.kinematics.reachability import default_arm

    joints = joints * _angle_unit(path, joints, source.angle or units.get(JOINTS[0], ""), "joint angles", notes)
    notes.append("the palm is computed from the joints of the arm")
    poses = [default_arm().fk(q) for q in joints]
    places, turns = np.array([p for p, _ in poses]), np.array([q for _, q in poses])
    return dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), (*places.T, *turns.T), strict=True))


def _turns(path: Path, table: Table, given: str, notes: list[str], place: Place) -> Array | None:
    """Quaternions (n, 4) without changes of sign."""
    names = _turn_names(table)
    if not names:
        return None
    values = np.column_stack([table[name] for name in names])
    if len(names) == 3:
        from scipy.spatial.transform import Rotation

        radians = values * _angle_unit(path, values, given, "turns", notes)
        q = Rotation.from_euler("xyz", radians).as_quat()
    else:
        lengths = np.linalg.norm(values, axis=1)
        if np.any(np.abs(lengths - 1.0) > 0.05):
            at = int(np.argmax(np.abs(lengths - 1.0)))
            raise CheckFailed(f"{path}: {place(at)}: a quaternion of length {lengths[at]:.2f}, expected 1 (x y z w)")
        q = values / lengths[:, None]
    signs = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= signs[:, None]
    return q


def _closing(path: Path, table: Table, given: str, notes: list[str]) -> Array | None:
    values = table.get("closing")
    if values is None or not np.isfinite(values).any():
        return None
    values = np.interp(np.arange(len(values)), np.flatnonzero(np.isfinite(values)), values[np.isfinite(values)])
    low, top = float(values.min()), float(values.max())
    scale = CLOSING.get(given, 1.0 if top <= 1.2 else 100.0 if top <= 100.0 else MOTOR_CLOSED)
    if not given and 1.2 < top < 5.0:
        raise CheckFailed(f"{path}: closing goes up to {top:g}: 0..1 or percent? For percent, name it closing_percent")
    if low < -0.2 * scale or top > 1.2 * scale:
        raise CheckFailed(f"{path}: closing goes from {low:g} to {top:g}; expected 0..1, percent or 0..254")
    if scale > 1.0:
        unit = "percent" if scale == 100.0 else "motor positions 0..254"
        notes.append(f"closing is taken as {unit} (up to {top:g}), converted to 0..1")
    return np.asarray(np.clip(values / scale, 0.0, 1.0))


def _without_jumps(path: Path, times: Array, places: Array, kept: Any, notes: list[str]) -> Any:
    """Indices of the possible samples. A jump that soon ends is left out; another one is refused."""
    good: list[int] = []
    left, since, before = 0, -1, -1  # samples left out; where the hand jumped away; the sample before
    for i in np.flatnonzero(kept):
        jumps = before >= 0 and _faster(places, times, before, i)
        before = i
        if since < 0 and not jumps:
            good.append(int(i))
        elif since >= 0 and jumps and not _faster(places, times, good[-1], i):  # it jumps back
            since = -1
            good.append(int(i))
        else:
            since = i if since < 0 else since
            left += 1
            if times[i] - times[since] > BRIEF_JUMP:
                way = np.linalg.norm(places[since] - places[good[-1]])
                raise CheckFailed(
                    f"{path}: the hand jumps by {way:.2f} m at {times[since] - times[0]:.2f} s and stays there: "
                    "the tracker confused it with something else; cut the file there, or record again"
                )
    if left:
        notes.append(f"{left} samples jump faster than {FASTEST:g} m/s and were left out")
    return np.array(good)


def _faster(places: Array, times: Array, a: int, b: int) -> bool:
    """True if the hand would be faster than FASTEST from sample a to sample b."""
    return bool(np.linalg.norm(places[b] - places[a]) > FASTEST * (times[b] - times[a]))
