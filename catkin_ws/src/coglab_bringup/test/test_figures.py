"""docs/figures.md says what was measured and nothing else."""

from __future__ import annotations

import ast
import os
import re
import shlex
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from coglab_bringup import arguments, bench, figures
from coglab_bringup.commit import git
from coglab_bringup.mutant import EQUIVALENT
from coglab_bringup.mutant_rows import rows_of
from coglab_bringup.sources import is_source, sources_of

TOP = Path(__file__).resolve().parents[4]
ELSEWHERE = re.compile(r"(?:^|: )\.\.\.|\b(?:of|among|beside|after) these\b|\bbeside it\b|\b(?:of|after) it$")
"""words in the name of a row for what another row says"""
ROW = dict(zip(bench.COLUMNS, ("one", "time of a | step", 1.23456, "us", "<= 2", "KDL", 3.0, True), strict=True))


@pytest.fixture
def checkout(tmp_path):
    """A checkout with benches `one` and `two` of package `p`, and packages `used` and `other`; all committed."""
    source = tmp_path / "catkin_ws" / "src"
    folder = source / "p" / "bench"
    folder.mkdir(parents=True)
    for name, uses in (("p", "<exec_depend>used</exec_depend>"), ("used", ""), ("other", "")):
        (source / name / "test").mkdir(parents=True)
        (source / name / "package.xml").write_text(f"<package><name>{name}</name>{uses}</package>")
    (tmp_path / "docs").mkdir()
    (tmp_path / "coglab").write_text("")
    (folder / "bench_one.py").write_text('"""Ten steps, none left out."""\n')
    (folder / "bench_two.py").write_text('"""Trials."""\n')
    (tmp_path / "README.md").write_text(f"before\n{figures.BEGIN}\nold\n{figures.END}\nafter\n")
    commit(tmp_path, "first")
    return tmp_path


def keep(top: Path, name: str, rows: list[dict], long: bool) -> None:
    """Rows of a run during which nothing has changed."""
    assert figures.record(top, name, rows, long, sources_of(top, name))


def commit(top: Path, message: str) -> None:
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", message]):
        git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(top), *words]
        subprocess.run(git, check=True, capture_output=True, timeout=30)


def test_the_page_has_definition_goal_value_peer_machine_date_and_commit(checkout):
    keep(checkout, "one", [ROW, ROW | {"figure": "other", "ok": False}], False)
    text = figures.write_report(checkout).read_text()
    assert "Ten steps, none left out." in text and "Printed by `./coglab bench one`, on " in text
    assert r"| one: time of a \| step | 1.235 us | <= 2 | met | KDL | 3 |" in text
    assert "| one: other | 1.235 us | <= 2 | **missed** | KDL | 3 |" in text
    assert re.search(r"on \d{4}-\d\d-\d\d, commit [0-9a-f]{7}, on \d+ cores of ", text)
    assert "| two: all of its rows | not measured on these sources | as in the bench | **missed** | - | - |" in text


def quoted_by(checkout: Path) -> str:
    figures.write_report(checkout)
    readme = (checkout / "README.md").read_text()
    assert readme.startswith(f"before\n{figures.BEGIN}\n") and readme.endswith(f"{figures.END}\nafter\n")
    assert "old" not in readme
    return readme


def test_the_readme_quotes_what_is_missed_and_the_latency_and_counts_the_rest(checkout, monkeypatch):
    for name in ("fri", "grasp"):
        (checkout / "catkin_ws" / "src" / "p" / "bench" / f"bench_{name}.py").write_text('"""Words."""\n')
    commit(checkout, "benches")
    monkeypatch.setattr(figures, "QUOTED", ("one", "fri"))
    missed, empty = ROW | {"figure": r"late | \ ones", "ok": False}, ROW | {"figure": "gone", "value": None}
    latency = ROW | {"figure": "answer latency, median", "goal": "<= 1.10"}
    reported = ROW | {"figure": "answer latency, p99", "goal": "reported"}
    keep(checkout, "one", [ROW, missed, empty], False)
    keep(checkout, "fri", [latency, reported, ROW], False)
    keep(checkout, "grasp", [ROW, missed, empty], False)
    rows = [line for line in quoted_by(checkout).splitlines() if figures.cells_of(line)]
    expected = [figures.line_of("fri", latency), figures.line_of("one", missed), figures.line_of("one", empty)]
    assert rows == expected, "in the order of the page"
    assert "rows of `grasp` 2; not measured on these sources: `mutants`, `two`. Every row: " in quoted_by(checkout)


