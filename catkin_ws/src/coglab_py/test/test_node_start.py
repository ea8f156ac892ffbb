"""A node starts and ends on a master of its own."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

BUSY_NODE = """
import rospy
from coglab_py.node_start import init_node
init_node("busy")
print("runs", flush=True)
while not rospy.is_shutdown():
    rospy.get_param_names()
"""

STARTS = """
from coglab_py.node_start import init_node
print("starts", flush=True)
init_node("starts")
"""


@pytest.fixture
def environment():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL)
    end = time.monotonic() + 60.0
    while time.monotonic() < end and socket.socket().connect_ex(("127.0.0.1", port)):
        time.sleep(0.05)
    yield {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"}
    master.terminate()
    master.wait(60.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_that_calls_the_master(environment, number):
    for _ in range(3):
        node = subprocess.Popen([sys.executable, "-c", BUSY_NODE], env=environment, text=True, stdout=subprocess.PIPE)
        try:
            assert node.stdout.readline() == "runs\n"
            time.sleep(0.1)
            node.send_signal(number)
            assert node.wait(60.0) == 0
        finally:
            node.kill()
            node.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_that_waits_for_its_master(number):
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{nobody.getsockname()[1]}"}
        starts = [sys.executable, "-u", "-c", STARTS]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        with subprocess.Popen(starts, env=environment, text=True, **pipes) as node:
            late = threading.Timer(60.0, node.kill)
            late.start()
            try:
                assert node.stdout.readline() == "starts\n"
                assert "master" in node.stdout.readline()  # it waits
                node.send_signal(number)
                assert node.wait(60.0) == 0
                assert "Traceback" not in node.stdout.read()
            finally:
                late.cancel()
                node.kill()
