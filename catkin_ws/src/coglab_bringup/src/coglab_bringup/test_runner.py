"""./coglab test: finds and runs every test of the workspace and counts each case once, from the JUnit files.

There are three kinds of tests, found by their place in a package:
  gtest    test/ROOM/*.cpp with a TEST in one of them: one binary, devel/lib/PACKAGE/PACKAGE_test_ROOM.
           test/test_THING.cpp: a separate binary, PACKAGE_test_THING. The target `tests` builds them. A missing binary
           is a failure
  pytest   test/test_*.py: one process per package, with a worker that is replaced if it crashes. A file that calls
           rospy.init_node has its own process, because a process can be only one node
  rostest  test/*.test, each with its own ROS master
Packages that the build omitted (./coglab build --upstream-smach) are listed and not tested.
A program or a file without a case is a failure, too.

One program per processor core runs at a time, at least two and at most four. No test may fail because others run beside
it. --repeat N runs everything N times, --load beside two busy processes, and lists each case whose result differs
between the runs. --long also runs the campaigns: tests that read COGLAB_LONG from the environment.
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
from threading import Semaphore

from coglab_bringup import process_tree
from coglab_bringup.arguments import Wanted, binary_of, cases_in, left_out, package_folders, test_files, test_options
from coglab_bringup.run_directory import free_port, run_environment
from coglab_bringup.usage import Refused

AT_A_TIME = max(2, min(4, os.cpu_count() or 2))  # programs that compute, one per core
BESIDE = AT_A_TIME // 2  # rostests beside them: a rostest mostly waits for its nodes
BUSY = ("-c", "import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n  sum(range(100000))")
"""A process that uses one core while its parent lives."""
OWN_NODE = "rospy.init_node("  # in a pytest file: the file needs its own process
REPEATED = "REPEATED "  # begins the line of a rostest that repeats a part because the computer was late
SLOWEST = 10  # programs and files whose time is printed at the end
LAST_LINES = 15  # of the output of a program that failed outside of its cases
TIME_LIMIT = 1800.0  # s per test program
LONG_TIME_LIMIT = 7200.0  # s with --long


@dataclass
class Program:
    """One test program and its results."""

    package: str
    kind: str  # gtest, pytest, rostest
    name: str
    command: list[str]
    junit: Path  # file that it writes; for rostest: folder
    files: list[str] = field(default_factory=list)  # pytest: each file must have a case
    slots: int = 1  # number of the AT_A_TIME slots that it occupies
    seconds: float = 0.0
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    failures: list[str] = field(default_factory=list)
    cases: dict[str, str] = field(default_factory=dict)  # passed, failed or skipped, by name of the case
    repeated: list[str] = field(default_factory=list)  # rostest: parts repeated because the computer was late
    seconds_of: dict[str, float] = field(default_factory=dict)  # pytest: by file


def find_programs(top: Path, results: Path, python: str, wanted: list[Wanted]) -> list[Program]:
    """The requested test programs; if none is named, those of all packages that the build did not omit."""
    folders = package_folders(top / "catkin_ws" / "src")
    programs = []
    by_package: dict[str, list[Wanted]] = {}
    for one in wanted or [Wanted(package) for package in folders if package not in left_out(top)]:
        by_package.setdefault(one.package, []).append(one)
    for package, words in by_package.items():
        files = test_files(folders[package] / "test")
        chosen = {path: {one.case for one in words if one.names(path)} for path in files}
        chosen = {path: {""} if "" in cases else cases for path, cases in chosen.items() if cases}
        library = top / "catkin_ws" / "devel" / "lib" / package
        programs += _gtests(package, library, results, chosen, files)
        programs += _pytests(package, python, results, chosen)
        for path in (path for path in chosen if path.suffix == ".test"):
            xml = results / f"{package}.{path.stem}"
            programs.append(Program(package, "rostest", path.name, ["rostest", str(path)], xml))
    for program in programs:
        if 1 < len(program.files) > sum(len(one.files) or 1 for one in programs) / 2:
            program.slots = 2  # nearly alone: with one worker the other cores would be idle
    return programs


def _gtests(
    package: str, library: Path, results: Path, chosen: dict[Path, set[str]], files: list[Path]
) -> list[Program]:
    """One program per binary with a requested file. It has a filter unless all of its files are requested whole."""
    filters: dict[str, list[str]] = {}
    whole: dict[str, bool] = {}
    for path in (path for path in files if path.suffix == ".cpp"):
        binary, cases = binary_of(package, path), chosen.get(path, set())
        whole[binary] = whole.get(binary, True) and "" in cases
        if cases:
            names = cases_in(path) if "" in cases else [f"*{case}*" for case in sorted(cases)]
            filters.setdefault(binary, []).extend(names)
    programs = []
    for binary, names in filters.items():
        xml = results / f"{package}.{binary}.xml"
        command = [str(library / binary), f"--gtest_output=xml:{xml}"]
        command += [] if whole[binary] else [f"--gtest_filter={':'.join(names)}"]
        programs.append(Program(package, "gtest", binary, command, xml))
    return programs


def _pytests(package: str, python: str, results: Path, chosen: dict[Path, set[str]]) -> list[Program]:
    """One program for all files that can share a process, and one for each other file."""
    shared: list[Path] = []
    groups: list[tuple[str, list[Path]]] = []
    for path in (path for path in chosen if path.suffix == ".py"):
        if OWN_NODE in path.read_text(encoding="utf-8"):
            groups.append((path.name, [path]))
        else:
            shared.append(path)
    if shared:
        groups.insert(0, (shared[0].name if len(shared) == 1 else f"{len(shared)} files", shared))
    programs = []
    for name, paths in groups:
        xml = results / f"{package}.{paths[0].stem if len(paths) == 1 else 'pytest'}.xml"
        command = [python, "-m", "pytest", "-v", "-p", "no:cacheprovider", f"--rootdir={paths[0].parent}"]
        command += [f"--junit-xml={xml}"]
        for path in paths:
            command += [str(path)] if "" in chosen[path] else [f"{path}::{case}" for case in sorted(chosen[path])]
        programs.append(Program(package, "pytest", name, command, xml, [path.name for path in paths]))
    return programs


def count_cases(program: Program, report: Path) -> None:
    """Add the cases of one JUnit file to the program's counts."""
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        name = f"{case.get('classname', '')}.{case.get('name', '')}".removeprefix(".")
        file = f"{name.partition('.')[0]}.py" if program.kind == "pytest" else ""
        if program.cases.get(name) == "failed":
            continue  # pytest-xdist repeats a case that ended its worker
        program.seconds_of[file] = program.seconds_of.get(file, 0.0) + float(case.get("time") or 0.0)
        problem = case.find("failure") if case.find("failure") is not None else case.find("error")
        if problem is not None:
            ended = "failed"
            program.failed += 1
            text = (problem.get("message") or problem.text or "").strip().splitlines()
            program.failures.append(f"{name}: {text[0] if text else 'no message'}")
        elif case.find("skipped") is not None or case.get("status") == "notrun":
            ended = "skipped"
            program.skipped += 1
        else:
            ended = "passed"
            program.passed += 1
        program.cases[name] = ended


