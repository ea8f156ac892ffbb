"""Builds the documentation site: ./coglab docs. Works without a network, in the environment of the workspace.

docs/_build/source receives the pages of docs/, the README of each package and pages generated from the code. Sphinx
converts it to docs/_build/html. A warning of Sphinx counts as an error.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import reference

DOCS = Path(__file__).resolve().parent
TOP = DOCS.parent
SOURCES = TOP / "catkin_ws" / "src"
BUILD = DOCS / "_build"
CPP_PACKAGES = ("coglab_rt", "lwr_fri_bridge", "ctrl_more", "coglab_controllers", "coglab_sim")


def places() -> dict[Path, str]:
    """Every page and picture of the project, with its path on the site."""
    found = {page: page.name for page in DOCS.glob("*.md")}
    found |= {TOP / "CHANGELOG.md": "changelog.md", TOP / "CONTRIBUTING.md": "contributing.md"}
    for page in sorted(SOURCES.glob("*/README.md")):
        found[page] = f"packages/{page.parent.name}.md"
    for ending in ("png", "svg", "gif"):
        found |= {picture: str(picture.relative_to(DOCS)) for picture in DOCS.glob(f"[!_]*/*.{ending}")}
    return found


def with_links(text: str, page: Path, found: dict[Path, str]) -> str:
    """Returns the text of a page with links to the site's paths. Links to other files become plain text."""

    def link(match: re.Match[str]) -> str:
        mark, label, target = match.groups()
        if target.startswith(("http:", "https:", "#")):
            return match.group(0)
        name, hash_sign, anchor = target.partition("#")
        place = found.get((page.parent / name).resolve())
        if place is None:
            return label
        here = os.path.dirname(found[page]) or "."
        return f"{mark}[{label}]({os.path.relpath(place, here)}{hash_sign}{anchor})"

    return re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", link, text)


def collect(source: Path) -> None:
    """Copy pages and pictures."""
    found = places()
    for page, place in found.items():
        target = source / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix == ".md":
            target.write_text(with_links(page.read_text(encoding="utf-8"), page, found), encoding="utf-8")
        else:
            shutil.copy(page, target)


def describe_controllers(folder: Path) -> None:
    """Write the generated page of each feedback controller of ctrl_more."""
    folder.mkdir()
    for library in sorted((TOP / "catkin_ws/devel/lib").glob("libctrl_more_*.so")):
        said = subprocess.run(["ctrl_more_describe", "page", library], capture_output=True, text=True, check=False)
        if said.returncode == 0:
            name = library.stem.removeprefix("libctrl_more_")
            (folder / f"{name}.md").write_text(said.stdout.replace("```math", "```text"), encoding="utf-8")


def read_headers(out: Path) -> list[tuple[str, list[tuple[str, str]]]]:
    """Run Doxygen on the public headers. Returns the documented classes and structs of each package."""
    classes = []
    for package in CPP_PACKAGES:
        settings = {
            "PROJECT_NAME": package,
            "INPUT": SOURCES / package / "include",
            "RECURSIVE": "YES",
            "OUTPUT_DIRECTORY": out / package,
            "GENERATE_HTML": "NO",
            "GENERATE_LATEX": "NO",
            "GENERATE_XML": "YES",
            "QUIET": "YES",
            "WARN_IF_UNDOCUMENTED": "NO",
            "WARN_IF_DOC_ERROR": "NO",
            "WARN_LOGFILE": out / package / "doxygen.log",
            "JAVADOC_AUTOBRIEF": "YES",
            "EXTRACT_ALL": "NO",
            "HIDE_UNDOC_CLASSES": "YES",
            "MARKDOWN_SUPPORT": "NO",
        }
        (out / package).mkdir(parents=True)
        text = "\n".join(f"{name} = {value}" for name, value in settings.items())
        subprocess.run(["doxygen", "-"], input=text, text=True, check=True)
        index = (out / package / "xml" / "index.xml").read_text(encoding="utf-8")
        found = re.findall(r'kind="(class|struct)"><name>([^<]+)</name>', index)
        names = {name for _, name in found}
        outer = [(name, kind) for kind, name in found if name.rpartition("::")[0] not in names and "&" not in name]
        classes.append((package, sorted(outer)))
    return classes


def write_api(source: Path, classes: list[tuple[str, list[tuple[str, str]]]]) -> None:
    """Write one page of C++ classes per package."""
    folder = source / "cpp"
    folder.mkdir()
    for package, names in classes:
        lines = [f"# {package} in C++", "", "Generated from the comments of the public headers.", ""]
        for name, kind in names:
            lines += [f"## {name}", "", f"```{{doxygen{kind}}} {name}", f":project: {package}", ":members:", "```", ""]
        (folder / f"{package}.md").write_text("\n".join(lines), encoding="utf-8")


def main() -> int:
    """Build the site and print its path. Exit status 1 if Sphinx reported a problem."""
    shutil.rmtree(BUILD, ignore_errors=True)
    source = BUILD / "source"
    source.mkdir(parents=True)
    collect(source)
    reference.write(TOP, source / "generated")
    describe_controllers(source / "controllers")
    write_api(source, read_headers(BUILD / "doxygen"))
    html = BUILD / "html"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-c", DOCS, source, html]
    if subprocess.run(command, check=False).returncode:
        print("[coglab] error: Sphinx reported the problems above", file=sys.stderr)
        return 1
    print(f"[coglab] documentation: {html / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
