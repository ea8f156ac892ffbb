"""The rooms of the library stand on one another in one order, and no file leads back to itself."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
# From the bottom to the top: a room includes itself and those before it.
ROOMS = ["log", "states", "description", "docs", "controller", "loading", "cycle", "manager"]
# What authors include; nothing inside does.
FRONT_DOORS = {"feedback_controller.hpp", "feedback_controllers_manager.hpp", "central_module.hpp"}
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def sources(package: Path) -> dict[str, tuple[str, list[str]]]:
    """Room and includes of each file, by the name under which it is included."""
    found = {}
    for root, prefix in ((package / "include" / "ctrl_more", "ctrl_more/"), (package / "src", "")):
        for path in sorted(root.glob("*/*.?pp")):
            name = f"{prefix}{path.parent.name}/{path.name}"
            found[name] = (path.parent.name, INCLUDE.findall(path.read_text()))
    return found


def faults(package: Path) -> list[str]:
    """Arrows back up, ways around the rooms, and circles: one sentence each."""
    files = sources(package)
    found = [
        f"{name} is in the room '{room}', which is not in the order"
        for name, (room, _) in files.items()
        if room not in ROOMS
    ]
    for name, (room, includes) in files.items():
        for include in includes:
            if include not in files:
                found.append(f"{name} includes {include}, which is in no room")
            elif ROOMS.index(files[include][0]) > ROOMS.index(room):
                found.append(f"{name} includes {include}, which is above it")
            elif name.startswith("ctrl_more/") and not include.startswith("ctrl_more/"):
                found.append(f"the public {name} includes {include}, which is not installed")
    return found + circles({name: [i for i in includes if i in files] for name, (_, includes) in files.items()})


def circles(files: dict[str, list[str]]) -> list[str]:
    """Files that include themselves by way of others."""
    found: list[str] = []
    done: set[str] = set()

    def walk(name: str, way: list[str]) -> None:
        if name in way:
            found.append(" -> ".join([*way[way.index(name) :], name]))
        elif name not in done:
            for include in files[name]:
                walk(include, [*way, name])
            done.add(name)

    for name in files:
        walk(name, [])
    return found


def test_arrows_run_down() -> None:
    assert not faults(PACKAGE)
    rooms = {room for room, _ in sources(PACKAGE).values()}
    assert rooms == set(ROOMS)


def test_front_doors_are_the_only_headers_outside_of_a_room() -> None:
    doors = {path.name for path in (PACKAGE / "include" / "ctrl_more").glob("*.hpp")}
    assert doors == FRONT_DOORS
    assert not list((PACKAGE / "src").glob("*.?pp"))


def test_an_arrow_back_up_and_a_circle_are_found(tmp_path: Path) -> None:
    def write(name: str, *includes: str) -> None:
        path = tmp_path / "include" / "ctrl_more" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("".join(f'#include "{include}"\n' for include in includes))

    write("log/a.hpp", "ctrl_more/states/b.hpp")
    write("states/b.hpp", "ctrl_more/states/c.hpp", "ctrl_more/manager.hpp")
    write("states/c.hpp", "ctrl_more/states/b.hpp", "cycle/guard.hpp")
    text = "\n".join(faults(tmp_path))
    assert "log/a.hpp includes ctrl_more/states/b.hpp, which is above it" in text
    assert "includes ctrl_more/manager.hpp, which is in no room" in text
    assert "ctrl_more/states/b.hpp -> ctrl_more/states/c.hpp -> ctrl_more/states/b.hpp" in text