def test_no_missed_row_is_left_out_of_the_readme():
    text = (TOP / "docs" / "figures.md").read_text(encoding="utf-8")
    quoted = figures.quotation(text)
    missed = [figures.cells_of(line) for line in text.splitlines() if "**missed**" in line]
    assert missed and all(missed), "each is read as a row"
    shown = [cells for cells in missed if any(figures.cells_of(line) == cells for line in quoted.splitlines())]
    unmeasured = {cells[0].partition(":")[0] for cells in missed if cells not in shown and figures.ALL_ROWS in cells[0]}
    counted = figures.missed_besides(text)
    assert all(f"`{bench}`" in counted for bench in unmeasured)
    rest = len(missed) - len(shown) - len(unmeasured)
    assert sum(int(count) for count in re.findall(r"` (\d+)", counted)) == rest


def test_a_value_that_is_missing_is_missed(checkout):
    keep(checkout, "one", [ROW | {"value": None, "ok": True}], False)
    assert "| not measured on these sources | <= 2 | **missed** |" in figures.page(checkout)


@pytest.mark.parametrize("goal", [None, "", "told", "reported"])
def test_what_has_no_goal_has_not_met_it(checkout, goal, capsys):
    told = ROW | {"goal": goal}
    assert figures.cells_of(figures.line_of("one", told))[3] == "-"
    absent = figures.cells_of(figures.line_of("one", told | {"value": None, "figure": "gone (did not occur)"}))
    assert absent[1] == absent[3] == "-"
    assert figures.cells_of(figures.line_of("one", told | {"ok": False}))[3] == "**missed**", "its bench says so"
    assert figures.cells_of(figures.line_of("one", told | {"value": None, "ok": False}))[3] == "**missed**"
    latency = figures.line_of("fri", told | {"figure": "answer latency, p99"})
    assert not figures.is_quoted(latency), "README.md shows what is judged"
    assert "**Missed" not in figures.missed_besides(latency)
    bench.print_table([told, ROW])
    assert [line.split()[-1] for line in capsys.readouterr().out.splitlines()] == ["ok", "-", "ok"]


def test_other_sources_make_a_figure_old_and_other_documents_do_not(checkout):
    keep(checkout, "one", [ROW], False)
    (checkout / "docs" / "page.md").write_text("words")
    commit(checkout, "a page")
    assert figures.measured(checkout, "one") is not None
    source = checkout / "catkin_ws" / "src" / "p" / "code.py"
    source.write_text("a = 1\n")
    assert figures.measured(checkout, "one") is None, "changed and not committed"
    keep(checkout, "one", [ROW], False)
    assert figures.measured(checkout, "one") is None, "measured on sources that nobody can get"
    commit(checkout, "code")
    assert figures.measured(checkout, "one") is None
    (checkout / ".coglab" / "figures" / "one.json").write_text("[1")
    assert figures.measured(checkout, "one") is None


def test_only_what_a_bench_runs_makes_its_figure_old(checkout):
    source = checkout / "catkin_ws" / "src"
    keep(checkout, "one", [ROW], False)
    for place in ("other/code.py", "p/README.md", "p/test/test_code.py", "used/test/a_rostest.py", "used/test/a.test"):
        (source / place).write_text("a = 1\n")
        commit(checkout, place)
        assert figures.measured(checkout, "one") is not None, place
    for place in ("p/test/rig.py", "used/code.py", "used/contest/test_x.py", "p/bench/bench_two.py"):
        (source / place).parent.mkdir(exist_ok=True)
        keep(checkout, "one", [ROW], False)
        (source / place).write_text('"""a"""\n')
        commit(checkout, place)
        assert figures.measured(checkout, "one") is None, place
    keep(checkout, "one", [ROW], False)
    (source / "p" / "bench" / "bench_one.py").write_text('"""Ten steps of `other`."""\n')
    commit(checkout, "it names a package that its own does not depend on")
    keep(checkout, "one", [ROW], False)
    (source / "other" / "code.py").write_text("a = 2\n")
    commit(checkout, "that changes")
    assert figures.measured(checkout, "one") is None


