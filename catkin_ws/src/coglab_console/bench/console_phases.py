"""The phases of an action, from the structure that its state machine publishes. No ROS here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

RECOVERY = "recover"
"""the container that an action enters after a failure: no phase of an action that nobody disturbs"""


def phases_of(structure: Mapping[str, Sequence[str]], action: str) -> list[str]:
    """Paths of the innermost states of an action, in the order of the machine. `structure`: children by the path of
    their container. KeyError where no container has that name."""
    root = next((path for path in structure if path.endswith(f"/{action}")), None)
    if root is None:
        raise KeyError(f"expected a container {action}, got {', '.join(sorted(structure)) or 'none'}")
    found: list[str] = []

    def look(path: str) -> None:
        for label in structure[path]:
            child = f"{path}/{label}"
            if label == RECOVERY:
                continue
            if child in structure:
                look(child)
            else:
                found.append(child)

    look(root)
    return found


def on_the_way(phases: Sequence[str], passed: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those phases that an action nobody disturbed has passed, and those that need an incident or another object."""
    seen = set(passed)
    return [path for path in phases if path in seen], [path for path in phases if path not in seen]
