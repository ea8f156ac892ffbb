"""Configuration of the machines from one YAML file, read again whenever the file changes."""
from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from typing import Any

import yaml


class ConfigError(Exception):
    """The configuration file cannot be used; the sentence names file and field."""


class Config:
    """Values by dotted name. A file that has become bad keeps the old values and says so once."""

    def __init__(self, values: Mapping[str, Any], path: str = "",
                 warn: Callable[[str], None] | None = None) -> None:
        self._values = dict(values)
        self.path = path
        self._warn = warn or (lambda text: None)
        self._stamp = os.stat(path).st_mtime_ns if path else 0
        self._lock = threading.Lock()

    @staticmethod
    def load(path: str, overrides: Mapping[str, Any] | None = None,
             warn: Callable[[str], None] | None = None) -> Config:
        """Read a file; ConfigError names file and line. ``overrides`` (dotted names) win over the file for good."""
        config = Config(_read(path), path, warn)
        config._overrides = dict(overrides or {})
        return config

    _overrides: dict[str, Any] = {}

    def get(self, name: str, default: Any = None) -> Any:
        """Value of ``a.b.c``; KeyError-like ConfigError if it is absent and no default is given."""
        if name in self._overrides:
            return self._overrides[name]
        self._reload_if_changed()
        node: Any = self._values
        for part in name.split("."):
            if not isinstance(node, Mapping) or part not in node:
                if default is None:
                    raise ConfigError(f"{self.path or 'configuration'}: '{name}' is missing")
                return default
            node = node[part]
        return node

    def set(self, name: str, value: Any) -> None:
        """Override one value while running (the console and tests use it)."""
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
                self._values = _read(self.path)
            except ConfigError as error:
                self._warn(f"{error}; the values read before stay in force")


def _read(path: str) -> dict[str, Any]:
    try:
        with open(path, encoding="utf-8") as stream:
            values = yaml.safe_load(stream)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: not YAML: {error}") from error
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: expected a mapping at the top, got {type(values).__name__}")
    return values