def test_tests_and_equivalent_changes_make_the_figures_of_mutants_old(checkout):
    for place in ("other/test/test_code.py", "p/test/a.test"):
        keep(checkout, "mutants", [ROW], False)
        assert figures.measured(checkout, "mutants") is not None
        (checkout / "catkin_ws" / "src" / place).write_text("a = 1\n")
        assert figures.measured(checkout, "mutants") is None, "changed and not committed"
        commit(checkout, place)
        assert figures.measured(checkout, "mutants") is None, place
    keep(checkout, "mutants", [ROW], False)
    (checkout / "catkin_ws" / "src" / "p" / "README.md").write_text("words")
    commit(checkout, "a page")
    assert figures.measured(checkout, "mutants") is not None
    (checkout / EQUIVALENT).write_text("[]\n")
    commit(checkout, "the list")
    assert figures.measured(checkout, "mutants") is None


def test_the_page_says_how_mutants_are_drawn_and_what_is_left_out(checkout):
    text = figures.page(checkout).partition("## mutants")[2].partition("\n## ")[0]
    for words in ("12 changes or more", "does not compile", "red on the unchanged sources", "cosmic-ray"):
        assert words in " ".join(text.split())


def test_what_was_reported_is_kept_for_who_has_not_measured(checkout):
    keep(checkout, "one", [ROW], False)
    text = figures.write_report(checkout).read_text()
    commit(checkout, "report")
    (checkout / ".coglab" / "figures" / "one.json").unlink()
    assert figures.page(checkout) == text
    (checkout / "catkin_ws" / "src" / "used" / "code.py").write_text("a = 1\n")
    commit(checkout, "code")
    assert figures.measured(checkout, "one") is None
    (checkout / figures.KEPT).write_text("[1")
    assert figures.measured(checkout, "one") is None and figures.kept(checkout) == {}


def test_what_changed_while_it_was_measured_is_not_kept(checkout, monkeypatch, capsys):
    monkeypatch.setenv("COGLAB_TOP", str(checkout))
    changes = iter(["used/code.py", "p/README.md"])

    def run_bench(name, *rest):
        (checkout / "catkin_ws" / "src" / next(changes)).write_text("a = 1\n")
        commit(checkout, "meanwhile")
        return [ROW]

    monkeypatch.setattr(bench, "run_bench", run_bench)
    bench.main(["one"])
    assert figures.measured(checkout, "one") is None and not (checkout / ".coglab" / "figures" / "one.json").exists()
    assert "sources changed while it ran" in capsys.readouterr().err
    before = sources_of(checkout, "one")["commit"]
    bench.main(["one"])
    assert figures.measured(checkout, "one")["commit"] == before, "the commit that was measured, not the later one"


def test_a_sample_can_miss_a_goal_and_not_meet_it(checkout, capsys):
    sample = ROW | {"done": 12, "asked": 100}
    rows = [sample, sample | {"ok": False}, sample | {"goal": "reported"}, ROW | {"done": 100, "asked": 100}]
    verdicts = [figures.SAMPLE, figures.MISSED, figures.UNJUDGED, figures.MET]
    assert [figures.verdict(row) for row in rows] == verdicts
    keep(checkout, "one", rows, False)
    lines = [line for line in figures.page(checkout).splitlines() if line.startswith("| one: ")]
    assert [figures.cells_of(line)[3] for line in lines] == verdicts
    assert ["[sample of 12 of 100 asked]" in line for line in lines] == [True, True, True, False]
    bench.print_table(rows)
    printed = capsys.readouterr().out.splitlines()[1:]
    assert [line.split()[-1] for line in printed] == ["sample", "MISSED", "-", "ok"]
    assert ["[sample of 12 of 100 asked]" in line for line in printed] == [True, True, True, False]


@pytest.mark.parametrize(
    "typed",
    ["./coglab bench one", "./coglab bench --long one", "COGLAB_BENCH_QUADS=4 ./coglab bench one",
     "CONSOLE_BENCH_PARTS='page load' ./coglab bench --long one"],
)  # fmt: skip
def test_the_command_on_the_page_typed_as_it_stands_prints_its_rows(checkout, monkeypatch, typed):
    """Also where the environment that it was typed in had settings of its own."""
    names = ("COGLAB_LONG", *figures.SETTINGS)

    def type_in(command: str, **beside: str) -> list[dict]:
        for name in names:
            monkeypatch.delenv(name, raising=False)
        words = shlex.split(command)
        before = [word.partition("=") for word in words[: words.index("./coglab")]]
        for name, value in (*((name, value) for name, _, value in before), *beside.items()):
            monkeypatch.setenv(name, value)
        assert bench.main(words[words.index("bench") + 1 :]) == 0
        return figures.measured(checkout, "one")["rows"]

    def run_bench(name, path, python, limit):
        seen = [f"{name} {os.environ.get(name)}" for name in names]
        return [ROW | {"figure": f"steps, {', '.join(seen)}, at most {limit:g} s"}]

    monkeypatch.setenv("COGLAB_TOP", str(checkout))
    monkeypatch.setattr(bench, "run_bench", run_bench)
    rows = type_in(typed)
    (command,) = re.findall(r"^Printed by `([^`]*)`", figures.page(checkout), flags=re.M)
    assert command == typed and type_in(command) == rows
    type_in("./coglab bench one", COGLAB_LONG="1")
    assert "Printed by `./coglab bench --long one`" in figures.page(checkout), "no sample says that it is none"
    assert type_in("./coglab bench one", COGLAB_LONG="0") == type_in("./coglab bench one"), "and none is a campaign"


