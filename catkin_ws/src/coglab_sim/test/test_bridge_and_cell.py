"""Both ends of the wire in lockstep: the bridge against the controller stand-in, bytes in between."""
import os
from pathlib import Path

import numpy as np
import pytest
from fri_client import parse, set_point

bridge_module = pytest.importorskip('lwr_fri_bridge', reason='the bridge is not built')
SOURCES = Path(__file__).resolve().parents[2]
URDF = str(SOURCES / 'lwr_description' / 'urdf' / 'lwr_ih2.urdf')
LIMITS = str(SOURCES / 'lwr_description' / 'config' / 'joint_limits.yaml')
LONG = os.environ.get('COGLAB_LONG') == '1'


class Wire:
    """Bridge and cell, one FRI period per tick()."""

    def __init__(self, bridge=None, profile='default', **parameters) -> None:
        from coglab_sim import _cell
        parameters = {key.replace('__', '/'): value for key, value in parameters.items()}
        self.cell = _cell.Cell(URDF, parameters)
        self.bridge = bridge_module.Bridge(LIMITS, profile, **(bridge or {}))
        self.measurement = None
        self.now = 0
        self.velocity = None
        self.commands = []

    def tick(self) -> None:
        answer = None
        if self.measurement is not None:
            answer = self.bridge.answer(self.measurement, self.now)
        else:
            self.bridge.idle(self.now)
        if self.velocity is not None:
            self.bridge.send_velocity(self.velocity, self.now)
        if answer is not None:
            self.commands.append(np.frombuffer(answer, np.float32, 7, 144).astype(float))
            del self.commands[:-4]
        self.measurement = self.cell.step(answer)
        self.now += round(self.cell.period * 1e9)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.cell.period)):
            self.tick()

    def request(self, event: str, limit: float = 15.0) -> tuple[bool, str]:
        """Submits an event and waits, in simulated time."""
        ticket = self.bridge.submit(event)
        for _ in range(round(limit / self.cell.period)):
            self.tick()
            outcome = self.bridge.outcome(ticket)
            if outcome is not None:
                return outcome
        raise AssertionError(f'{event}: no outcome within {limit} s')

    def start(self, mode: str = 'position') -> None:
        self.run(max(1.5, 110 * self.cell.period))
        for event in (mode, 'start'):
            good, message = self.request(event)
            assert good, (message, self.cell.messages)


MODES = {'position': 1, 'cartesian_impedance': 2, 'joint_impedance': 3}


@pytest.mark.parametrize('convention, mode', [
    (convention, mode) for convention in ('coglab', 'centro_epiaggio', 'stanford', 'rcprg_tum', 'rtt_lwr')
    for mode in MODES if convention != 'rcprg_tum' or mode == 'joint_impedance'])  # that program fixes the strategy
def test_every_convention_reaches_every_strategy_it_knows(convention, mode):
    wire = Wire({'krl_convention': convention}, krc__convention=convention)
    wire.start(mode)
    assert parse(wire.measurement)['control'] == MODES[mode]
    before = wire.cell.position.copy()
    wire.velocity = np.array([0.3, 0, 0, 0, 0, 0, 0.0])
    wire.run(1.0)
    assert wire.cell.fri_state == 2, wire.cell.messages
    moved = wire.cell.position - before
    assert 0.2 < moved[0] < 0.31 and np.abs(moved[1:]).max() < 0.03
    wire.velocity = None
    assert wire.request('stop')[0]
    assert wire.cell.fri_state == 1 and wire.cell.messages == []


@pytest.mark.parametrize('period', [0.001, 0.005, 0.02])
@pytest.mark.parametrize('mode', ['position', 'joint_impedance', 'joint_impedance stiffness 200 damping 0.7',
                                  'cartesian_impedance'])
def test_blocked_for_5_s_then_released(mode, period):
    wire = Wire(krc__period=period)
    wire.start(mode)
    wire.velocity = np.array([0.4, 0.2, 0.0, 0.0, 0.0, 0.3, 0.0])
    wire.run(0.6)
    wire.cell.block(True)
    wire.run(5.0)
    wire.cell.block(False)
    peak = 0.0
    for _ in range(round(3.0 / period)):
        wire.tick()
        peak = max(peak, np.abs(wire.cell.velocity).max())
    assert peak <= 0.1


@pytest.mark.parametrize('burst', [1, 2, 3, 5])
def test_losses_within_tolerance_are_ridden_through(burst):
    wire = Wire(krc__period=0.001)
    wire.start()
    wire.velocity = np.array([0.5, -0.3, 0.2, 0.1, -0.5, 0.4, 0.6])
    wire.run(0.5)
    last = wire.cell.set_point.copy()
    for i in range(600):
        if i % 60 == 0:
            wire.cell.lose_next(burst)
        wire.tick()
        step = np.abs(wire.cell.set_point - last).max()
        assert step <= 2.3 * 0.001
        last = wire.cell.set_point.copy()
    assert wire.cell.fri_state == 2, wire.cell.messages


