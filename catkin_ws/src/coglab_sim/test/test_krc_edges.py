"""The controller's servos, messages, faults and restarts: what a client sees of them, figure by figure."""

import numpy as np
import pytest
from fri_client import CARTESIAN_IMPEDANCE, COMMAND, JOINT_IMPEDANCE, JOINT_POSITION, MONITOR, parse, set_point
from test_object import EXACT

QUIET = {**EXACT, "arm__coulomb_friction": [0.0] * 7}
"""no friction: an arm that is pushed goes to where its springs hold it"""


def openkc(session, **parameters):
    s = session(krc__convention="openkc", **QUIET, **parameters)
    s.monitor()
    return s


def command(s, code):
    """One command of OpenKC."""
    s.client.ints[15], s.client.bools = code, 1
    s.run(0.3)
    s.client.ints[15], s.client.bools = 0, 0
    s.run(0.15)


def pushed(s, force, torque=(0.0, 0.0, 0.0), seconds=4.0):
    """Position and frame of the arm before a push and after it."""
    before = s.tick()
    s.cell.set_push(list(force), list(torque))
    return before, s.run(seconds)


def yields(before, after):
    """Joint torque of the push over the way that each joint gives, Nm/rad."""
    jacobian = np.array(before["jacobian"]).reshape(6, 7)
    return jacobian, np.array(after["position"]) - np.array(before["position"])


def test_joint_stiffness_of_the_controller_counts_where_the_pc_gives_none(session):
    s = openkc(session)
    stiffness = [700, 800, 900, 1000, 1100, 1200, 1300]
    s.client.ints[8:15], s.client.reals[9:16] = stiffness, [1.0] * 7
    command(s, 5)
    command(s, 7)
    s.client.flags = JOINT_POSITION
    command(s, 1)
    assert s.cell.fri_state == COMMAND and parse(s.measurement)["control"] == 3
    force = np.array([6.0, 8.0, -5.0])
    before, after = pushed(s, force, [1.0, 0.5, -0.8])
    jacobian, way = yields(before, after)
    torque = jacobian.T @ [*force, -0.8, 0.5, 1.0]  # the wire's rotation rows are z y x
    assert way * stiffness == pytest.approx(torque, abs=0.06)
    assert np.abs(torque).min() > 0.2, "every joint was asked"


@pytest.mark.parametrize("damping, overshoots", [(0.1, True), (1.0, False)])
@pytest.mark.parametrize("joint", [0, 3, 5])
def test_joint_damping_of_the_controller(session, joint, damping, overshoots):
    """Of this joint alone; the others are critically damped."""
    s = openkc(session)
    s.client.ints[8:15] = [400] * 7
    s.client.reals[9:16] = [1.0] * 7
    s.client.reals[9 + joint] = damping
    command(s, 5)
    command(s, 7)
    s.client.flags = JOINT_POSITION
    command(s, 1)
    jacobian = np.array(s.tick()["jacobian"]).reshape(6, 7)[[0, 1, 2, 5, 4, 3]]
    wrench = np.linalg.lstsq(jacobian.T, 6.0 * np.eye(7)[joint], rcond=None)[0]
    begin = s.cell.position[joint]
    s.cell.set_push(list(wrench[:3]), list(wrench[3:]))
    path = []
    for _ in range(400):
        s.tick()
        path.append(abs(s.cell.position[joint] - begin))
    assert bool(max(path) > 1.2 * path[-1]) is overshoots, max(path) / path[-1]


def test_cartesian_stiffness_of_the_controller_in_the_order_of_krl(session):
    """INT[10..15]: x y z, then A B C, which turn about z y x."""
    s = openkc(session)
    s.client.ints[9:15], s.client.reals[10:16] = [900, 1200, 1500, 90, 120, 150], [1.0] * 6
    command(s, 4)
    assert parse(s.measurement)["ints"][15] == 102
    command(s, 6)
    s.client.flags = 0x0100
    command(s, 1)
    assert s.cell.fri_state == COMMAND and parse(s.measurement)["control"] == 2
    before, after = pushed(s, [6.0, 8.0, -5.0], [1.0, 0.8, -0.9], 6.0)
    rotation, moved = (np.array(f["frame"]).reshape(3, 4) for f in (before, after))
    way = moved[:, 3] - rotation[:, 3]
    turned = moved[:, :3] @ rotation[:, :3].T
    turn = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / 2
    assert way * [900, 1200, 1500] == pytest.approx([6.0, 8.0, -5.0], abs=0.1)
    assert turn * [150, 120, 90] == pytest.approx([1.0, 0.8, -0.9], abs=0.02)


