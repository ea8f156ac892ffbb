"""What the packages' READMEs and the other pages print to be typed: each line is what its tool takes.

README, tour and how-to are run (test_printed_lines.py, test_printed_lines_long.py). Here nothing is started: words go
through the tools' own parsers, launch files are resolved, requests and messages are filled, names of services and
topics stand in docs/reference.md, programs compile.
"""

import ast
import re
import shlex
import subprocess
from pathlib import Path

import genpy
import pytest
import roslib.message
import rospkg
import yaml
from coglab_bringup.arguments import judge
from printed_lines import PAGES, TOP, blocks

OTHERS = sorted(
    str(page.relative_to(TOP))
    for page in [*TOP.glob("catkin_ws/src/**/README.md"), *TOP.glob("docs/*.md"), TOP / "CONTRIBUTING.md"]
    if str(page.relative_to(TOP)) not in PAGES
)
DRAWN = {  # blocks that nobody types
    ("catkin_ws/src/lwr_fri_bridge/README.md", "lwr_fri_bridge"),
    ("docs/limits_under_loss.md", "The budget"),
}
SHOWN = [
    (page, section, language, text)
    for page in OTHERS
    for section, language, text in blocks(page)
    if (page, section) not in DRAWN
]
PLACEHOLDERS = {"PACKAGE": "coglab_sim", "NAME": "fri", "...": "", "FILE": "trials.jsonl", "FOLDER": "sessions"}


def named_in_reference(name: str) -> str:
    """The second column of the row about a service or topic: by its whole name, or by the end of it."""
    rows = re.findall(r"^\| ((?:`[^`]+`(?:, )?)+) \| ([^|]+) \|", (TOP / "docs/reference.md").read_text(), flags=re.M)
    known = {f"/{one.strip('/')}": kind for names, kind in rows for one in re.findall(r"`([^` ]+)`", names)}
    ends = [one for one in known if name.endswith(one)]
    assert ends, f"{name}: no row of docs/reference.md"
    return known[max(ends, key=len)]


def filled(message: object, words: list[str]) -> None:
    """As rosservice and rostopic fill it; raises what they show."""
    genpy.message.fill_message_args(message, [yaml.safe_load(word) for word in words])


def judge_rosservice(words: list[str]) -> None:
    """rosservice call NAME [ARGUMENT ...]"""
    assert words[0] == "call"
    kind = named_in_reference(words[1]).strip().split()
    assert kind[0] == "service,", f"{words[1]}: {kind}"
    name = kind[1] if "/" in kind[1] else f"coglab_msgs/{kind[1]}"
    filled(roslib.message.get_service_class(name)._request_class(), words[2:])


def judge_rostopic(words: list[str]) -> None:
    """rostopic echo NAME, rostopic pub [OPTION ...] NAME TYPE ARGUMENT"""
    names = [word for word in words[1:] if word.startswith("/")]
    assert words[0] in ("echo", "hz", "pub") and len(names) == 1
    named_in_reference(names[0])
    if words[0] == "pub":
        kind, *arguments = words[words.index(names[0]) + 1 :]
        arguments = [one.replace("header: auto", "header: {}") for one in arguments]  # -s fills it in
        filled(roslib.message.get_message_class(kind)(), arguments)


def judge_roslaunch(words: list[str]) -> None:
    """roslaunch PACKAGE FILE [NAME:=VALUE ...]"""
    from roslaunch.config import load_config_default

    file = Path(rospkg.RosPack().get_path(words[0])) / "launch" / words[1]
    for argument in words[2:]:
        assert f'<arg name="{argument.partition(":=")[0]}"' in file.read_text(), argument
    there = [word for word in words[2:] if "$PWD" not in word]  # files of the reader's are not here
    assert load_config_default([(str(file), there)], None, verbose=False).nodes


def judge_rosparam(words: list[str]) -> None:
    """rosparam set NAME VALUE"""
    assert words[0] == "set" and words[1].startswith("/") and len(words) == 3
    yaml.safe_load(words[2])
    assert words[1].rpartition("/")[2] in (TOP / "docs/reference.md").read_text()


