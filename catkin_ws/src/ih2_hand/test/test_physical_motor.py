"""The emulator's bytes if the physics turns the motors and provides positions, currents and the stop at contact."""

from types import SimpleNamespace

import pytest
import rospy
from coglab_py import pace
from ih2_hand import frames
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.physical_motor import MotorState
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.ros.emulator_node import CellClock

FREE, STROKE_S, DT = 40.0, 1.0, 0.005


class Physics:
    """Five motors on springs: from `meets` (share of the stroke) on, effort grows by `stiffness` counts per stroke."""

    def __init__(self, meets=(1.1,) * 5, stiffness=4000.0):
        self.meets, self.stiffness = meets, stiffness
        self.position = [0.0] * 5
        self.slow = [0.0] * 5
        self.orders = [None] * 5

    def effort(self, i):
        return max(0.0, self.position[i] - self.meets[i]) * self.stiffness

    def step(self, orders):
        states = []
        for i, order in enumerate(orders):
            if order != self.orders[i]:
                self.orders[i], self.slow[i] = order, 0.0
            speed, target, current = order
            way, rate = target - self.position[i], speed / STROKE_S
            if way > 0.0:
                rate *= min(1.0, max(0.0, (current - FREE - self.effort(i)) / (0.2 * max(1.0, current - FREE))))
            wants = speed > 0.0 and abs(way) > 1e-6
            locked = wants and self.slow[i] >= 0.2
            moving = wants and not locked and rate > 0.05 * speed
            if wants and not locked:
                self.position[i] += max(-rate * DT, min(rate * DT, way))
                self.slow[i] = 0.0 if moving else self.slow[i] + DT
            states.append(
                MotorState(
                    min(1.0, max(0.0, self.position[i])),
                    (FREE + self.effort(i)) if wants and not locked else 0.0,
                    self.effort(i),
                    moving,
                    locked,
                )
            )
        return states


class Bench:
    def __init__(self, **kw):
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, physical=True, greeting=True)
        self.driver = HandSerialDriver(transport=VirtualLink(self.hand, self.clock), clock=self.clock)
        self.physics = Physics(**kw)

    def run(self, seconds):
        for _ in range(int(seconds / DT)):
            self.clock.now += DT
            self.hand.follow(self.physics.step(self.hand.orders()))
            self.hand.advance()


def test_a_posture_is_reached_by_the_physics():
    bench = Bench()
    bench.driver.set_hand_posture([245, 5, 30, 50, 100])
    assert bench.driver.get_finger_position(0) == 0  # nothing has turned yet
    bench.run(1.2)
    assert [bench.driver.get_finger_position(m) for m in range(5)] == pytest.approx([245, 5, 30, 50, 100], abs=1)
    assert all(bench.driver.get_finger_status(m)["target_reached"] for m in range(5))
    assert all(bench.driver.get_motor_current(m) == 0 for m in range(5))


def test_a_grasp_stops_at_contact_and_says_so():
    bench = Bench(meets=(1.1, 0.4, 0.5, 1.1, 0.6))
    bench.driver.set_grasp_mode("cylindrical", "medium", True)
    bench.run(1.2)
    bench.driver.grasp_mode_close()
    bench.run(0.3)
    assert bench.driver.get_finger_status(3)["moving"] and bench.driver.get_motor_current(3) >= FREE
    bench.run(2.0)
    status = [bench.driver.get_finger_status(m) for m in range(5)]
    for motor, share in ((1, 0.4), (2, 0.5), (4, 0.6)):
        assert (
            status[motor]["raw"] == 0x10 and not status[motor]["fully_closed"]
        )  # stopped after its current was reached
        assert 255 * share < bench.driver.get_finger_position(motor) < 255 * (share + 0.08)
        assert bench.driver.get_motor_current(motor) == 0 and bench.driver.get_finger_force(motor) > 30
    assert status[3]["fully_closed"] and not status[3]["target_reached"]  # it met nothing


def test_speed_moves_end_at_the_end_sensors_and_stop_holds():
    bench = Bench()
    for motor in range(1, 5):
        bench.driver.move_motor(motor, 256, True)
    bench.run(1.0)
    assert 100 < bench.driver.get_finger_position(2) < 150
    bench.driver.stop_all()
    bench.run(0.5)
    assert 100 < bench.driver.get_finger_position(2) < 150
    bench.driver.move_motor(2, 511, True)
    bench.run(1.0)
    assert bench.driver.get_finger_status(2)["raw"] == 0x04
    bench.driver.move_motor(2, 511, False)
    bench.run(1.2)
    assert bench.driver.get_finger_status(2)["raw"] == 0x08


def test_a_calibration_in_a_slowed_cell_opens_the_fingers(monkeypatch):
    """The cell runs at a quarter of real time: the fingers need four times as long, and so does the calibration."""
    now, factor = [100.0], 0.25
    monkeypatch.setattr(pace, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(rospy, "get_time", lambda: now[0])
    slowed = pace.Pace()
    slowed.change(factor)
    hand, physics = EmulatedHand(CellClock(slowed), physical=True), Physics()
    physics.position = [1.0] * 5
    hand.receive(bytes((frames.FAST_CALIBRATION,)))
    while hand.calibrating:
        now[0] += DT / factor
        hand.follow(physics.step(hand.orders()))
        hand.advance()
    assert physics.position == pytest.approx([0.0] * 5, abs=0.001)
