"""The arguments of coglab.launch, judged by name and value: roslaunch ignores a name that it does not know, and a node
that cannot use its value would be started again and again."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from coglab_bringup.usage import Refused, master_port, seed, writable_file

ROSLAUNCH_OPTIONS = ("--screen", "--log", "-v", "--dump-params", "--nodes", "--files", "--ros-args", "--wait")
BEHAVIOURS = "coglab_sim/src/coglab_sim/person/participant.py"
OBJECTS = "coglab_objects/objects"
LIMITS = "lwr_description/config/joint_limits.yaml"
CELL = "coglab_sim/include/coglab_sim/parameter_table.inc"
CONVENTIONS = "lwr_fri_bridge/src/fri/krl_convention.cpp"
HELP = """usage: ./coglab launch [-p PORT] [ARGUMENT:=VALUE ...] [OPTION of roslaunch ...]

Starts coglab.launch on a free port of its own for the ROS master, or on PORT. Arguments, with what they are by default:
"""


def launch_arguments(sources: Path) -> dict[str, tuple[str, str]]:
    """Default and meaning of each argument of coglab.launch, by name."""
    tree = ElementTree.parse(sources / "coglab_bringup" / "launch" / "coglab.launch")
    found = [arg.attrib for arg in tree.getroot().findall("arg") if "default" in arg.attrib]
    return {arg["name"]: (arg["default"], arg.get("doc", "")) for arg in found}


def _behaviours(sources: Path) -> list[str]:
    for node in ast.parse((sources / BEHAVIOURS).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "BEHAVIOURS":
            return list(ast.literal_eval(node.value))
    raise Refused(f"{BEHAVIOURS} holds no BEHAVIOURS")


def objects_in(folder: Path) -> list[str]:
    """Objects of a database folder: its files."""
    return sorted(path.stem for path in folder.glob("*.yaml"))


def _object(folder: Path, value: str) -> None:
    if value:
        _one_of(objects_in(folder), value)


def _profiles(sources: Path) -> list[str]:
    names = re.findall(r"^(\w+):\s*$", (sources / LIMITS).read_text(encoding="utf-8"), re.MULTILINE)
    return names


def _cell_range(sources: Path, parameter: str) -> tuple[float, float]:
    """Range of a parameter of the simulated cell."""
    found = re.search(rf'"{parameter}", (\S+), (\S+),', (sources / CELL).read_text(encoding="utf-8"))
    if found is None:
        raise Refused(f"{CELL} holds no {parameter}")
    return float(found[1]), float(found[2])


def _conventions(sources: Path) -> list[str]:
    listed = re.search(r"kNames = \{(.*?)\}", (sources / CONVENTIONS).read_text(encoding="utf-8"), re.DOTALL)
    return re.findall(r'"(\w+)"', listed.group(1)) if listed else []


def _one_of(words: list[str], value: str) -> None:
    if value not in words:
        raise ValueError(f"there is no '{value}'; there are: {', '.join(words)}")


def _number(low: float, high: float, value: str) -> None:
    try:
        inside = low <= float(value) <= high
    except ValueError:
        inside = False
    if not inside:
        raise ValueError(f"expected a number from {low:g} to {high:g}, got '{value}'")


def _file(value: str) -> None:
    if value and not Path(value).is_file():
        raise ValueError(f"there is no file {value}")


def _required_file(value: str) -> None:
    if not Path(value).is_file():
        raise ValueError(f"there is no file {value or '(empty name)'}")


def _folder(value: str) -> None:
    if not Path(value).is_dir():
        raise ValueError(f"there is no folder {value or '(empty name)'}")


def _address(value: str) -> None:
    parts = value.split(".")
    if len(parts) != 4 or not all(part.isdigit() and int(part) < 256 for part in parts):
        raise ValueError(f"expected an address of this computer, such as 127.0.0.1, got '{value}'")


def _whole(low: int, high: int, value: str) -> None:
    if not value.isdigit() or not low <= int(value) <= high:
        raise ValueError(f"expected a whole number from {low} to {high}, got '{value}'")


def _rules(sources: Path, objects: Path) -> dict[str, Callable[[str], object]]:
    """What each argument takes; a name that is missing here takes any text. `objects` is the database's folder."""
    boolean = ["true", "false"]
    rules: dict[str, Callable[[str], object]] = {
        "arm": lambda value: _one_of(["fri", "ideal"], value),
        "seed": seed,
        "fri_period": lambda value: _number(*_cell_range(sources, "krc/period"), value),
        "fri_address": _address,
        "fri_port": lambda value: _whole(0, 65535, value),
        "console_port": lambda value: _whole(0, 65535, value),
        "console_address": _address,
        "people": lambda value: _whole(1, 9, value),
        "krl_convention": lambda value: _one_of(_conventions(sources), value),
        "limits_profile": lambda value: _one_of(_profiles(sources), value),
        "behaviour": lambda value: _one_of(_behaviours(sources), value),
        "profile": lambda value: _one_of(["drawn", "patient", "accustomed"], value),
        "recorded_person": lambda value: _one_of(["wait", "no_wait", "leave"], value),
        "recorded_object": lambda value: _one_of(["recorded", "in_hand"], value),
        "object": lambda value: _object(objects, value),
        "objects": _folder,
        "recording": _file,
    }
    for name in ("alone", "sim", "split", "rviz", "perfect_perception", "auto_trigger", "recogniser", "console"):
        rules[name] = lambda value: _one_of(boolean, value.lower())
    for name in ("controllers", "dmp_library", "machines", "patterns"):
        rules[name] = _required_file
    for name in ("result_file", "log_file", "hand_trace"):
        rules[name] = lambda value: value and writable_file(value)
    return rules


def split_port(words: list[str]) -> tuple[int, list[str]]:
    """The port after `-p` (0: none) and the other words. Refused if it is none."""
    if "-p" not in words:
        return 0, words
    at = words.index("-p")
    try:
        return master_port((words[at + 1 : at + 2] or [""])[0]), words[:at] + words[at + 2 :]
    except Exception as error:
        raise Refused(f"-p: {error}") from error


def judge_launch(top: Path, words: list[str]) -> None:
    """Refused for an argument or value that the launch file cannot use; prints the arguments for --help and exits."""
    sources = top / "catkin_ws" / "src"
    known = launch_arguments(sources)
    if "-h" in words or "--help" in words:
        rows = [f"  {name + ':=' + default:45} {meaning}" for name, (default, meaning) in known.items()]
        print(HELP + "\n".join(rows))
        raise SystemExit(0)
    if {"arm:=ideal", "split:=true"} <= {word.lower() for word in words}:
        raise Refused("the ideal arm and its controllers are one process: leave out split:=true or arm:=ideal")
    folders = [value for name, _, value in (word.partition(":=") for word in words) if name == "objects"]
    rules = _rules(sources, Path(folders[-1]) if folders and "$(" not in folders[-1] else sources / OBJECTS)
    for word in split_port(words)[1]:
        name, equals, value = word.partition(":=")
        if not equals:
            if word not in ROSLAUNCH_OPTIONS:
                options = ", ".join(ROSLAUNCH_OPTIONS)
                raise Refused(f"launch expects ARGUMENT:=VALUE, -p PORT or one of {options}; got '{word}'")
        elif name not in known:
            raise Refused(f"coglab.launch has no argument '{name}'; there are: {', '.join(known)}")
        elif "$(" not in value and name in rules:  # substitutions are roslaunch's to resolve
            try:
                rules[name](value)
            except Refused:
                raise
            except Exception as error:  # the kinds of values tell by ValueError and by argparse's own error
                raise Refused(f"{word}: {error}") from error
