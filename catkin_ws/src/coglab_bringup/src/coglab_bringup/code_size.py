"""Lengths of files and functions (Python, C++, JavaScript); `python3 -m coglab_bringup.code_size` lists the longest."""

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
    """Python, C++ and JavaScript below `top`; a Python script may have no suffix."""
    for path in sorted(top.rglob("*")):
        if not path.is_file() or SKIPPED & set(path.parts):
            continue
        if path.suffix in (".py", ".cpp", ".hpp", ".js") or _is_script(path):
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


def _by_braces(text: str) -> Iterator[tuple[int, int, str]]:
    """Blocks whose braces follow a parameter list. Text and comments are blanked first, line breaks kept."""
    blank = _PIECES.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)
    blank = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: re.sub(r"[^\n]", " ", m.group()), blank, flags=re.M)
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


def main(arguments: list[str]) -> int:
    """The ten longest files and functions below the folders named."""
    found = [path for top in arguments or ["."] for path in source_files(Path(top))]
    files = sorted(((len(p.read_bytes().splitlines()), str(p)) for p in found), reverse=True)
    longest = sorted(((n, f"{p}:{line} {name}") for p in found for line, n, name in functions(p)), reverse=True)
    for lines, what in [*files[:10], *longest[:10]]:
        print(f"{lines:5} {what}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
