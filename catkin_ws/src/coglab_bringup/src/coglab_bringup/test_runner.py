"""./coglab test: finds and runs every test of the workspace and counts each case once, from the JUnit files.

Three kinds, found by where they lie in a package:
  gtest    test/test_THING.cpp, built by the target `tests` as devel/lib/<package>/<package>_test_THING;
           not built is a failure
  pytest   test/test_*.py (smach's own packages one level deeper alike)
  rostest  test/*.test, each with a ROS master of its own
Packages that the build left out (./coglab build --upstream-smach) are named and not tested.
A program without a single case is a failure, too: a test file that tests nothing hides what it was written for.

Two programs run at a time, or one per processor core up to four. None may be red because others run beside it.
--repeat N runs all of that N times, --load beside two busy processes, and lists each case that did not end alike each
time.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from coglab_bringup import process_tree
from coglab_bringup.arguments import TEST_FILES, Wanted, left_out, package_folders, test_options
from coglab_bringup.run_directory import free_port, run_environment
from coglab_bringup.usage import Refused

AT_A_TIME = max(2, min(4, os.cpu_count() or 2))
BUSY = ("-c", "import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n  sum(range(100000))")
"""a process that uses one core as long as its parent lives"""
FIRST = (
    *("console.test", "session.test"),
    *("test_virtual_trials.py", "test_plain_cmake.py", "test_virtual_bad_input.py", "test_corrupted_streams.py"),
    *("test_bridge_and_cell.py", "test_new_motion.py", "test_page.py"),
    *("lwr_node.test", "port_contracts.test", "hand_node.test", "hand_faults.test", "fuzz.test", "topic_goal.test"),
)
"""what takes longest begins first: as the last one it would run while nothing is left to run beside it"""
TIME_LIMIT = 1800.0  # s, per test program
LONG_TIME_LIMIT = 7200.0  # s, with --long


@dataclass
class Program:
    """One test program and what became of it."""

    package: str
    kind: str  # gtest, pytest, rostest
    name: str
    command: list[str]
    junit: Path  # file it writes, or (rostest) folder
    seconds: float = 0.0
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    failures: list[str] = field(default_factory=list)
    cases: dict[str, str] = field(default_factory=dict)  # passed, failed or skipped, by the name of the case


def find_programs(top: Path, results: Path, python: str, wanted: list[Wanted]) -> list[Program]:
    """The test programs wanted; if none is named, of all packages that the build did not leave out."""
    folders = package_folders(top / "catkin_ws" / "src")
    cases: dict[tuple[str, Path], set[str]] = {}  # "": the whole file
    for one in wanted or [Wanted(package) for package in folders if package not in left_out(top)]:
        for kind in TEST_FILES:
            for path in sorted((folders[one.package] / "test").glob(kind)):
                if one.file in ("", path.name):
                    cases.setdefault((one.package, path), set()).add(one.case)
    library = top / "catkin_ws" / "devel" / "lib"
    programs = []
    for (package, path), named in cases.items():
        only = [] if "" in named else sorted(named)
        xml = results / f"{package}.{path.stem}.xml"
        if path.suffix == ".cpp":
            binary = library / package / f"{package}_{path.stem}"
            xml = results / f"{package}.{binary.name}.xml"
            command = [str(binary), f"--gtest_output=xml:{xml}"]
            command += [f"--gtest_filter={':'.join(f'*{case}*' for case in only)}"] if only else []
            programs.append(Program(package, "gtest", binary.name, command, xml))
        elif path.suffix == ".py":
            command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junit-xml={xml}"]
            command += [f"{path}::{case}" for case in only] or [str(path)]
            programs.append(Program(package, "pytest", path.name, command, xml))
        else:
            programs.append(Program(package, "rostest", path.name, ["rostest", str(path)], xml.with_suffix("")))
    return programs


def count_cases(program: Program, report: Path) -> None:
    """Adds the cases of one JUnit file to the program's counts."""
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        name = f"{case.get('classname', '')}.{case.get('name', '')}"
        ended = "passed"
        if case.find("failure") is not None or case.find("error") is not None:
            problem = case.find("failure") if case.find("failure") is not None else case.find("error")
            assert problem is not None
            program.failed += 1
            ended = "failed"
            text = (problem.get("message") or problem.text or "").strip().splitlines()
            program.failures.append(f"{name}: {text[0] if text else 'no message'}")
        elif case.find("skipped") is not None or case.get("status") == "notrun":
            program.skipped += 1
            ended = "skipped"
        else:
            program.passed += 1
        program.cases[name] = ended


def count(program: Program, status: int | None) -> None:
    """Reads the program's JUnit files; one without such a file, or that died without a red case, is one failure."""
    if program.kind == "rostest":
        # rosunit-*.xml holds the cases; rostest-*.xml only says whether each test node left such a file
        reports = sorted(program.junit.rglob("rosunit-*.xml"))
        if status != 0 and not reports:
            reports = sorted(program.junit.rglob("rostest-*.xml"))
    else:
        reports = [program.junit] if program.junit.exists() else []
    for report in reports:
        try:
            count_cases(program, report)
        except ElementTree.ParseError as error:
            program.failed += 1
            program.failures.append(f"{report.name}: not readable as JUnit XML ({error})")
    ended = "was ended at its time limit" if status is None else f"ended with status {status}"
    all_skipped = program.kind == "pytest" and status == 5 and program.skipped
    if program.failed or all_skipped:
        return
    if status != 0 or not reports:
        program.failed += 1
        program.failures.append(f"{program.name} {ended} and reported no failed case; see its log")
    elif not program.passed and not program.skipped:
        program.failed += 1
        program.failures.append(f"{program.name} holds no case; write one, or remove the file")