def test_trials_that_came_from_a_file_are_said_to_come_from_one(checkout, monkeypatch):
    monkeypatch.setenv("COGLAB_TRIALS", "/home/me/trials.json")
    keep(checkout, "one", [ROW], True)
    assert "Printed by `COGLAB_TRIALS=FILE ./coglab bench --long one`, on " in figures.page(checkout)


def test_rows_of_the_own_tests_name_the_command_that_has_them(checkout):
    for own in (False, True):
        rows = rows_of({"one": []}, {"one": 7}, [], [], own)
        keep(checkout, "mutants", rows, False)
        command = "./coglab bench mutants --own" if own else "./coglab bench mutants"
        assert f"Printed by `{command}`, on " in figures.page(checkout)
        arguments.judge(TOP, "bench", command.split()[2:])


def test_every_setting_that_changes_rows_stands_before_the_command():
    known = {*figures.SETTINGS, "COGLAB_LONG", "COGLAB_TOP", "CONSOLE_BENCH_PART"}  # the last is a part's own process
    texts = [path.read_text(encoding="utf-8") for path in (TOP / "catkin_ws" / "src").rglob("bench/*.py")]
    read = {name for text in texts for name in re.findall(r"environ(?:\.get\(|\[)\"(CO[A-Z_]+)\"", text)}
    assert set(figures.SETTINGS) <= read <= known


def test_report_runs_only_what_is_named(checkout, monkeypatch):
    monkeypatch.setenv("COGLAB_TOP", str(checkout))
    ran: list[str] = []
    monkeypatch.setattr(bench, "run_bench", lambda name, *rest: ran.append(name) or [ROW | {"bench": name}])
    assert bench.main(["--report"]) == 0 and ran == []
    assert bench.main(["two", "--report"]) == 0 and ran == ["two"]
    assert "| two: time of a" in (checkout / "docs" / "figures.md").read_text()
    assert (checkout / ".coglab" / "figures" / "two.json").is_file()


def test_every_bench_says_what_it_measures_over_how_many_and_what_is_left_out():
    number = r"\b(?:\d[\d.e]*|one|two|three|four|five|six|seven|eight|nine|ten|twelve|hundred|thousand)\b"
    left_out = r"\bleft out\b|\binfinitely (?:late|far)\b|\bmissed\b|\b(?:replaced|drawn again|every \w+ counts)\b"
    wrong = []
    for paths in figures.find_benches(TOP / "catkin_ws" / "src").values():
        for path, text in ((path, " ".join(figures.definition([path]).split())) for path in paths):
            if len(text) <= 60 or not re.search(number, text, re.I):
                wrong.append(f"{path.relative_to(TOP)}: what, over how many?")
            if not re.search(left_out, text, re.I):
                wrong.append(f"{path.relative_to(TOP)}: what is left out (or none), and as what does it count?")
    assert not wrong, "\n".join(wrong)


