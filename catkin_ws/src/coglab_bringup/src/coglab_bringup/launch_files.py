"""Checks the files that arguments of coglab.launch and real.launch name, before a node starts."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree

from coglab_py.packages import package_path

LARGEST_FILE = 10_000_000  # bytes; the largest shipped one, primitives.xml, has some 10 000
PERCEPTION = ("stand_in", "bridge", "none")
LOAD_TIMEOUT = 20  # s

_NO_ARM = 3  # exit status of _LOAD
_LOAD = f"""
import ctypes, os, sys
try:
    library = ctypes.CDLL(sys.argv[1], os.RTLD_LAZY | os.RTLD_LOCAL)
except OSError as error:
    sys.exit(str(error))
os._exit(0 if hasattr(library, "coglab_arm") else {_NO_ARM})
"""


def check(arguments: Mapping[str, str]) -> None:
    """Raise ValueError with one sentence for the first argument whose value cannot be used. An empty value is no file,
    except where the launch file has a default."""
    for name, value in arguments.items():
        try:
            _CHECKS[name](value)
        except ValueError as error:
            raise ValueError(f"{name}:={value}: {' '.join(str(error).split())}") from None
    if arguments.get("split", "false").lower() == "true" and arguments.get("arm", "fri") != "fri":
        raise ValueError(f"split:=true: it needs arm:=fri; leave split out, or arm:={arguments['arm']}")
    source, simulated = arguments.get("perception", "none"), arguments.get("sim", "true").lower() == "true"
    if source not in PERCEPTION:
        raise ValueError(f"perception:={source}: expected one of {', '.join(PERCEPTION)}")
    if source == "stand_in" and not simulated:
        raise ValueError(
            "perception:=stand_in: the simulated tracker needs sim:=true; with the real arm: bridge or none"
        )
    if source == "bridge" and not arguments.get("tracker"):
        raise ValueError(
            "perception:=bridge: the argument tracker is missing; name the mapping file of your tracker, "
            "tracker:=FILE, such as coglab_perception/config/perception_bridge.yaml"
        )


def _bytes(value: str) -> bytes:
    """Content of an existing file."""
    path = Path(value)
    if not path.is_absolute():
        raise ValueError(f"expected a whole path, because nodes run in another folder; write {path.absolute()}")
    if path.is_dir():
        raise ValueError("expected a file, this is a folder")
    if not path.is_file():
        raise ValueError("there is no such file; check the path, or leave the argument out")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"expected at most {LARGEST_FILE} bytes, the file has {path.stat().st_size}")
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(f"the file cannot be read: {error.strerror}") from None
    if not content.strip():
        raise ValueError("the file is empty; write it, or leave the argument out")
    return content


def _mapping(value: str) -> None:
    import yaml

    content = _bytes(value)
    try:
        found = yaml.safe_load(content)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}: " if mark else ""
        raise ValueError(f"{where}not YAML: {getattr(error, 'problem', None) or error}") from None
    except (RecursionError, ValueError, TypeError) as error:  # endless nesting, an invalid date, or a list as a key
        raise ValueError(f"not YAML that can be used: {error}") from None
    if not isinstance(found, dict):
        kind = "nothing but comments" if found is None else f"a {type(found).__name__}"
        raise ValueError(f"expected fields with values (name: value), the file has {kind}")


def _controller_file(value: str) -> None:
    """A YAML file as /robot finds it: absolute path, package://name/path, or the name of a shipped one (`palm`)."""
    package, within = "coglab_controllers", f"config/{value}"
    if value.startswith("package://"):
        package, _, within = value.removeprefix("package://").partition("/")
    elif Path(value).is_absolute():
        _mapping(value)
        return
    elif not Path(value).suffix:
        within += ".yaml"
    try:
        path = package_path(package, *within.split("/"))
    except FileNotFoundError:
        raise ValueError(
            f"there is no file {package}/{within}; expected a whole path, package://NAME/PATH, or the name "
            "of a file of coglab_controllers/config"
        ) from None
    _mapping(str(path))


def _machines(value: str) -> None:
    """A configuration of the machines whose own actions, states and deliveries can be imported."""
    from coglab_smach.context.config import Config, ConfigError
    from coglab_smach.context.parts import Parts

    _mapping(value)
    try:
        Parts.load(Config.load(value))
    except ConfigError as error:
        raise ValueError(str(error)) from None


