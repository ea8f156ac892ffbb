#!/usr/bin/python3
"""Makes a new feedback controller from the template: code, configuration, list file and test.

    new_controller.py [--motion] NAME --into DIR

NAME is the type in CamelCase (for example WristDamper). DIR/wrist_damper is made with a CMake
project that builds alone or in a catkin workspace, compiles at once, and has a passing test.
With --motion it is a motion of the arm for coglab_controllers instead: a catkin package, from the
template of that package.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

PLACEHOLDERS = ("@TYPE@", "@name@")


def snake_case(name: str) -> str:
    """WristDamper -> wrist_damper; the same rule by which libraries are found by type."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def template_folder(package: str = "ctrl_more") -> Path:
    """The template of a package: beside this script's package in the source tree, or installed."""
    here = Path(__file__).resolve().parent
    places = (
        here.parent.parent / package / "template",
        here.parent / "template",
        here.parent.parent / "share" / package / "template",
    )
    for folder in places:
        if folder.is_dir() and (package == "ctrl_more" or folder.parent.name == package):
            return folder
    raise FileNotFoundError(f"the template was expected at {places[0]}; reinstall {package}")


def make_controller(name: str, into: Path, template: Path | None = None) -> Path:
    """Writes the new controller and returns its folder; raises ValueError or FileExistsError."""
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*[a-z][A-Za-z0-9]*", name):
        raise ValueError(f"a controller's name is CamelCase, letters and digits, like WristDamper; got '{name}'")
    if not into.is_dir():
        raise FileNotFoundError(f"there is no folder {into}; make it first")
    snake = snake_case(name)
    target = into / snake
    if target.exists():
        raise FileExistsError(f"{target} exists already; choose another name or remove it")
    template = template or template_folder()
    files = sorted(path for path in template.rglob("*") if path.is_file())
    target.mkdir()
    for source in files:
        relative = str(source.relative_to(template))
        for key, value in zip(PLACEHOLDERS, (name, snake), strict=False):
            relative = relative.replace(key, value)
        text = source.read_text(encoding="utf-8")
        for key, value in zip(PLACEHOLDERS, (name, snake), strict=False):
            text = text.replace(key, value)
        destination = target / relative.removesuffix(".in")
        destination.parent.mkdir(parents=True, exist_ok=True)
        destination.write_text(text, encoding="utf-8")
        destination.chmod(source.stat().st_mode)
    return target


def next_steps(target: Path, motion: bool = False) -> list[str]:
    """Commands that build and test the new controller: those of the workspace it lies in, else plain CMake."""
    workspace = target.resolve().parent.parent
    if target.resolve().parent.name == "src" and (workspace.parent / "coglab").is_file():
        return [f"./coglab build && ./coglab test {target.name}"]
    if motion:
        place = str(workspace) if target.resolve().parent.name == "src" else "WORKSPACE"
        return [
            f"catkin_make -C {place}",
            f". {place}/devel/setup.bash",
            f"rostest {target.name} {target.name}.test",
        ]
    return [
        f"cmake -S {target} -B {target}/build && cmake --build {target}/build",
        f"ctest --test-dir {target}/build --output-on-failure",
    ]


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", help="type of the controller in CamelCase, for example WristDamper")
    parser.add_argument("--into", type=Path, default=Path("."), help="folder to make it in")
    parser.add_argument("--motion", action="store_true", help="a motion of the arm, for coglab_controllers")
    arguments = parser.parse_args()
    try:
        package = "coglab_controllers" if arguments.motion else "ctrl_more"
        target = make_controller(arguments.name, arguments.into, template_folder(package))
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"made {target}; build and test it:")
    for line in next_steps(target, arguments.motion):
        print(f"  {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
