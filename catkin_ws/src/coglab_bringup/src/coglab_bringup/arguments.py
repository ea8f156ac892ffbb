"""Checks the arguments of the ./coglab commands before anything is installed or built. Standard library only.

    python3 -m coglab_bringup.arguments TOP COMMAND [ARG ...]

Exit status 0: arguments are valid. 2: refused, with one sentence that lists the valid ones. 10: help was printed.
The commands parse their arguments with the same functions.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from coglab_bringup.launch_arguments import judge_launch
from coglab_bringup.usage import Parser, Refused, seed, writable_file, writable_folder

HELP_GIVEN = 10
BUILD_WORDS = ("--upstream-smach", "tests")
TEST_FILES = ("test_*.cpp", "test_*.py", "*.test")  # in the folder test of a package
GTEST_CASE = re.compile(r"^\s*(TYPED_TEST|TEST_F|TEST_P|TEST)\(\s*(\w+)\s*,\s*(\w+)\s*\)", re.MULTILINE)


def demo_parser(top: Path) -> Parser:
    """./coglab demo"""
    parser = Parser(prog="coglab demo", description="Takes an object from the simulated person and gives it back.")
    parser.add_argument("--headless", action="store_true", help="no rviz, even if it is installed")
    parser.add_argument("--no-console", action="store_true", help="without the experimenter's page")
    parser.add_argument("--seed", type=seed, default=7, help="seed of the virtual person and of all noise")
    parser.add_argument(
        "--out",
        type=writable_folder,
        default=top / "out" / "demo",
        metavar="DIR",
        help="folder of result.json and trial.png",
    )
    parser.add_argument(
        "--person",
        choices=("patient", "accustomed", "drawn"),
        default="patient",
        help="patient: waits for the robot, seen without noise or delay (default); accustomed: also helps it by habit; "
        "drawn: late and inexact, by the seed, and seen with noise; not every handover succeeds, least with "
        "drawn people",
    )
    return parser


def film_parser(top: Path) -> Parser:
    """./coglab film"""
    parser = Parser(prog="coglab film", description="A moving picture of a handover in both directions.")
    parser.add_argument("--seed", type=seed, default=7, help="seed of the virtual person and of all noise")
    parser.add_argument(
        "--out",
        type=writable_file,
        default=top / "docs" / "images" / "handover.gif",
        metavar="FILE",
        help="the GIF (default: docs/images/handover.gif)",
    )
    return parser


def package_folders(sources: Path) -> dict[str, Path]:
    """Folder of each package of the workspace, by package name."""
    found = {}
    for manifest in sorted(sources.rglob("package.xml")):
        name = re.search(r"<name>\s*([\w-]+)\s*</name>", manifest.read_text(encoding="utf-8"))
        if name:
            found[name.group(1)] = manifest.parent
    return found


def needs_of(folders: dict[str, Path]) -> dict[str, set[str]]:
    """Dependencies of each package, of any kind, from its package.xml."""
    found = {}
    for name, folder in folders.items():
        text = (folder / "package.xml").read_text(encoding="utf-8")
        found[name] = set(re.findall(r"<(?:\w*_)?depend>\s*([\w-]+)\s*<", text))
    return found


def used_by(package: str, folders: dict[str, Path]) -> set[str]:
    """The packages of the workspace that `package` depends on, directly or indirectly."""
    needs, found = needs_of(folders), set[str]()
    front = {package}
    while front:
        front = {name for each in front for name in needs[each] if name in folders and name not in found}
        found |= front
    return found - {package}


def left_out(top: Path) -> list[str]:
    """Packages that the last build omitted because this computer has its own: ./coglab build --upstream-smach."""
    cache = top / "catkin_ws" / "build" / "CMakeCache.txt"
    text = cache.read_text(encoding="utf-8", errors="replace") if cache.is_file() else ""
    found = re.search(r"^CATKIN_BLACKLIST_PACKAGES:\w+=(.+)$", text, re.MULTILINE)
    return found.group(1).split(";") if found else []


def cases_in(path: Path) -> list[str]:
    """Names of the gtests in a C++ file, in the form of --gtest_filter."""
    forms = {"TEST_P": "*{}.{}/*", "TYPED_TEST": "{}/*.{}"}
    found = GTEST_CASE.findall(path.read_text(encoding="utf-8"))
    return [forms.get(macro, "{}.{}").format(suite, name) for macro, suite, name in found]


def test_files(test: Path) -> list[Path]:
    """The test files in a package's folder test and in its rooms. The .cpp files of a room form one gtest binary."""
    files = [path for kind in TEST_FILES for path in sorted(test.glob(kind))]
    return files + [path for path in sorted(test.glob("*/*.cpp")) if cases_in(path)]