def _tracker(value: str) -> None:
    """A mapping of the perception bridge."""
    from coglab_perception.frames import FrameNames
    from coglab_perception.tracker_mapping import TrackerMapping

    _mapping(value)
    TrackerMapping.load(value, FrameNames.load(str(package_path("coglab_perception", "config", "frames.yaml"))))


def _primitives(value: str) -> None:
    try:
        ElementTree.fromstring(_bytes(value))
    except ElementTree.ParseError as error:
        raise ValueError(
            f"not XML: {error}; expected a library of primitives, as ./coglab dmp train writes it"
        ) from None


def _patterns(value: str) -> None:
    try:
        found = json.loads(_bytes(value))
    except (RecursionError, ValueError) as error:  # invalid contents are ValueErrors too
        wrong = isinstance(error, (json.JSONDecodeError, UnicodeDecodeError, RecursionError))
        raise ValueError(f"not JSON: {error}; train_patterns.py writes such a file" if wrong else str(error)) from None
    if not isinstance(found, dict):
        raise ValueError("expected a file of train_patterns.py, a JSON object")


def _arm(value: str) -> None:
    """`fri`, `ideal`, or a library that the loader finds and that has an arm."""
    if value in ("fri", "ideal"):
        return
    if "/" not in value and ".so" not in value:
        raise ValueError("expected fri, ideal, or a library such as libmy_arm.so")
    # In a process of its own: loading a file that is cut short ends the process.
    try:
        tried = subprocess.run(
            [sys.executable, "-c", _LOAD, value], capture_output=True, text=True, errors="replace", timeout=LOAD_TIMEOUT
        )
    except subprocess.TimeoutExpired:
        raise ValueError(
            f"the library was not loaded within {LOAD_TIMEOUT} s; see what its static objects wait for"
        ) from None
    if tried.returncode < 0:
        raise ValueError(
            f"loading the library ended the process ({signal.strsignal(-tried.returncode)}); the file is cut short, or "
            "a static object of the library fails; build it again"
        )
    if tried.returncode == _NO_ARM:
        raise ValueError("the library has no arm; end its source with COGLAB_ARM(MyArm), see docs/arm_back_end.md")
    if tried.returncode:
        raise ValueError(f"the library cannot be loaded: {tried.stderr.strip()}; give its whole path, or build it")


def _objects(value: str) -> None:
    path = Path(value)
    if not path.is_absolute():
        raise ValueError(f"expected a whole path, because nodes run in another folder; write {path.absolute()}")
    if not path.is_dir():
        raise ValueError("there is no such folder; expected the folder of the objects, with a file per object")
    if not any(path.glob("*.yaml")):
        raise ValueError(
            "no object is in this folder; expected a YAML file per object, as ./coglab object new writes it"
        )


def _written(value: str) -> None:
    """A file to be written by a node."""
    path = Path(value)
    if path.is_dir():
        raise ValueError("expected a file to write, this is a folder")
    if path.is_absolute() and not path.parent.is_dir():
        raise ValueError(f"there is no folder {path.parent}; make it first")
    if path.is_absolute() and not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ValueError("the file cannot be written; check its permissions")


def _learnt(value: str) -> None:
    _written(value)
    if Path(value).exists():
        _mapping(value)


def _folder(value: str) -> None:
    if value != "none" and Path(value).exists() and not Path(value).is_dir():
        raise ValueError("expected a folder, this is a file")


def _or_empty(judge: Callable[[str], None]) -> Callable[[str], None]:
    return lambda value: judge(value) if value else None


_CHECKS: dict[str, Callable[[str], object]] = {
    "controllers": _mapping,
    "machines": _machines,
    **dict.fromkeys(("feedback", "managers", "signals"), _or_empty(_controller_file)),
    **dict.fromkeys(("results", "log_file", "hand_trace"), _or_empty(_written)),
    "arm": _arm,
    "primitives": _primitives,
    "patterns": _patterns,
    "objects": _objects,
    "tracker": _or_empty(_tracker),
    "contact_learnt_file": _or_empty(_learnt),
    "record": _or_empty(_folder),
    **dict.fromkeys(("perception", "sim", "split"), str),
}
