"""Every line that README, tour and how-to print belongs to a test that runs it, and what is cheap runs here.

The others: on a running system in test_printed_lines_long.py (./coglab test --long). Lines for hardware cannot run
without it; their launch files and arguments are resolved here, which starts nothing.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import test_printed_lines_long
from coglab_bringup.arguments import judge
from printed_lines import TOP, printed_block, printed_files, printed_lines

# Where a line runs: the first rule whose page and pattern fit. "entry": the argument check here and the tests of the
# commands themselves; "system": test_printed_lines_long.py; "hardware": resolved here.
RULES = [
    (r"how_to", r"sudo setcap|/dev/ttyUSB0|192\.168|position: \[\.\.\.\]", "hardware"),
    (r"how_to", r"cmake -S wrist_damper .*PREFIX", "entry"),  # ctrl_more's test of the template
    (r"", r"\./coglab shell python3 \w+\.py", "here"),
    (r"", r"\./coglab (shell|start|status|hold)\b", "system"),
    (r"", r"\./coglab |docker/(test|run)\b", "entry"),
    (
        r"",
        r"export ROS_MASTER_URI=\.\.\.|\. catkin_ws/devel/setup\.bash|ros(topic|service|node|param|run|launch) ",
        "system",
    ),
]


def where(line) -> str:
    """The test that a line belongs to; empty if there is none."""
    return next(
        (
            kind
            for page, pattern, kind in RULES
            if re.search(page, line.page)
            and re.match(pattern, line.command)
            or kind == "hardware"
            and re.search(page, line.page)
            and re.search(pattern, line.command)
        ),
        "",
    )


LINES = printed_lines()


def test_every_printed_line_belongs_to_a_test():
    assert len(LINES) > 60, "the pages were not read"
    assert [line for line in LINES if not where(line)] == []


def test_every_line_of_a_running_system_stands_in_a_section_that_is_read_aloud():
    """By name in a test of test_printed_lines_long.py, which takes all lines of a section."""
    text = (Path(__file__).parent / "test_printed_lines_long.py").read_text(encoding="utf-8")
    read = set(re.findall(r'"([^"\n]+)"', text))
    sections = {(line.page, line.section) for line in LINES if where(line) == "system"} - {("docs/how_to.md", "How to")}
    assert [
        section for _, section in sorted(sections) if not any(section.startswith(r) for r in read if len(r) > 2)
    ] == []


def test_what_needs_hardware_has_a_stand_in_with_a_reason():
    stand_ins = test_printed_lines_long.STAND_INS
    hardware = {line.command for line in LINES if where(line) == "hardware" and line.command.startswith("roslaunch")}
    assert hardware == set(stand_ins) and all(reason for _, reason in stand_ins.values())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A working folder in which the files that the pages name lie."""
    place = tmp_path_factory.mktemp("pages")
    (place / "catkin_ws").symlink_to(TOP / "catkin_ws")
    for file in printed_files():
        (place / file.name).write_text(file.text)
    t = np.linspace(0.0, 1.5, 150)
    s = 10 * (t / 1.5) ** 3 - 15 * (t / 1.5) ** 4 + 6 * (t / 1.5) ** 5
    rows = np.column_stack([t, 0.3 + 0.4 * s, 0.1 * s, 0.3 + 0.2 * np.sin(np.pi * s)])
    np.savetxt(place / "reach.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    for name in ("patterns.json", "reach.bag"):
        (place / name).touch()
    return place


@pytest.mark.parametrize("command", sorted({line.command for line in LINES if line.command.startswith("./coglab ")}))
def test_the_arguments_of_every_coglab_line_are_taken(command, folder, monkeypatch):
    monkeypatch.setenv("PWD", str(folder))
    for part in command.split(" && "):
        if " test " in part:  # packages made by the line before
            part = part.replace("wrist_damper", "ctrl_more").replace("side_sway", "coglab_controllers")
        words = shlex.split(os.path.expandvars(part))[1:]
        words = [
            "object:=mug" if word == "object:=cup" else word for word in words
        ]  # put there by the page's own recipe
        if words[0] not in ("help", "docs"):
            judge(TOP, words[0], words[1:])


@pytest.mark.parametrize(
    "name, said", [("learn.py", "reach_high"), ("machine.py", "preempted 5.0"), ("show.py", "succeeded after")]
)
def test_the_printed_programs_run(name, said, folder):
    ended = subprocess.run(
        [sys.executable, name],
        cwd=folder,
        text=True,
        timeout=120,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert ended.returncode == 0 and said in ended.stdout, ended.stdout


@pytest.mark.parametrize(
    "command",
    sorted({line.command for line in LINES if where(line) == "hardware" and line.command.startswith("roslaunch")})
    + ["roslaunch lab.launch"],
)
def test_launch_files_resolve(command, folder):
    import rospkg
    from roslaunch.config import load_config_default

    words = [word for word in command.split()[1:] if ":=" not in word]
    arguments = [word for word in command.split() if ":=" in word]
    (folder / "feedback.yaml").write_text("loadControllers: []\n")
    file = folder / words[0] if len(words) == 1 else Path(rospkg.RosPack().get_path(words[0])) / "launch" / words[1]
    declared = file.read_text()
    for argument in arguments:
        assert f'<arg name="{argument.partition(":=")[0]}"' in declared
    (folder / "my_primitives.xml").touch()
    assert load_config_default([(str(file), arguments)], None, verbose=False).nodes


def test_the_printed_feedback_list_is_whole():
    """ctrl_more itself reads it in test_printed_lines_long.py, once the controller that it names is built."""
    text = printed_block("docs/how_to.md", "Your own feedback controller", "yaml")
    import yaml

    listed = yaml.safe_load(text)
    loaded = listed["loadControllers"]
    assert "wrist_damper" in loaded and all("type" in listed[name] for name in loaded)
    assert all(name in loaded for profile in listed["profiles"].values() for name in profile)
