"""The controller stand-in's session: states, statistics, power, entry; fri_client reads the bytes again."""

import math

import numpy as np
import pytest
from fri_client import COMMAND, JOINT_IMPEDANCE, JOINT_POSITION, MONITOR, parse, set_point


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


def test_quality_is_earned_over_100_packets(session):
    s = session()
    seen = [s.tick()["quality"] for _ in range(101)]
    changes = {level: seen.index(level) for level in (1, 2, 3)}
    assert changes == {1: 80, 2: 95, 3: 99}
    levels = []
    for _ in range(25):  # without answers it falls again through all levels
        levels.append(s.tick(answer=False)["quality"])
    assert sorted(set(levels), reverse=True) == [3, 2, 1, 0]
    fields = s.tick(answer=False)
    assert fields["miss_counter"] >= 25
    assert fields["miss_rate"] == pytest.approx(1.0 - fields["answer_rate"])


def test_power_is_the_true_pattern(session):
    s = session()
    patterns = {s.tick()["power"] for _ in range(600)}
    assert patterns == {0, 0x7F}


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


@pytest.mark.parametrize("joint", range(7))
def test_jump_on_entry_is_an_interpolation_error(session, joint):
    s = session()
    fields = s.monitor()
    wrong = np.array(set_point(fields))
    wrong[joint] += 2e-4
    s.client.request(1, 10)
    s.run(0.5, position=wrong)
    assert parse(s.measurement)["state"] == MONITOR
    assert any(text.startswith("FRI interpolation error") for text in s.texts())
    assert parse(s.measurement)["power"] == 0  # brakes


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


def test_t1_is_slower(session):
    s = session(krc__mode="T1")
    target = np.array(set_point(s.command()))
    target[0] += 0.5 * s.cell.period
    s.tick(position=target)
    s.tick(position=target)
    assert "FRI speed limit J1 (A1)" in s.texts()


def test_axis_limits_are_kept(session):
    home = [0.0, 2.09, 0.0, 0.3, 0.0, 0.3, 0.0]
    s = session(home=home)
    target = np.array(set_point(s.command()))
    for _ in range(5):
        target[1] += 0.002
        fields = s.tick(position=target)
    assert fields["state"] == MONITOR
    assert "software limit switch A2" in s.texts()
    assert s.cell.limit_switches == 1


def test_an_axis_that_goes_on_by_itself_runs_into_its_limit_switch_too(session):
    """The last step before answers are missing led to the switch: extrapolation is no way past it."""
    s = session(home=[0.0, 2.09, 0.0, 0.3, 0.0, 0.3, 0.0])
    target = np.array(set_point(s.command()))
    for _ in range(2):
        target[1] += 0.0018
        s.tick(position=target)
    assert s.cell.limit_switches == 0 and parse(s.measurement)["state"] == COMMAND
    for _ in range(3):
        s.tick(answer=False)
    assert s.cell.limit_switches == 1
    assert parse(s.measurement)["state"] == MONITOR
    assert s.texts().count("software limit switch A2") == 1


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


def test_flags_may_not_change_in_command_mode(session):
    s = session()
    s.command()
    s.tick(flags=JOINT_IMPEDANCE)
    assert parse(s.measurement)["state"] == MONITOR
    assert "cmdFlags changed during cmd mode" in s.texts()


def test_flags_must_fit_the_strategy(session):
    s = session()
    s.monitor()
    s.client.flags = JOINT_POSITION
    s.client.request(1, 20)
    s.run(0.5)
    assert parse(s.measurement)["state"] == MONITOR
    assert "cmdFlags do not fit the control strategy" in s.texts()


def test_added_torque_has_to_be_ramped(session):
    s = session()
    s.monitor()
    s.client.torque = [2.0] + [0.0] * 6
    s.client.flags = JOINT_IMPEDANCE
    s.client.request(1, 30)
    s.run(0.5)
    assert "cmd.addJntTrq not properly initialized" in s.texts()

    s = session()
    s.command(30)
    for step in range(1, 11):
        s.client.torque = [0.5 * step] + [0.0] * 6
        fields = s.tick()
    assert fields["state"] == COMMAND
    s.client.torque = [8.0] + [0.0] * 6
    assert s.tick()["state"] == MONITOR


def test_cartesian_frame_has_to_be_mirrored(session):
    s = session()
    fields = s.monitor()
    frame = list(fields["commanded_frame"])
    frame[3] += 0.01
    s.client.frame = frame
    s.client.flags = 0x3500
    s.client.request(1, 20)
    s.run(0.5)
    assert "cmd.cartPos not properly initialized" in s.texts()


def test_strategies_move_the_arm(session):
    s = session()
    start = np.array(set_point(s.command(30)))
    target = start.copy()
    for i in range(400):
        target[3] = start[3] - 0.1 * (1 - math.cos(min(i, 314) * 0.01))
        fields = s.tick(position=target)
    s.run(1.0, position=target)
    assert abs(parse(s.measurement)["position"][3] - target[3]) < 0.01

    s = session()
    fields = s.command(20)
    frame = list(fields["commanded_frame"])
    s.client.frame = frame
    for _ in range(200):
        frame[7] += 0.0005
        s.client.frame = list(frame)
        fields = s.tick()
    fields = s.run(1.0)
    assert fields["state"] == COMMAND
    assert fields["frame"][7] == pytest.approx(frame[7], abs=0.005)
    assert fields["frame"][3] == pytest.approx(frame[3], abs=0.005)


@pytest.mark.parametrize("period", [0.001, 0.002, 0.005, 0.012, 0.1])
def test_periods(session, period):
    s = session(krc__period=period)
    s.command()
    before = s.cell.time
    s.tick()
    assert s.cell.time - before == pytest.approx(period)


@pytest.mark.parametrize(
    "name, value",
    [
        ("krc/period", 0.0005),
        ("krc/period", 0.2),
        ("krc/quality_ok", 2.0),
        ("krc/extrapolated_packets", -1),
        ("krc/nonsense", 1.0),
        ("krc/convention", "nobody"),
        ("krc/mode", "T3"),
        ("home", [0.0] * 6),
        ("object/mass", -1.0),
        ("object/shape", "pyramid"),
        ("krc/krl_poll", float("nan")),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(session, name, value):
    with pytest.raises(ValueError) as error:
        session(**{name.replace("/", "__"): value})
    assert name.split("/")[-1].split("_")[0] in str(error.value)


def test_first_counter_of_the_peer_is_free_and_wraps(session):
    s = session()
    s.client.counter = 65500
    s.command()
    assert s.cell.rejections == {"wrong_size": 0, "wrong_header": 0, "stale": 0, "repeated": 0}


def test_same_seed_same_bytes(session):
    def record(seed):
        s = session(seed=seed, krc__period=0.002)
        s.command()
        s.cell.set_loss(0.02, 0.02)
        s.cell.set_human([0.6, 0.1, 0.6], grip=1.0)
        out = []
        start = s.cell.set_point.copy()
        for i in range(2000):
            target = start.copy()
            target[2] += 0.05 * (1 - math.cos(i * 0.005))
            s.tick(position=target)
            out.append(s.measurement)
        return out

    first = record(9)
    assert first == record(9)
    assert first != record(10)
