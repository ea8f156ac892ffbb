"""Reads the person's hand and the object from a sequence of DexYCB, or from HandoverSim's cache of it.

* DexYCB: `SUBJECT/SEQUENCE/pose.npz` with `pose_m` (frames, hands, 51: MANO's turn as a rotation vector, 45 finger
  components, translation) and `pose_y` (frames, objects, 7: quaternion x y z w, translation), in the frame of the
  master camera; `meta.yml` beside it. `calibration/extrinsics_*/extrinsics.yml` further up has the tag on the table,
  whose z is up.
* HandoverSim: `pose_NNN.npz` at 1000 Hz with `pose_m` (frames, 1, 51: translation, Euler angles about the own axes x y
  z, 45 finger angles) and `pose_y` (frames, objects, 6: translation, Euler angles), in the tag's frame; `meta_NNN.json`
  beside it.

A frame of zeros has no hand. The hand's place is its wrist: MANO turns about it, and it lies about 0.1 m beside the
translation, by a constant of the hand's shape; its mean shape is used here (within some mm).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from coglab_tools.command import CheckFailed, NotThere
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.people.handover import Handover

RATE = 30.0  # Hz, of the raw recordings
CACHE_RATE = 1000.0  # Hz, of the recordings in the cache
KEEP = 10  # of the cache every tenth frame is kept: 100 Hz
WRIST = {"right": np.array([0.0957, 0.0064, 0.0062]), "left": np.array([-0.0957, 0.0064, 0.0062])}
"""m, wrist beside the translation in MANO's mean shape"""
SOURCE = "DexYCB (Chao et al. 2021, CC BY-NC 4.0)"


def read_dexycb(path: Path, rate: float | None = None) -> Handover:
    """Read a `pose.npz`, its folder, or a `pose_NNN.npz`. `rate`: Hz, of the frames. The person is the "giver"."""
    if path.is_dir():
        path = path / "pose.npz"
    if not path.is_file():
        raise NotThere(f"{path}: no such file; expected DexYCB's pose.npz or HandoverSim's pose_NNN.npz")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name], dtype=float) for name in file.files}
    except Exception:  # zip, header and value errors alike
        raise CheckFailed(f"{path}: no npz file of plain numbers; write it with numpy.savez") from None
    hand, things = arrays.get("pose_m"), arrays.get("pose_y")
    raw = path.name == "pose.npz"
    width = 7 if raw else 6
    if hand is None or hand.ndim != 3 or hand.shape[2] != 51:
        raise CheckFailed(f"{path}: expected pose_m (frames, hands, 51), got {_shapes(arrays)}")
    if things is None or things.ndim != 3 or things.shape[2] != width or len(things) != len(hand):
        raise CheckFailed(f"{path}: expected pose_y ({len(hand)}, objects, {width}), got {_shapes(arrays)}")
    meta = _meta(path, raw)
    side = str(meta.get("mano_sides", ["right"])[0])
    if side not in WRIST:
        raise CheckFailed(f"{path}: mano_sides: expected right or left, got '{side}'")
    grasped = int(meta.get("ycb_grasp_ind", 0))
    if not 0 <= grasped < things.shape[1]:
        raise CheckFailed(f"{path}: ycb_grasp_ind is {grasped}, but pose_y has {things.shape[1]} objects")
    read = _raw if raw else _cached
    positions, turns, object_positions, object_turns = read(path, hand[:, 0], things[:, grasped], WRIST[side], meta)
    seen = np.any(hand[:, 0] != 0.0, axis=1)
    if seen.sum() < 20:
        raise CheckFailed(f"{path}: the hand is in {int(seen.sum())} frames, expected at least 20")
    times = np.arange(len(hand)) / (rate or (RATE if raw else CACHE_RATE))
    every = slice(None, None, 1 if raw else KEEP)
    name = path.parent.name if raw else path.stem
    notes = (f"the hand is seen in {int(seen.sum())} of {len(seen)} frames",)
    track = Demonstration(
        name, times[seen][every], positions[seen][every], _signed(turns.as_quat()[seen][every]), None, notes
    )
    thing = Demonstration(
        f"{name}_object", times[every], object_positions[every], _signed(object_turns.as_quat()[every])
    )
    return Handover(name, {"giver": track}, thing, source=SOURCE, notes=notes)


def _raw(path: Path, hand: Array, thing: Array, wrist: Array, meta: dict[str, Any]) -> tuple[Any, Any, Any, Any]:
    """Positions and Rotations of wrist and object in the tag's frame, from the camera's."""
    from scipy.spatial.transform import Rotation

    tag = _tag(path, str(meta.get("extrinsics", "")))
    to_tag, origin = Rotation.from_matrix(tag[:, :3]).inv(), tag[:, 3]
    quaternions = thing[:, :4].copy()
    quaternions[np.linalg.norm(quaternions, axis=1) < 1e-6] = [0.0, 0.0, 0.0, 1.0]
    return (
        to_tag.apply(hand[:, 48:51] + wrist - origin),
        to_tag * Rotation.from_rotvec(hand[:, :3]),
        to_tag.apply(thing[:, 4:7] - origin),
        to_tag * Rotation.from_quat(quaternions),
    )


def _cached(path: Path, hand: Array, thing: Array, wrist: Array, meta: dict[str, Any]) -> tuple[Any, Any, Any, Any]:
    """The same from HandoverSim's cache, whose translation goes with a turn about the origin of the model."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_euler("XYZ", hand[:, 3:6])
    return (
        hand[:, :3] + turns.apply(wrist),
        turns,
        thing[:, :3],
        Rotation.from_euler("XYZ", thing[:, 3:6]),
    )


def _signed(q: Array) -> Array:
    q = q.copy()
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    return q


def _shapes(arrays: dict[str, Array]) -> str:
    return ", ".join(f"{name} {value.shape}" for name, value in arrays.items()) or "no arrays"


def _meta(path: Path, raw: bool) -> dict[str, Any]:
    """Values of meta.yml, or of meta_NNN.json."""
    beside = path.with_name("meta.yml" if raw else path.name.replace("pose_", "meta_").replace(".npz", ".json"))
    if not beside.is_file():
        raise NotThere(f"{beside}: no such file; it names the hand and the object of {path.name}")
    text = beside.read_text(encoding="utf-8")
    try:
        values = yaml.safe_load(text) if raw else json.loads(text)
    except (yaml.YAMLError, json.JSONDecodeError) as error:
        raise CheckFailed(f"{beside}: cannot be read: {error}") from None
    if not isinstance(values, dict):
        raise CheckFailed(f"{beside}: expected names and values")
    return values


def _tag(path: Path, calibration: str) -> Array:
    """Pose of the tag in the camera, 3 x 4, from the calibration further up."""
    for folder in path.resolve().parents:
        file = folder / "calibration" / f"extrinsics_{calibration}" / "extrinsics.yml"
        if file.is_file():
            try:
                values = yaml.safe_load(file.read_text(encoding="utf-8"))["extrinsics"]["apriltag"]
                return np.array(values, dtype=float).reshape(3, 4)
            except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
                raise CheckFailed(f"{file}: expected extrinsics: apriltag: 12 numbers ({error})") from None
    raise NotThere(
        f"{path}: no calibration/extrinsics_{calibration}/extrinsics.yml in a folder above: without it the "
        "vertical is unknown; keep DexYCB's folders together"
    )
