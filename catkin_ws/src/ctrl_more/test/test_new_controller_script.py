"""What new_controller.py writes from a template, and which commands it names next."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parent.parent / "scripts" / "new_controller.py"


def loaded() -> ModuleType:
    """The script as a module."""
    spec = importlib.util.spec_from_file_location("new_controller", SCRIPT)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


script = loaded()


@pytest.fixture
def template(tmp_path: Path) -> Path:
    """A template with folders in folders, and placeholders in names and texts."""
    folder = tmp_path / "template"
    (folder / "deep" / "@name@").mkdir(parents=True)
    (folder / "top.txt.in").write_text("@TYPE@ is @name@, @TYPE@\n")
    (folder / "second.txt").write_text("plain\n")
    (folder / "deep" / "@name@" / "@TYPE@.hpp.in").write_text("class @TYPE@;\n")
    tool = folder / "deep" / "run.sh"
    tool.write_text("#!/bin/sh\n")
    tool.chmod(0o755)
    return folder


def test_names_and_texts_are_filled_in_at_every_depth(template: Path, tmp_path: Path) -> None:
    made = script.make_controller("WristDamper", tmp_path, template)
    assert made == tmp_path / "wrist_damper"
    written = {str(path.relative_to(made)): path.read_text() for path in made.rglob("*") if path.is_file()}
    assert written == {
        "top.txt": "WristDamper is wrist_damper, WristDamper\n",
        "second.txt": "plain\n",
        "deep/wrist_damper/WristDamper.hpp": "class WristDamper;\n",
        "deep/run.sh": "#!/bin/sh\n",
    }
    assert (made / "deep" / "run.sh").stat().st_mode & 0o111, "what runs in the template runs here"
    assert not (made / "top.txt").stat().st_mode & 0o111


def test_the_packages_own_template_is_taken_where_none_is_given(tmp_path: Path) -> None:
    made = script.make_controller("WristDamper", tmp_path)
    assert (made / "src" / "wrist_damper.cpp").is_file()
    assert "WristDamper" in (made / "src" / "wrist_damper.cpp").read_text()


@pytest.mark.parametrize(
    ("name", "snake"),
    [("WristDamper", "wrist_damper"), ("Damper", "damper"), ("ZmpIP", "zmp_ip"), ("Arm2Damper", "arm2damper")],
)
def test_folders_are_named_in_small_letters(name: str, snake: str) -> None:
    assert script.snake_case(name) == snake


def test_each_package_has_a_template_of_its_own() -> None:
    own = script.template_folder()
    assert own == SCRIPT.parent.parent / "template"
    motion = SCRIPT.parent.parent.parent / "coglab_controllers" / "template"
    if motion.is_dir():
        assert script.template_folder("coglab_controllers") == motion
    with pytest.raises(FileNotFoundError, match="reinstall no_such_package"):
        script.template_folder("no_such_package")


def test_next_steps_are_those_of_the_place(tmp_path: Path) -> None:
    alone = tmp_path / "wrist_damper"
    assert script.next_steps(alone) == [
        f"cmake -S {alone} -B {alone}/build && cmake --build {alone}/build",
        f"ctest --test-dir {alone}/build --output-on-failure",
    ]
    assert script.next_steps(alone, motion=True)[0] == "catkin_make -C WORKSPACE"
    inside = tmp_path / "catkin_ws" / "src" / "wrist_damper"
    inside.mkdir(parents=True)
    workspace = tmp_path / "catkin_ws"
    assert script.next_steps(inside)[0].startswith("cmake -S")
    assert script.next_steps(inside, motion=True) == [
        f"catkin_make -C {workspace}",
        f". {workspace}/devel/setup.bash",
        "rostest wrist_damper wrist_damper.test",
    ]
    (tmp_path / "coglab").write_text("")
    for motion in (False, True):
        assert script.next_steps(inside, motion) == ["./coglab build && ./coglab test wrist_damper"]
    elsewhere = workspace / "other" / "wrist_damper"
    assert script.next_steps(elsewhere)[0].startswith("cmake -S"), "not among the packages of the workspace"


def test_the_command_line_says_what_it_is_for_and_where_to_go_on(tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, timeout=60, check=False
        )

    told = run("--help")
    assert told.returncode == 0
    assert "Makes a new feedback controller from the template" in told.stdout
    made = run("WristDamper", "--into", str(tmp_path))
    assert made.returncode == 0, made.stderr
    assert f"made {tmp_path}/wrist_damper; build and test it:\n  cmake -S" in made.stdout
