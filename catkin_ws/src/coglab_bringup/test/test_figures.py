"""docs/figures.md says what was measured and nothing else, and no document has a measured figure of its own."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from coglab_bringup import bench, figures

TOP = Path(__file__).resolve().parents[4]
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
    assert figures.record(top, name, rows, long, figures.sources_of(top, name))


def commit(top: Path, message: str) -> None:
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", message]):
        git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(top), *words]
        subprocess.run(git, check=True, capture_output=True, timeout=30)


def test_the_page_has_definition_goal_value_peer_machine_date_and_commit(checkout):
    keep(checkout, "one", [ROW, ROW | {"figure": "other", "ok": False}], False)
    text = figures.write_report(checkout).read_text()
    assert "Ten steps, none left out." in text and "./coglab bench one" in text
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
    (checkout / figures.EQUIVALENT).write_text("[]\n")
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
    before = figures.sources_of(checkout, "one")["commit"]
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


def test_report_runs_only_what_is_named(checkout, monkeypatch):
    monkeypatch.setenv("COGLAB_TOP", str(checkout))
    ran: list[str] = []
    monkeypatch.setattr(bench, "run_bench", lambda name, *rest: ran.append(name) or [ROW | {"bench": name}])
    assert bench.main(["--report"]) == 0 and ran == []
    assert bench.main(["two", "--report"]) == 0 and ran == ["two"]
    assert "| two: time of a" in (checkout / "docs" / "figures.md").read_text()
    assert (checkout / ".coglab" / "figures" / "two.json").is_file()


def test_every_bench_says_what_it_measures():
    for name, paths in figures.find_benches(TOP / "catkin_ws" / "src").items():
        assert len(figures.definition(paths)) > 60, f"{name}: what, over how many, what is left out?"


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
    assert runs and not missing, "run ./coglab bench --report\n" + "\n".join(missing)


def test_the_page_knows_every_bench_and_the_readme_quotes_it():
    text = (TOP / "docs" / "figures.md").read_text(encoding="utf-8")
    names = [*figures.find_benches(TOP / "catkin_ws" / "src"), "mutants"]
    assert re.findall(r"^## (\w+)$", text, flags=re.M) == sorted(names), "run ./coglab bench --report"
    readme = (TOP / "README.md").read_text(encoding="utf-8")
    assert figures.END in readme.partition(figures.BEGIN)[2]
    assert figures.with_quotation(readme, figures.quotation(text)) == readme, "run ./coglab bench --report"


# --- figures in documents -----------------------------------------------------------------------------------------

UNIT = (
    r"(?:m/s(?:\^2)?|rad/s(?:\^2)?|N/s|kHz|Hz|ms|us|ns|s|min|minutes?|seconds?|h|%|mm|cm|m|mrad|rad|deg|times|x|Nm|N|MB|kB"
    r"|lines)"
)
NUMBER = re.compile(r"(?<![\w.])(?:\d[\d.]*\s?" + UNIT + r"(?![\w/])|\d+ of (?:the )?\d+\b)")
MEASURED = re.compile(
    r"\bmeasured\b|\bmedian\b|\bp95\b|\bpercentile\b|\btakes?\b|\btook\b|\bslowest\b|\bcosts?\b|\bfaster\b|\bslower\b"
    r"|\b(?:of|in|over) \d+ (?:\w+ )?(?:trials|runs|seeds|handovers|reaches|stops|streams|people)\b"
    r"|\bon average\b|\bin a run\b|\bcomes? within\b|\*\*missed\*\*"
    r"|\blargest\b|\bworst\b|\bovershoots?\b|\bsucceed(?:s|ed)?\b|\bmiss(?:es|ed)?\b|\boff its\b"
    r"|\d+ of (?:the )?\d+\b",
    re.I,
)
# "At most" and "up to" are words of rules, too; what was is a measurement.
PAST = re.compile(
    r"\b(?:was|were|came|went|ran|reached|fell|had|needed|stayed|threw|moved|ended|succeeded|missed|measured|found)\b",
    re.I,
)
EXTREME = re.compile(r"\b(?:up to|at most)\b", re.I)
# A row with a cell that is nothing but a figure; one that begins with a name of the code says what a setting is.
FIGURE_ROW = re.compile(r"^\|(?! `).*\| *[<>=~]* ?\d[\d.]*\s?" + UNIT + r" *\|")
COMMAND = re.compile(
    r"\./coglab (?:bench|test|demo)|docker/prove_bare|docs/count_lines|code_size|\bbench_\w+|(?:\b|_)test_\w+|_rostest"
    r"|figures\.md"
)
# Figures that are no measurements of ours: what a setting, a source or a rule says. The words identify the passage.
SOURCED = {
    "ctrl_more/doc/controllers/JointLimits.md": ("setting `joint_position`",),
    "ih2_hand/README.md": ("about 50 requests for each poll", "`read_timeout_s`"),
    "lwr_fri_bridge/README.md": ("set_point_leash/position", "`joint_states` (pub)", "as far as this side can see"),
    "arm_back_end.md": ("It holds until the next one",),
    "deviations.md": (
        "actionlib's client alone",
        "kept on a leash",
        "eq. (6) | an error of the position",
        "the guard keeps 0.035 m/s",
        "its goal is raised",
    ),
    "how_to.md": ("Give `add_ptp` the measured position",),
    "limits_under_loss.md": (
        "At 20 ms 20 cycles are 0.4 s",
        "From full speed `R` is worth",
    ),
    "console.md": (
        "The path ahead is what the controllers predict",
        "four states at most are on their way",
        "A program without a browser gets a key",
    ),
    "coglab_console/README.md": ("states at 30 Hz with a number",),
    "people.md": (
        "Huber et al. 2008",
        "That grip follows load",
        "recorded handover between people",
        "| `trust` |",
        "until 1.2 times",
        "`recording:=FILE`",
        "It is seen by four fingertips",
        "between people the object never stops",
        "slowest speed of the object between people",
        "`receiving.LIFT_SPEED`",
    ),
    "coglab_smach/README.md": ("pushes the arm away, 40 to 60 N",),
    "reference.md": (
        "`/coglab/state` | out, latched",
        "N on the palm beyond what acted before",
        "what it started is gone 3 s later",
        "waits for the hub, 90 s at most",
    ),
}


def passages(text: str) -> list[str]:
    """Paragraphs, points of lists and rows of tables, without what stands in blocks to type, and without what is quoted
    from the page of figures, which a command writes."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    text = re.sub(f"{figures.BEGIN}.*?{figures.END}", "", text, flags=re.DOTALL)
    return re.split(r"\n\s*\n|\n(?=[*-] |\d+\. |\|)", text)


