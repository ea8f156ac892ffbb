"""Object database: one YAML file per object, checked with a JSON schema and for consistency, reloaded without a
restart."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_py.yaml_file import Document, Field, YamlError, parse, read
from ih2_hand.grasps import check_grasp

SCHEMA_FILE = package_path("coglab_objects", "config", "object_schema.json")
"""JSON schema of an object. The simulated cell also reads the ranges of mass, size and friction from it."""
SAME_LENGTH = 1e-6  # m, tolerance for rounding between `size` and the box around `shape`


class ObjectError(ValueError):
    """An object file is invalid: file, line if known, field, and the expected value."""


_chosen: list[Path] = []  # folders of objects_in, innermost last


def objects_folder() -> Path:
    """The folder with the objects of this package, or the one that `objects_in` has chosen."""
    return _chosen[-1] if _chosen else package_path("coglab_objects", "objects")


@contextmanager
def objects_in(folder: Path) -> Iterator[None]:
    """Within this block the process, and each simulated World made in it, uses the objects of ``folder``."""
    _chosen.append(folder)
    try:
        yield
    finally:
        _chosen.pop()


def parse_object(text: str, origin: str, dialect: str = "legacy") -> dict[str, Any]:
    """Parse and check one object for a hand of this dialect. ObjectError: ``origin:line: field: message``."""
    try:
        return _checked(parse(text, origin), dialect)
    except YamlError as error:
        raise ObjectError(str(error)) from None


def _checked(document: Document, dialect: str) -> dict[str, Any]:
    document.check(_schema())
    problem = _inconsistency(document.value, dialect)
    if problem is not None:
        raise YamlError(document.sentence(*problem))
    entry: dict[str, Any] = document.value
    return entry


@lru_cache(maxsize=1)
def _schema() -> dict[str, Any]:
    schema: dict[str, Any] = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    return schema


def _inconsistency(entry: dict[str, Any], dialect: str) -> tuple[Field, str] | None:
    """An error that the schema cannot find, in references between fields or in the geometry. None if there is none."""
    solid = _solid(entry["shape"])
    if solid is not None and not np.allclose(entry["size"], solid[1], rtol=0.0, atol=SAME_LENGTH):
        size = [float(v) for v in entry["size"]]
        return ("size",), f"{solid[0]} is {solid[1]}, got {size}; size is the box around the shape, m"
    for kind, default in (("grasps", "default_grasp"), ("deliveries", "default_delivery")):
        if entry[default] not in entry[kind]:
            return (default,), f"'{entry[default]}' is not among the {kind}: {', '.join(entry[kind])}"
        for name, item in entry[kind].items():
            try:
                pose = Pose.from_dict(item["pose"])
            except (ValueError, TypeError) as error:
                return (kind, name, "pose"), str(error)
            if np.linalg.norm(pose.position) > 1.0:
                return (kind, name, "pose", "xyz"), "more than 1 m away; lengths are in m"
    for name, grasp in entry["grasps"].items():
        try:
            check_grasp(grasp["hand"]["mode"], grasp["hand"]["level"], dialect)
        except ValueError as error:
            return ("grasps", name, "hand", "level"), str(error)
        axis = grasp.get("approach", {}).get("axis")
        if axis is not None and not np.linalg.norm(axis) > 1e-6:
            return ("grasps", name, "approach", "axis"), "a direction must not be zero"
    return None


def checked_delivery(value: Any, origin: str) -> dict[str, Any]:
    """Check one delivery, as in an object's file. ObjectError: ``origin:line: field: message``."""
    schema = _schema()
    one = {**schema["properties"]["deliveries"]["additionalProperties"], "definitions": schema["definitions"]}
    try:
        delivery: dict[str, Any] = json.loads(json.dumps(value, default=lambda array: array.tolist()))
    except (TypeError, ValueError, AttributeError):
        raise ObjectError(f"{origin}: a dict with 'pose' and 'release' is expected, got {value!r:.80}") from None
    document = Document(origin, "", delivery, {})
    try:
        document.check(one)
        pose = Pose.from_dict(delivery["pose"])
        if np.linalg.norm(pose.position) > 1.0:
            raise YamlError(document.sentence(("pose", "xyz"), "more than 1 m away; lengths are in m"))
    except (YamlError, ValueError, TypeError) as error:
        raise ObjectError(str(error)) from None
    return delivery


def _solid(shape: dict[str, Any]) -> tuple[str, list[float]] | None:
    """Name of the shape and the box around it (m); None if the shape has no lengths."""
    if shape["type"] == "box":
        return None
    radius = float(shape["radius"])
    across = round(2.0 * radius, 9)
    if shape["type"] == "sphere":
        return f"a sphere of radius {radius:g}", [across] * 3
    height = float(shape["height"])
    return f"a cylinder of radius {radius:g} and height {height:g}", [across, across, height]


def read_object(path: Path, dialect: str = "legacy") -> tuple[dict[str, Any], str]:
    """Entry and text of one file. Raises ObjectError if it cannot be read or is invalid."""
    try:
        document = read(path, path.name)
        entry = _checked(document, dialect)
    except YamlError as error:
        raise ObjectError(str(error)) from None
    if entry["id"] != path.stem:
        raise ObjectError(f"{path.name}:1: id: '{entry['id']}' must be the file's name, '{path.stem}'")
    return entry, document.text