@pytest.mark.parametrize("asked, given", [(300000, 500.0), (400, 400.0), (-100, 0.0)])
def test_stiffness_is_cut_to_what_the_controller_accepts(session, asked, given):
    s = (
        openkc(session, krc__joint_stiffness_max=500.0, krc__nullspace_stiffness=None)
        if False
        else openkc(session, krc__joint_stiffness_max=500.0)
    )
    s.client.ints[8:15], s.client.reals[9:16] = [600] * 7, [1.0] * 7
    s.client.ints[8] = asked
    command(s, 5)
    command(s, 7)
    s.client.flags = JOINT_POSITION
    command(s, 1)
    before = s.tick()
    torque = np.array(before["jacobian"]).reshape(6, 7)[0, 0] * 3.0
    s.cell.set_push([3.0, 0.0, 0.0])
    way = np.array(s.run(3.0)["position"]) - before["position"]
    if given:
        assert way[0] * given == pytest.approx(torque, rel=0.02)
    else:
        assert abs(way[0]) > 0.02, "a joint without a spring goes away"


def test_defaults_of_the_impedances(session):
    for strategy, flags in ((30, JOINT_POSITION), (20, 0x0100)):
        s = session(**QUIET)
        s.monitor()
        s.client.flags = flags
        s.client.request(1, strategy)
        assert s.run(0.5)["state"] == COMMAND
        before, after = pushed(s, [6.0, 8.0, -5.0])
        if strategy == 30:
            jacobian, way = yields(before, after)
            assert way * 1000.0 == pytest.approx(jacobian[:3].T @ [6.0, 8.0, -5.0], abs=0.06)
        else:
            way = np.array(after["frame"])[3::4] - np.array(before["frame"])[3::4]
            assert way * 2000.0 == pytest.approx([6.0, 8.0, -5.0], abs=0.15)


def test_values_of_the_pc_count_while_it_gives_them(session):
    s = session(**QUIET)
    s.monitor()
    s.client.flags, s.client.stiffness = JOINT_IMPEDANCE, [500.0] * 7
    s.client.request(1, 30)
    assert s.run(0.5)["state"] == COMMAND
    before, after = pushed(s, [0.0, 8.0, 0.0])
    jacobian, way = yields(before, after)
    assert way * 500.0 == pytest.approx(jacobian[1] * 8.0, abs=0.06)
    s.cell.set_push([0.0, 0.0, 0.0])
    s.run(2.0)
    before = s.tick()
    for step in range(1, 9):
        s.client.torque = [0.0, 0.5 * step] + [0.0] * 5
        s.tick()
    way = np.array(s.run(3.0)["position"]) - before["position"]
    assert way * 500.0 == pytest.approx([0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=0.06), "an added torque"


def test_an_added_force_at_the_tip_and_a_stiffness_there(session):
    import struct

    s = session(**QUIET)
    s.client.cart_stiffness = [1000.0] * 3 + [100.0] * 3
    begin = np.array(s.command(20)["frame"]).reshape(3, 4)
    answer = s.client.answer

    def with_force(measurement, position=None, **overrides):
        data = bytearray(answer(measurement, position, **overrides))
        struct.pack_into("<6f", data, 248, 5.0, 0.0, -4.0, 0.5, 0.0, 0.0)  # the last three turn about z y x
        return bytes(data)

    s.client.answer = with_force
    end = np.array(s.run(5.0)["frame"]).reshape(3, 4)
    assert (end - begin)[:, 3] * 1000.0 == pytest.approx([5.0, 0.0, -4.0], abs=0.15)
    turned = end[:, :3] @ begin[:, :3].T
    assert (turned[1, 0] - turned[0, 1]) / 2 * 100.0 == pytest.approx(0.5, abs=0.04)


def test_a_moving_frame_is_followed_without_lag(session):
    """The damper is told how fast the frame goes: 50 mm/s at 2000 N/m lag less than a millimetre."""
    s = session(**QUIET)
    frame = list(s.command(20)["commanded_frame"])
    begin = list(frame)
    for _ in range(200):
        frame[7] += 0.05 * s.cell.period
        s.client.frame = list(frame)
        fields = s.tick()
    assert fields["state"] == COMMAND
    assert fields["frame"][7] == pytest.approx(frame[7], abs=0.001)
    assert fields["commanded_frame"] == pytest.approx(begin), "the controller's own command stays"
    own = np.array(begin).reshape(3, 4)
    offset = np.array(fields["frame_offset"]).reshape(3, 4)
    moved = np.array(frame).reshape(3, 4)
    assert own[:, :3] @ offset[:, 3] == pytest.approx((moved - own)[:, 3], abs=1e-5)
    assert offset[:, :3] == pytest.approx(np.eye(3), abs=1e-5)


def test_a_joint_servo_follows_at_60_rad_per_s(session):
    """A steadily moving set-point is followed without lag, a step of the bandwidth's size within its times."""
    s = session(**QUIET)
    target = np.array(set_point(s.command()))
    for _ in range(200):
        target += 0.2 * s.cell.period
        s.tick(position=target)
    assert s.cell.position == pytest.approx(target, abs=4e-4)
    assert s.cell.velocity == pytest.approx([0.2] * 7, abs=0.003)


# -- messages, faults, restarts -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "mode, name", [("AUT", "operator safety"), ("T2", "enabling switch"), ("T1", "enabling switch")]
)
def test_the_switch_is_named_as_in_its_mode_and_said_once(session, mode, name):
    s = session(krc__mode=mode)
    s.monitor()
    for pressed in (True, False, False, True, True):
        s.cell.enabling_switch(pressed)
    assert s.texts() == [f"{name} released", f"{name} closed"]
    s.cell.enabling_switch(False)
    assert s.tick()["power"] == 0


