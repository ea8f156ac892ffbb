"""Lengths of files and functions (Python, C++, JavaScript), public methods of classes (Python, C++).

`python3 -m coglab_bringup.code_size FOLDER ...` lists the longest and those with the most.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

SKIPPED = {"__pycache__", ".pytest_cache", ".ruff_cache", ".mypy_cache"}
# What may stand before the brace of a function: a parameter list, then words like const, noexcept, an initialiser list.
_FUNCTION = re.compile(r"\)\s*(const|noexcept|override|final|mutable|->\s*[\w:<>,&*\s]+|:\s.*)*\s*$", re.DOTALL)
_NO_FUNCTION = re.compile(r"^\s*(if|for|while|switch|catch|else|do|return|namespace|class|struct|enum|union)\b")
_PIECES = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"\w*\((?:.|\n)*?\)\w*"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL
)


def source_files(top: Path) -> Iterator[Path]:
    """Python and its stubs, C++ and JavaScript below `top`; a Python script may have no suffix."""
    for path in sorted(top.rglob("*")):
        if not path.is_file() or SKIPPED & set(path.parts):
            continue
        if path.suffix in (".py", ".pyi", ".cpp", ".hpp", ".js") or _is_script(path):
            yield path


def _is_script(path: Path) -> bool:
    return path.suffix == "" and path.open("rb").read(40).startswith((b"#!/usr/bin/python", b"#!/usr/bin/env python"))


def functions(path: Path) -> Iterator[tuple[int, int, str]]:
    """Line, length and name of each function of a file."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix in (".cpp", ".hpp", ".js"):
        yield from _by_braces(text)
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.lineno, (node.end_lineno or node.lineno) - node.lineno + 1, node.name


def _blanked(text: str) -> str:
    """The text with comments, quoted texts and preprocessor lines made blank; line breaks stay."""
    blank = _PIECES.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: re.sub(r"[^\n]", " ", m.group()), blank, flags=re.M)


def _by_braces(text: str) -> Iterator[tuple[int, int, str]]:
    """Blocks whose braces follow a parameter list."""
    blank = _blanked(text)
    opened: list[tuple[int, str | None]] = []
    begin, line = 0, 1
    for at, mark in ((m.start(), m.group()) for m in re.finditer(r"[{};]", blank)):
        head = blank[begin:at]
        line = blank.count("\n", 0, at) + 1
        if mark == "{":
            named = _FUNCTION.search(head) and not _NO_FUNCTION.search(head.strip())
            first = line - head.strip().count("\n")
            opened.append((first, _name_of(head) if named else None))
        elif mark == "}" and opened:
            first, name = opened.pop()
            if name is not None:
                yield first, line - first + 1, name
        begin = at + 1


def _name_of(head: str) -> str:
    words = re.findall(r"([~\w:]+)\s*\(", head)
    return words[0] if words else "lambda"


def public_methods(path: Path) -> Iterator[tuple[int, set[str], str]]:
    """Line, public methods and name of each class of a file: what it declares itself, overloads once, and neither
    constructors, destructors, operators nor data."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix in (".cpp", ".hpp"):
        yield from _classes_by_braces(_blanked(text))
    elif path.suffix in (".py", ".pyi"):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef):
                names = {n.name for n in node.body if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef))}
                yield node.lineno, {name for name in names if not name.startswith("_")}, node.name


_CLASS = re.compile(
    r"^(?:\s*template\s*<.*>)?\s*(class|struct)\s+(?:\[\[\w+\]\]\s*)?(\w+)(?:\s+final)?\s*(?::[^{;]*)?$", re.S
)
_METHOD = re.compile(r"(?<![\w:~])(\w+)\s*\(")


def _classes_by_braces(blank: str) -> Iterator[tuple[int, set[str], str]]:
    """Walks the braces; what stands directly within a class is read declaration by declaration."""
    stack: list[list] = []  # of each open brace: line, class or "", "public" or another, methods
    begin = 0
    for mark in re.finditer(r"[{};]", blank):
        head = blank[begin : mark.start()]
        begin = mark.end()
        inside = stack[-1] if stack and stack[-1][1] else None
        if inside:
            for access in re.findall(r"\b(public|protected|private)\s*:(?!:)", head):
                inside[2] = access
            head = re.sub(r"\b(?:public|protected|private)\s*:(?!:)", "", head)
        named = _CLASS.match(head) if mark.group() == "{" else None
        if inside and not named and mark.group() != "}" and inside[2] == "public":
            method = _method_of(head, inside[1])
            if method:
                inside[3].add(method)
        if mark.group() == "{":
            kind, name = (named.group(1), named.group(2)) if named else ("", "")
            line = blank.count("\n", 0, mark.start()) + 1
            stack.append([line, name, "public" if kind == "struct" else "private", set()])
        elif mark.group() == "}" and stack:
            line, name, _, methods = stack.pop()
            if name:
                yield line, methods, name


def _method_of(declaration: str, owner: str) -> str:
    """Name of the method that a declaration declares; empty if it is something else."""
    if re.search(r"\b(?:operator|using|friend|typedef|enum|static_assert)\b|=\s*delete", declaration):
        return ""
    declared = re.sub(r"<[^<>]*>", "", re.sub(r"<[^<>]*>", "", declaration))
    if re.match(r"[^(]*=", declared):  # data with an initialiser
        return ""
    found = _METHOD.search(declared)
    return found.group(1) if found and found.group(1) not in (owner, "noexcept", "decltype", "alignas") else ""


def main(arguments: list[str]) -> int:
    """The ten longest files and functions, and the ten classes with most public methods, below the folders."""
    found = [path for top in arguments or ["."] for path in source_files(Path(top))]
    files = sorted(((len(p.read_bytes().splitlines()), str(p)) for p in found), reverse=True)
    longest = sorted(((n, f"{p}:{line} {name}") for p in found for line, n, name in functions(p)), reverse=True)
    classes = sorted(
        ((len(m), f"{p}:{line} {name}") for p in found for line, m, name in public_methods(p)), reverse=True
    )
    for lines, what in [*files[:10], *longest[:10], *classes[:10]]:
        print(f"{lines:5} {what}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
