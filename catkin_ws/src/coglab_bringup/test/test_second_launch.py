"""Two systems on one ROS master: the second one is refused before a node of the first has ended."""

import os
import subprocess
import sys
import time

import pytest
import rosgraph
from coglab_bringup.run_directory import free_port
from coglab_py.packages import package_path

NODE = "import rospy; rospy.init_node('x'); print('ready', flush=True); rospy.spin()"


@pytest.fixture(scope="module")
def first():
    """A ROS master with a running node /robot. Yields the environment to reach them, and the node's process."""
    port = free_port()
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL, env=environment)
    end = time.monotonic() + 60.0
    while not rosgraph.is_master_online(environment["ROS_MASTER_URI"]) and time.monotonic() < end:
        time.sleep(0.1)
    node = subprocess.Popen(
        [sys.executable, "-c", NODE, "__name:=robot"], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert node.stdout.readline() == "ready\n"
    yield environment, node
    for process in (node, master):
        process.terminate()
        process.wait(120)


def refusal(environment: dict, *command: object) -> str:
    """Returns the output of a program that must end with status 1."""
    ended = subprocess.run(
        [str(word) for word in command],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert ended.returncode == 1, ended.stdout + ended.stderr
    return ended.stderr


def test_a_second_launch_is_refused_by_name_and_process(first):
    environment, node = first
    words = refusal(environment, package_path("coglab_bringup", "scripts", "check_alone.py"))
    assert f"/robot, process {node.pid}" in words
    assert node.poll() is None


@pytest.mark.parametrize("program", ["coglab_objects/object_database_node.py", "coglab_controllers/robot_node"])
def test_a_node_does_not_replace_a_running_one(first, program):
    environment, node = first
    workspace = package_path("coglab_bringup").parents[1]
    words = refusal(environment, workspace / "devel" / "lib" / program, "__name:=robot")
    assert f"process {node.pid}" in words
    assert node.poll() is None, "the first node still runs"
