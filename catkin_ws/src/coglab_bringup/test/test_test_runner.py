"""The test runner must count correctly: failed, dead, hanging and empty programs are distinguished."""

import sys

import pytest
from coglab_bringup import arguments
from coglab_bringup.arguments import test_options as options_of_test
from coglab_bringup.test_runner import Program, find_programs, report, report_differences, run, unfinished
from coglab_bringup.usage import Refused

LIMIT = 600.0  # s, for programs that end by themselves, on a busy computer too

GREEN = (
    '<testsuites><testsuite><testcase classname="test_x" name="one"/>'
    '<testcase classname="test_x.Group" name="two"><skipped/></testcase></testsuite></testsuites>'
)
RED = '<testsuite><testcase classname="test_x" name="bad"><failure message="1 is not 2"/></testcase></testsuite>'

SKIPPED = '<testsuite><testcase classname="" name="test_x"><skipped/></testcase></testsuite>'


def program(tmp_path, script: str) -> Program:
    xml = tmp_path / "report.xml"
    command = [sys.executable, "-c", script.replace("XML", repr(str(xml)))]
    return Program("pkg", "pytest", "test_x.py", command, xml, ["test_x.py"])


@pytest.mark.parametrize(
    "script, counts",
    [
        (f"open(XML, 'w').write('''{GREEN}''')", (1, 0, 1)),
        (f"open(XML, 'w').write('''{RED}'''); raise SystemExit(1)", (0, 1, 0)),
        (f"open(XML, 'w').write('''{GREEN}'''); raise SystemExit(1)", (1, 1, 1)),  # died after green cases
        ("raise SystemExit(0)", (0, 1, 0)),  # succeeds without a report
        ("import os; os.abort()", (0, 1, 0)),
        ("open(XML, 'w').write('<testsuite><testcase')", (0, 1, 0)),
        ("import time; time.sleep(60)", (0, 1, 0)),  # ended at the limit
        ("open(XML, 'w').write('<testsuites></testsuites>')", (0, 1, 0)),  # runs without a case
        ("open(XML, 'w').write('<testsuite/>'); raise SystemExit(5)", (0, 1, 0)),  # a pytest file without a case
        (
            f"open(XML, 'w').write('{SKIPPED}'); raise SystemExit(5)",
            (0, 0, 1),
        ),  # a whole module skipped, with its reason
    ],
)
def test_counts(tmp_path, script, counts, capsys):
    item = program(tmp_path, script)
    run(item, tmp_path / "log", limit=1.0 if "sleep" in script else LIMIT)
    assert (item.passed, item.failed, item.skipped) == counts, item.failures
    status = report([item], tmp_path)
    assert status == (0 if counts[1] == 0 and counts[0] > 0 else 1)
    assert capsys.readouterr().out.splitlines()[-1] == "{} passed, {} failed, {} skipped".format(*counts)


def test_a_failure_outside_of_every_case_shows_its_reason(tmp_path):
    """rosunit reports a failure of setUpClass without a case; its reason stands only in the log of the test node."""
    script = """
from pathlib import Path
log, reports = Path(XML, 'log', '1'), Path(XML, 'test_results', 'pkg')
log.mkdir(parents=True)
reports.mkdir(parents=True)
(reports / 'rosunit-arm.xml').write_text('<testsuite errors="1" tests="0"/>')
(log / 'arm-4-stdout.log').write_text('ERRORS: 1 [setUpClass\\nAssertionError: not within 60 s: its end')
raise SystemExit(2)
"""
    item = program(tmp_path, script)
    item.kind, item.name, item.files = "rostest", "arm.test", []
    run(item, tmp_path / "log", limit=LIMIT)
    assert (item.passed, item.failed, item.skipped) == (0, 1, 0)
    assert "not within 60 s: its end" in item.failures[0]


def test_a_part_that_was_repeated_for_a_late_computer_is_listed(tmp_path, capsys):
    script = f"""
from pathlib import Path
log, reports = Path(XML, 'log', '1'), Path(XML, 'test_results', 'pkg')
log.mkdir(parents=True)
reports.mkdir(parents=True)
(reports / 'rosunit-arm.xml').write_text('''{GREEN}''')
(log / 'arm-4-stdout.log').write_text('begins\\nREPEATED reach: no goal\\n')
"""
    item = program(tmp_path, script)
    item.kind, item.name, item.files = "rostest", "arm.test", []
    run(item, tmp_path / "log", limit=LIMIT)
    assert report([item], tmp_path) == 0
    assert "REPEATED reach: no goal" in capsys.readouterr().out


def test_a_gtest_that_was_not_built_is_a_failure(tmp_path):
    package = tmp_path / "catkin_ws" / "src" / "pkg"
    (package / "test").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pkg</name></package>")
    (package / "test" / "test_thing.cpp").write_text("")
    (item,) = find_programs(tmp_path, tmp_path, sys.executable, [])
    assert item.name == "pkg_test_thing"
    run(item, tmp_path / "log", limit=LIMIT)
    assert (item.passed, item.failed, item.skipped) == (0, 1, 0) and "not built" in item.failures[0]


