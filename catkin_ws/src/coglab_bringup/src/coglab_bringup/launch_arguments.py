"""Checks names and values of the arguments of coglab.launch. roslaunch ignores an unknown name, and restarts a node
that cannot use its value again and again."""

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
READ = ("controllers", "feedback", "managers", "signals", "primitives", "dmp_library", "objects", "machines", "tracker",
        "patterns", "recording")  # fmt: skip
WRITTEN = ("results", "result_file", "contact_learnt_file", "record", "log_file", "hand_trace")
HELP = """usage: ./coglab launch [-p PORT] [ARGUMENT:=VALUE ...] [OPTION of roslaunch ...]

Starts coglab.launch with its own ROS master on a free port, or on PORT. Arguments with their defaults:
"""
Check = Callable[[str], object]  # raises an exception for an invalid value


def launch_arguments(sources: Path) -> dict[str, tuple[str, str]]:
    """Default and description of each argument of coglab.launch, by name."""
    tree = ElementTree.parse(sources / "coglab_bringup" / "launch" / "coglab.launch")
    found = [arg.attrib for arg in tree.getroot().findall("arg") if "default" in arg.attrib]
    return {arg["name"]: (arg["default"], arg.get("doc", "")) for arg in found}


def _behaviours(sources: Path) -> list[str]:
    for node in ast.parse((sources / BEHAVIOURS).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "BEHAVIOURS":
            return list(ast.literal_eval(node.value))
    raise Refused(f"{BEHAVIOURS} holds no BEHAVIOURS")


def _cell_range(sources: Path, parameter: str) -> tuple[float, float]:
    """Range of a parameter of the simulated cell."""
    found = re.search(rf'"{parameter}", (\S+), (\S+),', (sources / CELL).read_text(encoding="utf-8"))
    if found is None:
        raise Refused(f"{CELL} holds no {parameter}")
    return float(found[1]), float(found[2])


def _conventions(sources: Path) -> list[str]:
    listed = re.search(r"kNames = \{(.*?)\}", (sources / CONVENTIONS).read_text(encoding="utf-8"), re.DOTALL)
    return re.findall(r'"(\w+)"', listed.group(1)) if listed else []


def _must(fine: bool, sentence: str) -> None:
    if not fine:
        raise ValueError(sentence)


def _one_of(*words: str) -> Check:
    return lambda value: _must(value in words, f"there is no '{value}'; there are: {', '.join(words)}")


def _flag(value: str) -> None:
    _one_of("true", "false")(value.lower())


def _number(low: float, high: float) -> Check:
    def check(value: str) -> None:
        fine = bool(re.fullmatch(r"[-+.\deE]+", value)) and low <= float(value) <= high
        _must(fine, f"expected a number from {low:g} to {high:g}, got '{value}'")

    return check


def _whole(low: int, high: int) -> Check:
    return lambda value: _must(
        value.isdigit() and low <= int(value) <= high, f"expected a whole number from {low} to {high}, got '{value}'"
    )


def _file(value: str) -> None:
    _must(Path(value).is_file(), f"there is no file {value or '(empty name)'}")


def _controller_file(value: str) -> None:
    """/robot finds shipped files by their names, and files of packages."""
    if "/" in value and not value.startswith("package://"):
        _file(value)


def _folder(value: str) -> None:
    _must(Path(value).is_dir(), f"there is no folder {value or '(empty name)'}")


def _address(value: str) -> None:
    parts = value.split(".")
    fine = len(parts) == 4 and all(part.isdigit() and int(part) < 256 for part in parts)
    _must(fine, f"expected an address of this computer, such as 127.0.0.1, got '{value}'")


def _arm(value: str) -> None:
    if "/" in value:
        _file(value)
    elif not value.endswith(".so"):
        _must(value in ("fri", "ideal"), f"there is no '{value}'; there are: fri, ideal, and a library: libmy_arm.so")


def _or_empty(check: Check) -> Check:
    return lambda value: value and check(value)


def _checks(sources: Path, objects: Path) -> dict[str, Check]:
    """Check of each argument. An argument without a check accepts any text. `objects`: folder of the database."""
    profiles = re.findall(r"^(\w+):\s*$", (sources / LIMITS).read_text(encoding="utf-8"), re.MULTILINE)
    flags = ("alone", "sim", "split", "rviz", "perfect_perception", "auto_trigger", "recogniser", "console")
    files = ("controllers", "primitives", "dmp_library", "machines", "patterns")
    written = ("results", "result_file", "log_file", "hand_trace")
    return {
        **dict.fromkeys(flags, _flag),
        **dict.fromkeys(files, _file),
        **dict.fromkeys(written, _or_empty(writable_file)),
        **dict.fromkeys(("fri_port", "console_port"), _whole(0, 65535)),
        **dict.fromkeys(("fri_address", "console_address"), _address),
        "arm": _arm,
        "seed": seed,
        "fri_period": _number(*_cell_range(sources, "krc/period")),
        "people": _whole(1, 9),
        "krl_convention": _one_of(*_conventions(sources)),
        "limits_profile": _one_of(*profiles),
        "behaviour": _one_of(*_behaviours(sources)),
        "profile": _one_of("drawn", "patient", "accustomed"),
        "recorded_person": _one_of("wait", "no_wait", "leave"),
        "recorded_object": _one_of("recorded", "in_hand"),
        "object": _or_empty(_one_of(*sorted(path.stem for path in objects.glob("*.yaml")))),
        "objects": _folder,
        "perception": _one_of("stand_in", "bridge", "none"),
        **dict.fromkeys(("recording", "tracker"), _or_empty(_file)),
        **dict.fromkeys(("feedback", "managers", "signals"), _controller_file),
    }


def split_port(words: list[str]) -> tuple[int, list[str]]:
    """The port after `-p` (0: no -p) and the other words. Refused if it is not a port."""
    if "-p" not in words:
        return 0, words
    at = words.index("-p")
    try:
        return master_port((words[at + 1 : at + 2] or [""])[0]), words[:at] + words[at + 2 :]
    except Exception as error:
        raise Refused(f"-p: {error}") from error


def whole_path(word: str) -> str:
    """ARGUMENT:=VALUE with the absolute path of a file in this folder: nodes run in another one."""
    name, _, value = word.partition(":=")
    named = value and value != "none" and not value.startswith(("package://", "$("))
    if named and (name in WRITTEN or (name in READ and Path(value).exists())):
        return f"{name}:={Path(value).absolute()}"
    return word


def judge_launch(top: Path, words: list[str]) -> None:
    """Raise Refused for an invalid argument or value of the launch file. For --help, print the arguments and exit."""
    sources = top / "catkin_ws" / "src"
    known = launch_arguments(sources)
    if "-h" in words or "--help" in words:
        rows = [f"  {name + ':=' + default:45} {meaning}" for name, (default, meaning) in known.items()]
        print(HELP + "\n".join(rows))
        raise SystemExit(0)
    if {"arm:=ideal", "split:=true"} <= {word.lower() for word in words}:
        raise Refused("the ideal arm and its controllers are one process: leave out split:=true or arm:=ideal")
    if "perception:=bridge" in words and not any(re.match("tracker:=.", word) for word in words):
        raise Refused("perception:=bridge needs tracker:=FILE, such as coglab_perception/config/perception_bridge.yaml")
    folders = [value for name, _, value in (word.partition(":=") for word in words) if name == "objects"]
    checks = _checks(sources, Path(folders[-1]) if folders and "$(" not in folders[-1] else sources / OBJECTS)
    for word in split_port(words)[1]:
        name, equals, value = word.partition(":=")
        if not equals and word not in ROSLAUNCH_OPTIONS:
            options = ", ".join(ROSLAUNCH_OPTIONS)
            raise Refused(f"launch expects ARGUMENT:=VALUE, -p PORT or one of {options}; got '{word}'")
        if equals and name not in known:
            raise Refused(f"coglab.launch has no argument '{name}'; there are: {', '.join(known)}")
        if equals and "$(" not in value and name in checks:  # roslaunch resolves substitutions
            try:
                checks[name](value)
            except Refused:
                raise
            except Exception as error:  # ValueError or an error of argparse
                raise Refused(f"{word}: {error}") from error
