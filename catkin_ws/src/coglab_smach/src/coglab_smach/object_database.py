"""Object database: one YAML file per object, checked against a JSON schema and against itself, reloaded
without a restart."""
from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import yaml

from .pose import Pose

SCHEMA_FILE = Path(__file__).with_name("object_schema.json")
LARGEST_FILE = 100_000
"""bytes; an object is a page of text, not a data set."""


class ObjectError(Exception):
    """An object file cannot be used: file, line where known, field, and what was expected."""


class _Loader(yaml.SafeLoader):
    """Safe loader that refuses doubled keys and aliases and remembers where each mapping key stands."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self.lines: dict[tuple[Any, ...], int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.events.AliasEvent):
            event = self.peek_event()
            raise ObjectError(f"line {event.start_mark.line + 1}: aliases (*name) are not allowed")
        return super().compose_node(parent, index)


def _walk_lines(node: yaml.Node, path: tuple[Any, ...], lines: dict[tuple[Any, ...], int]) -> None:
    lines[path] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if key.value in seen:
                raise ObjectError(f"line {key.start_mark.line + 1}: field '{key.value}' appears twice")
            seen.add(key.value)
            _walk_lines(value, (*path, key.value), lines)
            lines[(*path, key.value)] = key.start_mark.line + 1
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            _walk_lines(value, (*path, i), lines)


def _line(lines: dict[tuple[Any, ...], int], path: tuple[Any, ...]) -> int:
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 1)


def parse_object(text: str, origin: str) -> dict[str, Any]:
    """Parse and check one object; ObjectError says ``origin:line: field: what``."""
    if len(text) > LARGEST_FILE:
        raise ObjectError(f"{origin}: {len(text)} bytes; an object file has at most {LARGEST_FILE}")
    lines: dict[tuple[Any, ...], int] = {}
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            raise ObjectError("line 1: the file is empty")
        _walk_lines(node, (), lines)
        entry = loader.construct_document(node)
    except ObjectError as error:
        raise ObjectError(f"{origin}: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{origin}:{mark.line + 1}" if mark else origin
        raise ObjectError(f"{where}: not YAML: {getattr(error, 'problem', error)}") from None
    errors = sorted(_validator().iter_errors(entry), key=lambda e: (len(e.absolute_path), str(e.absolute_path)))
    if errors:
        deepest = jsonschema.exceptions.best_match(errors)
        path = tuple(deepest.absolute_path)
        field = ".".join(str(p) for p in path) or "top level"
        raise ObjectError(f"{origin}:{_line(lines, path)}: {field}: {deepest.message}")
    problem = _inconsistency(entry)
    if problem is not None:
        path, message = problem
        raise ObjectError(f"{origin}:{_line(lines, path)}: {'.'.join(map(str, path))}: {message}")
    return entry


_VALIDATOR: jsonschema.Draft7Validator | None = None


def _validator() -> jsonschema.Draft7Validator:
    global _VALIDATOR
    if _VALIDATOR is None:
        _VALIDATOR = jsonschema.Draft7Validator(json.loads(SCHEMA_FILE.read_text(encoding="utf-8")))
    return _VALIDATOR


def _inconsistency(entry: dict[str, Any]) -> tuple[tuple[Any, ...], str] | None:
    """What the schema cannot see: references between fields, and geometry. None if all is well."""
    for kind, default in (("grasps", "default_grasp"), ("deliveries", "default_delivery")):
        if entry[default] not in entry[kind]:
            return (default,), f"'{entry[default]}' is none of {kind}: {', '.join(entry[kind])}"
        for name, item in entry[kind].items():
            try:
                pose = Pose.from_dict(item["pose"])
            except (ValueError, TypeError) as error:
                return (kind, name, "pose"), str(error)
            if np.linalg.norm(pose.position) > 1.0:
                return (kind, name, "pose", "xyz"), "more than 1 m away; lengths are in m"
    for name, grasp in entry["grasps"].items():
        axis = grasp.get("approach", {}).get("axis")
        if axis is not None and not np.linalg.norm(axis) > 1e-6:
            return ("grasps", name, "approach", "axis"), "a direction must not be zero"
    return None


class ObjectDatabase:
    """All objects of a folder. ``reload`` takes over what is good; a bad file keeps its old entry and is reported."""

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self._lock = threading.Lock()
        self._entries: dict[str, dict[str, Any]] = {}
        self._texts: dict[str, str] = {}
        self._files: dict[str, tuple[int, str]] = {}
        self.problems: list[str] = []

    def reload(self, only_changed: bool = False) -> list[str]:
        """Read the folder again; returns the problems found (empty if all files are good)."""
        if not self.folder.is_dir():
            self.problems = [f"{self.folder}: no such folder; expected one YAML file per object in it"]
            return self.problems
        problems: list[str] = []
        files = sorted(self.folder.glob("*.yaml"))
        with self._lock:
            for path in files:
                self._read(path, only_changed, problems)
            gone = set(self._files) - {path.name for path in files}
            for name in gone:
                object_id = self._files.pop(name)[1]
                self._entries.pop(object_id, None)
                self._texts.pop(object_id, None)
        self.problems = problems
        return problems

    def _read(self, path: Path, only_changed: bool, problems: list[str]) -> None:
        known = self._files.get(path.name)
        try:
            stamp = os.stat(path).st_mtime_ns
            if only_changed and known is not None and known[0] == stamp:
                return
            text = path.read_text(encoding="utf-8")
            entry = parse_object(text, path.name)
            if entry["id"] != path.stem:
                raise ObjectError(f"{path.name}:1: id: '{entry['id']}' must be the file's name, '{path.stem}'")
        except (OSError, UnicodeDecodeError) as error:
            problems.append(f"{path.name}: cannot be read: {error}")
            return
        except ObjectError as error:
            kept = "; the old entry stays" if known is not None else ""
            problems.append(f"{error}{kept}")
            return
        self._files[path.name] = (stamp, entry["id"])
        self._entries[entry["id"]] = entry
        self._texts[entry["id"]] = text

    def changed(self) -> bool:
        """Whether a file was added, removed or written since the last reload."""
        try:
            now = {path.name: os.stat(path).st_mtime_ns for path in self.folder.glob("*.yaml")}
        except OSError:
            return False
        with self._lock:
            return now != {name: stamp for name, (stamp, _) in self._files.items()}

    def ids(self) -> list[str]:
        """Ids of all objects, sorted."""
        with self._lock:
            return sorted(self._entries)

    def get(self, object_id: str) -> dict[str, Any]:
        """One entry; ObjectError names those that exist."""
        with self._lock:
            if object_id not in self._entries:
                raise ObjectError(f"object '{object_id}' is not in the database; it has: "
                                  f"{', '.join(sorted(self._entries)) or 'no objects'}")
            return self._entries[object_id]

    def text(self, object_id: str) -> str:
        """The entry as it stands in its file."""
        self.get(object_id)
        with self._lock:
            return self._texts[object_id]


_EXAMPLE = """\
# {id}: edit every value, then check it.
schema: 1
id: {id}
name: New object
mass: 0.30                       # kg
size: [0.06, 0.06, 0.12]         # m, box around the object
shape: {{type: cylinder, radius: 0.03, height: 0.12}}
friction: 0.5
fragile: false
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
    release: {{rule: load_share, threshold: 0.6, timeout: 8.0}}
dmp: {{receive: reach_human, give: give_human, take: take_board, put: put_board, dmp_ratio: 1.0}}
contact: {{k: 6.0, timeout: 6.0}}
"""


def new_object_text(object_id: str) -> str:
    """A valid entry to start from; ObjectError if the id cannot be one."""
    text = _EXAMPLE.format(id=object_id)
    parse_object(text, f"{object_id}.yaml")
    return text
