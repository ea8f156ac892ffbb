"""`tactile:=true`: whoever can use the forces of a hand with touch sensors listens where its driver sends them."""

import pytest
import rospkg
from roslaunch.config import load_config_default

READERS = ("/controller_manager/tactile_topic", "/contact_detector/tactile_topic")


def parameters(file, *arguments):
    """Those that a launch file of this package sets, by name."""
    path = f"{rospkg.RosPack().get_path('coglab_bringup')}/launch/{file}"
    return {name: each.value for name, each in load_config_default([(path, list(arguments))], None).params.items()}


def test_simulated_sensors_reach_feedback_and_contact():
    found = parameters("coglab.launch", "tactile:=true")
    assert found["/controller_manager/tactile"] is True and found["/coglab_sim/cell/tactile"] is True
    assert [found[name] for name in READERS] == ["coglab_sim/fingertip_forces"] * 2


def test_those_of_a_real_hand_are_where_its_driver_publishes_them():
    found = parameters("real.launch", "tactile:=true")
    assert found["/controller_manager/tactile"] is True
    assert not any(name in found for name in READERS), "the default: ih2_hand/fingertip_forces"


@pytest.mark.parametrize("file", ["coglab.launch", "real.launch"])
def test_without_them_nobody_waits_for_forces(file):
    assert parameters(file)["/controller_manager/tactile"] is False
