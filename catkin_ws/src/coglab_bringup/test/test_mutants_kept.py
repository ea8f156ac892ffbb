"""docs/mutants.json: what `./coglab bench mutants --own` has judged grows over days and machines, and none chooses."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from coglab_bringup import figures, mutant_workspace, mutants, mutants_kept
from coglab_bringup.commit import commit_seed, folder_seed, last_commit
from coglab_bringup.mutant import EQUIVALENT
from coglab_bringup.mutants_kept import further

CODE = "int f(int a) {\n  if (a < 3) return 1;\n  return a + 4;\n}\nint g() { return 5 * 6; }\nint h() { return 7; }\n"


def git(top: Path, *words: str) -> str:
    command = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(top), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout.strip()


def commit(top: Path, place: str, text: str) -> str:
    """Writes one file and commits all; the hash."""
    (top / place).parent.mkdir(parents=True, exist_ok=True)
    (top / place).write_text(text)
    git(top, "add", "-A")
    git(top, "commit", "-q", "-m", place)
    return git(top, "rev-parse", "HEAD")


def folder(top: Path, package: str) -> Path:
    return top / "catkin_ws" / "src" / package


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout whose cores are `one`, which uses `two`, and `two`; each has a last commit of its own."""
    top = tmp_path / "first"
    top.mkdir()
    git(top, "init", "-q")
    (top / ".gitignore").write_text("/.coglab/\n")
    (top / "docs").mkdir()
    (top / EQUIVALENT).write_text("[]\n")
    (top / "README.md").write_text(f"{figures.BEGIN}\n{figures.END}\n")
    commit(top, "coglab", "")
    for name, uses in (("two", ""), ("one", "<depend>two</depend>")):
        folder(top, name).mkdir(parents=True)
        (folder(top, name) / "package.xml").write_text(f"<package><name>{name}</name>{uses}</package>")
        commit(top, f"catkin_ws/src/{name}/src/{name}.cpp", CODE)
    monkeypatch.setattr(mutants, "CORES", ("one", "two"))
    return top


class Built:
    """What a Workspace was asked for, in place of builds and tests that would take minutes."""

    def __init__(self, monkeypatch):
        self.whole, self.judged = 0, 0
        self.reds = ("return 2", "a - 4", "a <= 3")
        workspace = mutant_workspace.Workspace
        monkeypatch.setattr(workspace, "build", lambda workspace, alone=None: self.build(workspace, alone))
        monkeypatch.setattr(workspace, "enter", lambda workspace: None)
        monkeypatch.setattr(workspace, "programs", lambda workspace, judges: [self.program(judges[0])])
        monkeypatch.setattr(workspace, "red", lambda workspace, program, limit: self.red(workspace, program))

    def build(self, workspace, alone) -> bool:
        self.whole += alone is None
        workspace.stale = alone is not None
        return True

    @staticmethod
    def program(of: str):
        class Program:
            package, name, kind, seconds = of, "test", "gtest", 1.0

        return Program()

    def red(self, workspace, program) -> bool:
        self.judged += 1
        return any(word in (folder(workspace.root, program.package) / "src" / f"{program.package}.cpp").read_text()
                   for word in self.reds)  # fmt: skip


@pytest.fixture
def built(monkeypatch):
    return Built(monkeypatch)


def run(top: Path, monkeypatch, *words: str) -> int:
    monkeypatch.setenv("COGLAB_TOP", str(top))
    return mutants.main([*words, "--count", "3"])


def kept(top: Path) -> dict:
    return json.loads((top / mutants_kept.KEPT).read_text())


def state_of(top: Path, package: str, seed: int) -> Path:
    return top / ".coglab" / "mutants" / f"{package}.{seed}.own.json"


def another_machine(top: Path) -> Path:
    """A clone, which has what is committed and nothing else."""
    git(top, "add", "-A")
    git(top, "commit", "-q", "--allow-empty", "-m", "report")
    other = top.parent / "other"
    git(top, "clone", "-q", str(top), str(other))
    return other


def test_the_seed_of_a_package_is_that_of_the_last_commit_that_touched_its_folder(checkout):
    one, two = folder(checkout, "one"), folder(checkout, "two")
    of_one, of_two = folder_seed(checkout, one), folder_seed(checkout, two)
    assert of_one == int(git(checkout, "log", "-1", "--format=%H", "--", str(one))[:7], 16) != of_two
    commit(checkout, "docs/page.md", "words")
    assert (folder_seed(checkout, one), folder_seed(checkout, two)) == (of_one, of_two)
    head = commit(checkout, "catkin_ws/src/one/README.md", "words")
    assert last_commit(checkout, one) == head and folder_seed(checkout, one) == int(head[:7], 16)
    assert folder_seed(checkout, two) == of_two