def unfinished(log: Path) -> list[str]:
    """Tests that began but did not end in a pytest log. Lines: `file::test`, then `[gw0] [ 5%] PASSED file::test`."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []
    ended = {words[-1] for words in map(str.split, lines) if len(words) > 1}
    return [line.strip() for line in lines if "::" in line and line.strip() == line.split()[0] not in ended]


def node_outputs(program: Program) -> list[str]:
    """What the nodes of a rostest printed. The test node is one of them."""
    return [path.read_text(errors="replace") for path in sorted(program.junit.glob("log/[0-9a-f]*/*-stdout.log"))]


def end_of_output(program: Program, log: Path) -> str:
    """The last lines of a program that failed outside of its cases. rosunit writes a failure of setUpClass only into
    the log of the test node."""
    texts = [text for text in node_outputs(program) if "setUpClass" in text]
    texts += [log.read_text(errors="replace") if log.exists() else ""]
    lines = [line for line in texts[0].splitlines() if line.strip()]
    return "".join(f"\n       {line}" for line in lines[-LAST_LINES:])


def count(program: Program, status: int | None, log: Path) -> None:
    """Read the program's JUnit files. A missing file, or a program that died without a failed case, is one failure."""
    if program.kind == "rostest":
        # rosunit-*.xml contains the cases; rostest-*.xml only records whether each test node wrote such a file
        reports = sorted(program.junit.rglob("rosunit-*.xml"))
        lines = [line for text in node_outputs(program) for line in text.splitlines()]
        program.repeated = [line for line in lines if line.startswith(REPEATED)]
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
            return
    ended = f"ended with status {status}"
    if status is None:
        ended = f"was ended at its time limit (running: {', '.join(unfinished(log)) or 'see its log'})"
    all_skipped = program.kind == "pytest" and status == 5 and program.skipped
    if not program.failed and (not reports or status != 0 and not all_skipped):
        program.failed += 1
        end = end_of_output(program, log)
        program.failures.append(f"{program.name} {ended} and reported no failed case. The end of its output:{end}")
    elif status is not None:
        empty = program.files if program.kind == "pytest" else [] if program.cases else [program.name]
        empty = [name for name in empty if name not in program.seconds_of]
        program.failed += len(empty)
        program.failures += [f"no case of {name} ran; write one, or remove the file" for name in empty]