def judge_coglab(words: list[str]) -> None:
    """./coglab COMMAND [WORD ...], and the program that a shell runs"""
    words = [word for word in (PLACEHOLDERS.get(word, word) for word in words) if word]
    judge(TOP, words[0], words[1:])
    if words[:2] == ["shell", "rosrun"]:
        found = list(Path(rospkg.RosPack().get_path(words[2])).rglob(words[3]))
        assert found, words[3]
    if words[:2] == ["shell", "python3"]:
        options = (TOP / words[2]).read_text()
        assert all(f'"{word.strip("[]")}"' in options for word in words if word.strip("[]").startswith("--"))


JUDGES = {
    "./coglab": judge_coglab,
    "rosservice": judge_rosservice,
    "rostopic": judge_rostopic,
    "roslaunch": judge_roslaunch,
    "rosparam": judge_rosparam,
}
SHELL = re.compile(r"python3 -c|link=|page=|key=|curl |for r in")
ELSEWHERE = {  # who runs it
    ".ci/run": "test_test_runner.py",
    "sudo setcap": "test_printed_lines.py: needs the rights that it gives",
    "rosbag record -O reach.bag /tf": "test_printed_lines_long.py, in another form",
}


def judge_line(line: str) -> None:
    """One printed line, without its comment."""
    line = re.sub(r"^(?:[A-Z_]+=\S+ )+", "", line)
    words = shlex.split(re.sub(r"\$\(rospack find (\w+)\)", lambda m: rospkg.RosPack().get_path(m.group(1)), line))
    assert words[0] in JUDGES, f"nothing judges: {line}"
    JUDGES[words[0]](words[1:])


def printed(text: str) -> list[str]:
    """The lines of a block, without comments."""
    lines = [re.sub(r"(^|\s+)# .*$", "", raw).strip() for raw in text.splitlines()]
    return [line for line in lines if line]


def test_the_pages_are_read():
    assert {Path(page).parts[2] for page, *_ in SHOWN if page.startswith("catkin_ws")} >= {
        "coglab_controllers",
        "coglab_sim",
        "coglab_smach",
        "lwr_fri_bridge",
    }
    lines = [line for *_, language, text in SHOWN if not language for line in printed(text)]
    assert len(lines) > 40


@pytest.mark.parametrize(
    "page, section, text", [(page, section, text) for page, section, language, text in SHOWN if not language]
)
def test_a_line_to_type_is_what_its_tool_takes(page, section, text):
    for line in printed(text):
        if not SHELL.match(line) and not any(line.startswith(begin) for begin in ELSEWHERE):
            judge_line(line)
    if any(SHELL.match(line) for line in printed(text)):
        assert subprocess.run(["bash", "-n", "-c", text], capture_output=True, timeout=30, check=False).returncode == 0


@pytest.mark.parametrize(
    "page, section, text", [(page, section, text) for page, section, language, text in SHOWN if language == "python"]
)
def test_a_program_that_is_shown_compiles(page, section, text):
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom | ast.Import):
            exec(compile(ast.Module([node], []), page, "exec"), {})


@pytest.mark.parametrize(
    "line",
    [
        "rosservice call /coglab/start '{action: reset, objekt: mug}'",
        "rosservice call /coglab/begin '{action: reset}'",
        "rosservice call /coglab/transitions",
        "rostopic echo /coglab/transition",
        "rostopic pub /lwr/target_joint_states sensor_msgs/JointState '{speed: [0.1]}'",
        "roslaunch coglab_sim cell.launch bogus:=1",
        "roslaunch coglab_sim cells.launch",
        "./coglab bench nosuch",
        "./coglab shell rosrun coglab_console console_sessions.py",
        "rosnode cleanup",
    ],
)
def test_a_line_that_would_fail_is_found(line):
    with pytest.raises(Exception):  # noqa: B017  each tool has its own
        judge_line(line)
