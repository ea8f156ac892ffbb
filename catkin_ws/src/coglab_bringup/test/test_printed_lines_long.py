"""README, tour and how-to read aloud to a running system: every line as printed, in its order (./coglab test --long).

Lines that show a stream have to show something; the others have to end well, and what a service answers must not be a
refusal. rviz is left out. What needs hardware is run on the simulated one: STAND_INS says how.
"""

import ast
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from coglab_bringup.run_directory import free_port
from printed_lines import TOP, printed_block, printed_files, printed_lines

pytestmark = pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: ./coglab test --long")

STREAMS = re.compile(r"rostopic (echo (?!.*-n1)|hz)|rostopic pub .*-r |rosrun tf tf_echo|rosrun ih2_hand hand_trace.py")
STAND_INS = {
    # printed line: (what takes its place, why)
    "roslaunch ih2_hand hand.launch sim:=false serial_port:=/dev/ttyUSB0": (
        "roslaunch ih2_hand hand.launch",
        "needs the hand; its emulator stands at the same wire",
    ),
    "roslaunch coglab_controllers robot_real.launch fri_address:=192.168.0.20 limits_profile:=t1": (
        "roslaunch first_motion.launch",
        "needs the cabinet's network; the same file with the loopback address, and the simulated cell beside it",
    ),
    "roslaunch coglab_bringup real.launch fri_address:=192.168.0.20 serial_port:=/dev/ttyUSB0": (
        f"{TOP}/coglab launch auto_trigger:=false",
        "needs arm and hand; the simulated system waits for `initialise` as well",
    ),
}
FIRST_MOTION = """<launch>
  <include file="$(find coglab_controllers)/launch/robot_real.launch">
    <arg name="fri_address" value="127.0.0.1"/><arg name="fri_port" value="0"/><arg name="limits_profile" value="t1"/>
  </include>
  <include file="$(find coglab_sim)/launch/cell.launch"><arg name="operating_mode" value="T1"/></include>
</launch>
"""
OTHER_TERMINAL = re.compile(r"\./coglab (launch|shell$|demo)|roslaunch |export ROS_MASTER_URI=\.\.\.|\. catkin_ws/")
AFTER = {  # what a reader waits for, in the order of the page, before the next line: a state of ./coglab status
    "./coglab start": r"state: +wait_with(out)?_object",
    "./coglab start reset": r"state: +wait_with(out)?_object",
}
READY = r"state: +wait_with"
STOPPED = r"state: +stopped"
OF_THIS_COMPUTER = r"this computer, was not run for \d+ ms"  # the simulated cabinet beside us was late: not of the line