def test_drive_errors_by_joint(session):
    s = session()
    s.monitor()
    s.cell.drive_error(0)
    s.cell.drive_error(6)
    fields = s.tick()
    assert (fields["error"], fields["power"]) == (0b1000001, 0)
    assert s.texts() == ["drive error J1", "drive error J7"]
    s.cell.drive_error(0, False)
    assert s.tick()["error"] == 0b1000000
    for joint in (-1, 7):
        with pytest.raises(ValueError, match=f"joint {joint}, expected 0 .. 6"):
            s.cell.drive_error(joint)


def test_messages_are_acknowledged_once_and_the_newest_200_are_kept(session):
    s = session()
    s.monitor()
    s.cell.acknowledge()
    assert s.texts() == []
    s.cell.leave_command_mode("first")
    s.cell.acknowledge()
    s.cell.acknowledge()
    assert s.texts() == ["first", "messages acknowledged"]
    assert s.cell.messages[0][0] == pytest.approx(s.cell.time)
    for i in range(198):
        s.cell.leave_command_mode(f"message {i}")
    assert len(s.texts()) == 200 and s.texts()[0] == "first" and s.texts()[-1] == "message 197"
    s.cell.leave_command_mode("one more")
    assert len(s.texts()) == 200 and s.texts()[0] == "messages acknowledged" and s.texts()[-1] == "one more"


def test_a_program_that_is_started_anew_pauses_and_opens_with_its_period(session):
    s = session()
    s.command()
    for period, pause, words in (
        (0.0009, 0.5, "krc/period = 0.0009"),
        (0.11, 0.5, "krc/period"),
        (0.01, -0.1, "pause"),
    ):
        with pytest.raises(ValueError, match=words):
            s.cell.restart_program(period, pause)
    assert s.tick()["state"] == COMMAND, "nothing was changed"
    s.cell.restart_program(0.01)
    begin = s.cell.time
    assert s.cell.fri_state == 0 and s.cell.period == 0.01
    while s.tick() is None:
        assert s.cell.time < begin + 2.0
    assert s.cell.time - begin == pytest.approx(0.5, abs=0.021)
    fields = parse(s.measurement)
    assert fields["quality"] == 0 and fields["state"] == MONITOR and fields["ints"][15] == 4010


def test_measurements_carry_the_time_and_the_scale(session):
    s = session()
    s.monitor()
    fields = s.tick()
    assert fields["timestamp"] == pytest.approx(s.cell.time) and fields["safety_scale"] == 1.0
    assert s.cell.truth()["time"] == pytest.approx(s.cell.time)
    assert fields["commanded_frame"] == pytest.approx(fields["frame"])
    assert np.array(fields["frame_offset"]).reshape(3, 4) == pytest.approx(np.eye(3, 4), abs=1e-6)
    assert fields["offset"] == (0.0,) * 7


@pytest.mark.parametrize("joint", [0, 5])
def test_full_torque_for_a_while_switches_off_and_names_the_joint(session, joint):
    ended = []
    for while_s in (0.05, 0.25):
        s = session(**EXACT, krc__torque_limit_time=while_s)
        target = np.array(set_point(s.command()))
        s.cell.block(True)
        begin = s.cell.time
        for _ in range(400):
            target[joint] += 0.002
            s.tick(position=target)
            if s.cell.fri_state == MONITOR:
                break
        assert s.texts() == [f"maximum torque exceeded J{joint + 1}"]
        assert s.cell.set_point == pytest.approx(s.cell.position, abs=1e-4), "nothing to jump to"
        ended.append(s.cell.time - begin)
    assert ended[1] - ended[0] == pytest.approx(0.2, abs=0.011)


def test_without_a_joint_command_the_joint_set_point_goes_where_the_arm_goes(session):
    s = session(**QUIET)
    frame = list(s.command(20)["commanded_frame"])
    for _ in range(150):
        frame[3] += 0.0004
        s.client.frame = list(frame)
        s.tick(flags=CARTESIAN_IMPEDANCE)
    # The answer is judged at the beginning of a period, in which the arm moves on a little.
    assert s.cell.set_point == pytest.approx(s.cell.position, abs=0.003)
    assert np.abs(np.array(parse(s.measurement)["offset"])).max() > 0.01
