"""The copy of a checkout in which `./coglab bench mutants` changes lines: follows the checkout, is built and tested."""

from __future__ import annotations

import ast
import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from coglab_bringup import process_tree, test_runner
from coglab_bringup.arguments import package_folders, used_by
from coglab_bringup.usage import Refused

NOT_COPIED = (".git", ".coglab", "out", "build", "devel", "install", "__pycache__", ".pytest_cache", ".ruff_cache")
BUILD_LIMIT = 3600.0  # s
FORM = ("test_house.py", "test_types.py", "test_one_place.py", "test_packages.py")
PAGES = ("test_pages.py", "test_figures.py", "test_measured_words.py", "test_architecture.py", "test_people_page.py")
NO_JUDGES = {*FORM, *PAGES, "test_feature_table.py"}
"""tests of the sources' form and of pages: a change that only the formatter or a page notices is one that no test of
what the program does has noticed"""

DRAWN_AND_JUDGED_BY = tuple(
    Path(__file__).with_name(name) for name in ("mutants.py", "mutator.py", Path(__file__).name)
)
"""what decides which lines are changed, how, and which test has noticed: of others no result is one of these sources"""


def update_copy(top: Path, copy: Path) -> str:
    """Makes the copy hold the files of the checkout, touching none that is the same; a digest of its sources and tests:
    what lies in catkin_ws/src, and `coglab`, but for pages."""
    digest, there = hashlib.sha256(), set()
    for folder, names, files in os.walk(top):
        names[:] = sorted(name for name in names if name not in NOT_COPIED and not (Path(folder) / name).is_symlink())
        for name in sorted(files):
            path = Path(folder) / name
            relative = path.relative_to(top)
            if path.is_symlink():  # catkin's own, made anew by the build
                continue
            content = path.read_bytes()
            if path.suffix != ".md" and (relative.parts[:2] == ("catkin_ws", "src") or str(relative) == "coglab"):
                digest.update(str(relative).encode() + b"\0" + hashlib.sha256(content).digest())
            target = copy / relative
            there.add(target)
            if not target.is_file() or target.read_bytes() != content:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
            shutil.copymode(path, target)
    for folder, names, files in os.walk(copy):
        names[:] = [name for name in names if name not in NOT_COPIED and not (Path(folder) / name).is_symlink()]
        for name in files:
            path = Path(folder) / name
            if path not in there and not path.is_symlink():
                path.unlink()
    return digest.hexdigest()


def code_of(path: Path) -> str:
    """The code of a Python file: without comments and docstrings, which decide nothing."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.unparse(tree)


def digest_of(root: Path, package: str) -> str:
    """Of what judges a package by its own tests alone: its files, the sources of what it uses, and `coglab`; but for
    pages and for the tests of what it uses. And of what draws the changes and runs the tests, as it is here."""
    packages = package_folders(root / "catkin_ws" / "src")
    digest = hashlib.sha256((root / "coglab").read_bytes() if (root / "coglab").is_file() else b"")
    for path in DRAWN_AND_JUDGED_BY:
        digest.update(f"{path.name}\0{code_of(path)}\0".encode())
    for name in sorted({package, *used_by(package, packages)}):
        for path in sorted(packages[name].rglob("*")):
            inside = path.relative_to(packages[name])
            if path.is_symlink() or not path.is_file() or path.suffix == ".md" or {*NOT_COPIED} & {*inside.parts}:
                continue
            if name == package or inside.parts[0] != "test":
                digest.update(f"{name}/{inside}".encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


class Workspace:
    """The copy: builds it and runs its tests."""

    def __init__(self, top: Path) -> None:
        self.root = top / ".coglab" / "mutants" / "checkout"
        self.logs = self.root.parent / "logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        self.digest = update_copy(top, self.root)
        oracles = top / ".coglab" / "venv"
        link = self.root / ".coglab" / "venv"
        if oracles.is_dir() and not link.exists():
            link.parent.mkdir(exist_ok=True)
            link.symlink_to(oracles)
        self._entered = False
        self.stale = True
        """Whether what is built, of any package, is not what the sources say."""

    def build(self, alone: Path | None = None) -> bool:
        """Whether it builds, with its tests; `alone`: only what the package in this folder builds."""
        command = [str(self.root / "coglab"), "build", "tests"]
        if alone is not None:
            build = self.root / "catkin_ws" / "build"
            programs = (build / alone.relative_to(self.root / "catkin_ws" / "src")).rglob("CMakeFiles/*.dir/link.txt")
            targets = sorted(path.parent.name.removesuffix(".dir") for path in programs)
            command = ["make", "-C", str(build), f"-j{len(os.sched_getaffinity(0))}", *targets]
        self.stale = alone is not None
        with (self.logs / "build.log").open("w") as log:
            return process_tree.run(command, BUILD_LIMIT, stdout=log, stderr=subprocess.STDOUT) == 0

    def digest_of(self, package: str) -> str:
        """See digest_of(); before anything is changed in the copy."""
        return digest_of(self.root, package)

    def ready(self, say: Callable[[str], None]) -> None:
        """Builds what is not built as the sources say, and enters: asked for where a test has to run, and not before,
        so that who knows all results already waits for no build."""
        if self.stale:
            say("building; the first time this takes as long as a whole build")
            if not self.build():
                raise Refused(f"the unchanged sources do not build; see {self.logs / 'build.log'}")
        if not self._entered:
            self.enter()
        self._entered = True

    def enter(self) -> None:
        """From now on this process and what it starts live in the copy's workspace."""
        script = f'set -e; . "{self.root}/catkin_ws/devel/setup.bash" >/dev/null; env -0'
        without = ("PYTHONPATH", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH")
        clean = {name: value for name, value in os.environ.items() if name not in without}
        text = subprocess.run(["bash", "-c", script], env=clean, capture_output=True, check=True, timeout=60).stdout
        entered = dict(entry.split("=", 1) for entry in text.decode().split("\0") if "=" in entry)
        os.environ.clear()
        os.environ.update(entered, COGLAB_TOP=str(self.root), PYTHONDONTWRITEBYTECODE="1")

    def programs(self, packages: list[str]) -> list[test_runner.Program]:
        """The tests of some packages that judge: the first package's first, quick kinds before rostests."""
        python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
        found = test_runner.find_programs(self.root, self.logs, python, packages)
        found = [program for program in found if program.name not in NO_JUDGES]
        return sorted(found, key=lambda p: (p.kind == "rostest", packages.index(p.package), p.kind != "gtest", p.name))

    def red(self, program: test_runner.Program, limit: float) -> bool:
        """Whether a test is red; one that does not end within `limit` (s) is."""
        if program.kind == "rostest":
            shutil.rmtree(program.junit, ignore_errors=True)
        else:
            program.junit.unlink(missing_ok=True)
        program.passed = program.failed = program.skipped = 0
        program.failures.clear()
        test_runner.run(program, self.logs / f"{program.package}.{program.name}.log", limit)
        return program.failed > 0
