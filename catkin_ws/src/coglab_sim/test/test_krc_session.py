"""The controller stand-in's session: states, statistics, power, entry; fri_client reads the bytes again."""

import math

import numpy as np
import pytest
from fri_client import CARTESIAN_IMPEDANCE, COMMAND, JOINT_IMPEDANCE, MONITOR, parse, set_point
from test_object import EXACT


def test_first_measurements_look_like_a_controllers(session):
    s = session(krc__period=0.005)
    raw = []
    for _ in range(3):
        s.tick()
        raw.append(s.measurement)
    first, second = parse(raw[0]), parse(raw[1])
    assert raw[0][:8] == bytes([1, 0, 0, 0, 0x94, 0x03, 0x06, 0x20])
    assert second["header"] == (2, 1, 916, 0x2006)
    assert first["state"] == MONITOR and first["quality"] == 0 and first["control"] == 1
    assert first["measurement_period"] == first["command_period"] == pytest.approx(0.005)
    times = [parse(data)["timestamp"] for data in raw]
    assert times == sorted(times) and len(set(times)) == 3


def test_command_mode_follows_and_keeps_the_controllers_own_command(session):
    s = session()
    own = s.command()["commanded"]
    start = np.array(set_point(parse(s.measurement)))
    for i in range(400):
        target = start.copy()
        target[0] += 0.1 * (1 - math.cos(i * 0.01))
        fields = s.tick(position=target)
    assert fields["state"] == COMMAND
    assert fields["commanded"] == own
    assert np.abs(np.array(set_point(fields)) - target).max() < 1e-6
    assert abs(fields["position"][0] - target[0]) < 2e-3


@pytest.mark.parametrize("share, ok", [(0.98, True), (1.20, False)])
def test_speed_limit_per_joint(session, share, ok):
    limits = [2.0943951, 2.0943951, 2.7925268, 2.7925268, 4.3633231, 3.8397244, 3.8397244]
    for joint, limit in enumerate(limits):
        s = session()
        target = np.array(set_point(s.command()))
        direction = -1.0 if target[joint] > 0 else 1.0
        for _ in range(3):
            target[joint] += direction * limit * s.cell.period * share
            fields = s.tick(position=target)
        assert (fields["state"] == COMMAND) == ok
        if not ok:
            assert any(text.startswith(f"FRI speed limit J{joint + 1}") for text in s.texts())


def test_a_standing_axis_at_its_end_meets_no_limit_switch(session):
    s = session(home=[0.0, 2.0943, 0.0, 0.3, 0.0, 0.3, 0.0])
    target = np.array(set_point(s.command()))
    for _ in range(5):
        s.tick(position=target)
        s.tick(answer=False)
    assert s.cell.limit_switches == 0 and parse(s.measurement)["state"] == COMMAND


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_not_a_number_is_not_followed(session, bad):
    s = session()
    target = np.array(set_point(s.command()))
    before = np.array(s.cell.set_point)
    target[3] = bad
    fields = s.tick(position=target)
    assert fields["state"] == MONITOR
    assert "cmd.jntPos not properly initialized" in s.texts()
    assert np.all(np.isfinite(s.cell.set_point)) and np.abs(s.cell.set_point - before).max() < 0.01


@pytest.mark.parametrize("lost, ridden", [(1, True), (3, True), (5, True), (6, False), (20, False)])
def test_losses_are_bridged_by_extrapolation(session, lost, ridden):
    s = session()
    target = np.array(set_point(s.command()))
    step = np.zeros(7)
    step[0] = 0.002
    for _ in range(10):
        target += step
        s.tick(position=target)
    for _ in range(lost):
        fields = s.tick(position=None, answer=False)
    if ridden:
        assert fields["state"] == COMMAND
        assert set_point(fields)[0] == pytest.approx(target[0] + lost * 0.002, abs=1e-5)
        target[0] = set_point(fields)[0] + 0.002
        assert s.tick(position=target)["state"] == COMMAND
    else:
        fields = s.tick()
        assert fields["state"] == MONITOR and fields["power"] == 0
        assert any("successive answers missing" in text for text in s.texts())