def binary_of(package: str, path: Path) -> str:
    """Name of the gtest binary (and target) that contains this file: that of the file itself or of its room."""
    return f"{package}_{path.stem}" if path.parent.name == "test" else f"{package}_test_{path.parent.name}"


class Wanted(NamedTuple):
    """Tests named by one command-line argument: PACKAGE, PACKAGE/ROOM, PACKAGE/FILE or PACKAGE/FILE::CASE."""

    package: str
    file: str = ""  # in the package's folder test or in one of its rooms; "": all files
    case: str = ""

    @classmethod
    def of(cls, word: str) -> Wanted:
        """Parse an argument, e.g. "coglab_rt/test_clock.cpp::counts"."""
        place, _, case = word.partition("::")
        package, _, file = place.rstrip("/").partition("/")
        return cls(package, file.removeprefix("test/"), case)

    def names(self, path: Path) -> bool:
        """True if it names this file of its package, or the file's room."""
        room = "" if path.parent.name == "test" else path.parent.name
        return self.file in {"", path.name, room, f"{room}/{path.name}"}

    def check(self, sources: Path) -> None:
        """Raise Refused if there is no such test. The message lists those that exist."""
        folders = package_folders(sources)
        _named([self.package], folders, "package")
        files = test_files(folders[self.package] / "test")
        if not any(self.names(path) for path in files) and self.file:
            rooms = {path.parent.name for path in files} - {"test"}
            _named([self.file], sorted(rooms.union(path.name for path in files)), f"test of {self.package}")
        if self.case and not self.file.endswith((".cpp", ".py")):
            raise Refused(f"{self.file or self.package} runs as a whole: leave out ::{self.case}")


NAMED_IN_A_TEST = r"""(?:\bfind |\bpkg=['"]|\bfrom |\bimport |_path\(['"]|\brosrun['"], ['"])(\w+)"""
"""Pattern of a package name in launch files and Python programs that run or import it."""


def test_targets(top: Path, wanted: list[Wanted]) -> list[str]:
    """Targets of the workspace's CMakeFiles/Makefile2 that these tests need. For pytests and rostests these are all
    targets of the packages that the package's tests name, and of their dependencies."""
    sources = top / "catkin_ws" / "src"
    rules = (top / "catkin_ws" / "build" / "CMakeFiles" / "Makefile2").read_text(encoding="utf-8")
    of_tests = re.findall(r"^CMakeFiles/tests.dir/all: (\S+)", rules, re.MULTILINE)
    folders = package_folders(sources)
    targets = set[str]()
    for one in wanted:
        place = folders[one.package].relative_to(sources)
        files = [path for path in test_files(folders[one.package] / "test") if one.names(path)]
        if one.file and all(path.suffix == ".cpp" for path in files):
            targets |= {f"{place}/CMakeFiles/{binary_of(one.package, path)}.dir/all" for path in files}
            continue
        targets |= {target for target in of_tests if target.startswith(f"{place}/CMakeFiles/")}
        text = "\n".join(path.read_text(encoding="utf-8") for path in (folders[one.package] / "test").glob("*.*"))
        named = {one.package, *(name for name in re.findall(NAMED_IN_A_TEST, text) if name in folders)}
        needed = named.union(*(used_by(name, folders) for name in named)) - set(left_out(top))
        targets |= {f"{folders[name].relative_to(sources)}/all" for name in needed}
    return sorted(targets)


def benchmarks(top: Path) -> list[str]:
    """Names of the programs in the folder benchmarks."""
    files = sorted((top / "benchmarks").glob("*.py"))
    return [path.stem for path in files if '__name__ == "__main__"' in path.read_text() and path.stem != "report"]


def _named(names: list[str], known: Iterable[str], what: str) -> None:
    unknown = [name for name in names if name not in known]
    if unknown:
        raise Refused(f"no {what} named {', '.join(unknown)}; there are: {', '.join(known)}")


