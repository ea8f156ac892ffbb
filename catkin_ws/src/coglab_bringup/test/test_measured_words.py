"""No document has a measured figure of its own: each stands beside the command that prints it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from coglab_bringup import figures

TOP = Path(__file__).resolve().parents[4]

UNIT = (
    r"(?:m/s(?:\^2)?|rad/s(?:\^2)?|N/s|kHz|Hz|ms|us|ns|s|min|minutes?|seconds?|h|%|mm|cm|m|mrad|rad|deg|times|x|Nm|N|MB|kB"
    r"|lines)"
)
SOME = r"(?:\d+|one|two|three|four|five|six|seven|eight|nine|ten)"
# What 1e-13 is without a unit: a figure where something is said to be so accurate, else a range or a threshold.
ACCURACY = r"(?:equal|agree|differ|deviat|accura|exact)\w*\b[^.;:|]*?\b(?:to|by|within) \d[\d.]*e-\d"
NUMBER = re.compile(
    r"(?<![\w.])(?:\d[\d.]*\s?" + UNIT + r"(?![\w/])|(?i:" + SOME + r" of (?:the )?\d+\b)"
    r"|(?:half|twice|\w+ times) as \w+|" + ACCURACY + ")"
)
MEASURED = re.compile(
    r"\bmeasured\b|\bmedian\b|\bp95\b|\bpercentile\b|\btakes?\b|\btook\b|\bslowest\b|\bcosts?\b|\bfaster\b|\bslower\b"
    r"|\b(?:of|in|over) \d+ (?:\w+ )?(?:trials|runs|seeds|handovers|reaches|stops|streams|people)\b"
    r"|\bon average\b|\bin a run\b|\bcomes? within\b|\*\*missed\*\*"
    r"|\blargest\b|\bworst\b|\bovershoots?\b|\bsucceed(?:s|ed)?\b|\bmiss(?:es|ed)?\b|\boff its\b"
    r"|\bthrown off\b|\b\d+ to \d+ \w+ (?:after|before|later|earlier|sooner)\b|\b(?:sample|recording): [^|;]*\d"
    rf"|\b{ACCURACY}|\b{SOME} of (?:the )?\d+\b",
    re.I,
)
BY_HAND = "counted by hand: no command here prints it for that commit"
NOBODY_PRINTS = re.compile(r"\bno command(?: here)? prints\b|\bprinted by no command\b", re.I)
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
    "CHANGELOG.md": (
        "most sights of 0.4 s decide",
        "fingers begin to close on the last 30 mm of the way",
        "the hand has arrived within 5 mm (10 before)",
        "of the goal's own speed at most `goal_max_speed`",
        "it had looked every 30 ms",
        "4 % below the table (`servo_overshoot`)",
    ),
    "ctrl_more/doc/controllers/JointLimits.md": ("setting `joint_position`",),
    "ih2_hand/README.md": ("`read_timeout_s`",),
    "lwr_fri_bridge/README.md": ("set_point_leash/position", "`joint_states` (pub)"),
    "arm_back_end.md": ("It holds until the next one",),
    "deviations.md": (
        "actionlib's client alone",
        "kept on a leash",
        "eq. (6) | an error of the position",
        "the guard keeps 0.035 m/s",
        "its goal is raised",
    ),
    "how_to.md": ("Give `add_ptp` the measured position",),
    "limits_under_loss.md": ("At 20 ms 20 cycles are 0.4 s",),
    "console.md": (
        "The path ahead is what the controllers predict",
        "four states at most are on their way",
        "A program without a browser gets a key",
    ),
    "coglab_console/README.md": ("states at 30 Hz with a number",),
    "people.md": (
        "median: Huber et al. 2008",
        "until 1.2 times",
        "`recording:=FILE`",
        "It is seen by four fingertips",
        "`receiving.LIFT_SPEED`",
    ),
    "reference.md": (
        "`/coglab/state` | out, latched",
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
    """Whether its words speak of a measurement; names in the code do not, nor does the median that is a setting of a
    distribution."""
    words = re.sub(r"`[^`]*`|\blognormal, median\b", "", passage)
    sentences = re.split(r"\.\s|[|;:]", words)
    return MEASURED.search(words) is not None or any(PAST.search(s) and EXTREME.search(s) for s in sentences)


def sections(text: str) -> list[str]:
    """What stands below each heading of a page, with it; a comment in a block to type is no heading."""
    text = re.sub(r"```.*?```", lambda block: block.group().replace("\n#", "\n "), text, flags=re.DOTALL)
    return re.split(r"\n(?=#{1,6} )", text)


def named_by(passage: str, before: str, section: str) -> bool:
    """Whether the command is named where it has to be: in the passage, or, of a row, in the paragraph before its table,
    or at least in its own section where the row does not speak of measuring."""
    if not passage.startswith("|"):
        return COMMAND.search(passage) is not None
    where = f"{before} {passage}" if is_measured(passage) else section
    return COMMAND.search(where) is not None


def without_command(path: Path) -> list[str]:
    """Passages with a measured figure and without the command that prints it; every row of a table with a figure of its
    own, too, where its section has no command at all."""
    found, before = [], ""
    for section in sections(path.read_text(encoding="utf-8")):
        for passage in passages(section):
            flat = " ".join(passage.split())
            row = flat.startswith("|")
            told = is_measured(flat) or FIGURE_ROW.search(flat)
            if told and NUMBER.search(flat) and not named_by(flat, before, section):
                found.append(flat)
            before = before if row else flat
    return found


def excused(path: Path) -> list[str]:
    """Words of the passages of a page that are no measurements of ours."""
    return [words for name, all_words in SOURCED.items() if str(path).endswith(name) for words in all_words]


def unprinted(path: Path) -> list[str]:
    """What is left of these when those are taken out whose figures a setting, a source or a rule says."""
    found = [flat for flat in without_command(path) if not any(words in flat for words in excused(path))]
    return [f"{path.name}: {flat[:160]}" for flat in found]


def documents() -> list[Path]:
    """All pages but the one that a command writes."""
    pages = [*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *(TOP / "catkin_ws" / "src").rglob("*.md")]
    return [page for page in pages if page.name != "figures.md"]


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


@pytest.mark.parametrize("heading", ["# a", "## a", "### a"])
def test_a_command_of_another_section_prints_no_row(tmp_path, heading):
    table = "| period | now |\n| --- | --- |\n| slow | 1.307 s |\n"
    page = tmp_path / "page.md"
    page.write_text(f"## First\n\nBy `./coglab bench fri`.\n\n{heading}\n\n{table}")
    assert unprinted(page) == ["page.md: | slow | 1.307 s |"]
    page.write_text(f"{heading}\n\n```\nwords\n# a comment\n./coglab bench fri\n```\n\n{table}")
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
        "M, C and g equal KDL's to 1e-13.\n",
        "The build takes half as long.\n",
        "Two of 100 hands were such.\n",
        "Its place was thrown off by 10 cm.\n",
        "Torques at rest feel an object 2 to 3 s after a person.\n",
        "| `release_time` | 0.25 | one sample: both hold for 0.29-0.38 s |\n",
    ],
)
def test_a_figure_is_found_however_it_is_put(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert len(unprinted(page)) == 1
    page.write_text(f"By `./coglab bench trials`: {text}")
    assert unprinted(page) == []


@pytest.mark.parametrize(
    "text",
    [
        "A threshold below 1e-6 is refused.\n",
        "| `reaction_median` | lognormal, median 0.35 s, sigma 0.15 | ours |\n",
        "Commands live for 0.1 s.\n",
    ],
)
def test_what_a_setting_or_a_rule_says_is_no_measurement(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert unprinted(page) == []


def test_no_page_excuses_its_figures_because_nothing_prints_them():
    """But for what others counted once, by hand, and which is told as theirs."""
    flat = [" ".join(p.split()) for page in documents() for p in passages(page.read_text(encoding="utf-8"))]
    found = [passage[:160] for passage in flat if NOBODY_PRINTS.search(passage) and BY_HAND not in passage]
    assert not found, "\n".join(found)


def test_every_measured_figure_of_a_document_has_a_command_that_prints_it():
    found = [line for page in documents() for line in unprinted(page)]
    assert not found, "\n".join(found)


def test_nothing_is_excused_that_needs_no_excuse():
    for name, all_words in SOURCED.items():
        found = [flat for page in documents() if str(page).endswith(name) for flat in without_command(page)]
        assert not [words for words in all_words if not any(words in flat for flat in found)], name
