"""Finds files of the packages, in the source tree and in an install space."""

from __future__ import annotations

from pathlib import Path


def package_path(package: str, *path: str) -> Path:
    """A file or folder of a package of this workspace: beside this package, in the share folder, or found by rospack.
    Raises FileNotFoundError if it does not exist."""
    for parent in Path(__file__).resolve().parents:
        for candidate in (parent.joinpath(package, *path), parent.joinpath("share", package, *path)):
            if candidate.exists():
                return candidate
    import rospkg

    try:
        found = Path(rospkg.RosPack().get_path(package)).joinpath(*path)
    except rospkg.ResourceNotFound:
        found = Path("/".join((package, *path)))
    if not found.exists():
        raise FileNotFoundError(f"{found} does not exist: build the workspace, or install the package {package} again")
    return found