class System:
    """./coglab launch, or another line that launches something, on a port of its own; ended with the test."""

    def __init__(self, folder: Path, *arguments: str, line: str = f"{TOP}/coglab launch", ready: str = "") -> None:
        self.port = free_port()
        self.folder = folder
        self.log = folder / "launch.log"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                self._with_port(line, arguments),
                cwd=folder,
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
            )
        try:
            if ready:
                self.until(ready, 120.0)
            else:
                self.wait_for(READY, 120.0)
        except BaseException:
            self.end()
            raise

    def _with_port(self, line: str, arguments: tuple[str, ...]) -> list[str]:
        words = line.replace("./coglab", f"{TOP}/coglab").split()
        at = next(i for i, word in enumerate(words) if word in ("launch", "roslaunch")) + 1
        words = [*words[:at], "-p", str(self.port), *words[at:], *arguments]
        return words if words[0].endswith("coglab") else [f"{TOP}/coglab", "shell", *words]

    def until(self, command: str, limit: float) -> None:
        """Waits until this line ends well."""
        end = time.monotonic() + limit
        while self.line(command)[0] != 0:
            assert time.monotonic() < end, f"{command}: not within {limit} s; log: {self.log.read_text()[-3000:]}"
            time.sleep(0.5)

    def line(self, command: str, limit: float = 60.0) -> tuple[int | None, str]:
        """Exit status (None: ended at the limit) and output of a line, as a reader types it."""
        if command.startswith("./coglab "):
            script = re.sub(r"^\./coglab (start|status|hold|stop)", rf"./coglab \1 -p {self.port}", command)
            script = script.replace("./coglab", f"{TOP}/coglab")
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

    def wait_for(self, pattern: str, limit: float) -> str:
        """Waits until ./coglab status matches; returns what it said."""
        end, said = time.monotonic() + limit, ""
        while time.monotonic() < end:
            said = self.line("./coglab status")[1]
            if re.search(pattern, said):
                return said
            time.sleep(0.5)
        raise AssertionError(f"no {pattern} within {limit} s; last: {said}")

    def read_aloud(self, command: str) -> None:
        """Runs a line as its kind asks for, and asserts that it ended well."""
        if STREAMS.match(command):
            status, output = self.line(command, 8.0)
            assert output.strip() or "transitions" in command or "pub" in command, f"{command}: nothing came"
            return
        for _ in range(3):
            status, output = self.line(command)
            assert status == 0, f"{command}: {output}"
            refused = re.search(r"^(success|accepted): False|^status: 2$", output, re.MULTILINE)
            assert not refused, f"{command}: {output}"
            if command not in AFTER:
                return
            time.sleep(1.0)
            said = self.wait_for(f"{AFTER[command]}|{STOPPED}", 90.0)
            if not re.search(STOPPED, said):
                return
            # A reader does what it says, and types the line again.
            assert re.search(OF_THIS_COMPUTER, said), f"{command}: {said}"
            assert self.line("./coglab start reset")[0] == 0
            self.wait_for(READY, 90.0)
        raise AssertionError(f"{command}: stopped three times by the load of this computer")

    def end(self) -> None:
        """Ctrl-C; once is enough."""
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(20)


@pytest.fixture
def system(tmp_path):
    """Starts systems and ends them."""
    begun = []

    def begin(*arguments: str, **how: str) -> System:
        begun.append(System(tmp_path, *arguments, **how))
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
    lines = lines_of("README.md", "Drive it yourself")
    by_tool = [line for line in lines if line.startswith("./coglab")]
    running = system()
    for command in by_tool:
        running.read_aloud(command)
    running.end()
    plain = system(line="roslaunch coglab_bringup coglab.launch")
    for command in [line for line in lines if line not in by_tool]:
        plain.read_aloud(command)


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


def in_checkout(command: str, out: Path) -> None:
    """A line that builds something, in the folder of the checkout."""
    ended = subprocess.run(
        command.replace("./coglab test", f"./coglab test --out {out}"),
        shell=True,
        cwd=TOP,
        timeout=1800,
        check=False,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert ended.returncode == 0, f"{command}: {ended.stdout}"


def forget_package(name: str) -> None:
    """Nothing of it is left in the workspace."""
    shutil.rmtree(TOP / "catkin_ws" / "src" / name, ignore_errors=True)
    shutil.rmtree(TOP / "catkin_ws" / "build" / name, ignore_errors=True)


def with_files(folder: Path) -> None:
    """The files that the pages show, and recordings as they describe them."""
    (folder / "catkin_ws").symlink_to(TOP / "catkin_ws")
    for file in printed_files():
        (folder / file.name).write_text(file.text)
    rest = np.zeros(60)
    s = np.concatenate([rest, np.linspace(0.0, 1.0, 120), rest + 1.0])
    s = 10 * s**3 - 15 * s**4 + 6 * s**5
    t = 0.01 * np.arange(len(s))
    for name, top in (("reach", 0.2), ("high1", 0.25), ("high2", 0.3), ("low1", -0.1), ("low2", -0.15)):
        first = 60 if name == "reach" else 0
        rows = np.column_stack([t, 1.1 - 0.4 * s, 0.1 * s, 0.3 + top * s])[first : len(s) - first]
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header="t,x,y,z", comments="")


