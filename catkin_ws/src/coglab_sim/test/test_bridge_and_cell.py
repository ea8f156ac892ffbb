"""Both ends of the wire in lockstep: the bridge against the controller stand-in, bytes in between."""

import os
import struct

import lwr_fri_bridge as bridge_module
import numpy as np
import pytest
import yaml
from fri_client import Session, parse, set_point
from wire import BLOCKED_MODES, BLOCKED_MOTIONS, LIMITS, MODES, URDF, Wire, lockstep_bytes, speed_after_block

LONG = os.environ.get("COGLAB_LONG") == "1"


@pytest.mark.parametrize(
    "convention, mode",
    [
        (convention, mode)
        for convention in ("coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc")
        for mode in MODES
        if convention != "rcprg_tum" or mode == "joint_impedance"
    ],
)  # that program fixes the strategy
def test_every_convention_reaches_every_strategy_it_knows(convention, mode):
    wire = Wire({"krl_convention": convention}, krc__convention=convention)
    wire.start(mode)
    assert parse(wire.measurement)["control"] == MODES[mode]
    before = wire.cell.position.copy()
    wire.velocity = np.array([0.3, 0, 0, 0, 0, 0, 0.0])
    wire.run(1.0)
    assert wire.cell.fri_state == 2, wire.cell.messages
    moved = wire.cell.position - before
    assert 0.2 < moved[0] < 0.31 and np.abs(moved[1:]).max() < 0.03
    wire.velocity = None
    assert wire.request("stop")[0]
    assert wire.cell.fri_state == 1 and wire.cell.messages == []


@pytest.mark.parametrize("period", [0.001, 0.005, 0.02] if LONG else [0.005])
@pytest.mark.parametrize("moving", BLOCKED_MOTIONS)
@pytest.mark.parametrize("mode", BLOCKED_MODES)
def test_blocked_for_5_s_then_released(mode, moving, period):
    wire = Wire(krc__period=period)
    assert speed_after_block(wire, mode, moving) <= 0.1
    # A stiff servo reaches the full torque of a small joint before the leash: then the controller's monitor ends it.
    torque = any("maximum torque" in text for _, text in wire.cell.messages)
    assert torque or wire.bridge.snapshot()["leash_trips"] == 1
    if mode not in ("position", "cartesian_impedance") and moving == "A1 A2":
        assert not torque and wire.cell.fri_state == 2


@pytest.mark.parametrize("how", ["10 % both ways", "burst of 50 ms"])
@pytest.mark.parametrize("seed", range(5 if LONG else 2))
def test_losses_beyond_tolerance_end_mirrored_in_monitor_mode(how, seed):
    wire = Wire(krc__period=0.001, seed=seed)
    wire.start()
    wire.velocity = np.array([0.5, -0.3, 0.2, 0.1, -0.5, 0.4, 0.6])
    wire.run(0.4)
    if how.startswith("10"):
        wire.cell.set_loss(0.1, 0.1)
    else:
        wire.cell.lose_next(50)
    last, answers = wire.cell.set_point.copy(), 0
    for _ in range(3000):
        wire.tick()
        fell = wire.cell.fri_state == 1
        if fell:
            break
        assert np.abs(wire.cell.set_point - last).max() <= 0.6 * 0.001 + 1e-6  # not even for one packet
        last = wire.cell.set_point.copy()
        answers += 1
    assert fell
    # It continues from the pose where it stopped, at most its braking distance away.
    assert np.abs(wire.cell.set_point - last).max() < 0.02
    wire.cell.set_loss(0.0, 0.0)
    stood = wire.cell.position.copy()
    for _ in range(500):
        wire.tick()
        if wire.measurement is not None and wire.commands:
            assert np.abs(wire.commands[-1] - wire.cell.position).max() < 0.05
    assert np.abs(wire.cell.position - stood).max() < 0.06
    assert any(
        "successive answers missing" in text or "quality unacceptable" in text for _, text in wire.cell.messages
    )  # the controller says why
    fields = parse(wire.measurement)
    assert fields["power"] == 0 and np.abs(wire.cell.velocity).max() == 0.0
    assert np.abs(wire.commands[-1] - set_point(fields)).max() < 1e-6  # mirrored
    snapshot = wire.bridge.snapshot()
    assert not snapshot["motion_allowed"] and snapshot["fall_backs"] == 1
    assert snapshot["supervisor"] == "stopped"
    assert snapshot["lost_measurements"] > 0
    before = wire.cell.position.copy()  # it stands, and only a start gets it going again
    wire.run(1.0)
    assert np.abs(wire.cell.position - before).max() < 1e-9
    assert wire.request("start")[0]
    wire.run(0.3)
    assert wire.cell.fri_state == 2


