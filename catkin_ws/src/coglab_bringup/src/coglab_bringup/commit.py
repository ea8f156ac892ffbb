"""The commit of this checkout, read from .git, since git itself may not be installed; and that of one of its folders,
which only git can tell."""

from __future__ import annotations

import subprocess
from pathlib import Path

UNKNOWN = "unknown"


def git(top: Path, *words: str) -> str:
    """What git says of a checkout; empty where it says nothing, or is not there."""
    try:
        done = subprocess.run(["git", "-C", str(top), *words], capture_output=True, text=True, timeout=20, check=True)
        return done.stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


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


def commit_seed(top: Path) -> int:
    """A seed from the commit, the same for all who have it; 1 outside of a checkout."""
    commit = commit_of(top)
    return 1 if commit == UNKNOWN else int(commit[:7], 16)


def last_commit(top: Path, folder: Path) -> str:
    """The last commit that touched a folder; empty without git, for a folder that was never committed, and in a
    checkout without its whole history, where git would name the commit at which that begins."""
    if git(top, "rev-parse", "--is-shallow-repository") != "false":
        return ""
    return git(top, "rev-list", "-1", "HEAD", "--", str(folder))


def folder_seed(top: Path, folder: Path) -> int:
    """A seed from the last commit that touched a folder; where that is not known, from the commit of the checkout."""
    commit = last_commit(top, folder)
    return int(commit[:7], 16) if commit else commit_seed(top)