@pytest.mark.parametrize('how', ['10 % both ways', 'burst of 50 ms'])
@pytest.mark.parametrize('seed', range(5))
def test_losses_beyond_tolerance_end_mirrored_in_monitor_mode(how, seed):
    wire = Wire(krc__period=0.001, seed=seed)
    wire.start()
    wire.velocity = np.array([0.5, -0.3, 0.2, 0.1, -0.5, 0.4, 0.6])
    wire.run(0.4)
    if how.startswith('10'):
        wire.cell.set_loss(0.1, 0.1)
    else:
        wire.cell.lose_next(50)
    for _ in range(3000):
        wire.tick()
        if wire.cell.fri_state == 1:
            break
    assert wire.cell.fri_state == 1
    wire.cell.set_loss(0.0, 0.0)
    wire.run(0.5)
    fields = parse(wire.measurement)
    assert fields['power'] == 0 and np.abs(wire.cell.velocity).max() == 0.0
    assert np.abs(wire.commands[-1] - set_point(fields)).max() < 1e-6  # mirrored
    snapshot = wire.bridge.snapshot()
    assert not snapshot['motion_allowed'] and snapshot['fall_backs'] == 1
    before = wire.cell.position.copy()  # it stands, and only a start gets it going again
    wire.run(1.0)
    assert np.abs(wire.cell.position - before).max() < 1e-9
    assert wire.request('start')[0]
    wire.run(0.3)
    assert wire.cell.fri_state == 2


def test_no_position_limit_is_crossed_at_top_speed():
    limits = bridge_module.JointLimits(LIMITS)
    random = np.random.default_rng(3)
    for case in range(200 if LONG else 14):
        joint, side = case % 7, 1.0 if case % 14 < 7 else -1.0
        home = random.uniform(-0.6, 0.6, 7)
        home[joint] = side * random.uniform(0.3, 0.8) * limits.upper_position[joint]
        wire = Wire(krc__period=0.005, home=list(home))
        wire.start()
        wire.velocity = np.zeros(7)
        wire.velocity[joint] = side * limits.velocity[joint]
        for _ in range(800):
            wire.tick()
            assert abs(wire.cell.set_point[joint]) <= limits.upper_position[joint]
        assert wire.cell.fri_state == 2, wire.cell.messages
        assert abs(wire.cell.set_point[joint]) > limits.upper_position[joint] - 0.05


def test_no_answer_ever_trips_a_limit_of_the_controller():
    """Random target velocities at every tick: bridge and controller agree on what is allowed."""
    random = np.random.default_rng(8)
    for period in (0.001, 0.005, 0.02):
        wire = Wire(krc__period=period)
        wire.start()
        for tick in range(round(6.0 / period)):
            if tick % 7 == 0:
                wire.velocity = random.uniform(-3.0, 3.0, 7)
            wire.tick()
            assert wire.cell.fri_state == 2, (period, wire.cell.messages)


def test_lockstep_gives_the_same_bytes_twice():
    def record():
        wire = Wire(krc__period=0.002, seed=6)
        wire.start('joint_impedance')
        out = []
        for tick in range(3000):
            wire.velocity = 0.4 * np.sin(tick * 0.002 * np.arange(1, 8))
            if tick == 1000:
                wire.cell.set_loss(0.01, 0.01)
            wire.tick()
            out.append(wire.measurement)
        return out

    assert record() == record()


def test_rubbish_toward_the_controller():
    """Random, cut, long and replayed datagrams beside a running session: no reaction of the arm, all counted."""
    rounds = 1_000_000 if LONG else 20_000
    wire = Wire(krc__period=0.001)
    wire.start()
    random = np.random.default_rng(2)
    before = wire.cell.position.copy()
    rejected = sum(wire.cell.rejections.values())
    old = b''
    for i in range(rounds):
        kind = i % 4
        if kind == 0:
            data = random.bytes(int(random.integers(0, 600)))
        elif kind == 1:
            data = old[:int(random.integers(0, 376))]
        elif kind == 2:
            data = old + b'0'
        else:
            data = old
        wire.cell.receive(data)
        if i % 10 == 0:
            old = wire.bridge.answer(wire.measurement, wire.now)
            wire.measurement = wire.cell.step(old)
            wire.now += 1_000_000
    assert wire.cell.fri_state == 2
    assert np.abs(wire.cell.position - before).max() < 1e-3
    assert sum(wire.cell.rejections.values()) - rejected >= rounds - 1
