"""The command lines that README, tour and how-to print, with the section they stand in."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

TOP = Path(__file__).resolve().parents[4]
PAGES = ("README.md", "docs/tour.md", "docs/how_to.md")


@dataclass(frozen=True)
class Line:
    """One command as printed, without its comment."""

    page: str
    section: str
    command: str


@dataclass(frozen=True)
class File:
    """A file that a page shows; its name stands in the first line."""

    name: str
    text: str


def blocks(page: str) -> list[tuple[str, str, str]]:
    """Section, language and text of each fenced block, also of those inside of a list."""
    section, found, language, lines = "", [], None, []
    for raw in (TOP / page).read_text(encoding="utf-8").splitlines():
        fence = re.fullmatch(r"\s*```(\w*)", raw)
        if language is None and raw.startswith("#"):
            section = raw.lstrip("# ")
        elif fence and language is None:
            language, lines = fence.group(1), []
            indent = len(raw) - len(raw.lstrip())
        elif fence:
            found.append((section, language, "\n".join(lines)))
            language = None
        elif language is not None:
            lines.append(raw[indent:])
    return found


def printed_lines() -> list[Line]:
    """Every line of every block without a language."""
    lines = []
    for page in PAGES:
        for section, language, text in blocks(page):
            for raw in text.splitlines() if not language else []:
                command = re.sub(r"(^|\s+)# .*$", "", raw).strip()
                if command:
                    lines.append(Line(page, section, command))
    return lines


def printed_files() -> list[File]:
    """Python and launch files that a page shows in full: those with their name in the first line."""
    files = []
    for page in PAGES:
        for _, language, text in blocks(page):
            name = re.match(r"(?:# |<!-- )(\w+\.(?:py|launch))\b", text)
            if language and name:
                files.append(File(name.group(1), text + "\n"))
    return files


def printed_block(page: str, section: str, language: str) -> str:
    """The first block of that language in a section."""
    return next(text for where, kind, text in blocks(page) if where == section and kind == language)