def test_fall_back_brakes_and_the_program_comes_back(session):
    s = session()
    target = np.array(set_point(s.command()))
    for _ in range(50):
        target[0] += 0.005
        s.tick(position=target)
    assert abs(s.cell.velocity[0]) > 0.5
    s.cell.leave_command_mode("fault injected")
    s.run(0.3)
    assert np.abs(s.cell.velocity).max() == 0.0
    fields = parse(s.measurement)
    assert np.abs(np.array(set_point(fields)) - fields["position"]).max() < 1e-6  # nothing to jump to
    s.client.request(1, 10)
    s.run(2.0)
    assert parse(s.measurement)["state"] == COMMAND


def test_errors_can_wait_for_an_operator(session):
    s = session(krc__acknowledge_by_program=False)
    s.command()
    s.cell.leave_command_mode("fault injected")
    s.client.request(1, 10)
    s.run(4.0)
    fields = parse(s.measurement)
    assert fields["state"] == MONITOR and fields["power"] == 0
    assert fields["ints"][1] == -4 and "acknowledgement required" in s.texts()
    s.cell.acknowledge()
    s.client.request(1, 10)
    s.run(2.0)
    assert parse(s.measurement)["state"] == COMMAND


def test_enabling_switch_takes_power_and_asks_for_a_new_mirror(session):
    s = session(krc__mode="T2")
    s.command()
    s.cell.enabling_switch(False)
    fields = s.run(0.2)
    assert fields["state"] == COMMAND and fields["power"] == 0
    s.cell.enabling_switch(True)
    assert s.run(0.2)["state"] == COMMAND
    assert parse(s.measurement)["power"] == 0x7F

    s.cell.enabling_switch(False)
    s.run(0.2)
    s.cell.enabling_switch(True)
    wrong = np.array(set_point(parse(s.measurement))) + 0.003
    s.run(0.1, position=wrong)
    assert s.cell.fri_state == MONITOR
    assert any("interpolation error" in text for text in s.texts())


def test_drive_error_switches_everything_off(session):
    s = session()
    s.command()
    s.cell.drive_error(4)
    fields = s.run(0.05)
    assert (fields["state"], fields["power"], fields["error"]) == (MONITOR, 0, 1 << 4)
    s.client.request(1, 10)
    assert s.run(5.0)["ints"][1] == -4  # no drives
    s.cell.drive_error(4, False)
    s.client.request(1, 10)
    assert s.run(2.0)["state"] == COMMAND


def test_silence_sends_nothing_and_does_not_count(session):
    s = session()
    fields = s.monitor()
    s.cell.silence(0.5)
    sent = s.sent
    s.run(0.4)
    assert s.sent == sent
    later = s.run(1.0)
    assert later["miss_counter"] <= fields["miss_counter"] + 1
    assert later["quality"] == 3


QUIET = {**EXACT, "arm__coulomb_friction": [0.0] * 7}
"""no friction: an arm that is pushed goes to where its springs hold it"""


def pushed(s, force, torque=(0.0, 0.0, 0.0), seconds=4.0):
    """Position and frame of the arm before a push and after it."""
    before = s.tick()
    s.cell.set_push(list(force), list(torque))
    return before, s.run(seconds)


def yields(before, after):
    """Joint torque of the push over the way that each joint gives, Nm/rad."""
    jacobian = np.array(before["jacobian"]).reshape(6, 7)
    return jacobian, np.array(after["position"]) - np.array(before["position"])


def test_values_of_the_pc_apply_while_it_sends_them(session):
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


def test_a_moving_frame_is_followed_without_lag(session):
    """The damper gets the frame's speed: at 50 mm/s and 2000 N/m the lag is below a millimetre."""
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


# -- messages, faults, restarts -----------------------------------------------------------------------------------


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