def strings(path: Path) -> list[str]:
    """Those of a program but its docstrings, each value in them as {}."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    joined = [node for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)]
    told |= {id(part) for node in joined for part in node.values}
    whole = [node.value for node in ast.walk(tree)
             if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told]  # fmt: skip
    return whole + ["".join(getattr(part, "value", "") if isinstance(part, ast.Constant) else "{}"
                            for part in node.values) for node in joined]  # fmt: skip


def test_no_bench_names_a_row_by_another_one():
    """What a peer is may say "the same cycle on KDL": it stands in the row that it is the peer of."""
    beginning = re.compile(r"(?:^|: )the same(?:[,:]| (?:with|without|from|of|for)\b)")
    wrong = [f"{path.name}: {text}" for path in sorted((TOP / "catkin_ws" / "src").rglob("bench/*.py"))
             for text in strings(path) if ELSEWHERE.search(text) or beginning.search(text)]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_every_row_of_the_page_can_be_read_alone():
    """It names what is measured itself, in three words or more, and no other row of the bench has its name, unit and
    peer."""
    wrong = []
    for name, run in figures.kept(TOP).items():
        known = Counter((row["figure"], row["unit"], row["peer"]) for row in run["rows"])
        for figure, _, _ in (key for key in known if known[key] > 1 or ELSEWHERE.search(key[0])
                             or re.search(r"(?:^|: )the same\b", key[0]) or len(key[0].split()) < 3):  # fmt: skip
            wrong.append(f"{name}: {figure}")
    assert not wrong, "\n".join(wrong)


def test_every_goal_is_a_comparison_or_a_number_or_none():
    def fine(goal: object) -> bool:
        return goal in figures.NO_GOAL or figures.GOAL.match(str(goal)) is not None

    assert all(map(fine, ("<= 0.25", "0", "> 3", ">= 75, of >= 12 each", "<= peer + 50", "reported")))
    assert not any(map(fine, ("printed", "as before", "<= what was")))
    assert figures.verdict(ROW | {"goal": "printed"}) == figures.MISSED
    names = figures.find_benches(TOP / "catkin_ws" / "src")
    wrong = [f"{name}: {row['figure']}: {row['goal']}" for name in names if (run := figures.measured(TOP, name))
             for row in run["rows"] if not fine(row["goal"]) and row["ok"]]  # fmt: skip
    for path in (TOP / "catkin_ws" / "src").glob("*/bench/*.py"):
        goals = re.findall(r"\"goal\": \"([^\"]*)\"|\bgoal=\"([^\"]*)\"", path.read_text(encoding="utf-8"))
        wrong += [f"{path.name}: {a or b}" for a, b in goals if not fine(a or b)]
    assert not wrong, "\n".join(wrong)


def test_every_row_that_was_kept_stands_on_the_page():
    lines = set((TOP / "docs" / "figures.md").read_text(encoding="utf-8").splitlines())
    runs = figures.kept(TOP)
    missing = [figures.line_of(name, row) for name, run in runs.items() for row in run["rows"]
               if figures.line_of(name, row) not in lines]  # fmt: skip
    missing += [line for name, run in runs.items() if (line := figures.printed_by(name, run)) not in lines]
    assert runs and not missing, "run ./coglab bench --report\n" + "\n".join(missing)


def test_no_row_of_the_page_is_of_other_sources():
    if git(TOP, "status", "--porcelain", "--", "catkin_ws/src", "coglab"):
        pytest.skip("sources are changed and not committed: nothing is measured on them")
    text = (TOP / "docs" / "figures.md").read_text(encoding="utf-8")
    sections = dict(zip(*[iter(re.split(r"^## (\w+)$", text, flags=re.M)[1:])] * 2, strict=True))
    old = [name for name, section in sections.items() if figures.NOT_MEASURED not in section
           and figures.measured(TOP, name) is None]  # fmt: skip
    assert not old, f"measured before these were changed; run ./coglab bench --report: {', '.join(old)}"


def test_a_test_that_a_bench_names_is_one_of_its_sources():
    """It runs it, so that what it measures is defined there."""
    words = 'find("p_test_cycle"), TEST / "fuzz.test", test_one_oracle'
    for path in ("p/test/test_cycle.cpp", "p/test/fuzz.test", "p/test/fuzz_rostest.py", "p/test/test_one_oracle.py"):
        assert is_source(path, words=words) and not is_source(path)
    for path in ("p/test/test_cycle_limits.cpp", "p/test/test_one.py", "p/test/test_fuzz_rules.py", "p/README.md"):
        assert not is_source(path, words=words)


def test_the_page_knows_every_bench_and_the_readme_quotes_it():
    text = (TOP / "docs" / "figures.md").read_text(encoding="utf-8")
    names = [*figures.find_benches(TOP / "catkin_ws" / "src"), "mutants"]
    assert re.findall(r"^## (\w+)$", text, flags=re.M) == sorted(names), "run ./coglab bench --report"
    readme = (TOP / "README.md").read_text(encoding="utf-8")
    assert figures.END in readme.partition(figures.BEGIN)[2]
    assert figures.with_quotation(readme, figures.quotation(text)) == readme, "run ./coglab bench --report"