def run(program: Program, log: Path, limit: float) -> None:
    """Run one program and end it at the time limit. None of its processes survives."""
    environment = dict(os.environ)
    if program.kind == "rostest":
        environment = run_environment(free_port(), program.junit)
    began = time.monotonic()
    if not Path(shutil.which(program.command[0]) or "").is_file():
        program.failed += 1
        program.failures.append(f"{program.command[0]} does not exist: it was not built; see .coglab/build.log")
        print(f"  {program.package:20s} {program.kind:8s}{program.name:44s} not built  FAILED", flush=True)
        return
    # A script's background processes ignore SIGINT, and so would all processes below: tests of Ctrl-C would fail.
    command = ["env", "--default-signal=INT,QUIT", *program.command]
    if len(program.files) > 1:
        command += ["-n", str(program.slots), "--dist", "loadfile"]
    with log.open("w") as output:
        status = process_tree.run(
            command, limit, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, env=environment
        )
    program.seconds = time.monotonic() - began
    count(program, status, log)
    verdict = "ok" if not program.failed else f"{program.failed} FAILED"
    print(
        f"  {program.package:20s} {program.kind:8s}{program.name:44s}{program.passed:6d} passed "
        f"{program.skipped:3d} skipped {program.seconds:7.1f} s  {verdict}",
        flush=True,
    )


def longest_first(programs: list[Program]) -> list[Program]:
    """Programs in their starting order. Short ones are last, so that all processor cores finish at the same time."""
    return sorted(programs, key=lambda one: (-one.slots, one.kind == "gtest", -len(one.files)))


def log_of(program: Program, results: Path) -> Path:
    """Log file of a program's output."""
    return results / "logs" / f"{program.junit.name.removesuffix('.xml')}.log"


def report_differences(runs: list[list[Program]], out: Path) -> int:
    """Print each case whose result differs between the runs. Returns the exit status."""
    ends: dict[tuple[str, str, str], dict[int, str]] = {}  # by case: result by number of the run
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
    """Print failures, the time of each package and the last line. Returns the exit status."""
    for program in programs:
        for failure in program.failures:
            print(f"FAILED {program.package} {program.name}: {failure}")
            print(f"       log: {log_of(program, results)}")
        for line in program.repeated:
            print(f"the computer was late in {program.package} {program.name}: {line}")
    by_package: dict[str, float] = {}
    for program in programs:
        by_package[program.package] = by_package.get(program.package, 0.0) + program.seconds
    times = [
        (seconds, f"{program.package}/{file or program.name}")
        for program in programs
        for file, seconds in (program.seconds_of if len(program.files) > 1 else {"": program.seconds}).items()
    ]
    slowest = sorted(times, reverse=True)[:SLOWEST]
    print("slowest: " + ", ".join(f"{name} {seconds:.0f} s" for seconds, name in slowest))
    print("time per package: " + ", ".join(f"{name} {seconds:.0f} s" for name, seconds in sorted(by_package.items())))
    passed = sum(program.passed for program in programs)
    failed = sum(program.failed for program in programs)
    skipped = sum(program.skipped for program in programs)
    print(f"{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 0 if failed == 0 and passed > 0 else 1


def main(arguments: list[str]) -> int:
    """Run the tests. Exit status 0 only if at least one test passed and none failed."""
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
    """Run these tests once. Returns the programs and the exit status."""
    (results / "logs").mkdir(parents=True, exist_ok=True)
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    programs = find_programs(top, results, python, wanted)
    start = time.monotonic()

    rostests = [one for one in programs if one.kind == "rostest"]
    others = [one for one in programs if one.kind != "rostest"]
    queues = [(longest_first(others), AT_A_TIME), (rostests, BESIDE if others else AT_A_TIME)]
    with ThreadPoolExecutor(max_workers=len(queues)) as pool:
        for one in [pool.submit(run_queue, queue, slots, results, limit) for queue, slots in queues]:
            one.result()
    print(f"all tests: {time.monotonic() - start:.0f} s; JUnit files and logs: {os.path.relpath(results)}")
    return programs, report(programs, results)


def run_queue(programs: list[Program], most: int, results: Path, limit: float) -> None:
    """Run these programs, in this order and at most ``most`` slots at a time."""
    free = Semaphore(most)

    def run_one(program: Program, slots: int) -> None:
        try:
            run(program, log_of(program, results), limit)
        finally:
            free.release(slots)

    with ThreadPoolExecutor(max_workers=most) as pool:
        started = []
        for program in programs:
            slots = min(program.slots, most)
            for _ in range(slots):
                free.acquire()
            started.append(pool.submit(run_one, program, slots))
        for one in started:
            one.result()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