def cell_parameters(entry: dict[str, Any]) -> dict[str, Any]:
    """Parameters of the simulated cell from an entry, by their names below ``object/``.

    The origin of the object frame is the middle of the underside, half of the height below the middle of the solid."""
    return {
        "id": entry["id"],
        "mass": float(entry["mass"]),
        "shape": entry["shape"]["type"],
        "size": [float(v) for v in entry["size"]],
        "center": [0.0, 0.0, float(entry["size"][2]) / 2],
        "friction": float(entry["friction"]),
    }


@dataclass
class _File:
    """State of one file: its ``stamp`` when it was read, its error then, and its last valid entry, if any."""

    stamp: tuple[int, int] | None
    problem: str = ""
    entry: dict[str, Any] | None = None
    text: str = ""


class ObjectDatabase:
    """All objects of a folder. ``reload`` accepts valid files. An invalid file keeps its last entry and is reported.

    ``dialect`` of the hand, legacy or v17, determines which grasps exist.
    """

    def __init__(self, folder: str | os.PathLike[str], dialect: str = "legacy") -> None:
        self.folder = Path(folder)
        self.dialect = dialect
        self._lock = threading.Lock()
        self._files: dict[str, _File] = {}
        self.problems: list[str] = []

    def reload(self, only_changed: bool = False) -> list[str]:
        """Read the folder again. Returns the errors; empty if all files are valid."""
        if not self.folder.is_dir():
            self.problems = [f"{self.folder}: no such folder; expected one YAML file per object in it"]
            return self.problems
        with self._lock:
            stamps = self._stamps()
            files = {}
            for name, stamp in sorted(stamps.items()):
                known = self._files.get(name)
                if only_changed and known is not None and known.stamp == stamp:
                    files[name] = known
                else:
                    files[name] = self._read(name, stamp, known)
            self._files = files
            self.problems = [file.problem for file in files.values() if file.problem]
        return self.problems

    def _stamps(self) -> dict[str, tuple[int, int] | None]:
        stamps: dict[str, tuple[int, int] | None] = {}
        for path in self.folder.glob("*.yaml"):
            try:
                found = os.stat(path)
                stamps[path.name] = (found.st_mtime_ns, found.st_size)
            except OSError:  # a broken link, or the file was removed meanwhile
                stamps[path.name] = None
        return stamps

    def _read(self, name: str, stamp: tuple[int, int] | None, known: _File | None) -> _File:
        try:
            entry, text = read_object(self.folder / name, self.dialect)
            return _File(stamp, "", entry, text)
        except ObjectError as error:
            if known is None or known.entry is None:
                return _File(stamp, str(error))
            return _File(stamp, f"{error}; the old entry stays", known.entry, known.text)

    def changed(self) -> bool:
        """True if a file was added, removed or written since the last reload."""
        with self._lock:
            return self._stamps() != {name: file.stamp for name, file in self._files.items()}

    def _good(self) -> dict[str, _File]:
        return {file.entry["id"]: file for file in self._files.values() if file.entry is not None}

    def ids(self) -> list[str]:
        """Ids of all objects, sorted."""
        with self._lock:
            return sorted(self._good())

    def _find(self, object_id: str) -> _File:
        with self._lock:
            good = self._good()
        if object_id not in good:
            raise ObjectError(
                f"object '{object_id[:40]}' is not in the database; it has: {', '.join(sorted(good)) or 'no objects'}"
            )
        return good[object_id]

    def get(self, object_id: str) -> dict[str, Any]:
        """One entry. An ObjectError lists the existing ids."""
        entry = self._find(object_id).entry
        assert entry is not None
        return entry

    def text(self, object_id: str) -> str:
        """The entry as text of its file."""
        return self._find(object_id).text


_EXAMPLE = """\
# {id}: edit every value, then check it.
schema: 1
id: {id}
name: New object
mass: 0.30                       # kg
size: [0.06, 0.06, 0.12]         # m, box around the object
shape: {{type: cylinder, radius: 0.03, height: 0.12}}
friction: 0.5
frame: object_{id}
default_grasp: side
grasps:
  side:
    hand: {{mode: cylindrical, level: medium}}
    pose: {{xyz: [0.0, -0.03, 0.06], quaternion: [0.5, 0.5, 0.5, 0.5]}}   # ih2_palm in the object frame at contact
    approach: {{axis: [0.0, 1.0, 0.0], distance: 0.025}}                 # the reach ends this far before it
default_delivery: offer
deliveries:
  offer:
    pose: {{xyz: [-0.10, 0.0, -0.06], rpy_deg: [0, 0, 0]}}               # object in the human hand frame
    release: {{threshold: 0.6, timeout: 8.0}}
dmp: {{receive: reach_human, give: give_human, take: take_board, put: put_board, dmp_ratio: 1.0}}
contact: {{k: 6.0, timeout: 6.0}}
"""


def new_object_text(object_id: str) -> str:
    """Text of a valid entry as a template. Raises ObjectError if the id is invalid."""
    text = _EXAMPLE.format(id=object_id)
    parse_object(text, f"{object_id}.yaml")
    return text
