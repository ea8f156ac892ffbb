"""Object database: one YAML file per object, checked against a JSON schema and against itself, reloaded
without a restart."""
from __future__ import annotations

import json
import math
import os
import stat
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import yaml
from ih2_hand.grasps import check_grasp

from .pose import Pose

SCHEMA_FILE = Path(__file__).with_name("object_schema.json")
LARGEST_FILE = 100_000
"""bytes; an object is a page of text, not a data set."""
DEEPEST = 16
"""levels of lists and mappings inside each other; an object has five."""
LARGEST_INTEGER = 2**31 - 1
"""of the parameter server."""


class ObjectError(Exception):
    """An object file cannot be used: file, line where known, field, and what was expected."""


class _Loader(yaml.SafeLoader):
    """Safe loader that refuses aliases and deep nesting."""

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        line = self.peek_event().start_mark.line + 1
        if self.check_event(yaml.events.AliasEvent):
            raise ObjectError(f"line {line}: aliases (*name) are not allowed")
        if self.depth > DEEPEST:
            raise ObjectError(f"line {line}: nested more than {DEEPEST} levels deep")
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _walk_lines(node: yaml.Node, path: tuple[Any, ...], lines: dict[tuple[Any, ...], int]) -> None:
    lines[path] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise ObjectError(f"line {key.start_mark.line + 1}: a field's name is one word, no list or mapping")
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


def parse_object(text: str, origin: str, dialect: str = "legacy") -> dict[str, Any]:
    """Parse and check one object for a hand of this dialect; ObjectError says ``origin:line: field: what``."""
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
    except Exception as error:  # a date that does not exist, a tag that does not fit its value, ...
        raise ObjectError(f"{origin}: a value cannot be read as what it looks like or is tagged as: {error}") from None
    errors = sorted(_validator().iter_errors(entry), key=lambda e: (len(e.absolute_path), str(e.absolute_path)))
    if errors:
        deepest = jsonschema.exceptions.best_match(errors)
        path = tuple(deepest.absolute_path)
        field = ".".join(str(p) for p in path) or "top level"
        raise ObjectError(f"{origin}:{_line(lines, path)}: {field}: {deepest.message}")
    problem = next(_unfit(entry, ()), None) or _inconsistency(entry, dialect)
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


def _unfit(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[tuple[Any, ...], str]]:
    """What a schema lets pass and nobody can use: numbers that are none, texts that no message can carry."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _unfit(key, path)
            yield from _unfit(item, (*path, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _unfit(item, (*path, i))
    elif isinstance(value, str):
        if not all(c.isprintable() or c in "\n\t" for c in value):
            yield path, "a text without control characters expected"
    elif isinstance(value, float) and not math.isfinite(value):
        yield path, f"a finite number expected, got {value}"
    elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        yield path, f"a whole number of at most {LARGEST_INTEGER} expected"


def _inconsistency(entry: dict[str, Any], dialect: str) -> tuple[tuple[Any, ...], str] | None:
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
        try:
            check_grasp(grasp["hand"]["mode"], grasp["hand"]["level"], dialect)
        except ValueError as error:
            return ("grasps", name, "hand", "level"), str(error)
        axis = grasp.get("approach", {}).get("axis")
        if axis is not None and not np.linalg.norm(axis) > 1e-6:
            return ("grasps", name, "approach", "axis"), "a direction must not be zero"
    return None


def read_object(path: Path, dialect: str = "legacy") -> tuple[dict[str, Any], str]:
    """Entry and text of one file; ObjectError if it cannot be read or used."""
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            raise ObjectError(f"{path.name}: a file expected, it is something else")
        if found.st_size > LARGEST_FILE:
            raise ObjectError(f"{path.name}: {found.st_size} bytes; an object file has at most {LARGEST_FILE}")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ObjectError(f"{path.name}: cannot be read: {error}") from None
    entry = parse_object(text, path.name, dialect)
    if entry["id"] != path.stem:
        raise ObjectError(f"{path.name}:1: id: '{entry['id']}' must be the file's name, '{path.stem}'")
    return entry, text


@dataclass
class _File:
    """What is known of one file: its ``stamp`` when it was read, what was wrong then, and its good entry, if any."""

    stamp: tuple[int, int] | None
    problem: str = ""
    entry: dict[str, Any] | None = None
    text: str = ""


class ObjectDatabase:
    """All objects of a folder. ``reload`` takes over what is good; a bad file keeps its old entry and is reported.

    ``dialect``: that of the hand, legacy or v17; it decides which grasps there are.
    """

    def __init__(self, folder: str, dialect: str = "legacy") -> None:
        self.folder = Path(folder)
        self.dialect = dialect
        self._lock = threading.Lock()
        self._files: dict[str, _File] = {}
        self.problems: list[str] = []

    def reload(self, only_changed: bool = False) -> list[str]:
        """Read the folder again; returns the problems there are (empty if all files are good)."""
        if not self.folder.is_dir():
            self.problems = [f"{self.folder}: no such folder; expected one YAML file per object in it"]
            return self.problems
        with self._lock:
            stamps = self._stamps()
            files = {}
            for name, stamp in sorted(stamps.items()):
                known = self._files.get(name)
                unchanged = only_changed and known is not None and known.stamp == stamp
                files[name] = known if unchanged else self._read(name, stamp, known)
            self._files = files
            self.problems = [file.problem for file in files.values() if file.problem]
        return self.problems

    def _stamps(self) -> dict[str, tuple[int, int] | None]:
        stamps: dict[str, tuple[int, int] | None] = {}
        for path in self.folder.glob("*.yaml"):
            try:
                found = os.stat(path)
                stamps[path.name] = (found.st_mtime_ns, found.st_size)
            except OSError:  # a link to nothing, or gone meanwhile
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
        """Whether a file was added, removed or written since the last reload."""
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
            raise ObjectError(f"object '{object_id[:40]}' is not in the database; it has: "
                              f"{', '.join(sorted(good)) or 'no objects'}")
        return good[object_id]

    def get(self, object_id: str) -> dict[str, Any]:
        """One entry; ObjectError names those that exist."""
        entry = self._find(object_id).entry
        assert entry is not None
        return entry

    def text(self, object_id: str) -> str:
        """The entry as it stands in its file."""
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
    """A valid entry to start from; ObjectError if the id cannot be one."""
    text = _EXAMPLE.format(id=object_id)
    parse_object(text, f"{object_id}.yaml")
    return text
