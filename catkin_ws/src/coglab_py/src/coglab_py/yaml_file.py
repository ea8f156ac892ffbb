"""Reads YAML files with the lines of their fields, so that errors have the form ``file:line: field: message``.

Stricter than YAML: no aliases, no duplicate fields, no deep nesting, only numbers and texts that ROS can carry.
"""

from __future__ import annotations

import math
import os
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsonschema
import yaml

LARGEST_FILE = 100_000  # bytes; a configuration is a page of text, not a data set
DEEPEST = 16  # levels of nested lists and mappings
LARGEST_INTEGER = 2**31 - 1  # limit of the parameter server

Field = tuple[Any, ...]
"""Path of a value: keys and indices from the top."""


class YamlError(ValueError):
    """A YAML file is invalid: file, line if known, field, and the expected value."""


class _Loader(yaml.SafeLoader):
    """Safe loader that rejects aliases and deep nesting."""

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        line = self.peek_event().start_mark.line + 1
        if self.check_event(yaml.events.AliasEvent):
            raise YamlError(f"line {line}: aliases (*name) are not allowed")
        if self.depth > DEEPEST:
            raise YamlError(f"line {line}: nested more than {DEEPEST} levels deep")
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


@dataclass(frozen=True)
class Document:
    """Content of a YAML file: its value, its text, and the line of each field."""

    origin: str
    """name of the file in messages"""
    text: str
    value: Any
    lines: Mapping[Field, int]

    def sentence(self, path: Field, message: str) -> str:
        """A message about a field, with file and line."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        where = f"{self.origin}:{self.lines.get(known, 1)}"
        return f"{where}: {'.'.join(map(str, path)) or 'top level'}: {message}"

    def check(self, schema: Mapping[str, Any]) -> None:
        """Raise YamlError with the first value that violates a JSON schema (draft 7) or that ROS cannot carry."""
        errors = sorted(
            jsonschema.Draft7Validator(schema).iter_errors(self.value),
            key=lambda e: (len(e.absolute_path), str(e.absolute_path)),
        )
        if errors:
            deepest = jsonschema.exceptions.best_match(errors)
            raise YamlError(self.sentence(tuple(deepest.absolute_path), deepest.message))
        unfit = next(_unfit(self.value, ()), None)
        if unfit is not None:
            raise YamlError(self.sentence(*unfit))


def parse(text: str, origin: str) -> Document:
    """The document in a text. A YamlError has the form ``origin:line: message``."""
    if len(text) > LARGEST_FILE:
        raise YamlError(f"{origin}: {len(text)} bytes; such a file has at most {LARGEST_FILE}")
    lines: dict[Field, int] = {}
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            raise YamlError("line 1: the file is empty")
        _walk_lines(node, (), lines)
        value = loader.construct_document(node)
    except YamlError as error:
        raise YamlError(f"{origin}: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{origin}:{mark.line + 1}" if mark else origin
        raise YamlError(f"{where}: not YAML: {getattr(error, 'problem', error)}") from None
    except Exception as error:  # for example an invalid date, or a tag that does not match its value
        raise YamlError(f"{origin}: a value cannot be read as what it looks like or is tagged as: {error}") from None
    return Document(origin, text, value, lines)


def read(path: str | os.PathLike[str], origin: str = "") -> Document:
    """The document in a file. ``origin`` is its name in messages, by default its path. Raises YamlError."""
    name = origin or str(path)
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            raise YamlError(f"{name}: a file expected, it is something else")
        if found.st_size > LARGEST_FILE:
            raise YamlError(f"{name}: {found.st_size} bytes; such a file has at most {LARGEST_FILE}")
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise YamlError(f"{name}: cannot be read: {error}") from None
    return parse(text, name)


def _walk_lines(node: yaml.Node, path: Field, lines: dict[Field, int]) -> None:
    lines[path] = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise YamlError(f"line {key.start_mark.line + 1}: a field's name is one word, no list or mapping")
            if key.value in seen:
                raise YamlError(f"line {key.start_mark.line + 1}: field '{key.value}' appears twice")
            seen.add(key.value)
            _walk_lines(value, (*path, key.value), lines)
            lines[(*path, key.value)] = key.start_mark.line + 1
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            _walk_lines(value, (*path, i), lines)


def _unfit(value: Any, path: Field) -> Iterator[tuple[Field, str]]:
    """Values that a schema accepts but ROS cannot carry: nan and similar numbers, texts that no message can contain."""
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