@pytest.mark.parametrize("period", [0.001, 0.01])
def test_the_measured_arm_keeps_the_speed_limits_of_the_table(period):
    """Every joint to full speed and back: the servos exceed the commanded speed, but not the table's limit."""
    with open(LIMITS) as table:
        limit = np.array(yaml.safe_load(table)["default"]["velocity"])
    measured, true, sent = np.zeros(7), np.zeros(7), np.zeros(7)
    wire = Wire(krc__period=period, home=[0.0, 0.3, 0.0, 0.9, 0.0, 0.3, 0.0])
    wire.start()
    for joint in range(7):
        for sign in (-1.0, 1.0):
            wire.velocity = np.zeros(7)
            wire.velocity[joint] = sign * 2.0 * limit[joint]
            for _ in range(round(0.45 / period)):
                wire.tick()
                snapshot = wire.bridge.snapshot()
                measured = np.maximum(measured, np.abs(snapshot["velocity"]) / limit)
                sent = np.maximum(sent, np.abs(snapshot["commanded_velocity"]) / limit)
                true = np.maximum(true, np.abs(wire.cell.velocity) / limit)
    assert true.max() <= 1.0 and measured.max() <= 1.0, (true, measured)
    assert measured.min() > 0.95 and sent.max() < 1.0  # and the limits are used


def test_lockstep_gives_the_same_bytes_twice():
    assert lockstep_bytes(6, 3000) == lockstep_bytes(6, 3000)
    assert lockstep_bytes(6, 300) != lockstep_bytes(7, 300)


def rubbish(random, good: bytes, old: list[bytes]) -> bytes:
    """One bad datagram: random, truncated, oversized, replayed (hence reordered), or with a wrong header."""
    kind = int(random.integers(0, 6))
    if kind == 0:
        return random.bytes(int(random.integers(0, 1500)))
    if kind == 1:
        return good[: int(random.integers(0, 376))]
    if kind == 2:
        return good + random.bytes(int(random.integers(1, 1200)))
    if kind == 3:
        return old[int(random.integers(0, len(old)))]
    data = bytearray(good)
    if kind == 4:  # correct length and header, but for an old measurement; the rest is random
        data[8:] = random.bytes(368)
        reflected = struct.unpack_from("<H", good, 2)[0] - int(random.integers(1, 60000))
        struct.pack_into("<H", data, 2, reflected & 0xFFFF)
    else:
        struct.pack_into("<H", data, int(random.choice([4, 6])), int(random.integers(0x1100, 0xFFFF)))
        data[0:2] = random.bytes(2)
    return bytes(data)