def test_options(top: Path, words: list[str]) -> argparse.Namespace:
    """./coglab test"""
    parser = Parser(prog="coglab test", description="Runs every test; the last line counts them.")
    parser.add_argument("tests", nargs="*", metavar="PACKAGE[/FILE[::CASE]]", type=Wanted.of, help="default: all")
    parser.add_argument("--long", action="store_true", help="the campaigns too (hours)")
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="run N times; list the cases that differ")
    parser.add_argument("--load", action="store_true", help="run beside two busy processes")
    parser.add_argument(
        "--out",
        type=writable_folder,
        default=top / "out" / "test",
        metavar="DIR",
        help="folder of JUnit files and logs, emptied first (default: out/test)",
    )
    options = parser.parse_args(words)
    out: Path = options.out
    if out.is_dir() and any(out.iterdir()) and not (out / "logs").is_dir():
        raise Refused(f"--out {out} holds other files, and would be emptied; name a new folder")
    if options.repeat < 1:
        raise Refused(f"--repeat takes a number of runs from 1, got {options.repeat}")
    for one in options.tests:
        one.check(top / "catkin_ws" / "src")
        if one.package in left_out(top):
            raise Refused(
                f"this build leaves out {one.package} for the one installed on this machine; "
                "to test ours: ./coglab build"
            )
    return options


def bench_options(top: Path, words: list[str]) -> argparse.Namespace:
    """./coglab bench"""
    known = benchmarks(top)
    parser = Parser(
        prog="coglab bench", description="Runs the benchmarks, with goals and other programs for comparison."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(known)}; default: all, without --report")
    parser.add_argument("--quick", action="store_true", help="few repetitions; prints the rows and stores none")
    parser.add_argument("--report", action="store_true", help="writes docs/benchmarks.md from benchmarks/results.csv")
    options = parser.parse_args(words)
    _named(options.names, known, "benchmark")
    if not options.names and not options.report:
        options.names = known
    return options


def _judge_shell(top: Path, words: list[str]) -> None:
    path = os.pathsep.join((os.environ["PATH"], str(top / "catkin_ws" / "devel" / "bin")))
    if words and (top / "catkin_ws" / "devel" / "setup.bash").exists() and not shutil.which(words[0], path=path):
        raise Refused(
            f"no command named '{words[0]}' in the PATH of this workspace; to build a new one: ./coglab build"
        )


def _judge_tool(command: str, words: list[str]) -> None:
    verbs = TOOLS[command]
    if words[:1] == ["--folder"]:  # option of object_tool.py, which may come first
        words = words[2:]
    if not words or words[0] not in verbs:
        what = f"got '{words[0]}'" if words else "got nothing"
        raise Refused(f"{command} expects one of: {', '.join(verbs)}; {what}")
    if len(words) - 1 < verbs[words[0]]:
        raise Refused(f"{command} {words[0]} expects a {'FILE' if words[0] == 'run' else 'NAME'}")


TOOLS = {
    "hand": {"trace": 0},
    "controller": {"new": 1, "run": 1},
    "object": {"new": 1, "check": 0, "list": 0},
    "console": {"picture": 0},
}
"""For each command: its first words, and the least number of words that follow each of them."""


def judge(top: Path, command: str, words: list[str]) -> None:
    """Raise Refused for arguments that the command cannot use."""
    if command == "demo":
        demo_parser(top).parse_args(words)
    elif command == "film":
        film_parser(top).parse_args(words)
    elif command == "test":
        test_options(top, words)
    elif command == "bench":
        bench_options(top, words)
    elif command == "launch":
        judge_launch(top, words)
    elif command == "shell":
        _judge_shell(top, words)
    elif command == "extras":
        pass  # any command, also one that PyPI installs first
    elif command == "install":
        lines = (top / "debian-packages.txt").read_text(encoding="utf-8").splitlines()
        _named(words, dict.fromkeys(line.split(":")[0] for line in lines if line and line[0] != "#"), "group")
    elif command == "build":
        unknown = [word for word in words if word not in BUILD_WORDS]
        if unknown:
            raise Refused(f"build takes {', '.join(BUILD_WORDS)}, not {', '.join(unknown)}")
    elif command in TOOLS:
        _judge_tool(command, words)
    elif words:
        raise Refused(f"{command} takes no arguments, got '{' '.join(words)}'")


def main(words: list[str]) -> int:
    """See the module's docstring."""
    top, command, rest = Path(words[0]), words[1], words[2:]
    if command in ("test-names", "test-targets"):  # the build before `test` passes the arguments of `test`
        tests = test_options(top, rest).tests
        print(*(test_targets(top, tests) if command == "test-targets" else (one.package for one in tests)))
        return 0
    try:
        judge(top, command, rest)
    except SystemExit:  # argparse printed its help
        return HELP_GIVEN
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
