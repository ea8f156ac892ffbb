"""./coglab start, status and hold with a simulated brain that publishes its latched state, on its own master."""

import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from coglab_bringup import ask as ask_module
from coglab_bringup.run_directory import free_port
from coglab_py.running_systems import brain_of

TOP = Path(__file__).resolve().parents[4]
HUB = "/coglab_master/wait_without_object"
TAKES = ["exchange_human_to_robot", "take"]


class BrainDouble:
    """Serves /coglab/start like the brain: in a hub it accepts the hub's actions, otherwise nothing."""

    def __init__(self) -> None:
        import rospy
        from coglab_msgs.msg import MasterState
        from coglab_msgs.srv import LwrCommand, LwrCommandResponse, Start, StartResponse

        rospy.init_node("coglab", disable_rosout=True, disable_signals=True)
        self.started = []
        self._publisher = rospy.Publisher("/coglab/state", MasterState, queue_size=1, latch=True)
        self._state = MasterState

        def on_start(request):
            accepted = self.now.in_hub and request.action in self.now.actions
            if accepted:
                self.started.append((request.action, request.object_id))
                self.say("/coglab_master/exchange_human_to_robot", [])
            words = "accepted" if accepted else f"refused: the hub takes {', '.join(self.now.actions)}"
            return StartResponse(success=accepted, message=f"'{request.action}' {words}")

        def on_command(request):
            self.say("/coglab_master/stopped", ["reset"], "hold was requested")
            return LwrCommandResponse(success=True, message=f"{request.event} done")

        rospy.Service("/coglab/start", Start, on_start)
        rospy.Service("/lwr/command", LwrCommand, on_command)
        rospy.set_param("/coglab_sim/cell/object/id", "mug")
        self.say("/coglab_master/initialise/home", [])

    def say(self, state: str, actions: list, why: str = "", object_id: str = "") -> None:
        """Publish the state; with actions it is a hub."""
        self.now = self._state(state=state, actions=actions, in_hub=bool(actions), why=why, object_id=object_id)
        self._publisher.publish(self.now)


@pytest.fixture(scope="module")
def brain():
    port = free_port()
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL)
    import rosgraph

    end = time.monotonic() + 60.0
    while not rosgraph.is_master_online() and time.monotonic() < end:
        time.sleep(0.05)
    double = BrainDouble()
    assert brain_of(os.environ["ROS_MASTER_URI"])
    yield double
    master.terminate()
    master.wait(60.0)


def begin(*words: str) -> subprocess.Popen:
    """Start ./coglab WORDS with the master of this test, output and errors as one text."""
    port = os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1]
    environment = {**os.environ, "COGLAB_TOP": str(TOP)}
    return subprocess.Popen(
        [sys.executable, "-I", "-S", ask_module.__file__, *words, "-p", port],  # like ./coglab: without ROS
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def ask(*words: str) -> tuple[int, str]:
    """Exit status and output of ./coglab WORDS."""
    process = begin(*words)
    output, _ = process.communicate(timeout=60)
    return process.returncode, output


def test_start_waits_for_the_hub_and_takes_the_offered_object(brain):
    process, end = begin("start"), time.monotonic() + 60.0
    while "is starting" in (line := process.stdout.readline()) and time.monotonic() < end:
        process.kill()  # on this busy computer the state did not come within 1 s
        process.communicate()
        process = begin("start")
    assert "hub" in line and "home" in line
    brain.say(HUB, TAKES)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0, output
    assert brain.started == [("exchange_human_to_robot", "mug")]
    brain.started.clear()


def test_start_waits_as_long_as_nodes_come(monkeypatch):
    """On a busy computer a node needs a minute. Four of them come, then none for 90 s."""
    now = 0.0
    monkeypatch.setattr(ask_module, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(
        ask_module,
        "master_call",
        lambda *_: [[], [], [["/service", ["/node"]]] * (min(int(now / 60), 4) - int(now) % 2)],
    )
    patience = ask_module.Patience("http://127.0.0.1:11311", 90.0)
    while patience.left() > 0.0:
        now += 1.0
    assert now == pytest.approx(4 * 60 + 90, abs=1.0)


def test_hold_status_and_reset(brain):
    brain.say("/coglab_master/wait_with_object", ["exchange_robot_to_human", "put"], object_id="mug")
    status, output = ask("status")
    assert status == 0 and "exchange_robot_to_human, put" in output and "mug" in output
    status, output = ask("hold")
    assert status == 0 and "./coglab start reset" in output
    status, output = ask("status")
    assert "hold" in output and "./coglab start reset" in output
    status, output = ask("start")
    assert status == 1 and "reset" in output and "hold" in output
    status, output = ask("start", "reset")
    assert status == 0 and brain.started == [("reset", "")], output
    brain.started.clear()
    brain.say("/coglab_master/fault", ["initialise"], "the robot is silent")
    status, output = ask("status")
    assert status == 0 and "silent" in output and "./coglab start initialise" in output


def test_a_short_name_and_a_delivery_reach_the_brain(brain):
    holding = "/coglab_master/wait_with_object", ["exchange_robot_to_human", "put", "polish"]
    for words, asked in (
        (("give", "mug", "delivery:=rim_first"), ("exchange_robot_to_human", "mug/rim_first")),
        (("give", "delivery:=rim_first"), ("exchange_robot_to_human", "/rim_first")),
        (("polish",), ("polish", "")),
    ):
        brain.started.clear()
        brain.say(*holding, object_id="mug")
        status, output = ask("start", *words)
        assert status == 0 and brain.started == [asked], output
    brain.say(*holding, object_id="mug")
    status, output = ask("start", "give", "mug", "rim_first")
    assert status == 2 and "delivery:=NAME" in output
    brain.started.clear()


def test_a_refused_action_ends_with_a_command(brain):
    brain.say(HUB, TAKES)
    status, output = ask("start", "put", "--wait", "20")
    assert status == 1 and "'put'" in output
    assert output.endswith("./coglab start exchange_human_to_robot or ./coglab start take\n"), output


def test_the_command_does_not_register_at_the_master(brain):
    import rosgraph

    brain.say(HUB, TAKES)
    for words in (("status",), ("hold",)):
        assert ask(*words)[0] == 0
    assert {name for kind in rosgraph.Master("/test").getSystemState() for _, names in kind for name in names} == {
        "/coglab"
    }
