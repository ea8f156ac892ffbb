"""What `./coglab bench mutants` can draw: all code that ships, but for what the docstring of mutator.py names."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from coglab_bringup import mutant_workspace, mutants
from coglab_bringup.arguments import package_folders
from coglab_bringup.mutator import changes, code_lines

TOP = Path(__file__).resolve().parents[4]
SHEBANG = "#!/usr/bin/env python3\n"


def offered(line: str, name: str) -> set[tuple[str, str]]:
    return {(change.before, change.after) for change in changes(f"{line}\n", name)}


@pytest.mark.parametrize(
    "line, expected",
    [
        ("def f(limit=0.05, on=True): return g", {("0.05", "0.1"), ("True", "False")}),
        ("    def f(self, limit: float = -0.05) -> float:", {("-", ""), ("0.05", "0.1")}),
        ("@dataclass(frozen=True)", {("True", "False")}),
        ("class Row(Base, total=False):", {("False", "True")}),
        ("    x = -1.5 * z", {("-", ""), ("1.5", "3.0"), ("*", "/")}),
        ("    x = a[-1] - b", {("-", ""), ("1", "2"), ("-", "+")}),
        ("    x = 10**-y", {("-", ""), ("10", "11")}),
        ("    if a is None:", {("is", "is not")}),
        ("    if a is not None:", {("not ", "")}),
        ("    x *= 2", {("*=", "/="), ("2", "3")}),
        ("    x = 0x7F", {("0x7F", "0x80")}),
        ("    x = a if b else 1e-3", {("1e-3", "0.002")}),
    ],
)
def test_of_python_no_line_is_left_out_but_what_gives_names(line, expected):
    assert offered(line, "a.py") == expected


@pytest.mark.parametrize(
    "line, expected",
    [
        ("  return -x;", {("-", "")}),
        ("  x = f(-a, *b) - c[-1];", {("-", ""), ("-", "+"), ("1", "2")}),
        ("  double y = -1.5 * z;", {("-", ""), ("1.5", "3.0"), ("*", "/")}),
        ("  if (a < 3 &&", {("<", "<="), ("3", "4"), ("&&", "||")}),
        ("  x = a +", {("+", "-")}),
        ("  --i;", set()),
        ("  p->x = 1e-3;", {("1e-3", "0.002")}),
        ("struct Limits { double low = 0.5; bool on = true; };", {("0.5", "1.0"), ("true", "false")}),
        ("enum class Code { kOne = 1 };", {("1", "2")}),
        ("template <int kSize = 7>", {("7", "8")}),
        ("  friend bool same(A a, A b) { return a.x == b.x; }", {("==", "!=")}),
        ("using Joints = std::array<double, 7>;", {("7", "8")}),
        ("  constexpr long kSecond = 1'000'000;", {("1'000'000", "1000001")}),
        ("  x = 0x0F;", {("0x0F", "0x10")}),
        ("#define NEAR(a) \\\n  (a < 3)", {("<", "<="), ("3", "4")}),
        ("#if LIMIT > 3 && \\\n  OTHER > 4", set()),
        ("  char c = '7';", set()),
        ("  static_assert(kSize == 7);", set()),
        ("  virtual double at(int i) const = 0;", set()),
    ],
)
def test_of_cpp_no_line_is_left_out_but_what_the_compiler_alone_reads(line, expected):
    assert offered(line, "a.cpp") == expected


def test_every_sign_of_the_shipped_python_can_be_dropped():
    """What Python's own parser takes for a sign, by line and column."""
    for folder in package_folders(TOP / "catkin_ws" / "src").values():
        for path in mutants.shipped(folder):
            if path.suffix != ".py":
                continue
            text = path.read_text(encoding="utf-8")
            tree, lines = ast.parse(text), text.split("\n")
            # What stands in a text is left alone, and the parser does not say where in it a sign stands.
            texts = [node for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)]
            inside = {id(part) for each in texts for part in ast.walk(each)}
            minus = [
                node
                for node in ast.walk(tree)
                if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and id(node) not in inside
            ]
            signs = {(n.lineno, len(lines[n.lineno - 1].encode()[: n.col_offset].decode())) for n in minus}
            dropped = {(c.line, c.begin) for c in changes(text, path.name) if (c.before, c.after) == ("-", "")}
            assert dropped == signs, path


def test_a_program_without_ending_and_a_template_are_drawn_as_what_they_are(tmp_path):
    for name, text in (
        ("scripts/tool", f"{SHEBANG}def f(on=True):\n    return -x and 2\n"),
        ("scripts/other", "#!/bin/sh\nexit 3\n"),
        ("LICENSE", "3 and 4\n"),
        ("template/src/@name@.cpp.in", "int f() { return 3 and 4; }\n"),
        ("template/test/test_a.cpp.in", "int f() { return 3; }\n"),
        ("template/package.xml.in", "<a>3</a>\n"),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    files = mutants.shipped(tmp_path)
    assert [str(path.relative_to(tmp_path)) for path in files] == ["scripts/tool", "template/src/@name@.cpp.in"]
    tool, template = ({(c.before, c.after) for c in changes(p.read_text(), p.name)} for p in files)
    assert tool == {("True", "False"), ("-", ""), ("and", "or"), ("2", "3"), ("return -x and 2", "pass")}
    assert template == {("3", "4"), ("4", "5")}, "the words of Python are none here"
    assert code_lines(files[0].read_text(), "tool") == [2, 3]


def test_a_program_without_ending_is_not_built_anew(tmp_path):
    builds = []

    class Workspace:
        stale = False

        def build(self, alone) -> bool:
            builds.append(alone)
            return True

    path = tmp_path / "tool"
    for name, text, expected in (("tool", SHEBANG, 0), ("a.cpp", "int a;\n", 1)):
        path = tmp_path / name
        path.write_text(text)
        assert mutants.Edited(Workspace(), path, (text, f"{text}\n"), None).enter() and len(builds) == expected


def test_what_was_judged_by_another_mutator_is_not_of_these_sources(tmp_path, monkeypatch):
    folder = tmp_path / "catkin_ws" / "src" / "one"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>one</name></package>")
    ours = Path(mutants.__file__).parent
    assert {*mutant_workspace.DRAWN_AND_JUDGED_BY} == {
        ours / name for name in ("mutants.py", "mutator.py", "mutant_workspace.py")
    }
    tool = tmp_path / "mutator.py"
    monkeypatch.setattr(mutant_workspace, "DRAWN_AND_JUDGED_BY", (tool,))
    digests = []
    for text in (
        '"""One."""\nx = 1\n',
        '"""Two."""\n# Why.\nx = 1\n\n\ndef f():\n    """Three."""\n',
        'x = 1\n\n\ndef f():\n    """Four."""\n',
        "x = 2\n",
    ):
        tool.write_text(text)
        digests.append(mutant_workspace.digest_of(tmp_path, "one"))
    assert digests[1] == digests[2] and len({*digests}) == 3, "its code counts, and its words do not"
