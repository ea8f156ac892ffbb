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


def test_headers_name_this_page_and_no_other_design():
    rooms = ("control_cycle", "control_thread", "transformation_system", "fri_thread", "feedback_controllers_manager")
    for room in rooms:
        headers = list(SOURCES.rglob(f"include/**/{room}.hpp"))
        assert any("docs/architecture.md" in header.read_text(encoding="utf-8") for header in headers), room
    stray = [path for path in code_files() if "design, section" in path.read_text(encoding="utf-8", errors="replace")]
    assert [path for path in stray if path != Path(__file__).resolve()] == []


def test_the_steps_of_the_cycle_are_those_of_the_code():
    page = re.findall(r"^(\d)\. \*\*(.+?)\*\*", PAGE, flags=re.MULTILINE)
    code = (SOURCES / "coglab_controllers" / "src" / "manager" / "control_cycle.cpp").read_text(encoding="utf-8")
    steps = re.findall(r"// Step (\d): (.+?)\.$", code, flags=re.MULTILINE)
    assert [int(number) for number, _ in page] == list(range(1, len(page) + 1))
    assert sorted(number for number, _ in steps) == [number for number, _ in page]


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


def test_the_readme_leads_to_it_first():
    links = re.findall(r"\]\((?!docs/images)([^)]+)\)", (TOP / "README.md").read_text(encoding="utf-8"))
    assert links[0] == "docs/architecture.md"


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/architecture.md", "docs/migration.md"])
def test_the_links_of_the_page_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", (TOP / page).read_text(encoding="utf-8")):
        assert (TOP / page).parent.joinpath(link).exists(), f"{page}: {link}"