def test_a_package_that_the_build_left_out_is_not_tested(tmp_path):
    for name in ("smach", "brain"):
        package = tmp_path / "catkin_ws" / "src" / name
        (package / "test").mkdir(parents=True)
        (package / "package.xml").write_text(f"<package><name>{name}</name></package>")
        (package / "test" / "test_it.py").write_text("")
    assert len(find_programs(tmp_path, tmp_path, sys.executable, [])) == 2
    assert [one.package for one in options_of_test(tmp_path, ["smach"]).tests] == ["smach"]
    (tmp_path / "catkin_ws" / "build").mkdir()
    cache = tmp_path / "catkin_ws" / "build" / "CMakeCache.txt"
    cache.write_text("A:STRING=b\nCATKIN_BLACKLIST_PACKAGES:STRING=smach;smach_msgs;smach_ros\nC:BOOL=ON\n")
    (item,) = find_programs(tmp_path, tmp_path, sys.executable, [])
    assert item.package == "brain"
    with pytest.raises(Refused) as refusal:
        options_of_test(tmp_path, ["brain", "smach"])
    assert "smach" in str(refusal.value)
    assert "./coglab build" in str(refusal.value)
    cache.write_text("CATKIN_BLACKLIST_PACKAGES:UNINITIALIZED=\nC:BOOL=ON\n")
    assert len(find_programs(tmp_path, tmp_path, sys.executable, [])) == 2


def package_with(top, *files: tuple[str, str]) -> None:
    """A package with these tests: name and text of each."""
    package = top / "catkin_ws" / "src" / "pkg"
    (package / "test").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pkg</name></package>")
    for name, text in files:
        (package / "test" / name).parent.mkdir(exist_ok=True)
        (package / "test" / name).write_text(text)


def test_a_word_names_a_package_a_file_or_a_case(tmp_path):
    package_with(tmp_path, ("test_a.py", ""), ("test_b.cpp", ""), ("c.test", "<launch/>"))

    def chosen(*words):
        wanted = options_of_test(tmp_path, list(words)).tests
        return {one.name: one.command[-1] for one in find_programs(tmp_path, tmp_path, sys.executable, wanted)}

    assert set(chosen("pkg")) == {"test_a.py", "pkg_test_b", "c.test"}
    assert set(chosen("pkg/c.test")) == {"c.test"}
    assert chosen("pkg/test_a.py::test_one")["test_a.py"].endswith("test_a.py::test_one")
    assert chosen("pkg/test_a.py::test_one", "pkg/test_a.py")["test_a.py"].endswith("test_a.py")
    two = chosen("pkg/test_b.cpp::Thing.one", "pkg/test_b.cpp::Thing.two")
    assert two == {"pkg_test_b": "--gtest_filter=*Thing.one*:*Thing.two*"}
    for words, names in ((["pkg/d.test"], "c.test, test_a.py"), (["pkg/c.test::x"], "c.test"), (["other"], "pkg")):
        with pytest.raises(Refused) as refusal:
            options_of_test(tmp_path, words)
        assert names in str(refusal.value)


def test_pytests_of_a_package_share_a_process_unless_they_are_a_node(tmp_path):
    cases = "def test_good(): pass\n\ndef test_bad():\n    assert not 'right'\n"
    dies = "import os\n\ndef test_dies():\n    os.abort()\n"
    package_with(
        tmp_path,
        *(("test_a.py", cases), ("test_b.py", ""), ("test_c.py", dies)),
        ("test_node.py", "rospy.init_" + "node('x')"),
    )
    first, node = find_programs(tmp_path, tmp_path, sys.executable, [])
    assert (first.files, node.files) == (["test_a.py", "test_b.py", "test_c.py"], ["test_node.py"])
    run(first, tmp_path / "log", limit=LIMIT)
    assert (first.passed, first.failed, first.skipped) == (1, 3, 0), first.failures
    told = "\n".join(first.failures)
    assert "test_a.test_bad: " in told and "test_b.py" in told
    assert "test_c.test_dies: " in told and "crashed" in told


def test_a_hanging_test_is_named(tmp_path):
    log = tmp_path / "log"
    log.write_text("header\ntest_a.py::test_x \n[gw0] [ 50%] PASSED test_a.py::test_x \ntest_a.py::test_y \n")
    assert unfinished(log) == ["test_a.py::test_y"]


def test_repeated_runs_are_compared_case_by_case(tmp_path, capsys):
    def one_run(**cases: str) -> list[Program]:
        made = program(tmp_path, "")
        made.cases, made.failed = cases, list(cases.values()).count("failed")
        return [made]

    def compared(*runs: list[Program]) -> tuple[int, str]:
        return report_differences(list(runs), tmp_path), capsys.readouterr().out

    for end in ("passed", "failed", "skipped"):
        assert compared(one_run(a=end), one_run(a=end))[0] == 0
    status, text = compared(one_run(a="passed", b="passed"), one_run(a="passed", b="failed"), one_run(a="passed"))
    assert status == 1 and "test_x.py: b\n" in text and "test_x.py: a\n" not in text
    for part in ("passed in run 1\n", "failed in run 2\n", "missing in run 3\n", "run_2"):
        assert part in text


def test_a_named_test_builds_its_targets(tmp_path):
    package_with(tmp_path, ("test_a.py", "import needed"), ("test_b.cpp", ""))
    for name in ("needed", "other"):
        (tmp_path / "catkin_ws" / "src" / name).mkdir()
        (tmp_path / "catkin_ws" / "src" / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
    rules = tmp_path / "catkin_ws" / "build" / "CMakeFiles" / "Makefile2"
    rules.parent.mkdir(parents=True)
    rules.write_text(
        "".join(
            f"CMakeFiles/tests.dir/all: {name}/CMakeFiles/{name}_test_{thing}.dir/all\n"
            for name, thing in (("pkg", "b"), ("other", "x"))
        )
    )
    wanted = options_of_test(tmp_path, ["pkg"]).tests
    assert arguments.test_targets(tmp_path, wanted) == ["needed/all", "pkg/CMakeFiles/pkg_test_b.dir/all", "pkg/all"]
    wanted = options_of_test(tmp_path, ["pkg/test_b.cpp::x"]).tests
    assert arguments.test_targets(tmp_path, wanted) == ["pkg/CMakeFiles/pkg_test_b.dir/all"]
