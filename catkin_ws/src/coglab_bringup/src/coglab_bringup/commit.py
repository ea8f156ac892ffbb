"""The commit of this checkout, read from .git, since git itself may not be installed."""

from __future__ import annotations

from pathlib import Path

UNKNOWN = "unknown"


def _git_folders(top: Path) -> list[Path]:
    """Where HEAD lies, and where the branches lie: elsewhere in a second worktree."""
    folder = top / ".git"
    if folder.is_file():
        folder = top / folder.read_text(encoding="utf-8").strip().removeprefix("gitdir: ")
    common = folder / "commondir"
    return [folder, folder / common.read_text(encoding="utf-8").strip()] if common.is_file() else [folder]


def commit_of(top: Path) -> str:
    """The commit in 40 hex digits; "unknown" outside of a checkout."""
    try:
        folders = _git_folders(top)
        head = (folders[0] / "HEAD").read_text(encoding="utf-8").strip()
        if not head.startswith("ref: "):
            return head
        reference = head.removeprefix("ref: ")
        for folder in folders:
            loose, packed = folder / reference, folder / "packed-refs"
            if loose.is_file():
                return loose.read_text(encoding="utf-8").strip()
            for line in packed.read_text(encoding="utf-8").splitlines() if packed.is_file() else []:
                if line.endswith(" " + reference):
                    return line.split()[0]
    except OSError:
        pass
    return UNKNOWN