def run(program: Program, log: Path, limit: float) -> None:
    """Runs one program, and ends it at the limit; nothing that it started outlives it."""
    environment = dict(os.environ)
    if program.kind == "rostest":
        environment = run_environment(free_port(), program.junit)
    began = time.monotonic()
    if not Path(shutil.which(program.command[0]) or "").is_file():
        program.failed += 1
        program.failures.append(f"{program.command[0]} does not exist: it was not built; see .coglab/build.log")
        print(f"  {program.package:20s} {program.kind:8s}{program.name:44s} not built  FAILED", flush=True)
        return
    # What a script starts in the background ignores SIGINT, and so would all below it: tests of Ctrl-C would be red.
    command = ["env", "--default-signal=INT,QUIT", *program.command]
    with log.open("w") as output:
        status = process_tree.run(
            command, limit, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, env=environment
        )
    program.seconds = time.monotonic() - began
    count(program, status)
    verdict = "ok" if not program.failed else f"{program.failed} FAILED"
    print(
        f"  {program.package:20s} {program.kind:8s}{program.name:44s}{program.passed:6d} passed "
        f"{program.skipped:3d} skipped {program.seconds:7.1f} s  {verdict}",
        flush=True,
    )


def longest_first(programs: list[Program]) -> list[Program]:
    """In the order in which they begin."""
    return sorted(programs, key=lambda one: FIRST.index(one.name) if one.name in FIRST else len(FIRST))


def log_of(program: Program, results: Path) -> Path:
    """Where the words of a program go."""
    return results / "logs" / f"{program.package}.{program.name}.log"


def report_differences(runs: list[list[Program]], out: Path) -> int:
    """Prints each case that did not end alike in all runs; returns the exit status."""
    ends: dict[tuple[str, str, str], dict[int, str]] = {}  # by case: how it ended, by the number of the run
    logs: dict[tuple[int, str, str], Path] = {}
    for number, programs in enumerate(runs, 1):
        for program in programs:
            logs[number, program.package, program.name] = log_of(program, out / f"run_{number}")
            program.cases.setdefault("the program itself", "failed" if program.failed else "passed")
            for case, end in program.cases.items():
                ends.setdefault((program.package, program.name, case), {})[number] = end
    differ = 0
    for (package, name, case), by_run in sorted(ends.items()):
        found = {by_run.get(number, "missing") for number in range(1, len(runs) + 1)}
        if len(found) == 1:
            continue
        differ += 1
        print(f"DIFFERS {package} {name}: {case}")
        for end in sorted(found):
            numbers = [number for number in range(1, len(runs) + 1) if by_run.get(number, "missing") == end]
            print(f"        {end} in {'run' if len(numbers) == 1 else 'runs'} {', '.join(map(str, numbers))}")
            if end != "passed":
                for number in numbers:
                    print(f"        log: {logs.get((number, package, name), 'none')}")
    print(f"{len(runs)} runs, {differ} differences", flush=True)
    return 1 if differ else 0


def report(programs: list[Program], results: Path) -> int:
    """Prints failures, the time of each package and the closing line; returns the exit status."""
    for program in programs:
        for failure in program.failures:
            print(f"FAILED {program.package} {program.name}: {failure}")
            print(f"       log: {log_of(program, results)}")
    by_package: dict[str, float] = {}
    for program in programs:
        by_package[program.package] = by_package.get(program.package, 0.0) + program.seconds
    print("time per package: " + ", ".join(f"{name} {seconds:.0f} s" for name, seconds in sorted(by_package.items())))
    passed = sum(program.passed for program in programs)
    failed = sum(program.failed for program in programs)
    skipped = sum(program.skipped for program in programs)
    print(f"{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 0 if failed == 0 and passed > 0 else 1


def main(arguments: list[str]) -> int:
    """Runs the tests; exit status 0 only if at least one passed and none failed."""
    top = Path(os.environ["COGLAB_TOP"])
    try:
        options = test_options(top, arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    if options.long:
        os.environ["COGLAB_LONG"] = "1"
    limit = LONG_TIME_LIMIT if options.long else TIME_LIMIT
    out: Path = options.out
    shutil.rmtree(out, ignore_errors=True)
    (out / "logs").mkdir(parents=True)
    if left_out(top):
        print(f"not tested, because this build uses those installed on this machine: {', '.join(left_out(top))}")
    busy = [subprocess.Popen([sys.executable, *BUSY]) for _ in range(2 if options.load else 0)]
    try:
        if options.repeat == 1:
            return run_all(top, out, options.tests, limit)[1]
        runs, status = [], 0
        for number in range(1, options.repeat + 1):
            print(f"run {number} of {options.repeat}", flush=True)
            programs, red = run_all(top, out / f"run_{number}", options.tests, limit)
            runs.append(programs)
            status = max(status, red)
        return max(status, report_differences(runs, out))
    finally:
        for process in busy:
            process.kill()
            process.wait()


def run_all(top: Path, results: Path, wanted: list[Wanted], limit: float) -> tuple[list[Program], int]:
    """Runs these tests once: the programs, and the exit status."""
    (results / "logs").mkdir(parents=True, exist_ok=True)
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    programs = find_programs(top, results, python, wanted)
    start = time.monotonic()

    def run_one(program: Program) -> None:
        run(program, log_of(program, results), limit)

    with ThreadPoolExecutor(max_workers=AT_A_TIME) as pool:
        list(pool.map(run_one, longest_first(programs)))
    print(f"all tests: {time.monotonic() - start:.0f} s; JUnit files and logs: {os.path.relpath(results)}")
    return programs, report(programs, results)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