def test_rubbish_toward_the_controller():
    """Bad datagrams during a motion: no jump of the set-point, all counted, command mode continues."""
    rounds = 1_000_000 if LONG else 30_000
    wire = Wire(krc__period=0.001)
    wire.start()
    random = np.random.default_rng(2)
    limits = bridge_module.JointLimits(LIMITS)
    before = wire.cell.rejections
    last = wire.cell.set_point.copy()
    old = [wire.bridge.answer(wire.measurement, wire.now)]
    wire.measurement = wire.cell.step(old[0])
    fed = 0
    while fed < rounds:
        if fed % 2000 == 0:
            wire.velocity = random.uniform(-0.3, 0.3, 7)
        wire.bridge.send_velocity(wire.velocity, wire.now)
        wire.now += 1_000_000
        good = wire.bridge.answer(wire.measurement, wire.now)
        turn = int(random.integers(0, 20))  # the true answer comes among the bad ones, then doubled ones too
        for k in range(20):
            if k == turn:
                wire.cell.receive(good)
            wire.cell.receive(rubbish(random, good, [*old, good] if k >= turn else old))
        fed += 20
        wire.measurement = wire.cell.step(None)
        old = [*old[-50:], good]
        assert np.abs(wire.cell.set_point - last).max() <= limits.velocity.max() * 0.001
        last = wire.cell.set_point.copy()
    assert wire.cell.fri_state == 2, wire.cell.messages
    counted = {name: count - before[name] for name, count in wire.cell.rejections.items()}
    assert sum(counted.values()) == fed
    assert all(count > 0 for count in counted.values()), counted


@pytest.mark.parametrize("pause", [0.0, 0.1, 0.6] if LONG else [0.1])
@pytest.mark.parametrize("convention", ["coglab", "centro_epiaggio", "stanford", "rtt_lwr"])
def test_friopen_in_the_middle_of_a_motion(convention, pause):
    """The operator restarts the KRL program while the arm moves: the arm stops, mirrored, until an explicit start."""
    wire = Wire({"krl_convention": convention}, krc__period=0.002, krc__convention=convention)
    wire.start()
    wire.velocity = np.array([0.4, 0, 0, 0, 0, 0.4, 0])
    wire.run(0.5)
    wire.cell.restart_program(0.010, pause)
    stood = wire.cell.set_point.copy()
    for _ in range(300):
        wire.tick()
        assert np.abs(wire.cell.set_point - stood).max() < 1e-6
    fields = parse(wire.measurement)
    assert (fields["state"], fields["command_period"]) == (1, pytest.approx(0.010))
    assert np.abs(wire.commands[-1] - set_point(fields)).max() < 1e-6  # mirrored
    snapshot = wire.bridge.snapshot()
    assert snapshot["fall_backs"] == 1 and not snapshot["motion_allowed"]
    assert wire.request("start")[0], wire.cell.messages
    before = wire.cell.set_point.copy()
    wire.run(1.0)
    assert wire.cell.set_point[0] - before[0] == pytest.approx(0.4, abs=0.05)
    assert wire.cell.messages == []


def test_the_program_of_rcprg_opens_fri_again_on_request():
    """FRM_INT[1] = 3 with the period (ms) in FRM_INT[2], as in requests of its own PC stack."""
    s = Session(URDF, krc__period=0.002, krc__convention="rcprg_tum")
    s.monitor()
    s.client.ints[0:2], s.client.bools = [3, 10], 1
    s.run(0.3)
    assert s.cell.period == pytest.approx(0.010)
    s.client.bools = 0
    fields = s.run(1.5)
    assert fields["command_period"] == pytest.approx(0.010) and fields["quality"] == 3
    s.client.ints[0:2], s.client.bools = [3, 500], 1  # out of range: said, and FRI stays closed
    s.run(0.3)
    assert any("friOpen: period" in text for text in s.texts())


def test_t1_profile_is_slow_enough_for_t1():
    """At the highest target velocity the t1 profile never trips the controller's T1 limit; the default profile does."""
    for profile, good in (("t1", True), ("default", False)):
        wire = Wire(profile=profile, krc__mode="T1")
        wire.start()
        for tick in range(1500):
            wire.velocity = np.full(7, 2.0) * np.sin(0.01 * tick)
            wire.tick()
        assert (wire.cell.fri_state == 2) == good, wire.cell.messages
        assert any("FRI speed limit" in text for _, text in wire.cell.messages) != good
