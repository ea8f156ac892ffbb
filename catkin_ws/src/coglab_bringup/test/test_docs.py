"""The pages of the project: links and named files exist, shell blocks parse, Python blocks compile; README's run.
The drawing of the packages shows what their package.xml files say."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from graphlib import TopologicalSorter
from html import unescape
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
TESTS = {path.name for path in SOURCES.glob("*/test/**/test_*.*")}
PAGES = sorted([*TOP.glob("*.md"), *TOP.glob("docs/*.md"), *SOURCES.glob("*/README.md")])


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as in the usual renderers of Markdown."""
    text = re.sub(r"```.*?```", "", text_of(page), flags=re.S)
    titles = re.findall(r"^#+ +(.+?) *$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def blocks(page: Path, *kinds: str) -> list[str]:
    """The blocks of these kinds; unmarked ones that call the project count as shell."""
    found = re.findall(r"^( *)```(\w*)\n(.*?)^ *```", text_of(page), re.M | re.S)
    return [
        re.sub(f"^{indent}", "", text, flags=re.M)
        for indent, kind, text in found
        if kind in kinds or ("sh" in kinds and not kind and "./coglab " in text)
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(TOP)))
def test_links_exist(page: Path):
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        if target.startswith(("http:", "https:")):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(TOP)))
def test_named_files_exist(page: Path):
    """Files named with their path from the top of the checkout, and tests; NAME and <...> are placeholders."""
    named = re.findall(r"`((?:catkin_ws/src|docs|docker|benchmarks)/[\w./-]+\.\w+)`", text_of(page))
    made = ("side_sway", "wrist_damper", "_build", "/cup.yaml", "NAME")  # created by the commands on the page
    missing = [name for name in named if not (TOP / name).exists() and not any(part in name for part in made)]
    tests = set(re.findall(r"`(?:[\w.-]+/)*(test_[a-z\d_]+\.\w+)`", text_of(page)))  # of any package
    assert missing + sorted(tests - TESTS) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(TOP)))
def test_blocks_parse(page: Path):
    for block in blocks(page, "sh", "bash"):
        done = subprocess.run(["bash", "-n"], input=block, text=True, capture_output=True, check=False)
        assert done.returncode == 0, f"{done.stderr}\n{block}"
    for block in blocks(page, "python"):
        compile(block, page.name, "exec")


@pytest.mark.parametrize("block", blocks(TOP / "README.md", "python"))
def test_python_of_the_readme_runs(block: str, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", block], text=True, capture_output=True, timeout=300, check=False, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr


def test_the_drawing_of_the_packages_is_up_to_date():
    """If not: docs/drawings/draw. The form of the picture depends on the version of Graphviz, its arrows do not."""
    wanted = runpy.run_path(str(TOP / "docs/drawings/draw"))["packages_dot"]()
    assert text_of(TOP / "docs/drawings/packages.dot") == wanted
    titles = re.findall(r"<title>(.*?)</title>", text_of(TOP / "docs/images/packages.svg"))
    drawn = {title for title in map(unescape, titles) if "->" in title}
    assert drawn == {f"{a}->{b}" for a, b in re.findall(r"^  (\w+) -> (\w+);$", wanted, re.M)}


def test_no_package_needs_itself_through_others():
    arrows = runpy.run_path(str(TOP / "docs/drawings/draw"))["package_arrows"]()
    TopologicalSorter(arrows).prepare()  # raises CycleError, which names the circle
