"""debian-packages.txt holds nothing that nothing uses: each package has a file that this repository names."""

import ast
import re
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path

import pytest
from coglab_bringup.doctor import installed, package_groups

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
GROUPS = package_groups(TOP)

# Used though no file of theirs is named here: metapackages, and what others need of them.
UNNAMED = {
    "ros-core": "roscore, rospy and the ROS tools as a whole",
    "ros-message-generation": "the dependency message_generation of the message packages",
    "python3-dev": "headers of Python, which pybind11 includes",
    "python3-setuptools": "the setup.py of each Python package, which catkin runs",
    "python3-venv": "python3 -m venv of ./coglab for the oracles",
    "libtinyxml-dev": "CMake files of urdfdom, which kdl_parser brings, name its library",
    "libgtest-dev": "catkin_add_gtest builds gtest from its sources",
    "libjs-three": "scene3d.js of the console, served from where Debian puts it",
    "libjs-dygraphs": "charts.js of the console, served from where Debian puts it",
    "joint-state-publisher-gui": "lwr_description's display.launch, on a screen",
    "rviz": "lwr_description's display.launch and coglab.launch, on a screen",
}


def texts(*suffixes: str) -> str:
    """Everything in files of these kinds."""
    found = [path for path in SOURCES.rglob("*") if path.suffix in suffixes and path.is_file()]
    return "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in found)


@lru_cache
def imported() -> set[str]:
    """Top-level names of the Python modules that are imported anywhere."""
    names: set[str] = set()
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.split(".")[0])
    return names


@lru_cache
def included() -> set[str]:
    """Headers that C++ files include, as they name them."""
    return set(re.findall(r"#include <([^>]+)>", texts(".cpp", ".hpp", ".h", ".in")))


@lru_cache
def ros_packages() -> set[str]:
    """ROS packages that manifests, CMake and launch files name."""
    names = set(re.findall(r"<\w*depend\w*>([^<]+)<", texts(".xml")))
    names |= set(re.findall(r"\b(?:pkg|find)[= (]+\"?(\w+)", texts(".launch", ".test")))
    components = re.findall(r"(?:COMPONENTS|DEPENDENCIES)\s+([^)]*)", texts(".txt"))
    return names | set(re.findall(r"\w+", " ".join(components)))


@lru_cache
def words() -> set[str]:
    """Words of what starts programs: the command, the containers, scripts, tests and CMake files."""
    text = texts(".py", ".txt", ".sh", ".launch", ".test", ".xml", ".md")
    for name in ("coglab", "docker/Dockerfile", "docker/test", "docker/run", "docs/how_to.md", "docs/tour.md"):
        text += (TOP / name).read_text(encoding="utf-8")
    return set(re.findall(r"[\w+.-]+", text))


@lru_cache
def lower_words() -> set[str]:
    return {word.lower() for word in words()}


def use_of(package: str) -> str:
    """What this repository names of a package; empty if nothing."""
    listed = subprocess.run(["dpkg", "-L", package], capture_output=True, text=True, check=True).stdout.splitlines()
    for path in listed:
        parts = ["", "", "", *path.strip("/").split("/")]
        name = parts[-1]
        if "dist-packages" in parts and parts[-2] == "dist-packages" and name.split(".")[0] in imported():
            return f"import {name.split('.')[0]}"
        if "/include/" in path and any(path.endswith(f"/{header}") for header in included()):
            return f"#include {name}"
        if name == "package.xml" and parts[-2] in ros_packages():
            return f"ROS package {parts[-2]}"
        if parts[-2] in ("msg", "srv", "action") and parts[-3] in ros_packages():
            return f"definitions of ROS package {parts[-3]}"
        if ("/bin/" in path or parts[3:5] == ["usr", "lib"] and len(parts) == 7) and name in words():
            return f"program {name}"
        if name.endswith((".cmake", ".pc")) and re.split(r"Config|-config|\.", name)[0].lower() in lower_words():
            return f"CMake package {name}"
    return ""


@pytest.mark.skipif(shutil.which("dpkg") is None, reason="dpkg is not installed: this is no Debian")
@pytest.mark.parametrize("package", sorted({name for names in GROUPS.values() for name in names}))
def test_every_package_is_used(package):
    if package in UNNAMED:
        return
    if package not in installed([package]):
        pytest.skip(f"{package} is not installed here: ./coglab install")
    assert use_of(package), f"nothing of {package} is named anywhere; take it out of debian-packages.txt"


def test_what_is_excused_is_in_the_list():
    assert set(UNNAMED) <= {name for names in GROUPS.values() for name in names}


def test_no_package_is_listed_twice():
    every = [name for names in GROUPS.values() for name in names]
    assert len(every) == len(set(every))


def test_what_nodes_import_is_installed_to_run():
    """A module that only tests need may come with the group test."""
    shipped = {name for path in SOURCES.glob("*/src/**/*.py") for name in imports_of(path)}
    shipped |= {name for path in SOURCES.glob("*/scripts/*.py") for name in imports_of(path)}
    for package in GROUPS["test"]:
        if package in installed([package]) and package.startswith("python3-"):
            listed = subprocess.run(["dpkg", "-L", package], capture_output=True, text=True, check=True).stdout
            provided = set(re.findall(r"dist-packages/(\w+)(?:\.py)?$", listed, re.M))
            assert not provided & shipped, f"{package} is needed to run: {provided & shipped}"


def imports_of(path: Path) -> set[str]:
    """Top-level names that one file imports at its head."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


def test_the_target_of_the_first_demo_holds_what_a_launched_system_runs():
    cmake = (SOURCES / "coglab_bringup" / "CMakeLists.txt").read_text(encoding="utf-8")
    listed = set(re.search(r"foreach\(target ([^)]*)\)", cmake)[1].split())
    feedback = (SOURCES / "ctrl_more" / "config" / "feedback.yaml").read_text(encoding="utf-8")
    plugins = set(re.findall(r"lib(\w+)\.so", feedback))
    launch = "".join(p.read_text(encoding="utf-8") for p in SOURCES.glob("*/launch/*.launch"))
    nodes = set(re.findall(r'type="(\w+_node)"', launch)) - {"lwr_node", "controller_manager_node", "goal_helper_node"}
    messages = {
        f"{p.parent.name}_generate_messages" for p in SOURCES.rglob("package.xml") if (p.parent / "msg").is_dir()
    }
    assert plugins and nodes == {"robot_node", "cell_node"} and len(messages) == 2
    # What the launch and its Python programs load besides: session.test asserts that nothing is missing.
    assert listed == plugins | nodes | messages | {"coglab_controllers_python", "coglab_sim_plant_python"}
    # The plug-ins of the manager, which nobody links, come with its node.
    controllers = (SOURCES / "coglab_controllers" / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "add_dependencies(robot_node coglab_dmp_controller coglab_ptp_controller)" in controllers
