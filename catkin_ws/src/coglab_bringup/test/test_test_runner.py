"""The runner that counts all other tests must not lie: red, dead, hanging and empty programs are told apart."""

import signal
import sys
import time
from pathlib import Path

import pytest
from coglab_bringup import test_runner
from coglab_bringup.arguments import test_options as options_of_test
from coglab_bringup.test_runner import BESIDE, FIRST, Program, find_programs, in_groups, report, run
from coglab_bringup.usage import Refused

GREEN = (
    '<testsuites><testsuite><testcase classname="a" name="one"/>'
    '<testcase name="two"><skipped/></testcase></testsuite></testsuites>'
)
RED = '<testsuite><testcase name="bad"><failure message="1 is not 2"/></testcase></testsuite>'

SKIPPED = '<testsuite><testcase name="module"><skipped/></testcase></testsuite>'


def program(tmp_path, script: str) -> Program:
    xml = tmp_path / "report.xml"
    return Program("pkg", "pytest", "test_x.py", [sys.executable, "-c", script.replace("XML", repr(str(xml)))], xml)


@pytest.mark.parametrize(
    "script, counts",
    [
        (f"open(XML, 'w').write('''{GREEN}''')", (1, 0, 1)),
        (f"open(XML, 'w').write('''{RED}'''); raise SystemExit(1)", (0, 1, 0)),
        (f"open(XML, 'w').write('''{GREEN}'''); raise SystemExit(1)", (1, 1, 1)),  # died after green cases
        ("raise SystemExit(0)", (0, 1, 0)),  # says it is fine and leaves no report
        ("import os; os.abort()", (0, 1, 0)),
        ("open(XML, 'w').write('<testsuite><testcase')", (0, 1, 0)),
        ("import time; time.sleep(60)", (0, 1, 0)),  # ended at the limit
        ("open(XML, 'w').write('<testsuites></testsuites>')", (0, 1, 0)),  # runs, and holds no case
        ("open(XML, 'w').write('<testsuite/>'); raise SystemExit(5)", (0, 1, 0)),  # a pytest file without a case
        (
            f"open(XML, 'w').write('{SKIPPED}'); raise SystemExit(5)",
            (0, 0, 1),
        ),  # a whole module skipped, with its reason
    ],
)
def test_counts(tmp_path, script, counts, capsys):
    item = program(tmp_path, script)
    run(item, tmp_path / "log", limit=1.0 if "sleep" in script else 60.0)
    assert (item.passed, item.failed, item.skipped) == counts, item.failures
    status = report([item], tmp_path)
    assert status == (0 if counts[1] == 0 and counts[0] > 0 else 1)
    assert capsys.readouterr().out.splitlines()[-1] == "{} passed, {} failed, {} skipped".format(*counts)


