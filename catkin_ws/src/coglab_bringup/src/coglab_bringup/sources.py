"""The sources of a bench: one word for them, which is the same as long as nothing changes on which a figure may depend.

They are its package, the packages that its own files name, what all these depend on (package.xml), and `coglab`;
documents and tests are none. Programs beside the tests, which benches share with them, are, and so are the tests that a
bench names, because it runs them. Those of `mutants` are all packages with their tests, which are what it measures, and
its list of equivalent changes. There is a word only for what is committed, and nowhere outside of a repository.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from xml.etree import ElementTree

from coglab_bringup.arguments import find_benches, package_folders
from coglab_bringup.commit import git
from coglab_bringup.mutant import EQUIVALENT

MUTANTS = "mutants"


def _needed(packages: dict[str, Path], files: list[Path], words: str) -> list[Path]:
    """Folders of the packages that a bench of these files, with these words, runs; all of them where the files are not
    known."""
    found = [
        name for name, folder in packages.items() if name in words or any(folder in path.parents for path in files)
    ]
    for name in found:  # which grows meanwhile
        manifest = ElementTree.parse(packages[name] / "package.xml").getroot()
        uses = {element.text for element in manifest if element.tag.endswith("depend")}
        found += [other for other in packages if other in uses and other not in found]
    return [packages[name] for name in found or packages]


def is_source(path: str, tests: bool = False, words: str = "") -> bool:
    """Whether a figure may depend on this file: documents measure nothing, nor do tests but where they are measured, or
    run by the bench, whose files hold these words."""
    folder, _, name = path.rpartition("/")
    test = f"{folder}/".count("/test/") and (name.startswith("test_") or name.endswith((".test", "_rostest.py")))
    stem = name.partition(".")[0]
    # A rostest is named by its launch file, a program by the end of its name.
    call = stem if name.startswith("test_") else f"{stem.removesuffix('_rostest')}.test"
    run = re.search(rf"(?:\b|_){re.escape(call)}\b", words) is not None
    return not (test and not tests and not run or name.endswith(".md"))


def sources_of(top: Path, bench: str) -> dict[str, str]:
    """Commit of a checkout, and one word for the sources of a bench: the same where only others change."""
    source = top / "catkin_ws" / "src"
    its_files = find_benches(source).get(bench, [])
    words = " ".join(path.read_text(encoding="utf-8") for path in its_files)
    folders = _needed(package_folders(source), its_files, words)
    places = ["coglab", *sorted(str(folder.relative_to(top)) for folder in folders)]
    tests = bench == MUTANTS
    places += [EQUIVALENT] if tests else []

    def kept(lines: str) -> list[str]:
        return [line for line in lines.splitlines() if is_source(line, tests, words)]

    changed = bool(kept(git(top, "status", "--porcelain", "--", *places)))
    files = kept(git(top, "ls-tree", "-r", "HEAD", "--", *places))
    digest = hashlib.sha256("\n".join(files).encode()).hexdigest() if files else ""
    return {
        "commit": git(top, "rev-parse", "--short=7", "HEAD") + (" with changes" if changed else ""),
        "sources": "" if changed else digest,
    }


def wall_sources(top: Path) -> str:
    """The word of `./coglab bench wall`, for a demo or a test run that goes on whatever it is: empty where it cannot be
    told, as without git, outside of a repository, or where a manifest cannot be read."""
    try:
        return sources_of(top, "wall")["sources"]
    except (OSError, ValueError, ElementTree.ParseError):
        return ""
