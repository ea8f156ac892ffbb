"""An invalid argument: one sentence with the valid values, before anything is installed or built."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from coglab_bringup.arguments import judge
from coglab_bringup.ask import COMMANDS, ask_parser
from coglab_bringup.launch_arguments import judge_launch, launch_arguments
from coglab_bringup.usage import Refused

TOP = Path(__file__).resolve().parents[4]
ABSENT = "coglab-test-no-such-package"

REFUSED = {
    "demo --seed -1": "0 to 2147483647",
    "demo --out /proc/x": "/proc/x",
    "test nosuch": "coglab, coglab_bringup, ",
    "test --out /usr": "/usr",
    "bench nosuch": "console, contact, dynamics",
    "launch bogus:=1": "sim, split",
    "launch object:=xyz": "ball, bottle, mug, screwdriver, tea_box",
    "launch objects:=/nope": "/nope",
    "launch fri_period:=nan": "0.001 to 0.1",
    "launch krl_convention:=x": "coglab, centro_epiaggio, stanford, rcprg_tum, rtt_lwr",
    "console": "picture",
    "launch arm:=steel": "fri, ideal",
    "launch arm:=ideal split:=true": "one process",
    "launch -p high": "11411",
    "install vizz": "run, build, test, tools, browser, viz",
    "shell nosuchcmd": "'nosuchcmd'",
    "object paint": "new, check, list",
    "status now": "unrecognized arguments: now",
    "start take mug cup": "delivery:=NAME",
}


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """The sources with a list of packages that are not installed: any installing or building would be noticed."""
    top = tmp_path_factory.mktemp("bare")
    shutil.copy(TOP / "coglab", top)
    (top / "debian-packages.txt").write_text(
        "".join(f"{group}: {ABSENT}\n" for group in ("run", "build", "test", "tools", "browser", "viz"))
    )
    (top / "catkin_ws" / "devel").mkdir(parents=True)
    (top / "catkin_ws" / "src").symlink_to(TOP / "catkin_ws" / "src")
    (top / "catkin_ws" / "devel" / "setup.bash").write_text("exit 99\n")
    return top


def run(top: Path, words: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [top / "coglab", *words.split()],
        text=True,
        timeout=600,
        check=False,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, "ROS_PACKAGE_PATH": "", "CMAKE_PREFIX_PATH": "", "PYTHONPATH": ""},
    )


@pytest.mark.parametrize("words", REFUSED)
def test_invalid_arguments_are_refused_with_the_valid_values(words):
    command, *rest = words.split()
    with pytest.raises(Refused) as refusal:
        ask_parser(command).parse_args(rest) if command in COMMANDS else judge(TOP, command, rest)
    assert REFUSED[words] in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "words", ["demo --out /proc/x", "launch bogus:=1", "install vizz", "shell nosuchcmd", "status now"]
)
def test_refused_before_anything_is_done(bare, words):
    ended = run(bare, words)
    assert ended.returncode == 2, ended.stdout
    (line,) = ended.stdout.splitlines()
    assert line.startswith("[coglab] error: ") and REFUSED[words] in line
    assert not (bare / ".coglab").exists() and not (bare / "out").exists()


def test_results_need_space(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9 - 10**7, 10**7))
    with pytest.raises(Refused, match=f"{tmp_path} .*10 MB"):
        judge(TOP, "demo", ["--out", str(tmp_path / "results")])
    assert not (tmp_path / "results").exists()


def test_an_unknown_group_is_refused_where_python_is_missing_too(tmp_path):
    """The check of arguments is a Python program, and a bare machine has no Python yet."""
    for name in ("coglab", "debian-packages.txt"):
        shutil.copy(TOP / name, tmp_path)
    ended = subprocess.run(
        [tmp_path / "coglab", "install", "run", "vizz"], capture_output=True, text=True, timeout=600, check=False
    )
    assert ended.returncode == 2 and "installed" not in ended.stderr
    assert "browser build docs film run test tools viz" in ended.stderr


HELP = {
    "demo": "--seed SEED",
    "launch": "fri_period:=0.005",
    "build": "./coglab build",
    "shell": "[COMMAND ...]",
    "extras": "[COMMAND ...]",
    "install": "[GROUP ...]",
    "doctor": "./coglab doctor",
    "docs": "./coglab docs",
    "hand": "hand trace",
    "controller": "controller run",
    "object": "object new|check|list",
    "console": "console picture",
    "completion": "eval",
}


@pytest.mark.parametrize("command", HELP)
def test_help_does_nothing_else(bare, command):
    ended = run(bare, f"{command} --help")
    assert ended.returncode == 0 and HELP[command] in ended.stdout
    assert not (bare / ".coglab").exists()


def test_every_value_of_the_launch_files_is_accepted():
    """The lists of valid values are read from their definitions."""
    sources = TOP / "catkin_ws" / "src"
    defaults = launch_arguments(sources)
    judge_launch(TOP, [f"{name}:={value}" for name, (value, _) in defaults.items()])
    for convention in defaults["krl_convention"][1].partition(": ")[2].split(", "):
        judge_launch(TOP, [f"krl_convention:={convention}"])
    for entry in (sources / "coglab_objects" / "objects").glob("*.yaml"):
        judge_launch(TOP, [f"object:={entry.stem}"])
