"""What goes wrong between the controller stand-in and its client: losses, fall-backs, power, silence, rubbish."""

import random

import numpy as np
import pytest
from fri_client import COMMAND, MONITOR, parse, set_point


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


def test_ten_percent_loss_both_ways_ends_in_monitor_mode(session):
    ended = 0
    for seed in range(5):
        s = session(seed=seed, krc__period=0.001)
        s.command()
        s.cell.set_loss(0.1, 0.1)
        position = s.cell.position.copy()
        for _ in range(3000):
            s.tick()
        ended += s.cell.fri_state == MONITOR
        assert np.abs(s.cell.position - position).max() < 0.01
    assert ended == 5


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


def test_blocked_arm_in_position_mode_trips_on_torque(session):
    s = session()
    target = np.array(set_point(s.command()))
    s.cell.block(True)
    for _ in range(100):
        target[0] += 0.002
        s.tick(position=target)
    assert s.cell.fri_state == MONITOR
    assert "maximum torque exceeded J1" in s.texts()


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


def test_rubbish_is_no_answer(session):
    """Random, cut, long, replayed and reordered datagrams: all counted, none followed."""
    s = session()
    s.command()
    dice = random.Random(11)
    before = s.cell.position.copy()
    good = [s.client.answer(s.measurement)]
    s.tick()  # a newer answer than that was taken, so that all of `good` is old from now on
    fed = 4000
    for _ in range(fed):
        kind = dice.randrange(5)
        good.append(s.client.answer(s.measurement))
        del good[:-20]
        if kind == 0:
            data = dice.randbytes(dice.choice([0, 1, 8, 375, 376, 377, 2000]))
        elif kind == 1:
            data = good[-1][: dice.randrange(376)]
        elif kind == 2:
            data = dice.choice(good[:-1]) if len(good) > 1 else b""
        elif kind == 3:
            data = good[-1] + b"x"
        else:
            wrong = bytearray(good[-1])
            at = dice.choice([4, 6])
            wrong[at] ^= dice.randrange(1, 256)
            data = bytes(wrong)
        s.cell.receive(data)
        s.tick()
    assert s.cell.fri_state == COMMAND
    assert sum(s.cell.rejections.values()) == fed
    assert np.abs(s.cell.position - before).max() < 1e-3
