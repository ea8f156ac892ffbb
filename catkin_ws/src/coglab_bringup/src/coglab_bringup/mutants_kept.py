"""docs/mutants.json: what `./coglab bench mutants --own` has judged, kept with the checkout for later days.

By package: its seed, which is that of the last commit that touched its folder, the digest of the sources and tests that
were judged and of what drew and judged, date and machine, the changes as drawn, and the tests that told nothing.
`./coglab bench --report` takes them from the state files below .coglab/mutants. An entry stands as long as seed and
digest are those of the checkout, and is replaced only by one that goes on from it: who has less, or judges again what
was judged, changes nothing.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from coglab_bringup.arguments import package_folders, used_by
from coglab_bringup.commit import folder_seed, git, last_commit
from coglab_bringup.mutant import EQUIVALENT, Mutant, read_equivalent, told
from coglab_bringup.mutant_workspace import digest_of

KEPT = "docs/mutants.json"


def read_state(path: Path) -> dict[str, Any]:
    """The object in a JSON file; an empty one where there is none."""
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        return state if isinstance(state, dict) else {}
    except (OSError, ValueError):
        return {}


def write_whole(path: Path, content: dict[str, Any]) -> None:
    """A JSON file that is the old or the new one, whenever this process ends."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    new.replace(path)


def mutants_of(rows: list[dict[str, Any] | None]) -> list[Mutant | None]:
    """The changes as drawn; None: one that did not compile."""
    return [Mutant(**row) if row else None for row in rows]


def rows_of_state(state: dict[str, Any], digest: str) -> list[dict[str, Any] | None]:
    """What a state has judged of sources with this digest; nothing where it is of others, or cannot be read."""
    try:
        if state["digest"] == digest:
            mutants_of(state["drawn"])
            return list(state["drawn"])
    except (KeyError, TypeError):
        pass
    return []


def entry_of(top: Path, package: str, seed: int, digest: str) -> dict[str, Any]:
    """What is kept of a package, if it was drawn with this seed from sources with this digest; else nothing."""
    entry = read_state(top / KEPT).get(package)
    fits = isinstance(entry, dict) and entry.get("seed") == seed and rows_of_state(entry, digest)
    return entry if isinstance(entry, dict) and fits else {}


def further(kept: list[Any], here: list[Any]) -> list[Any]:
    """What counts of what is kept and what was judged here: the latter only where it goes on from the former."""
    return here if here[: len(kept)] == kept else kept


def own_seeds(top: Path, packages: list[str]) -> dict[str, int]:
    """The seed of each package's last commit; none of a package whose last commit is not known."""
    folders = package_folders(top / "catkin_ws" / "src")
    return {name: folder_seed(top, folders[name]) for name in packages if last_commit(top, folders[name])}


def _committed(top: Path, package: str) -> bool:
    """Whether what judges a package by its own tests is as committed; pages aside."""
    folders = package_folders(top / "catkin_ws" / "src")
    places = [str(folders[name]) for name in (package, *used_by(package, folders))]
    changed = git(top, "status", "--porcelain", "-uall", "--no-renames", "--", str(top / "coglab"), *places)
    return all(line.endswith(".md") for line in changed.splitlines())


def _entry_now(top: Path, package: str, seed: int, machine: str) -> dict[str, Any]:
    """The entry of a package, with what the state file here adds to it; empty if there is nothing."""
    digest, folder = digest_of(top, package), top / ".coglab" / "mutants"
    entry, path = entry_of(top, package, seed, digest), folder / f"{package}.{seed}.own.json"
    old = entry.get("drawn", [])
    here = rows_of_state(read_state(path), digest) if _committed(top, package) else []
    drawn = further(old, here)
    if drawn == old:
        return entry
    machines = entry["machine"].split("; ") if "machine" in entry else []
    times = read_state(folder / f"times.{package}.json")
    red = [name for name, seconds in times.get("times", {}).items() if seconds is None and times["digest"] == digest]
    return {
        "seed": seed,
        "digest": digest,
        "date": datetime.fromtimestamp(path.stat().st_mtime, UTC).strftime("%Y-%m-%d"),
        "machine": "; ".join(machines + [machine] * (machine not in machines)),
        "red": sorted({*entry.get("red", []), *red}),
        "drawn": drawn,
    }


def keep(top: Path, machine: str) -> None:
    """Writes docs/mutants.json anew: what is there and still fits, and what was judged here since."""
    before, folder = read_state(top / KEPT), top / ".coglab" / "mutants"
    names = [
        name
        for name in sorted(package_folders(top / "catkin_ws" / "src"))
        if name in before or any(folder.glob(f"{name}.*.own.json"))
    ]
    seeds = own_seeds(top, names)
    entries = {name: entry for name in seeds if (entry := _entry_now(top, name, seeds[name], machine))}
    if entries or (top / KEPT).exists():
        write_whole(top / KEPT, entries)


def survivors(top: Path) -> str:
    """What docs/figures.md says below the rows: each survivor that is kept and fits the sources, with file and line."""
    names = [name for name in package_folders(top / "catkin_ws" / "src") if name in read_state(top / KEPT)]
    judged: dict[str, list[Mutant]] = {}
    for name, seed in own_seeds(top, sorted(names)).items():
        drawn = mutants_of(entry_of(top, name, seed, digest_of(top, name)).get("drawn", []))
        judged |= {name: [mutant for mutant in drawn if mutant is not None]} if drawn else {}
    if not judged:
        return ""
    survived = {name: [m for m in mutants if m.verdict == "survived"] for name, mutants in judged.items()}
    counts = ", ".join(f"{name} {len(survived[name])} of {len(judged[name])}" for name in judged)
    every = [mutant for mutants in survived.values() for mutant in mutants]
    named = read_equivalent(top) if (top / EQUIVALENT).is_file() else []
    lines = [f"- `{what}`{why}" for what, why in told(every, named)]
    return "\n".join([f"What the package's own tests let survive, by {KEPT}: {counts}.", "", *lines]).strip()
