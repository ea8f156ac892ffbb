"""./coglab bench mutants: what it changes, what it leaves alone, that it goes on where it was ended."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from coglab_bringup import mutant_workspace, mutants
from coglab_bringup.arguments import CORES, mutants_options, package_folders
from coglab_bringup.mutant_workspace import update_copy
from coglab_bringup.mutator import changes, code_lines
from coglab_bringup.usage import Refused

TOP = Path(__file__).resolve().parents[4]

CPP = """// if (a < b) return;
#define LIMIT 3
/* a + b
   a - b */
double limit(double a, double b) {
  if (a < b) return 0.5;
  const char* text = "a < b && 7";
  for (int i = 0; i < 10; ++i) a += scale(b, a) * 2.0;
  if (!ready() && a >= 1e-3) return;
  std::vector<double> list;
  continue;
  return a - b;
}
"""

PYTHON = '''"""a < b and 3"""
import os


def limit(a, b):
    """a + b"""
    if a < b and not ready(a, b):  # a < 7
        return "a == b"
    x = 2 * a - 1.5
    return True
'''


def words(text: str, name: str) -> set[tuple[int, str, str]]:
    return {(change.line, change.before, change.after) for change in changes(text, name)}


def test_cpp_is_changed_where_it_is_code():
    assert words(CPP, "limit.cpp") == {
        (2, "3", "4"),
        (6, "<", "<="), (6, "0.5", "1.0"), (6, "return 0.5;", ";"),
        (8, "0", "1"), (8, "<", "<="), (8, "10", "11"), (8, "+=", "-="), (8, "(b, a)", "(a, b)"), (8, "*", "/"),
        (8, "2.0", "4.0"),
        (9, "!", ""), (9, "&&", "||"), (9, ">=", ">"), (9, "1e-3", "0.002"), (9, "return;", ";"),
        (11, "continue;", ";"), (12, "-", "+"),
    }  # fmt: skip


def test_python_is_changed_where_it_is_code():
    assert words(PYTHON, "limit.py") == {
        (7, "<", "<="), (7, "and", "or"), (7, "not ", ""), (7, "(a, b)", "(b, a)"),
        (8, 'return "a == b"', "pass"),
        (9, "2", "3"), (9, "*", "/"), (9, "-", "+"), (9, "1.5", "3.0"),
        (10, "True", "False"), (10, "return True", "pass"),
    }  # fmt: skip


def test_lines_of_code_are_counted_without_comments_and_texts():
    assert code_lines(CPP, "limit.cpp") == [2, 5, 6, 7, 8, 9, 10, 11, 12]
    assert code_lines(PYTHON, "limit.py") == [2, 5, 7, 8, 9, 10]


@pytest.mark.parametrize("package", CORES)
def test_every_change_of_what_ships_fits_its_line(package):
    folder = package_folders(TOP / "catkin_ws" / "src")[package]
    files = mutants.shipped(folder)
    assert files and not [path for path in files if {"test", "bench"} & set(path.relative_to(folder).parts)]
    total = 0
    for path in files:
        text = path.read_text()
        for change in changes(text, path.name):
            old, new = text.splitlines(), change.apply(text).splitlines()
            assert [o for o, n in zip(old, new, strict=True) if o != n] == [old[change.line - 1]]
            total += 1
        if path.suffix == ".py":
            for change in random.Random(1).sample(changes(text, path.name), min(3, len(changes(text, path.name)))):
                compile(change.apply(text), path.name, "exec")
    assert total > 100


def test_who_stands_on_a_package_is_found_by_the_manifests():
    folders = package_folders(TOP / "catkin_ws" / "src")
    on_smach = mutants.standing_on("smach", folders)
    assert on_smach[0] == "smach_ros" or "smach_ros" in on_smach[:3]
    assert "coglab_smach" in on_smach and "coglab_bringup" in on_smach and "ctrl_more" not in on_smach
    assert "coglab_controllers" in mutants.standing_on("ctrl_more", folders)


class FakeWorkspace:
    """A checkout of one package whose tests are red where the file says 'red'."""

    def __init__(self, top: Path):
        self.root, self.digest, self.stale = top / "copy", "one", True
        folder = self.root / "catkin_ws" / "src" / "one"
        (folder / "src").mkdir(parents=True, exist_ok=True)
        (folder / "package.xml").write_text("<package><name>one</name></package>")
        self.file = folder / "src" / "one.cpp"
        self.file.write_text("int f(int a) {\n  if (a < 3) return 1;\n  return a + 4;\n}\nint g() { return 5 * 6; }\n")
        self.builds, self.readied, self.alone = 0, 0, []
        self.seen: list[str] = []

    def digest_of(self, package) -> str:
        return f"{package} of {self.digest}"

    def build(self, alone=None) -> bool:
        self.builds += 1
        self.alone.append(alone)
        self.stale = alone is not None
        return "return a - 4" not in self.file.read_text()  # this one does not compile

    def ready(self, say) -> None:
        self.readied += 1

    def programs(self, packages):
        class Program:
            package, name, kind, seconds = "one", "test_one", "gtest", 1.0

        return [Program()]

    def red(self, program, limit):
        self.seen.append(self.file.read_text())
        return "return 2" in self.file.read_text()


def test_a_campaign_judges_keeps_and_goes_on(tmp_path):
    said = []

    def campaign(workspace):
        return mutants.Campaign(workspace, "one", 5, mutants.Times(workspace), said.append)

    workspace = FakeWorkspace(tmp_path)
    before = workspace.file.read_text()
    first = campaign(workspace)
    first.run(3)
    assert workspace.file.read_text() == before and len(first.mutants()) == 3
    assert not [line for line in said if "before" in line]
    again = FakeWorkspace(tmp_path)
    second = campaign(again)
    second.run(3)
    assert said[-1] == "one: 3 were judged before"
    assert second.mutants() == first.mutants() and again.builds == again.readied == 0
    second.run(6)
    assert second.mutants()[:3] == first.mutants() and len(second.mutants()) == 6 and again.readied == 1
    whole = FakeWorkspace(tmp_path / "other")
    third = campaign(whole)
    third.run(6)
    assert [(m.line, m.after, m.verdict) for m in third.mutants()] == [
        (m.line, m.after, m.verdict) for m in second.mutants()
    ]
    assert {m.verdict for m in third.mutants()} <= {"killed", "survived"}
    for mutant in third.mutants():
        assert (mutant.verdict == "killed") == (mutant.before == "1" and mutant.by == "one/test_one")
    changed = FakeWorkspace(tmp_path)
    changed.digest = "other sources"
    assert campaign(changed).drawn == []


def test_no_change_is_drawn_twice_and_a_package_has_an_end(tmp_path):
    workspace, said = FakeWorkspace(tmp_path), []
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace), said.append)
    campaign.run(50)
    found = [(m.line, m.before, m.after) for m in campaign.mutants()]
    offered = changes(workspace.file.read_text(), "one.cpp")
    assert len(set(found)) == len(found) == len(offered) - 1, "all but the one that does not compile"
    assert said[-1] == f"one: there are no more than {len(found)} changes"
    workspace.file.write_text("\n")
    with pytest.raises(Refused, match="no line of C"):
        mutants.Campaign(workspace, "one", 6, mutants.Times(workspace)).run(1)


def test_judged_by_its_own_tests_a_package_is_built_alone(tmp_path):
    workspace = FakeWorkspace(tmp_path)
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace), own=True)
    campaign.run(2)
    assert set(workspace.alone) == {tmp_path / "copy" / "catkin_ws" / "src" / "one"} and workspace.stale
    workspace = FakeWorkspace(tmp_path / "whole")
    mutants.Campaign(workspace, "one", 5, mutants.Times(workspace)).run(2)
    assert set(workspace.alone) == {None}


def test_what_is_built_alone_are_the_programs_of_the_folder(tmp_path, monkeypatch):
    (tmp_path / "catkin_ws" / "src" / "group" / "one").mkdir(parents=True)
    workspace = mutant_workspace.Workspace(tmp_path)
    build = workspace.root / "catkin_ws" / "build"
    for name in ("group/one/CMakeFiles/one.dir", "group/one/CMakeFiles/one_test_one.dir", "two/CMakeFiles/two.dir"):
        (build / name).mkdir(parents=True)
        (build / name / "link.txt").write_text("")
    (build / "group/one/CMakeFiles/run_tests.dir").mkdir()
    ran = []
    monkeypatch.setattr(
        mutant_workspace.process_tree, "run", lambda command, limit, **options: ran.append(command) or 0
    )
    assert workspace.build() and not workspace.stale
    assert workspace.build(workspace.root / "catkin_ws" / "src" / "group" / "one") and workspace.stale
    assert ran[0][1:] == ["build", "tests"]
    assert ran[1][:3] == ["make", "-C", str(build)] and ran[1][4:] == ["one", "one_test_one"]


@pytest.mark.parametrize("kind", ["gtest", "pytest", "rostest"])
def test_a_test_that_is_red_once_kills_nothing(tmp_path, kind):
    workspace = FakeWorkspace(tmp_path)

    class Program:
        package, name, seconds = "one", "test_one", 1.0

    Program.kind = kind
    workspace.programs = lambda packages: [Program()]
    reds = iter([True, False] * 4)
    workspace.red = lambda program, limit: next(reds)
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace))
    campaign.run(4)
    assert [m.verdict for m in campaign.mutants()] == ["survived"] * 4


def test_form_and_pages_do_not_judge(tmp_path, monkeypatch):
    sources = TOP / "catkin_ws" / "src"
    names = {path.name for path in sources.glob("*/test/test_*.py")}
    assert names >= mutant_workspace.NO_JUDGES >= {"test_house.py", "test_pages.py", "test_figures.py", "test_types.py"}
    workspace = mutant_workspace.Workspace(tmp_path)
    workspace.root = TOP
    found = {program.name for program in workspace.programs(["coglab_bringup", "coglab_sim"])}
    assert not found & mutant_workspace.NO_JUDGES and {"test_mutants.py", "test_tracker.py"} <= found


def test_what_judges_a_package_alone_does_not_change_with_others(tmp_path):
    def write(place: str, text: str) -> None:
        path = tmp_path / "catkin_ws" / "src" / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    for name, uses in (("one", "two"), ("two", "three"), ("three", "outside"), ("other", "one")):
        manifest = f"<package><name>{name}</name><exec_depend>{uses}</exec_depend></package>"
        write(f"{name}/package.xml", manifest)
        write(f"{name}/code.py", "a = 1\n")
        write(f"{name}/test/test_code.py", "a = 1\n")
        write(f"{name}/README.md", "words\n")
    before = mutant_workspace.digest_of(tmp_path, "one")
    for place in (
        "other/code.py",
        "other/test/test_code.py",
        "two/test/test_code.py",
        "three/README.md",
        "one/README.md",
    ):
        write(place, "a = 2\n")
        assert mutant_workspace.digest_of(tmp_path, "one") == before, place
    for place in ("one/code.py", "one/test/test_code.py", "two/code.py", "three/code.py"):
        write(place, "a = 2\n")
        after = mutant_workspace.digest_of(tmp_path, "one")
        assert after != before, place
        before = after


def test_judged_alone_what_was_judged_stays_where_others_change(tmp_path):
    def campaign(workspace):
        return mutants.Campaign(workspace, "one", 5, mutants.Times(workspace, "one"), own=True)

    workspace = FakeWorkspace(tmp_path)
    workspace.digest_of = lambda package: "its own"
    campaign(workspace).run(2)
    workspace.digest = "others have changed"
    assert len(campaign(workspace).drawn) == 2 and mutants.Times(workspace, "one").knows("one/test_one")
    assert not mutants.Times(workspace).knows("one/test_one")
    workspace.digest_of = lambda package: "changed"
    assert campaign(workspace).drawn == [] and not mutants.Times(workspace, "one").knows("one/test_one")


@pytest.mark.parametrize("own", [[], ["--own"]])
def test_only_the_seed_of_the_commit_and_its_sources_are_kept_for_the_page(tmp_path, monkeypatch, own):
    kept: list[dict] = []
    monkeypatch.setattr(mutants.figures, "record", lambda top, name, rows, long, before: kept.append(before) or True)
    committed, changed = {"commit": "abc", "sources": "digest"}, {"commit": "abc with changes", "sources": ""}
    (source := tmp_path / "catkin_ws" / "src" / CORES[0]).mkdir(parents=True)
    (source / "package.xml").write_text(f"<package><name>{CORES[0]}</name></package>")
    for words, before in (([CORES[0]], committed), (["--seed", "77"], committed), ([], changed)):
        assert not mutants.recorded(tmp_path, mutants_options(tmp_path, [*words, *own]), {}, [], before) and not kept
    moved = mutants.recorded(tmp_path, mutants_options(tmp_path, own), {CORES[0]: 5}, [], committed)
    assert not moved and not kept, "not the seed of a last commit"
    assert mutants.recorded(tmp_path, mutants_options(tmp_path, own), {}, [], committed) and kept == [committed]


def test_a_test_that_is_red_anyway_is_left_out_and_said(tmp_path):
    workspace = FakeWorkspace(tmp_path)
    workspace.red = lambda program, limit: True
    said: list[str] = []
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace), said.append)
    campaign.run(4)
    assert {m.verdict for m in campaign.mutants()} == {"survived"}
    assert [line for line in said if "red on the unchanged sources" in line] == [said[0]]
    assert mutants.Times(workspace).of("one/test_one") is None


def test_a_test_never_seen_green_is_run_on_the_unchanged_sources_before_it_is_believed(tmp_path):
    workspace = FakeWorkspace(tmp_path)
    before = workspace.file.read_text()
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace))
    campaign.run(6)
    first = next(m for m in campaign.mutants() if m.verdict == "killed")
    assert first.by == "one/test_one"
    if campaign.mutants()[0] is first:
        assert workspace.seen[1] == before


def test_an_end_in_the_middle_leaves_the_file_as_it_was(tmp_path):
    workspace = FakeWorkspace(tmp_path)
    before = workspace.file.read_text()

    def ended(program, limit):
        raise KeyboardInterrupt

    workspace.red = ended
    campaign = mutants.Campaign(workspace, "one", 5, mutants.Times(workspace))
    with pytest.raises(KeyboardInterrupt):
        campaign.run(3)
    assert workspace.file.read_text() == before and workspace.stale


def test_the_copy_follows_the_checkout_and_nothing_flows_back(tmp_path):
    top, copy = tmp_path / "top", tmp_path / "top" / ".coglab" / "copy"
    source = top / "catkin_ws" / "src"
    source.mkdir(parents=True)
    (top / "out").mkdir()
    (source / "a.py").write_text("a = 1\n")
    (source / "b.py").write_text("b = 1\n")
    (top / "out" / "c.py").write_text("c = 1\n")
    digest = update_copy(top, copy)
    (copy / "catkin_ws" / "src" / "a.py").write_text("a = 2\n")  # a run that was killed in the middle
    (copy / "catkin_ws" / "src" / "stray.py").write_text("")
    (copy / ".coglab").mkdir()
    (copy / ".coglab" / "built.all").write_text("")
    kept = (copy / "catkin_ws" / "src" / "b.py").stat().st_mtime_ns
    assert update_copy(top, copy) == digest
    assert (copy / "catkin_ws" / "src" / "a.py").read_text() == (source / "a.py").read_text() == "a = 1\n"
    assert not (copy / "catkin_ws" / "src" / "stray.py").exists() and not (copy / "out").exists()
    assert (copy / ".coglab" / "built.all").exists() and (
        copy / "catkin_ws" / "src" / "b.py"
    ).stat().st_mtime_ns == kept
    (source / "b.py").write_text("b = 2\n")
    assert update_copy(top, copy) != digest


def test_a_changed_word_in_a_document_throws_no_campaign_away(tmp_path):
    top, copy = tmp_path / "top", tmp_path / "copy"
    for name in ("catkin_ws/src/p/README.md", "catkin_ws/src/p/test/test_a.py", "docs/a.json", "README.md", "coglab"):
        (top / name).parent.mkdir(parents=True, exist_ok=True)
        (top / name).write_text("one\n")
    digest = update_copy(top, copy)
    for name in ("catkin_ws/src/p/README.md", "docs/a.json", "README.md"):
        (top / name).write_text("two\n")
        assert update_copy(top, copy) == digest and (copy / name).read_text() == "two\n"
    for name in ("coglab", "catkin_ws/src/p/test/test_a.py"):
        (top / name).write_text("two\n")
        digest, before = update_copy(top, copy), digest
        assert digest != before, name


def test_options():
    assert mutants_options(TOP, ["ih2_hand", "--seed", "9"]).seed == 9
    options = mutants_options(TOP, [])
    assert options.packages == [] and options.count == 12 and options.seed is None, "each package has its own"
    assert mutants_options(TOP, ["--count", "3"]).count == 3
    for bad in (["nobody"], ["--seed", "-1"], ["--count", "0"], ["--seed"]):
        with pytest.raises(Refused):
            mutants_options(TOP, bad)