def test_a_program_hears_ctrl_c_also_where_the_runner_ignores_it(tmp_path):
    """As it does where a script has started it in the background."""
    heard = "import signal; assert signal.getsignal(signal.SIGINT) != signal.SIG_IGN"
    item = program(tmp_path, f"{heard}; open(XML, 'w').write('''{GREEN}''')")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        run(item, tmp_path / "log", limit=60.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (item.passed, item.failed) == (1, 0), item.failures


def test_a_gtest_that_was_not_built_is_a_failure(tmp_path):
    package = tmp_path / "catkin_ws" / "src" / "pkg"
    (package / "test").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pkg</name></package>")
    (package / "test" / "test_thing.cpp").write_text("")
    (item,) = find_programs(tmp_path, tmp_path, sys.executable, [])
    assert item.name == "pkg_test_thing"
    run(item, tmp_path / "log", limit=5.0)
    assert (item.passed, item.failed, item.skipped) == (0, 1, 0) and "not built" in item.failures[0]


def test_nothing_at_all_is_not_a_success(tmp_path):
    assert report([], tmp_path) == 1


def test_a_package_that_the_build_left_out_is_not_tested(tmp_path):
    for name in ("smach", "brain"):
        package = tmp_path / "catkin_ws" / "src" / name
        (package / "test").mkdir(parents=True)
        (package / "package.xml").write_text(f"<package><name>{name}</name></package>")
        (package / "test" / "test_it.py").write_text("")
    assert len(find_programs(tmp_path, tmp_path, sys.executable, [])) == 2
    assert options_of_test(tmp_path, ["smach"]).packages == ["smach"]
    (tmp_path / "catkin_ws" / "build").mkdir()
    cache = tmp_path / "catkin_ws" / "build" / "CMakeCache.txt"
    cache.write_text("A:STRING=b\nCATKIN_BLACKLIST_PACKAGES:STRING=smach;smach_msgs;smach_ros\nC:BOOL=ON\n")
    (item,) = find_programs(tmp_path, tmp_path, sys.executable, [])
    assert item.package == "brain"
    with pytest.raises(Refused) as refusal:
        options_of_test(tmp_path, ["brain", "smach"])
    assert "this build leaves out smach for the one installed on this machine" in str(refusal.value)
    assert "./coglab build" in str(refusal.value)
    cache.write_text("CATKIN_BLACKLIST_PACKAGES:UNINITIALIZED=\nC:BOOL=ON\n")
    assert len(find_programs(tmp_path, tmp_path, sys.executable, [])) == 2


def package_with(top, *files: tuple[str, str]) -> None:
    """A package with these tests: name and text of each."""
    package = top / "catkin_ws" / "src" / "pkg"
    (package / "test").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pkg</name></package>")
    for name, text in files:
        (package / "test" / name).write_text(text)


def test_a_rostest_runs_alone_unless_its_file_says_that_it_may_have_others_beside_it(tmp_path):
    package_with(
        tmp_path,
        ("test_it.py", ""),
        ("busy.test", "<launch/>"),
        ("resting.test", f"<launch>\n  {BESIDE} it waits. -->\n</launch>"),
    )
    groups = in_groups(find_programs(tmp_path, tmp_path, sys.executable, []))
    assert [[(one.name, one.beside) for one in group] for group in groups] == [
        [("test_it.py", 2)],
        [("resting.test", 2)],
        [("busy.test", 1)],
    ]


def test_who_has_others_beside_it_never_meets_who_runs_alone(tmp_path, monkeypatch):
    resting = f"{BESIDE} it waits. -->"
    package_with(
        tmp_path, *((f"alone_{i}.test", "") for i in range(2)), *((f"resting_{i}.test", resting) for i in range(4))
    )
    ran: dict[str, tuple[float, float]] = {}

    def pretend(program: Program, _log, _limit: float) -> None:
        begin = time.monotonic()
        time.sleep(0.1)
        ran[program.name] = (begin, time.monotonic())
        program.passed = 1

    monkeypatch.setattr(test_runner, "run", pretend)
    monkeypatch.setenv("COGLAB_TOP", str(tmp_path))
    assert test_runner.main(["--out", str(tmp_path / "out")]) == 0
    assert len(ran) == 6
    at_begin = {name: [other for other, (a, b) in ran.items() if a <= begin < b] for name, (begin, _) in ran.items()}
    assert max(len(running) for running in at_begin.values()) == 2, at_begin
    for name in ("alone_0.test", "alone_1.test"):
        begin, end = ran[name]
        assert [other for other, (a, b) in ran.items() if a < end and begin < b] == [name], ran


def test_what_takes_longest_is_there_and_begins_first(tmp_path):
    programs = find_programs(Path(__file__).resolve().parents[4], tmp_path, sys.executable, [])
    names = [[one.name for one in group] for group in in_groups(programs)]
    assert sorted(name for group in names for name in group if name in FIRST) == sorted(FIRST), "each is one program"
    for group in names:
        wanted = [name for name in FIRST if name in group]
        assert group[: len(wanted)] == wanted