def test_where_the_last_commit_of_a_folder_is_not_known_the_seed_is_that_of_the_checkout(checkout, monkeypatch):
    assert folder_seed(checkout, checkout / "new") == commit_seed(checkout)
    shallow = checkout.parent / "shallow"
    git(checkout, "clone", "-q", "--depth", "1", f"file://{checkout}", str(shallow))
    two = folder(shallow, "two")
    assert last_commit(shallow, two) == "", "its history ends before the commit that would be found"
    assert folder_seed(shallow, two) == commit_seed(shallow) == commit_seed(checkout)
    monkeypatch.setenv("PATH", str(checkout.parent))  # no git
    assert last_commit(checkout, two) == "" and folder_seed(checkout, folder(checkout, "two")) == commit_seed(checkout)
    shutil.rmtree(checkout / ".git")
    assert folder_seed(checkout, folder(checkout, "two")) == 1


def test_each_package_is_drawn_with_its_own_seed_and_the_rows_say_which(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    seeds = {name: folder_seed(checkout, folder(checkout, name)) for name in ("one", "two")}
    assert all(state_of(checkout, name, seed).is_file() for name, seed in seeds.items())
    figure = [row["figure"] for row in figures.measured(checkout, "mutants")["rows"]]
    assert f"one, seed {seeds['one']}," in figure[0] and f"two, seed {seeds['two']}," in figure[1]
    assert "all, seeds of the packages' last commits, of 6" in figure[2]


def test_a_seed_or_packages_given_by_hand_are_only_printed(checkout, built, monkeypatch, capsys):
    own = folder_seed(checkout, folder(checkout, "two"))
    for words in (["--seed", "5"], ["two"], ["two", "--seed", str(own)], ["--seed", str(own)]):
        run(checkout, monkeypatch, "--own", *words)
        assert "only printed" in capsys.readouterr().err and figures.measured(checkout, "mutants") is None
    assert state_of(checkout, "one", 5).is_file() and state_of(checkout, "two", 5).is_file()
    figures.write_report(checkout)
    assert set(kept(checkout)) == {"two"} and kept(checkout)["two"]["seed"] == own, "no other seed is kept"


def test_a_commit_elsewhere_throws_nothing_away(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    judged = built.judged
    commit(checkout, "catkin_ws/src/one/test/test_one.cpp", "int a = 1;\n")
    run(checkout, monkeypatch, "two", "--own")
    assert built.judged == judged
    run(checkout, monkeypatch, "one", "--own")
    assert built.judged > judged, "its seed and its sources are others now"


def test_the_report_keeps_what_was_judged_of_the_sources_as_they_are(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    figures.write_report(checkout)
    entries = kept(checkout)
    assert set(entries) == {"one", "two"}
    for name, entry in entries.items():
        state = json.loads(state_of(checkout, name, entry["seed"]).read_text())
        assert entry["drawn"] == state["drawn"] and len(entry["drawn"]) == 3
        assert entry["digest"] == state["digest"] == mutant_workspace.digest_of(checkout, name)
        assert entry["machine"] == figures.machine() and len(entry["date"]) == len("2000-01-01")
    shutil.rmtree(checkout / ".coglab")
    figures.write_report(checkout)
    assert kept(checkout) == entries, "kept where nothing was judged"
    commit(checkout, "catkin_ws/src/two/README.md", "words")
    figures.write_report(checkout)
    assert kept(checkout) == {"one": entries["one"]}, "another seed"
    commit(checkout, "catkin_ws/src/two/src/two.cpp", CODE + "\n")
    figures.write_report(checkout)
    assert kept(checkout) == {}, "`one` uses it: other sources"


def test_what_is_not_committed_is_judged_and_not_kept(checkout, built, monkeypatch, capsys):
    (folder(checkout, "two") / "src" / "two.cpp").write_text(CODE + "\n")
    run(checkout, monkeypatch, "--own")
    assert built.judged and "only printed" in capsys.readouterr().err
    figures.write_report(checkout)
    assert not (checkout / mutants_kept.KEPT).exists(), "what `one` uses is changed, too"
    git(checkout, "checkout", "-q", ".")
    (folder(checkout, "one") / "src" / "new.cpp").write_text(CODE)
    run(checkout, monkeypatch, "--own")
    figures.write_report(checkout)
    assert set(kept(checkout)) == {"two"}
    (folder(checkout, "one") / "src" / "new.cpp").unlink()
    run(checkout, monkeypatch, "--own")
    (folder(checkout, "one") / "README.md").write_text("words")
    figures.write_report(checkout)
    assert set(kept(checkout)) == {"one", "two"}, "pages judge nothing"


def test_another_machine_goes_on_where_the_first_one_was(checkout, built, monkeypatch):
    monkeypatch.setattr(figures, "machine", lambda: "the first")
    run(checkout, monkeypatch, "two", "--own")
    figures.write_report(checkout)
    first = kept(checkout)["two"]
    other = another_machine(checkout)
    judged = built.judged
    monkeypatch.setattr(figures, "machine", lambda: "the second")
    assert run(other, monkeypatch, "two", "--own") == 1 and built.judged == judged
    monkeypatch.setenv("COGLAB_TOP", str(other))
    mutants.main(["two", "--own", "--count", "5"])
    figures.write_report(other)
    second = kept(other)["two"]
    assert second["drawn"][:3] == first["drawn"] and len(second["drawn"]) == 5
    assert (first["machine"], second["machine"]) == ("the first", "the first; the second")


def test_where_all_is_known_nothing_is_built_and_the_rows_are_kept(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    rows = figures.measured(checkout, "mutants")["rows"]
    figures.write_report(checkout)
    other = another_machine(checkout)
    shutil.rmtree(other / ".coglab", ignore_errors=True)
    (other / figures.KEPT).unlink()
    assert figures.measured(other, "mutants") is None
    built.whole = built.judged = 0
    run(other, monkeypatch, "--own")
    assert built.whole == built.judged == 0
    assert figures.measured(other, "mutants")["rows"] == rows


def test_tests_left_out_on_one_machine_are_told_on_the_next(checkout, built, monkeypatch):
    built.reds = ("int",)
    run(checkout, monkeypatch, "--own")
    figures.write_report(checkout)
    other = another_machine(checkout)
    run(other, monkeypatch, "--own")
    assert (
        "2 test programs that are red on the unchanged sources (one/test, two/test)"
        in (figures.measured(other, "mutants")["rows"][-1]["figure"])
    )


def test_what_was_kept_first_stands(checkout, built, monkeypatch):
    """Nobody judges again and again until he likes it, nor loses what is known by having less of it himself."""
    assert further([], [1]) == [1] and further([1, 2], [1, 2, 3]) == [1, 2, 3]
    assert further([1, 2], [1]) == further([1, 2], [1, 3, 4]) == [1, 2]
    run(checkout, monkeypatch, "two", "--own")
    figures.write_report(checkout)
    first = kept(checkout)
    shutil.rmtree(checkout / ".coglab")
    (checkout / mutants_kept.KEPT).rename(checkout / "aside")
    built.reds = ("return",)
    run(checkout, monkeypatch, "two", "--own")
    (checkout / "aside").rename(checkout / mutants_kept.KEPT)
    figures.write_report(checkout)
    assert kept(checkout) == first


@pytest.mark.parametrize("spoilt", ["digest", "seed", "drawn", "file"])
def test_an_entry_that_does_not_fit_starts_nothing(checkout, built, monkeypatch, spoilt):
    run(checkout, monkeypatch, "two", "--own")
    figures.write_report(checkout)
    entries = kept(checkout)
    entries["two"][spoilt] = {"digest": "other", "seed": 5, "drawn": [{"package": "two"}], "file": ""}[spoilt]
    (checkout / mutants_kept.KEPT).write_text("[1" if spoilt == "file" else json.dumps(entries))
    shutil.rmtree(checkout / ".coglab")
    judged = built.judged
    run(checkout, monkeypatch, "two", "--own")
    assert built.judged > judged


def test_judged_by_all_tests_nothing_is_taken_from_it(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    figures.write_report(checkout)
    judged = built.judged
    run(checkout, monkeypatch)
    assert built.judged > judged
    assert figures.measured(checkout, "mutants") is not None


def test_the_list_of_what_was_judged_makes_nothing_old(checkout, built, monkeypatch):
    run(checkout, monkeypatch, "--own")
    whole = mutant_workspace.update_copy(checkout, checkout / ".coglab" / "copy")
    figures.write_report(checkout)
    assert mutant_workspace.update_copy(checkout, checkout / ".coglab" / "copy") == whole
    assert figures.measured(checkout, "mutants") is not None
    commit(checkout, "docs/page.md", "words")
    assert figures.measured(checkout, "mutants") is not None


def section(top: Path) -> str:
    figures.write_report(top)
    return (top / "docs" / "figures.md").read_text().partition("## mutants")[2].partition("\n## ")[0]


def test_the_page_lists_the_survivors_with_file_and_line(checkout, built, monkeypatch):
    assert "survived" not in section(checkout).partition(figures.TABLE)[2]
    built.reds = ()
    run(checkout, monkeypatch, "--own")
    first = json.loads(next((checkout / ".coglab" / "mutants").glob("two.*.own.json")).read_text())["drawn"][0]
    named = {"file": first["file"], "line": first["text"], "change": first["changed"], "reason": "g is never called"}
    (checkout / EQUIVALENT).write_text(json.dumps([named]))
    text = section(checkout).partition(figures.TABLE)[2]
    lines = [line for line in text.splitlines() if line.startswith("- `catkin_ws/src/")]
    assert len(lines) == 6 and "one 3 of 3, two 3 of 3" in text and mutants_kept.KEPT in text
    (line,) = [line for line in lines if "equivalent" in line]
    assert line.startswith(f"- `{first['file']}:{first['line']}: ") and line.endswith("(equivalent: g is never called)")
    assert not [line for line in lines if figures.cells_of(line)]
    commit(checkout, "catkin_ws/src/two/src/two.cpp", CODE + "\n")
    assert "- `catkin_ws" not in section(checkout), "of other sources no lines are told"


def test_git_hears_nothing_of_the_one_who_calls(checkout):
    """No setting of a user's git changes the seed."""
    two = folder(checkout, "two")
    seed = folder_seed(checkout, two)
    git(checkout, "config", "log.showSignature", "true")
    git(checkout, "config", "log.follow", "true")
    assert folder_seed(checkout, two) == seed
