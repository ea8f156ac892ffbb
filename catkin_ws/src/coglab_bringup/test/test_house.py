"""Rules of the house that a program can see: sizes, format, names of tests. CONTRIBUTING.md has them in words."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from coglab_bringup.code_size import functions, public_methods, source_files

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
FILE_LIMIT, FUNCTION_LIMIT, METHOD_LIMIT = 400, 60, 25
# Tables and not functions: one statement per line, nothing to divide.
TABLES = re.compile(r"PYBIND11_MODULE|bind[A-Z]\w*|makeTable|\w+::describe")
# Longer than the limits, and why it stays. Nothing is added here without a reason.
LONG: dict[str, str] = {
    "coglab_controllers/test/thread_stress.cpp": "threads that share locals",
    "ctrl_more/test/thread_stress.cpp": "threads that share locals",
    "coglab_controllers/src/coglab_controllers/_core.pyi": "Python reads the types of one compiled module in one stub",
}
# Classes with more public methods of their own than the limit, and why they stay; docs/house.md says it, too.
MANY_METHODS = {
    "Plant": "one world: each method reads or sets one quantity of the one state that MuJoCo holds",
}


def shown(path: Path) -> str:
    return str(path.relative_to(SOURCES))


def test_no_file_is_too_long():
    long = [(shown(p), n) for p in source_files(SOURCES) if (n := len(p.read_bytes().splitlines())) > FILE_LIMIT]
    assert not [(name, n) for name, n in long if name not in LONG], long


def test_no_function_is_too_long():
    long = [
        (f"{shown(path)}:{line}", name, length)
        for path in source_files(SOURCES)
        for line, length, name in functions(path)
        if length > FUNCTION_LIMIT and not TABLES.fullmatch(name) and shown(path) not in LONG
    ]
    assert not long, "\n".join(map(str, long))


def test_no_class_has_too_many_public_methods():
    many = [
        (f"{shown(path)}:{line}", name, len(methods))
        for path in source_files(SOURCES)
        for line, methods, name in public_methods(path)
        if len(methods) > METHOD_LIMIT
    ]
    assert sorted(name for _, name, _ in many) == sorted(MANY_METHODS), many
    house = (TOP / "docs" / "house.md").read_text(encoding="utf-8")
    assert not [name for name in MANY_METHODS if f"`{name}`" not in house]


def test_public_methods_are_counted(tmp_path):
    cpp = tmp_path / "a.hpp"
    cpp.write_text(
        """template <typename T>
class Arm final : public Base<T> {
 public:
  explicit Arm(int a);
  ~Arm();
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;
  using Attach = std::function<void(int)>;
  void move(double x);  // not rest()
  void move(int x) { if (x) { other(x); } }
  std::function<void()> wait() const override;
  [[nodiscard]] virtual int count() const noexcept = 0;
  struct Inner {
    int size() const { return 1; }
  };
  std::atomic<bool> ending{false};
  int number = compute(3);
 private:
  void hidden();
};
struct Plain { int value() const; };
"""
    )
    found = {name: methods for _, methods, name in public_methods(cpp)}
    assert found == {"Arm": {"move", "wait", "count"}, "Inner": {"size"}, "Plain": {"value"}}
    python = tmp_path / "a.py"
    python.write_text("class A:\n    def b(self): ...\n    def _c(self): ...\n    def __init__(self): ...\n")
    assert [(methods, name) for _, methods, name in public_methods(python)] == [({"b"}, "A")]


def test_nothing_is_excused_that_needs_no_excuse():
    for name in LONG:
        path = SOURCES / name
        lines = len(path.read_bytes().splitlines())
        assert lines > FILE_LIMIT or any(n > FUNCTION_LIMIT for _, n, _ in functions(path)), name


def test_nothing_is_installed_that_only_tests_and_benches_use():
    rules = [*SOURCES.rglob("CMakeLists.txt"), *SOURCES.rglob("*.cmake")]
    found = []
    for path in rules:
        text = re.sub(r"#[^\n]*", "", path.read_text(encoding="utf-8"))
        made = (
            r"(?:add_executable|add_library|pybind11_add_module)\((\w+)[^)]*?\s(?:bench|test|examples/motions)/[^)]*\)"
        )
        targets = set(re.findall(made, text))
        for block in re.findall(r"install(?:_python)?\(([^)]*)\)", text):
            found += [
                f"{shown(path)}: {word}" for word in block.split() if word in targets or word.startswith("bench/")
            ]
    assert len(rules) > 15 and not found, found


def test_cpp_is_formatted():
    assert shutil.which("clang-format"), "clang-format is missing: ./coglab install test"
    files = [str(p) for p in SOURCES.rglob("*") if p.suffix in (".cpp", ".hpp")]
    done = subprocess.run(
        ["clang-format", "--dry-run", "-Werror", *files], capture_output=True, text=True, timeout=300, cwd=TOP
    )
    wrong = sorted({line.split(":")[0] for line in done.stderr.splitlines() if ": error:" in line})
    assert not wrong, "clang-format -i " + " ".join(str(Path(w).relative_to(TOP)) for w in wrong)


def test_python_is_formatted_and_clean():
    pytest.importorskip("ruff", reason="ruff is not installed (PyPI); pre-commit and continuous integration have it")
    for words in (["format", "--check", "-q"], ["check", "-q"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *words, "."], capture_output=True, text=True, timeout=300, cwd=TOP
        )
        assert done.returncode == 0, f"ruff {' '.join(words)}: {done.stdout[-3000:]}{done.stderr}"


def test_cpp_tests_are_named_in_one_style():
    wrong = [
        f"{shown(path)}: {name}"
        for path in SOURCES.rglob("*.cpp")
        for name in re.findall(r"^TEST(?:_[FP])?\(\s*\w+,\s*(\w+)\)", path.read_text(encoding="utf-8"), flags=re.M)
        if not name[0].isupper()
    ]
    assert not wrong, f"UpperCamel, as the others: {wrong[:10]}"


def test_no_test_is_skipped_because_something_of_ours_is_not_built():
    """A build that lost a library would be green; what is missing is a failure that says what to build."""
    wrong = [
        f"{shown(path)}: {found}"
        for path in SOURCES.rglob("test_*.py")
        for found in re.findall(r"pytest\.skip\([^)]*\bis not built\b[^)]*\)", path.read_text(encoding="utf-8"))
    ]
    assert not wrong, "\n".join(wrong)
