"""The robot in lockstep in one thread: periods, a frozen process, and refused requests."""

from dataclasses import replace

import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.packages import package_path
from coglab_smach.ports.interfaces import DmpRequest
from coglab_smach.ports.pending import PortError
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.world import DT, Robot, World

PRIMITIVES = str(package_path("coglab_controllers", "config", "primitives.xml"))
# --- lockstep ---------------------------------------------------------------------------------------------------------


def test_time_advances_by_periods_and_a_frozen_process_does_not_answer():
    robot = Robot(3, krc__period=0.002).virtual
    robot.advance(0.5)
    assert robot.now == pytest.approx(1.5) and robot.cell.time == pytest.approx(0.5) and robot.cell.quality == 3
    robot.frozen = True
    before = robot.report()["cycles"]
    robot.advance(0.5)
    assert robot.cell.quality == 0 and robot.report()["cycles"] == before and robot.now == pytest.approx(2.0)
    robot.frozen = False
    robot.advance(0.5)
    assert robot.cell.quality == 3 and robot.report()["cycles"] > before


# --- refusals ---------------------------------------------------------------------------------------------------------

REACH = DmpRequest("take_board", "board", [0.0, -0.25, 0.45], dmp_ratio=2.0)
NAN = float("nan")


@pytest.fixture(scope="module")
def arm():
    """The arm port, ready to move, and a posture near the present one."""
    world = World(1, object_on="world")
    port = VirtualArm(world)

    def wait(condition, limit=10.0):
        while not condition():
            assert (limit := limit - DT) > 0.0
            world.step()

    for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
        port.load_controller(name, kind).result()
    port.load_dmps(PRIMITIVES).result()
    wait(lambda: world.cell.quality == 3)
    port.lwr_command("position")
    start = port.lwr_command("start")
    wait(start.done)
    start.result()
    wait(lambda: port.motion_allowed().ok and world.t > 3.0)
    q = list(port.joint_positions())
    return port, [*q[:6], q[6] + 0.1]


def refused(pending):
    assert pending.done()
    with pytest.raises(PortError) as error:
        pending.result()
    return error.value.code


@pytest.mark.parametrize(
    "fields, code",
    [
        ({"primitive_id": "to_the_moon"}, ReasonCode.UNKNOWN_NAME),
        ({"goal_frame": "nowhere"}, ReasonCode.UNKNOWN_NAME),
        ({"goal_offset": [0.0, 0.0, 9.0]}, ReasonCode.GOAL_OUTSIDE_WORKSPACE),
        ({"goal_offset": [0.0, NAN, 0.4]}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_approach": (0.0, 0.0, 0.5)}, ReasonCode.INVALID_ARGUMENT),
        ({"orientation_control": True, "target_orientation": (0.0, 0.0, 0.0, 2.0)}, ReasonCode.INVALID_ARGUMENT),
    ],
)
def test_invalid_reaches_are_refused_with_their_code(arm, fields, code):
    port, _ = arm
    port.switch_controller("dmp").result()
    assert refused(port.execute_dmp(replace(REACH, **fields))) == code


def test_other_invalid_requests_are_refused_with_their_code(arm):
    port, near = arm
    assert refused(port.switch_controller("nobody")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.load_controller("x", "coglab/NoController")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.load_dmps("/no/such.xml")) == ReasonCode.BAD_FILE
    assert refused(port.apply_profile("nobody")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.lwr_command("dance")) == ReasonCode.UNKNOWN_NAME
    port.switch_controller("dmp").result()
    assert refused(port.move_ptp(near, [])) == ReasonCode.NOT_ACTIVE
    assert refused(port.switch_dmp(REACH)) == ReasonCode.NOTHING_RUNS
    port.switch_controller("ptp").result()
    assert refused(port.execute_dmp(REACH)) == ReasonCode.NOT_ACTIVE
    for position, speed, code in (
        ([NAN, *near[1:]], [], ReasonCode.INVALID_ARGUMENT),
        ([3.5, *near[1:]], [], ReasonCode.OUT_OF_RANGE),
        ([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0], [], ReasonCode.GOAL_OUTSIDE_WORKSPACE),
        (near, [9.0, *[0.1] * 6], ReasonCode.OUT_OF_RANGE),
    ):
        assert refused(port.move_ptp(position, speed)) == code