def is_measured(passage: str) -> bool:
    """Whether its words speak of a measurement; names in the code do not."""
    words = re.sub(r"`[^`]*`", "", passage)
    sentences = re.split(r"\.\s|[|;:]", words)
    return MEASURED.search(words) is not None or any(PAST.search(s) and EXTREME.search(s) for s in sentences)


def named_by(passage: str, before: str, page: str) -> bool:
    """Whether the command is named where it has to be: in the passage, or, of a row, in the paragraph before its table,
    or at least anywhere on its page where the row does not speak of measuring."""
    if not passage.startswith("|"):
        return COMMAND.search(passage) is not None
    where = f"{before} {passage}" if is_measured(passage) else page
    return COMMAND.search(where) is not None


def unprinted(path: Path) -> list[str]:
    """Passages with a measured figure and without the command that prints it; every row of a table with a figure of its
    own, too, where its page has no command at all."""
    excused = [words for name, all_words in SOURCED.items() if str(path).endswith(name) for words in all_words]
    found, before, page = [], "", path.read_text(encoding="utf-8")
    for passage in passages(page):
        flat = " ".join(passage.split())
        row = flat.startswith("|")
        if (
            (is_measured(flat) or FIGURE_ROW.search(flat))
            and NUMBER.search(flat)
            and not named_by(flat, before, page)
            and not any(w in flat for w in excused)
        ):
            found.append(f"{path.name}: {flat[:160]}")
        before = before if row else flat
    return found


def documents() -> list[Path]:
    """All pages but the changelog, which says what was, and the two that are written by a command."""
    pages = [*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *(TOP / "catkin_ws" / "src").rglob("*.md")]
    return [page for page in pages if page.name not in ("CHANGELOG.md", "figures.md", "world_figures.md")]


def test_a_figure_without_a_command_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("A step takes 3 us.\n\nThe limit is 3 us.\n\nA step takes 3 us (`./coglab bench dmp`).\n")
    assert unprinted(page) == ["page.md: A step takes 3 us."]


@pytest.mark.parametrize(
    "text",
    [
        "| a | b |\n| --- | --- |\n| scaling | lets the error grow to 188 mm in 300 random reaches |\n",
        "Mean and largest of 1000 stops at 10 % loss:\n",
        "| period | now |\n| --- | --- |\n| slow | 1.307 s |\n",
        "Stops (`./coglab bench fri`).\n\nOthers:\n\n| a | b |\n| --- | --- |\n| 5 ms | 1.79 **missed** |\n",
        "That test comes within 2 mrad of the bound.\n",
    ],
)
def test_a_figure_of_a_row_or_of_some_reaches_needs_a_command(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert len(unprinted(page)) == 1
    if "Others:" in text:
        page.write_text(text.replace("Others:", "Others (`./coglab bench fri`):"))
    else:
        page.write_text(f"All by `./coglab bench --long fri`: {text}")
    assert unprinted(page) == []


@pytest.mark.parametrize(
    "text",
    [
        "Measured: 0.67 m/s.\n",
        "83 of 300 reaches miss.\n",
        "The palm is 13.9 mm off its grasp.\n",
        "Handovers succeed in 96 %.\n",
        "It runs 6.1 times faster than real time.\n",
        "The arm overshoots by 3 %.\n",
        "Of 100 people 97 succeeded in 2 s.\n",
        "The largest force was 66 N.\n",
        "The hand came back at up to 1.1 m/s.\n",
        "The reach ends 0.4 m/s too fast in the worst trial.\n",
        "The status comes at 28 Hz, measured.\n",
    ],
)
def test_a_figure_is_found_however_it_is_put(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert len(unprinted(page)) == 1
    page.write_text(f"By `./coglab bench trials`: {text}")
    assert unprinted(page) == []


def test_every_measured_figure_of_a_document_has_a_command_that_prints_it():
    found = [line for page in documents() for line in unprinted(page)]
    assert not found, "\n".join(found)


def test_nothing_is_excused_that_is_gone():
    for name, all_words in SOURCED.items():
        text = " ".join(" ".join(p.read_text(encoding="utf-8").split()) for p in documents() if str(p).endswith(name))
        assert not [words for words in all_words if words not in text], name
