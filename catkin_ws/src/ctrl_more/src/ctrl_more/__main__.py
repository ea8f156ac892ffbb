"""`python3 -m ctrl_more list|check|page|run FILE`: shows, checks, documents and runs the controllers of a list file.

FILE may also be a Python file with a controller: `my_module.py`, or `my_module.py:MyController`.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ctrl_more import (
    ControlStates,
    Cycle,
    Description,
    FeedbackControllersManager,
    Logger,
    Refused,
    RobotStates,
    describe,
)
from ctrl_more._scripts import controllers_of

Numbers = npt.NDArray[np.float64]


class Loaded:
    """The controllers of a list file on empty stores."""

    def __init__(self, file: str, joints: int = 0, period: float = 0.005) -> None:
        quiet = Logger()
        self.robot = RobotStates(quiet)
        self.control = ControlStates(joints, period, quiet)
        self.manager = FeedbackControllersManager(self.robot, self.control, logger=quiet)
        if is_python(file):
            path, kind = python_type(file)
            name = kind.rpartition(":")[2]
            self.manager.load_text(
                f"loadControllers: [{name}]\n{name}: {{type: '{kind}', enabled: true}}\n", path.parent
            )
        else:
            self.manager.load(file)


def is_python(file: str) -> bool:
    """Whether it is `my_module.py` or `my_module.py:MyController`, not a list file or a library."""
    return file.partition(":")[0].endswith(".py")


def python_type(file: str) -> tuple[Path, str]:
    """The path of `my_module.py` or `my_module.py:MyController`, and its type `my_module:MyController`."""
    name, _, chosen = file.partition(":")
    path = Path(name)
    if not path.is_file():
        raise Refused(f"there is no file {path}")
    if not chosen:
        found = controllers_of(path)
        if len(found) != 1:
            raise Refused(f"{path} has {len(found)} controllers: {found}; choose one: {path}:MyController")
        chosen = found[0]
    return path, f"{path.stem}:{chosen}"


def show_list(arguments: argparse.Namespace) -> int:
    manager = Loaded(arguments.file, arguments.joints).manager
    for status in manager.status_all():
        summary = manager.describe(status.name).summary
        print(f"{status.name}: {status.type or 'type of its library'}, {status.stage} stage, "
              f"{'enabled' if status.enabled else 'disabled'}. {summary}")  # fmt: skip
    return 0


def descriptions(file: str, joints: int) -> list[tuple[str, Description]]:
    """Controllers of a list file, or the one of a library or of `module.py:Class`."""
    if file.endswith(".so"):
        return [(file, describe(file))]
    if is_python(file):
        path, kind = python_type(file)
        return [(kind.rpartition(":")[2], describe(str(path.parent), kind))]
    manager = Loaded(file, joints).manager
    return [(name, manager.describe(name)) for name in manager.get_controllers_names()]


def check(arguments: argparse.Namespace) -> int:
    wrong = 0
    for name, description in descriptions(arguments.file, arguments.joints):
        for complaint in [*description.faults(), *description.empty_fields()]:
            print(f"{name}: {complaint}", file=sys.stderr)
            wrong += 1
    if not wrong:
        print("every controller loads and every field of its description is filled")
    return 1 if wrong else 0


def page(arguments: argparse.Namespace) -> int:
    print("\n".join(description.page() for _, description in descriptions(arguments.file, arguments.joints)))
    return 0


def read_signals(arguments: argparse.Namespace) -> dict[str, Numbers]:
    """Rows of numbers by signal: one row for a constant signal."""
    signals: dict[str, Numbers] = {}
    for text in arguments.signal:
        name, equals, values = text.partition("=")
        if not equals:
            raise Refused(f"--signal {text}: expected map/key=1,2,3")
        try:
            signals[name] = np.array([[float(part) for part in values.split(",")]])
        except ValueError:
            raise Refused(f"--signal {text}: expected numbers after '=', such as 1,2,3") from None
    if arguments.record:
        with open(arguments.record, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        columns: dict[str, list[str]] = {}
        for column in rows[0] if rows else []:
            columns.setdefault(column.rpartition(".")[0], []).append(column)
        for name, parts in columns.items():
            signals[name] = np.array([[float(row[part]) for part in parts] for row in rows])
    return signals


def write_signal(loaded: Loaded, name: str, values: Numbers, now_ns: int) -> None:
    group, _, key = name.partition("/")
    setters = {"measuredData": loaded.robot.set_measured_data, "estimatedData": loaded.robot.set_estimated_data}
    used = [*loaded.manager.get_used_robot_states(), *loaded.manager.get_used_control_states()]
    if name not in used:
        raise Refused(f"--signal {name}: no controller uses it; they use: {', '.join(used)}")
    if group in setters:
        setters[group](key, values, now_ns)
        return
    loaded.control.view(group, key)[:] = values


def run(arguments: argparse.Namespace) -> int:
    if arguments.cycles < 1:
        raise Refused(f"--cycles: 1 or more is expected, got {arguments.cycles}")
    loaded = Loaded(arguments.file, arguments.joints, arguments.period)
    manager = loaded.manager
    if arguments.enable_all:
        manager.enable()
    signals = read_signals(arguments)
    manager.freeze()
    start = {
        group: {s.key: loaded.control.view(group, s.key).copy() for s in loaded.control.signals(group)}
        for group in {name.partition("/")[0] for name in manager.get_used_control_states()}
    }
    largest: dict[tuple[str, str], float] = {}
    ran: Counter[str] = Counter()
    for number in range(1, arguments.cycles + 1):
        now_ns = int(number * arguments.period * 1e9)
        for group, keys in start.items():  # each cycle corrects the same references anew
            for key, values in keys.items():
                loaded.control.view(group, key)[:] = values
        for name, rows in signals.items():
            write_signal(loaded, name, rows[min(number, len(rows)) - 1], now_ns)
        manager.update(Cycle(now_ns, arguments.period, number))
        for change in manager.last_cycle().changes:
            pair = change.controller, change.signal
            largest[pair] = max(largest.get(pair, 0.0), change.size, change.angle)
        ran.update(status.name for status in manager.status_all() if status.activity == "running")
    for status in manager.status_all():
        words = f", {status.fault_text} (cycle {status.fault_cycle})" if status.faults else ""
        words += f", waits for {status.waiting_for} (--signal gives it)" if status.waiting_for else ""
        print(f"{status.name}: {status.activity}, ran in {ran[status.name]} of {arguments.cycles} cycles{words}")
        for change in manager.last_cycle().changes:
            if change.controller == status.name:
                before, after = (np.array2string(np.array(v), precision=4) for v in (change.before, change.after))
                top = largest[change.controller, change.signal]
                print(f"  {change.signal}: {before} -> {after}, largest correction {top:.4g}")
    return 1 if any(status.faults for status in manager.status_all()) else 0


def parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(prog="python3 -m ctrl_more", description=__doc__.partition("\n")[0])
    commands = top.add_subparsers(dest="command", required=True)
    for name, function, words in (
        ("list", show_list, "load it and name each controller"),
        ("check", check, "load it and find empty fields of descriptions"),
        ("page", page, "write the documentation page in Markdown"),
        ("run", run, "run it for some cycles and say what each controller did"),
    ):
        command = commands.add_parser(name, help=words, description=words)
        other = ", a library" if name in ("check", "page") else ""
        command.add_argument("file", help=f"list file{other}, my_module.py or my_module.py:MyController")
        command.add_argument(
            "--joints", type=int, default=0, help="joints of the robot (0: the first reference decides)"
        )
        command.set_defaults(function=function)
    command.add_argument("--cycles", type=int, default=200, help="cycles to run (200)")
    command.add_argument("--period", type=float, default=0.005, help="time of a cycle in s (0.005)")
    command.add_argument("--enable-all", action="store_true", help="enable every controller")
    command.add_argument("--signal", action="append", default=[], metavar="MAP/KEY=1,2,3",
                         help="a constant signal, such as measuredData/imu=0,0,0; may be repeated")  # fmt: skip
    words = "recorded signals: one row per cycle, columns measuredData/imu.0, measuredData/imu.1, ..."
    command.add_argument("--record", metavar="CSV", help=words)
    return top


def main() -> int:
    """Run a command. Returns 0: success, 1: error in the file, 2: wrong usage."""
    arguments = parser().parse_args()
    try:
        code = int(arguments.function(arguments))
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # `... | head` has read enough; nothing is written at the end either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Refused, RuntimeError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
