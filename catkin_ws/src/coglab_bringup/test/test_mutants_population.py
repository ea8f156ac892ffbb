"""./coglab bench mutants draws from all code that the packages with a core held when the figure was asked for, wherever
it lies now, and each package that it draws from has tests of its own that judge."""

from __future__ import annotations

from pathlib import Path

import pytest
from coglab_bringup import mutant_workspace, mutants
from coglab_bringup.arguments import CORES, mutants_options, package_folders
from coglab_bringup.commit import git
from coglab_bringup.mutator import changes, code_lines

TOP = Path(__file__).resolve().parents[4]
SOURCES = "catkin_ws/src"
ASKED = "5828bb3"
"""the commit of which the figure was asked for"""
THEN = ("lwr_fri_bridge", "coglab_controllers", "ctrl_more", "ih2_hand", "executive_smach/smach", "coglab_smach",
        "coglab_sim")  # fmt: skip
"""folders of the seven packages in it"""
LONG_LINE = 40  # letters: a line so long is hardly written twice
FEW = 5
"""so many of such lines are the same by chance, or by habit"""


def lines_of(text: str) -> set[str]:
    """What is long enough to be told from any other, without includes and imports."""
    lines = {line.strip() for line in text.splitlines()}
    return {x for x in lines if len(x) >= LONG_LINE and not x.startswith(("#", "//", "import ", "from ", '"""', "*"))}


def test_what_the_packages_with_a_core_held_is_drawn_wherever_it_lies():
    names = git(TOP, "ls-tree", "-r", "--name-only", ASKED, "--", SOURCES).splitlines()
    if not names:
        pytest.skip(f"the history of this checkout does not reach back to {ASKED}")
    then: dict[bool, set[str]] = {True: set(), False: set()}  # lines of the seven, of others
    for name in names:
        if name.endswith((".py", ".cpp", ".hpp")):
            seven = any(name.startswith(f"{SOURCES}/{folder}/") for folder in THEN)
            shipped = not {"test", "bench"} & set(Path(name).parts)
            then[seven and shipped] |= lines_of(git(TOP, "show", f"{ASKED}:{name}"))
    assert len(then[True]) > 5000
    moved: dict[str, set[str]] = {}
    for package, folder in package_folders(TOP / SOURCES).items():
        for path in mutants.shipped(folder):
            text = path.read_text(encoding="utf-8")
            code = "\n".join(text.splitlines()[number - 1] for number in code_lines(text, path.name))
            moved.setdefault(package, set()).update(lines_of(code) & then[True] - then[False])
    outside = {package: sorted(lines) for package, lines in moved.items() if package not in CORES}
    assert not {package: lines for package, lines in outside.items() if len(lines) > FEW}
    assert all(len(moved[package]) > FEW for package in CORES), "nothing is drawn that was not asked for"


@pytest.mark.parametrize("package", CORES)
def test_each_package_has_more_changes_than_are_drawn_and_tests_of_its_own_that_judge(package, tmp_path):
    files = mutants.shipped(package_folders(TOP / SOURCES)[package])
    lines = {(path, change.line) for path in files for change in changes(path.read_text(encoding="utf-8"), path.name)}
    assert len(lines) >= 5 * 12, "or most of what there is is drawn, and a figure of it says little of what is written"
    workspace = mutant_workspace.Workspace(tmp_path)
    workspace.root = TOP
    programs = workspace.programs([package])
    assert len(programs) >= 2 and {program.package for program in programs} == {package}
    compiled = any(path.suffix in (".cpp", ".hpp") for path in files)
    assert any(program.kind == "gtest" for program in programs) == compiled


def test_every_package_is_drawn_from_where_none_is_named(capsys):
    assert mutants_options(TOP, []).packages == [] and mutants_options(TOP, list(CORES)).packages == list(CORES)
    with pytest.raises(SystemExit):
        mutants_options(TOP, ["--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert all(package in said for package in CORES)
