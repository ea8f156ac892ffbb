"""docs/architecture.md against the code: drawings, packages, steps of the control cycle, and what comments cite."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
PAGE = (TOP / "docs" / "architecture.md").read_text(encoding="utf-8")
CODE = {".py", ".cpp", ".hpp", ".launch", ".test", ".yaml", ".msg", ".srv", ".action", ".js", ".cmake", ".txt"}


def test_the_drawings_are_those_of_their_sources():
    assert shutil.which("dot"), "Graphviz is missing: ./coglab install test"
    done = subprocess.run(
        [str(TOP / "docs" / "drawings" / "draw"), "--check"], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, f"{done.stdout}{done.stderr}run docs/drawings/draw and look at the pictures"


def test_every_picture_of_the_page_is_drawn_from_source():
    for name in re.findall(r"\]\(images/(\w+)\.svg\)", PAGE):
        assert (TOP / "docs" / "drawings" / f"{name}.dot").is_file(), name


def test_the_table_of_packages_is_complete():
    table = PAGE.split("## Packages")[1].split("## ")[0]
    packages = {
        p.parent.relative_to(SOURCES).parts[0] for p in SOURCES.glob("**/package.xml") if "template" not in p.parts
    }
    assert packages <= set(re.findall(r"`(\w+)`", table)), packages - set(re.findall(r"`(\w+)`", table))


def shipped_code(suffixes: set[str], *packages: str) -> list[Path]:
    folders = ("src", "include", "scripts", "nodes")
    found = [p for name in packages for folder in folders for p in (SOURCES / name / folder).rglob("*")]
    return [path for path in found if path.suffix in suffixes]


def test_every_thread_of_the_robot_is_in_its_table():
    section = PAGE.split("## Processes and threads")[1].split("## ")[0]
    names, rooms = set(), set()
    for path in shipped_code({".cpp", ".hpp"}, "coglab_controllers", "lwr_fri_bridge", "ctrl_more", "coglab_rt"):
        text = path.read_text(encoding="utf-8")
        names |= set(re.findall(r"pthread_setname_np\(pthread_self\(\), \"(\w+)\"", text))
        names |= set(re.findall(r"\b\w*(?:thread|publisher)_\.start\(\"(\w+)\"", text))
        if re.search(r"\bstd::thread\b(?!::)|\bAsyncSpinner\b", text):
            rooms.add(path.stem)
    assert {"fri", "control", "goals", "lwr_publisher"} <= names and "tf_listener" in rooms
    assert not [name for name in names if f"`{name}`" not in section]
    # The nodes of split:=true have a spinner each, in place of the main thread of /robot.
    rooms -= {"lwr_node", "controller_manager_node"}
    assert not [room for room in rooms if not re.search(rf"/{room}`", section)]


def test_every_node_and_every_thread_of_a_node_is_in_the_tables():
    section = PAGE.split("## Processes and threads")[1].split("## ")[0]
    launched = [p for p in SOURCES.glob("*/launch/*.launch") if p.name not in ("display.launch", "goal_helper.launch")]
    nodes = {n for p in launched for n in re.findall(r"<node[^>]*?\bname=\"(\w+)\"", p.read_text(encoding="utf-8"))}
    assert not sorted(name for name in nodes - {"rviz", "lwr", "controller_manager"} if f"/{name}`" not in section)
    threads = set()
    engine = ("executive_smach/smach", "executive_smach/smach_ros")
    packages = ("coglab_smach", "coglab_console", "ih2_hand", "coglab_objects", "coglab_perception", *engine)
    for path in shipped_code({".py"}, *packages):
        threads |= set(
            re.findall(r"Thread\([^()]*?(?:\([^()]*\)[^()]*?)*\bname=f?\"([\w:]+)", path.read_text(encoding="utf-8"))
        )
    assert {"poll", "coglab_master", "call:", "concurrent_split:", "smach_introspection:"} <= threads
    assert not sorted(name for name in threads if f"`{name}" not in section)


def test_every_timer_and_tf_listener_of_a_node_is_in_the_table():
    rows = re.findall(r"^\| `/.+$", PAGE.split("## Processes and threads")[1].split("## ")[0], flags=re.MULTILINE)
    made = {"rospy.Timer(": "timer", "TfListener(": "tf listener"}
    scripts = [path for path in SOURCES.glob("*/scripts/*.py") if "def main" in path.read_text(encoding="utf-8")]
    found = 0
    for path in scripts:
        text = path.read_text(encoding="utf-8")
        for row in (row for row in rows if f"`{path.name}`" in row or f"/{path.name}`" in row):
            for call, word in made.items():
                found += call in text
                assert (call in text) <= (word in row), (path.name, word)
    assert found >= 6


def test_the_numbers_in_the_table_of_threads_are_those_of_the_code():
    section = PAGE.split("## Processes and threads")[1].split("## ")[0]
    said = {
        "FRI | `fri` | SCHED_FIFO {}": ("lwr_fri_bridge/include/**/fri_thread.hpp", r"int priority = (\d+)"),
        "spinner of the arm, {} |": ("lwr_fri_bridge/src/ros/bridge_ros.cpp", r"kSpinnerThreads = (\d+)"),
        "spinner of the manager, {} |": ("coglab_controllers/src/ros/manager_ros.cpp", r"AsyncSpinner>\((\d+)"),
        "cancel, {} |": ("coglab_controllers/src/ros/cancel_ros.cpp", r"spinner_\((\d+)"),
        "a spinner of {} take": ("coglab_controllers/src/ideal/ideal_arm_ros.cpp", r"AsyncSpinner>\((\d+)"),
    }
    for phrase, (where, pattern) in said.items():
        (path,) = SOURCES.glob(where)
        (number,) = re.findall(pattern, path.read_text(encoding="utf-8"))
        assert phrase.format(number) in section, (phrase, number)


def test_headers_name_this_page():
    rooms = ("control_cycle", "control_thread", "transformation_system", "fri_thread", "feedback_controllers_manager")
    for room in rooms:
        headers = list(SOURCES.rglob(f"include/**/{room}.hpp"))
        assert any("docs/architecture.md" in header.read_text(encoding="utf-8") for header in headers), room


def test_the_steps_of_the_cycle_are_those_of_the_code():
    page = re.findall(r"^(\d)\. \*\*(.+?)\*\*", PAGE, flags=re.MULTILINE)
    code = (SOURCES / "coglab_controllers" / "src" / "manager" / "control_cycle.cpp").read_text(encoding="utf-8")
    steps = dict(re.findall(r"// Step (\d): (.+?)\.$", code, flags=re.MULTILINE))
    drawing = (TOP / "docs" / "drawings" / "cycle.dot").read_text(encoding="utf-8")
    drawn = dict(re.findall(r"label=\"(\d)  (.+?)\"", drawing))
    assert [int(number) for number, _ in page] == list(range(1, len(page) + 1))
    assert sorted(steps) == sorted(drawn) == [number for number, _ in page]
    for number, title in page:
        title = title.replace("`", "").rstrip(".").lower()
        assert steps[number].lower().startswith(title), (title, steps[number])
        assert drawn[number].lower().startswith(title), (title, drawn[number])


def test_the_notation_names_what_the_code_has():
    table = PAGE.split("## Notation")[1]
    rows = re.findall(r"^\| (`.+?) \| (.+?) \| (.+?) \| (.+?) \|$", table, flags=re.MULTILINE)
    assert len(rows) >= 15
    headers = "".join(
        p.read_text(encoding="utf-8") for p in (SOURCES / "coglab_controllers" / "include").rglob("*.hpp")
    )
    for symbol, unit, _, code in rows:
        names = re.findall(r"\w+", " ".join(re.findall(r"`(.+?)`", code)))
        assert names and not [name for name in names if not re.search(rf"\b{name}\b", headers)], (symbol, names)
        symbols = len(re.findall(r"`.+?`", symbol))
        assert len(unit.split(",")) in (1, symbols), f"{symbol}: {symbols} symbols, units {unit}"


def test_the_drawing_and_the_headers_number_the_steps_as_the_page_does():
    controllers = SOURCES / "coglab_controllers"
    drawing = next(TOP.glob("docs/**/cycle.dot")).read_text(encoding="utf-8")
    headers = "".join(
        path.read_text(encoding="utf-8") for path in (controllers / "include/coglab_controllers/manager").glob("*.hpp")
    )
    cited = {
        "computeReference": r"Step (\d): computes the reference",
        "resolve": r"Step (\d): from the references",
        "Fill RobotStates": r"Step (\d): measurement to robot states",
        "Guard": r"step (\d) did|limits of step (\d)",
    }
    for title, phrase in cited.items():
        number = re.search(rf"^(\d)\. \*\*`?{title}", PAGE, flags=re.MULTILINE).group(1)
        assert re.search(rf'label="{number}  {title}', drawing, flags=re.IGNORECASE), title
        told = [next(filter(None, match.groups())) for match in re.finditer(phrase, headers)]
        assert told and set(told) == {number}, (title, told)


def code_files() -> list[Path]:
    return [
        path
        for path in SOURCES.rglob("*")
        if path.suffix in CODE and path.is_file() and not {"__pycache__", ".pytest_cache"} & set(path.parts)
    ]


def test_no_comment_cites_a_page_that_is_not_there():
    wrong = []
    for path in code_files():
        for cited in re.findall(r"[\w./-]*\b[\w-]+\.md\b", path.read_text(encoding="utf-8", errors="replace")):
            name = Path(cited).name
            if name == "README.md" or any(TOP.rglob(name)):
                continue
            wrong.append(f"{path.relative_to(TOP)}: {cited}")
    assert not [w for w in wrong if "/test/" not in w], "\n".join(wrong)


# A document that a reader can get is named beside its section: D4.10, and the Ctrl-MORE paper.
SECTION = re.compile(r"\b[Ss]ections?\s+(?:\d+|[IVX]+\b)|\b[Cc]omplaints?\s+\d+")
NAMED = re.compile(r"D4\.10|\bpaper\b")
NOT_HERE = re.compile(
    r"\b(?:the|this|our|of) (?:specification|design page|brief|audit)\b"
    r"|\bfacts(?: page|/)|\b(?:protocol|of the) facts\b"
    r"|\bthe issue (?:asks|says|wants|names)\b|\b[Ii]ssues? #?\d",
)


def foreign_citations(text: str) -> list[str]:
    """Passages that send the reader to a page that is not in the repository."""
    found = [match.group() for match in NOT_HERE.finditer(text)]
    for match in SECTION.finditer(text):
        if not NAMED.search(text[max(0, match.start() - 80) : match.end() + 80]):
            found.append(match.group())
    return found


def test_a_foreign_citation_is_found():
    assert foreign_citations("Section 7 of the specification: Concurrence") == ["the specification", "Section 7"]
    assert foreign_citations("What the issue asks of a reach") == ["the issue asks"]
    assert foreign_citations("typed from the last paragraph of section 8 of the protocol facts")
    assert foreign_citations("as D4.10 section 3.2 describes; the user code of the paper's section VI-A") == []


def test_nothing_cites_a_document_that_a_reader_cannot_get():
    pages = [*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *SOURCES.rglob("*.md"), *SOURCES.rglob("*.xml")]
    pages += [TOP / "coglab", *(TOP / "docker").iterdir()]
    wrong = []
    for path in [*code_files(), *pages]:
        if path == Path(__file__).resolve():
            continue
        for passage in foreign_citations(path.read_text(encoding="utf-8", errors="replace")):
            wrong.append(f"{path.relative_to(TOP)}: {passage}")
    assert not wrong, "say the fact itself:\n" + "\n".join(wrong)


def test_the_readme_leads_to_it_first():
    links = re.findall(r"\]\((?!docs/images)([^)]+)\)", (TOP / "README.md").read_text(encoding="utf-8"))
    assert links[0] == "docs/architecture.md"


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/architecture.md", "docs/migration.md"])
def test_the_links_of_the_page_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", (TOP / page).read_text(encoding="utf-8")):
        assert (TOP / page).parent.joinpath(link).exists(), f"{page}: {link}"
