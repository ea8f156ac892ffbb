"""README, tour and how-to read aloud to a running system: every line as printed, in its order (./coglab test --long).

Lines that show a stream have to show something; the others have to end well, and what a service answers must not be a
refusal. rviz is left out.
"""

import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from coglab_bringup.run_directory import free_port
from printed_lines import TOP, printed_block, printed_lines

pytestmark = pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: ./coglab test --long")

STREAMS = re.compile(r"rostopic (echo (?!.*-n1)|hz)|rostopic pub .*-r |rosrun tf tf_echo")
OTHER_TERMINAL = re.compile(r"\./coglab (launch|shell$|demo)|roslaunch |export ROS_MASTER_URI=\.\.\.|\. catkin_ws/")
AFTER = {  # what a reader waits for, in the order of the page, before the next line: a state of ./coglab status
    "./coglab start": r"state: +wait_with(out)?_object",
    "./coglab start reset": r"state: +wait_with(out)?_object",
}
READY = r"state: +wait_with"


class System:
    """./coglab launch on a port of its own, ended with the test."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.port = free_port()
        self.folder = folder
        self.log = folder / "launch.log"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [TOP / "coglab", "launch", "-p", str(self.port), *arguments],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
            )
        self.wait_for(READY, 120.0)

    def line(self, command: str, limit: float = 60.0) -> tuple[int | None, str]:
        """Exit status (None: ended at the limit) and output of a line, as a reader types it."""
        if command.startswith("./coglab "):
            script = re.sub(r"^\./coglab (start|status|hold|stop)", rf"{TOP}/coglab \1 -p {self.port}", command)
        else:
            script = (
                f". {TOP}/catkin_ws/devel/setup.bash; export ROS_MASTER_URI=http://127.0.0.1:{self.port}; {command}"
            )
        with subprocess.Popen(
            ["bash", "-c", script],
            cwd=self.folder,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process:
            try:
                output, _ = process.communicate(timeout=limit)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGINT)
                output, _ = process.communicate(timeout=20.0)
                return None, output
        return process.returncode, output

    def wait_for(self, pattern: str, limit: float) -> None:
        """Waits until ./coglab status matches."""
        end, said = time.monotonic() + limit, ""
        while time.monotonic() < end:
            said = self.line("./coglab status")[1]
            if re.search(pattern, said):
                return
            time.sleep(0.5)
        raise AssertionError(f"no {pattern} within {limit} s; last: {said}")

    def read_aloud(self, command: str) -> None:
        """Runs a line as its kind asks for, and asserts that it ended well."""
        if STREAMS.match(command):
            status, output = self.line(command, 8.0)
            assert output.strip() or "transitions" in command or "pub" in command, f"{command}: nothing came"
            return
        status, output = self.line(command)
        assert status == 0, f"{command}: {output}"
        assert not re.search(r"^(success|accepted): False", output, re.MULTILINE), f"{command}: {output}"
        if command in AFTER:
            time.sleep(1.0)
            self.wait_for(AFTER[command], 90.0)

    def end(self) -> None:
        """Ctrl-C."""
        self.process.terminate()
        self.process.wait(20)


@pytest.fixture
def system(tmp_path):
    """Starts systems and ends them."""
    begun = []

    def begin(*arguments: str) -> System:
        begun.append(System(tmp_path, *arguments))
        return begun[-1]

    yield begin
    for one in begun:
        one.end()


def lines_of(page: str, *sections: str) -> list[str]:
    """The lines of these sections but those that begin a terminal."""
    return [
        line.command
        for line in printed_lines()
        if line.page == page
        and any(line.section.startswith(s) for s in sections)
        and not OTHER_TERMINAL.match(line.command)
    ]


def test_readme(system):
    running = system()
    lines = lines_of("README.md", "Drive it yourself")
    by_tool = [line for line in lines if line.startswith("./coglab")]
    for command in by_tool:
        running.read_aloud(command)
    for command in [line for line in lines if line not in by_tool]:
        running.read_aloud(command)


def test_tour(system):
    running = system()
    for command in lines_of("docs/tour.md", "2. ", "4. "):
        running.read_aloud(command)


def test_own_object(system):
    target = TOP / "catkin_ws/src/coglab_objects/objects/cup.yaml"
    try:
        for command in ("new cup", "check cup", "list"):
            ended = subprocess.run(f"./coglab object {command}", shell=True, cwd=TOP, timeout=600, check=False)
            assert ended.returncode == 0
        running = system()
        for command in lines_of("docs/how_to.md", "Your own object"):
            if not command.startswith("./coglab object"):
                running.read_aloud(command)
    finally:
        target.unlink(missing_ok=True)


def test_own_controller(system, tmp_path):
    folder = TOP / "catkin_ws" / "src" / "wrist_damper"
    lines = [line.command for line in printed_lines() if line.section == "Your own feedback controller"]
    try:
        for command in [line for line in lines if line.startswith("./coglab")]:
            command = command.replace("./coglab test", f"./coglab test --out {tmp_path / 'test'}")
            ended = subprocess.run(
                command,
                shell=True,
                cwd=TOP,
                timeout=1800,
                check=False,
                text=True,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            assert ended.returncode == 0, f"{command}: {ended.stdout}"
        (tmp_path / "feedback.yaml").write_text(printed_block("docs/how_to.md", "Your own feedback controller", "yaml"))
        checked = subprocess.run(
            [TOP / "coglab", "shell", "ctrl_more_describe", "list", tmp_path / "feedback.yaml"], check=False
        )
        assert checked.returncode == 0
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(TOP / "catkin_ws" / "build" / "wrist_damper", ignore_errors=True)


def test_two_nodes(system):
    running = system("split:=true")
    for command in lines_of("docs/how_to.md", "Bridge and manager as two nodes"):
        running.read_aloud(command)