def test_own_primitive(system, tmp_path):
    with_files(tmp_path)
    lines = lines_of("docs/how_to.md", "Your own primitive")
    assert lines[0] == "./coglab shell python3 learn.py" and len(lines) > 5
    running = system()
    for command in lines:
        running.read_aloud(command)
    running.wait_for(READY, 30.0)


def test_own_perception(system, tmp_path):
    with_files(tmp_path)
    train, show = lines_of("docs/how_to.md", "Your own perception")
    trained = subprocess.run(
        ["bash", "-c", f". {TOP}/catkin_ws/devel/setup.bash; {train}"], cwd=tmp_path, timeout=120, check=False
    )
    assert trained.returncode == 0
    running = system(f"patterns:={tmp_path}/patterns.json")
    running.read_aloud(show)


def test_hand(system):
    lines = lines_of("docs/how_to.md", "3. Hand")
    launch = next(line.command for line in printed_lines() if line.section == "3. Hand")
    running = system(line=STAND_INS[launch][0], ready="rostopic echo -n1 /ih2_hand/hand_status")
    for command in lines:
        running.read_aloud(command)


def test_first_motion(system, tmp_path):
    (tmp_path / "first_motion.launch").write_text(FIRST_MOTION)
    lines = [line.command for line in printed_lines() if line.section.startswith("5. The first motion")]
    launches = [line for line in lines if line.startswith("roslaunch")]
    arm = system(line=STAND_INS[launches[0]][0], ready="rostopic echo -n1 /lwr/state")
    before = lines[1 : lines.index(launches[1])]
    assert "[...]" in before[-1]
    for command in before[:-1]:
        arm.read_aloud(command)
    _, said = arm.line("rostopic echo -n1 /lwr/joint_states/position")
    measured = ast.literal_eval(said.partition("---")[0].strip())
    goal = [*measured[:6], measured[6] + 0.05]
    arm.read_aloud(before[-1].replace("[...]", str(goal)))
    arm.until("rostopic echo -n1 /controller_manager/ptp/finished_ptp", 30.0)
    whole = system(line=STAND_INS[launches[1]][0], ready="rosservice info /coglab/start")
    time.sleep(5.0)
    for command in lines[lines.index(launches[1]) + 1 :]:
        whole.read_aloud(command)
    whole.wait_for(READY, 90.0)


def test_own_motion(system, tmp_path):
    lines = [line.command for line in printed_lines() if line.section == "Your own motion"]
    launch = next(line for line in lines if "roslaunch" in line)
    later = next(i for i, line in enumerate(lines) if "load_controller" in line)
    try:
        for command in lines[: lines.index(launch)]:
            in_checkout(command, tmp_path / "test")
        alone = system(line=launch, ready="rosservice call /controller_manager/list_controllers")
        for command in lines[lines.index(launch) + 1 : later]:
            alone.read_aloud(command)
        whole = system()
        for command in lines[later:]:
            whole.read_aloud(command)
    finally:
        forget_package("side_sway")


def test_own_controller(system, tmp_path):
    lines = [line.command for line in printed_lines() if line.section == "Your own feedback controller"]
    try:
        for command in [line for line in lines if line.startswith("./coglab")]:
            in_checkout(command, tmp_path / "test")
        (tmp_path / "feedback.yaml").write_text(printed_block("docs/how_to.md", "Your own feedback controller", "yaml"))
        checked = subprocess.run(
            [TOP / "coglab", "shell", "ctrl_more_describe", "list", tmp_path / "feedback.yaml"], check=False
        )
        assert checked.returncode == 0
        with_files(tmp_path)
        in_checkout(f"cd {tmp_path} && {TOP}/coglab shell python3 learn.py", tmp_path)  # lab.launch names its library
        running = system(line="./coglab shell roslaunch lab.launch")
        for command in [line for line in lines if line.startswith("ros")]:
            running.read_aloud(command)
    finally:
        forget_package("wrist_damper")


def test_two_nodes(system):
    running = system("split:=true")
    for command in lines_of("docs/how_to.md", "Bridge and manager as two nodes"):
        running.read_aloud(command)
