"""Configuration of the machines: values of machines.yaml and the node's parameters, else the defaults of
coglab_smach.parameters. The file is read again when it changes."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from typing import Any

from coglab_py.yaml_file import Document, YamlError, read

from coglab_smach.parameters import BY_NAME, NO_DEFAULT, schema, unknown

AT_START = ("actions", "states", "deliveries")  # parameters that the machines are built from


class ConfigError(Exception):
    """The configuration file cannot be used. The sentence names file and field."""


class Config:
    """Values by dotted name. If the changed file is invalid, the old values stay in force and one warning is given."""

    def __init__(self, values: Mapping[str, Any], path: str = "", warn: Callable[[str], None] | None = None) -> None:
        self._values = dict(values)
        self.path = path
        self._warn = warn or (lambda text: None)
        self._stamp = os.stat(path).st_mtime_ns if path else 0
        self._lock = threading.Lock()

    @staticmethod
    def load(
        path: str, overrides: Mapping[str, Any] | None = None, warn: Callable[[str], None] | None = None
    ) -> Config:
        """Read a file; ConfigError names file and line. ``overrides`` (dotted names) always win over the file."""
        config = Config(_read(path), path, warn)
        _checked(Document("configuration given beside the file", "", _nested(overrides or {}), {}))
        config._overrides = dict(overrides or {})
        _known_timing(path, str(config._overrides.get("timing", "")), config._values)
        return config

    _overrides: dict[str, Any] = {}

    def get(self, name: str) -> Any:
        """Returns the value of ``a.b.c``. ConfigError if neither the file nor the table of parameters has one."""
        if name in self._overrides:
            return self._overrides[name]
        self._reload_if_changed()
        timed = self._timing()
        if name in timed:
            return timed[name]
        node: Any = self._values
        for part in name.split("."):
            if not isinstance(node, Mapping) or part not in node:
                default = BY_NAME[name].default if name in BY_NAME else NO_DEFAULT
                if default is NO_DEFAULT:
                    raise ConfigError(f"{self.path or 'configuration'}: '{name}' is missing")
                return default
            node = node[part]
        return node

    def number(self, name: str) -> float:
        """Returns the value as a float."""
        return float(self.get(name))

    def text(self, name: str) -> str:
        """Returns the value as a str."""
        return str(self.get(name))

    def _timing(self) -> Mapping[str, Any]:
        """Returns the values (by dotted name) of the selected timing; empty if the file does not have this timing."""
        chosen = self._overrides.get("timing", self._values.get("timing", ""))
        timed: Mapping[str, Any] = self._values.get("timings", {}).get(chosen, {})
        return timed

    def set(self, name: str, value: Any) -> None:
        """Override one value at run time (used by the console and tests)."""
        self._overrides = {**self._overrides, name: value}

    def _reload_if_changed(self) -> None:
        if not self.path:
            return
        with self._lock:
            try:
                stamp = os.stat(self.path).st_mtime_ns
            except OSError:
                return
            if stamp == self._stamp:
                return
            self._stamp = stamp
            try:
                values = _read(self.path)
            except ConfigError as error:
                self._warn(f"{error}; the values read before stay in force")
                return
            for name in AT_START:
                if values.get(name) != self._values.get(name):
                    self._warn(f"{self.path}: '{name}' has changed; the value read at the start stays in force")
                values[name] = self._values.get(name, {})
            self._values = values


def _read(path: str) -> dict[str, Any]:
    try:
        document = read(path)
    except YamlError as error:
        raise ConfigError(str(error)) from None
    values = _checked(document)
    _known_timing(path, str(values.get("timing", "")), values)
    _region_in_order(path, values.get("handover", {}))
    return values


def _region_in_order(path: str, handover: Mapping[str, Any]) -> None:
    """ConfigError if the lower corner of the handover region is not below the upper one."""
    low, high = handover.get("region_low"), handover.get("region_high")
    if low is not None and high is not None and any(a >= b for a, b in zip(low, high, strict=True)):
        raise ConfigError(f"{path}: handover.region_low {low} is not below region_high {high} (m, each axis)")


def _checked(document: Document) -> dict[str, Any]:
    values: dict[str, Any] = document.value
    try:
        for way, nearest in unknown(values) if isinstance(values, Mapping) else ():
            hint = f"; did you mean '{nearest}'?" if nearest else ""
            raise ConfigError(document.sentence(way, f"there is no such parameter{hint}"))
        document.check(schema())
    except YamlError as error:
        raise ConfigError(str(error)) from None
    return values


def _known_timing(path: str, timing: str, values: Mapping[str, Any]) -> None:
    """ConfigError if the selected timing does not exist."""
    timings = values.get("timings", {})
    if timing and timing not in timings:
        raise ConfigError(f"{path}: there is no timing '{timing}'; timings: {', '.join(timings) or 'none'}")


def _nested(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Converts values by dotted name to the nested form of the file."""
    values: dict[str, Any] = {}
    for name, value in overrides.items():
        node = values
        *above, last = name.split(".")
        for part in above:
            node = node.setdefault(part, {})
        node[last] = value
    return values
