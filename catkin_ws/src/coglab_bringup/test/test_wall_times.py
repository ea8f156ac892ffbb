"""What ./coglab records of installation, build and first demo: only what one command did, never sums of several."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from coglab_bringup.run_directory import record_times
from coglab_bringup.sources import sources_of, wall_sources

TOP = Path(__file__).resolve().parents[4]
SET_UP = {
    "COGLAB_INSTALL_SECONDS": "70",
    "COGLAB_INSTALLED": "120 of 140",
    "COGLAB_BUILD_SECONDS": "300",
    "COGLAB_FIRST_BUILD": "yes",
}
# Without what the command that runs these tests has measured, and without a compiler cache.
HERE = {k: v for k, v in os.environ.items() if k not in SET_UP and "COMPILER_LAUNCHER" not in k}
PRINT = "import os; print({k: v for k, v in os.environ.items() if k.startswith('COGLAB_')})\n"


@pytest.fixture
def checkout(tmp_path):
    """The command, with nothing built; what runs after installing prints what was measured."""
    shutil.copy(TOP / "coglab", tmp_path)
    (tmp_path / "debian-packages.txt").write_text("run: bash\nbuild: bash\n")
    tools = tmp_path / "catkin_ws" / "src" / "coglab_bringup" / "src" / "coglab_bringup"
    tools.mkdir(parents=True)
    (tools / "process_tree.py").write_text(PRINT)
    return tmp_path


def run(*command: str | Path, **environment: str) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        env={**HERE, **environment},
        text=True,
        timeout=60,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def with_program(path: str, script: Path, *command: str | Path, **environment: str) -> str:
    """Runs a command where the program at `path` is our script."""
    script.chmod(0o755)
    words = 'mount --bind "$1" "$2" && shift 2 && exec "$@"'
    return run("unshare", "--mount", "sh", "-c", words, "sh", script, path, *command, **environment)


MAY_MOUNT = subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode == 0
needs_mount = pytest.mark.skipif(not MAY_MOUNT, reason="`unshare --mount` does not run here: not root")


def test_a_check_that_installs_nothing_records_no_installation(checkout):
    said = run(checkout / "coglab", "demo", **SET_UP)
    assert "INSTALL" not in said and "BUILD" not in said, "nor what an outer command has measured"


@needs_mount
def test_an_installation_is_recorded_with_how_many_were_missing(checkout):
    (checkout / "debian-packages.txt").write_text("run: bash coglab-test-no-such-package\nbuild: bash\n")
    apt = checkout / "apt-get"
    apt.write_text("#!/bin/sh\nsleep 0.1\n")
    said = with_program("/usr/bin/apt-get", apt, checkout / "coglab", "demo")
    assert "'COGLAB_INSTALLED': '1 of 2'" in said
    assert "'COGLAB_INSTALL_SECONDS': '1'" in said or "'COGLAB_INSTALL_SECONDS': '2'" in said


@needs_mount
@pytest.mark.skipif(not Path("/usr/bin/catkin_make").is_file(), reason="catkin_make is not installed")
def test_only_a_build_where_nothing_was_built_is_a_first_one(checkout):
    make = checkout / "catkin_make"
    make.write_text("#!/bin/sh\nmkdir -p build devel && touch devel/setup.bash\n")

    def said(**environment):
        return with_program("/usr/bin/catkin_make", make, checkout / "coglab", "--kept", "shell", "env", **environment)

    cached = said(CMAKE_CXX_COMPILER_LAUNCHER="ccache")
    assert "COGLAB_BUILD_SECONDS=" in cached and "FIRST_BUILD" not in cached
    for folder in ("build", "devel", "../.coglab"):
        shutil.rmtree(checkout / "catkin_ws" / folder)
    assert "COGLAB_FIRST_BUILD=yes" in said()
    (checkout / "catkin_ws" / "src" / "new.cpp").touch()
    assert "building" in (again := said()) and "FIRST_BUILD" not in again


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """What is kept after demos or tests, each with the environment that ./coglab gave it."""

    def run_all(*commands: tuple[str, dict[str, str]]) -> dict:
        for command, environment in commands:
            for name in SET_UP:
                monkeypatch.delenv(name, raising=False)
            for name, value in environment.items():
                monkeypatch.setenv(name, value)
            record_times(tmp_path, command, 30.0, "")
        return json.loads((tmp_path / ".coglab" / "times.json").read_text())

    return run_all


def test_the_first_demo_is_that_of_the_command_that_did_the_set_up(recorded):
    times = recorded(("demo", SET_UP), ("demo", {"COGLAB_BUILD_SECONDS": "900"}), ("test", SET_UP))
    first = times["demo_from_nothing"]
    assert (first["install_s"], first["build_s"], first["run_s"]) == (70.0, 300.0, 30.0)
    assert first["installed"] == "120 of 140" and times["last_demo"]["install_s"] == 0.0


@pytest.mark.parametrize("without", ["COGLAB_INSTALL_SECONDS", "COGLAB_BUILD_SECONDS", "COGLAB_FIRST_BUILD"])
def test_parts_of_several_commands_make_no_first_demo(recorded, without):
    times = recorded(("demo", {name: value for name, value in SET_UP.items() if name != without}), ("demo", SET_UP))
    assert "demo_from_nothing" not in times and "setup" not in times


def test_a_test_that_did_the_set_up_is_no_demo(recorded):
    assert "demo_from_nothing" not in recorded(("test", SET_UP))


@pytest.fixture
def repository(tmp_path):
    """A checkout with the bench of wall times, committed."""
    folder = tmp_path / "catkin_ws" / "src" / "p" / "bench"
    folder.mkdir(parents=True)
    (folder.parent / "package.xml").write_text("<package><name>p</name></package>")
    (folder / "bench_wall.py").write_text('"""Times."""\n')
    (tmp_path / ".gitignore").write_text("/.coglab/\n")
    (tmp_path / "coglab").write_text("")
    commit_all(tmp_path)
    return tmp_path


def commit_all(top: Path) -> None:
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "words"]):
        git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(top), *words]
        subprocess.run(git, check=True, capture_output=True, timeout=30)


def times_of(top: Path, before: str) -> dict:
    record_times(top, "test", 30.0, before)
    return json.loads((top / ".coglab" / "times.json").read_text())["last_test"]


def test_a_time_says_the_sources_that_it_is_of(repository):
    before = sources_of(repository, "wall")["sources"]
    assert before and times_of(repository, before)["sources"] == before
    source = repository / "catkin_ws" / "src" / "p" / "code.py"
    source.write_text("x = 1\n")
    assert times_of(repository, before)["sources"] == "", "they changed while it ran"
    assert times_of(repository, sources_of(repository, "wall")["sources"])["sources"] == "", "not committed"
    commit_all(repository)
    assert times_of(repository, before)["sources"] == "", "others were committed while it ran"
    after = sources_of(repository, "wall")["sources"]
    assert times_of(repository, after)["sources"] == after != before


def test_where_git_is_missing_or_knows_nothing_a_time_is_of_no_sources(repository, monkeypatch):
    before = sources_of(repository, "wall")["sources"]
    with monkeypatch.context() as without:
        without.setenv("PATH", str(repository))
        assert times_of(repository, before)["sources"] == "" and times_of(repository, "")["sources"] == ""
    shutil.rmtree(repository / ".git")
    assert times_of(repository, sources_of(repository, "wall")["sources"])["sources"] == ""


def test_a_manifest_that_cannot_be_read_ends_no_demo(repository):
    (repository / "catkin_ws" / "src" / "p" / "package.xml").write_text("<package><name>p</name>")
    assert times_of(repository, wall_sources(repository))["sources"] == wall_sources(repository) == ""
