"""limits_profile:=t1 of every launch file that takes it reaches the arm's interface and the controller manager."""

import subprocess

import pytest
import yaml

FILES = (
    ("coglab_controllers", "robot.launch"),
    ("coglab_controllers", "robot_real.launch"),
    ("coglab_bringup", "coglab.launch"),
    ("coglab_bringup", "real.launch"),
)


@pytest.mark.parametrize("profile", ["default", "t1"])
@pytest.mark.parametrize("package, file", FILES)
def test_both_read_the_same_profile(package, file, profile):
    line = ["roslaunch", "--dump-params", package, file, f"limits_profile:={profile}", "fri_address:=127.0.0.1"]
    run = subprocess.run(line, capture_output=True, text=True, timeout=60, check=True)
    parameters = yaml.safe_load(run.stdout)
    assert parameters["/lwr/limits_profile"] == profile
    assert parameters["/controller_manager/joint_limits_profile"] == profile
