"""One fact, one place: who reads parameters, where the home posture is written, which words the neutral side uses."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
CPP_READ = re.compile(
    r"\bgetParam\w*\s*[(<]|(?:\.|->)param\s*[(<]|\bparam::(?:get|param|search)\w*\s*[(<]|\bsearchParam"
)
PYTHON_READ = re.compile(r"\brospy\.(?:get_param|search_param)\(")
# Beside coglab_rt/ros and coglab_py.parameters, and why.
OTHER_READERS = {
    "coglab_controllers/src/ros/dmp_controller_ros.cpp": "looks for a changed flag without asking the master",
    "coglab_sim/nodes/cell_node.cpp": "waits for what another node publishes as a parameter",
    "coglab_console/src/coglab_console/ros/commands.py": "shows all parameters there are",
    "coglab_bringup/src/coglab_bringup/ask.py": "a command beside the system, no node",
}
# What reads YAML otherwise than coglab_py.yaml_file, and why.
OTHER_YAML_READERS = {
    "coglab_bringup/src/coglab_bringup/handover.py": "an entry that the database has judged and answered with",
    "coglab_console/src/coglab_console/ros/knowledge.py": "what database and brain have judged before",
}
# What names an arm, its robot controller or its wire.
ARM_WORDS = re.compile(r"\b(?:FRI|KRC|KRL|KUKA|LWR|fri|krc|kuka)\b|\bdatagrams?\b")
# Where the two back ends are told apart, by name.
ARM_IS_CHOSEN = {"robot_node.cpp", "ideal_arm.cpp", "ideal_arm_ros.cpp"}


def code(*folders: str, suffixes: tuple[str, ...]) -> list[Path]:
    return sorted(p for folder in folders for p in SOURCES.glob(f"{folder}/**/*") if p.suffix in suffixes)


def test_parameters_of_ros_have_one_reader_in_each_language():
    cpp = code("*/src", "*/include", "*/nodes", suffixes=(".cpp", ".hpp"))
    python = code("*/src", "*/scripts", suffixes=(".py",))
    own = {"coglab_rt/include/coglab_rt/ros", "coglab_py/src/coglab_py"}
    found = {
        str(path.relative_to(SOURCES))
        for paths, pattern in ((cpp, CPP_READ), (python, PYTHON_READ))
        for path in paths
        if str(path.relative_to(SOURCES).parent) not in own and pattern.search(without_comments(path))
    }
    assert found == set(OTHER_READERS), found ^ set(OTHER_READERS)


def test_yaml_has_one_reader_in_python():
    paths = [p for p in code("*/src", "*/scripts", "*/*/src", suffixes=(".py",)) if p.name != "yaml_file.py"]
    otherwise = re.compile(r"\byaml\.(?:safe_|full_|unsafe_)?load\w*\(|\byaml\.\w*Loader\b")
    found = {str(path.relative_to(SOURCES)) for path in paths if otherwise.search(without_comments(path))}
    assert len(paths) > 150 and found == set(OTHER_YAML_READERS), found ^ set(OTHER_YAML_READERS)


def without_comments(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    return re.sub(r"//[^\n]*" if path.suffix in (".cpp", ".hpp") else r"#[^\n]*", "", text)


def numbers(text: str) -> list[float]:
    return [float(n) for n in re.findall(r"-?\d+\.\d+", text)]


def test_the_home_posture_is_that_of_the_machines_wherever_it_is_written():
    machines = yaml.safe_load((SOURCES / "coglab_smach" / "config" / "machines.yaml").read_text(encoding="utf-8"))
    home = machines["postures"]["home"]
    assert len(home) == 7
    # A header of a simulated arm has the posture where it begins: it reads no file of the machines.
    shipped = {
        "coglab_controllers/include/coglab_controllers/ideal/ideal_arm.hpp": "start_position",
        "coglab_controllers/include/coglab_controllers/testing/virtual_arm.hpp": "kHome",
        "coglab_sim/include/coglab_sim/cell_config.hpp": "home",
    }
    for name, variable in shipped.items():
        (written,) = re.findall(rf"\b{variable} =([^;]*)\.finished", (SOURCES / name).read_text(encoding="utf-8"))
        assert numbers(written) == home, name
    first = re.escape(str(home[0]))
    everywhere = [*code("*", suffixes=(".cpp", ".hpp", ".py", ".launch", ".yaml")), *TOP.glob("docs/*.md")]
    others = set()
    for path in everywhere:
        for rest in re.findall(rf"{first}F?,([^\]\}};]*)", path.read_text(encoding="utf-8")):
            given = numbers(rest)
            # Some tests leave a number out on purpose.
            assert given == home[1:] or path.name == "test_config.py", f"{path.relative_to(TOP)}: {given}"
            others.add(str(path.relative_to(SOURCES)) if SOURCES in path.parents else "docs")
    in_what_ships = {name for name in others if not {"test", "bench", "docs"} & set(Path(name).parts)}
    assert in_what_ships == {*shipped, "coglab_smach/config/machines.yaml"}, in_what_ships


def test_the_neutral_side_speaks_of_no_particular_arm():
    found = []
    neutral = code("coglab_rt/include", "ctrl_more/*", "coglab_controllers/include", "coglab_controllers/src",
                   suffixes=(".hpp", ".cpp"))  # fmt: skip
    for path in neutral:
        if path.name not in ARM_IS_CHOSEN and "test" not in path.parts:
            found += [f"{path.relative_to(SOURCES)}: {m}" for m in ARM_WORDS.findall(path.read_text(encoding="utf-8"))]
    found += [str(p) for p in code("coglab_rt/include", suffixes=(".hpp",)) if re.search("(?i)lwr", p.read_text())]
    assert len(neutral) > 150 and not found, found
