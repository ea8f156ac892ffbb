"""The phases of an action, from the structure that its state machine publishes. No ROS here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

RECOVERY = "recover"
"""the container that an action enters after a failure: no phase of an action that nobody disturbs"""


def phases_of(structure: Mapping[str, Sequence[str]], action: str) -> tuple[list[str], list[str]]:
    """Paths of the innermost states of an action, in the order of the machine: those of the action itself, and those of
    its recovery, which are no phases of an action that nobody disturbs. `structure`: children by the path of their
    container. KeyError where no container has that name."""
    root = next((path for path in structure if path.endswith(f"/{action}")), None)
    if root is None:
        raise KeyError(f"expected a container {action}, got {', '.join(sorted(structure)) or 'none'}")
    found: list[str] = []
    aside: list[str] = []

    def look(path: str, into: list[str]) -> None:
        for label in structure[path]:
            child = f"{path}/{label}"
            below = aside if label == RECOVERY else into
            if child in structure:
                look(child, below)
            else:
                below.append(child)

    look(root, found)
    return found, aside


def on_the_way(phases: Sequence[str], passed: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those phases that an action nobody disturbed has passed, and those that need an incident or another object."""
    seen = set(passed)
    return [path for path in phases if path in seen], [path for path in phases if path not in seen]
