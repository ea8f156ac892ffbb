"""Bridge and controller with random target velocities, as far as the arm moves freely, and into the board."""

import numpy as np
from wire import Wire


def touching(wire: Wire) -> bool:
    """Whether the arm touches anything: without contact the torque of the surroundings is exactly nothing."""
    return bool(np.any(wire.cell.truth()["external_torque"] != 0.0))


def test_no_answer_ever_trips_a_limit_of_the_controller():
    """Random target velocities at every tick: bridge and controller agree on what is allowed. An arm that touches the
    board or itself begins again at home: what comes of that is the next test's."""
    random = np.random.default_rng(8)
    for period in (0.001, 0.005, 0.02):
        ticks = 0
        while ticks < round(6.0 / period):
            wire = Wire(krc__period=period)
            wire.start()
            while ticks < round(6.0 / period) and not touching(wire):
                if ticks % 7 == 0:
                    wire.velocity = random.uniform(-3.0, 3.0, 7)
                wire.tick()
                ticks += 1
                assert wire.cell.fri_state == 2, (period, wire.cell.messages)


def test_an_arm_that_runs_into_the_board_is_stopped_by_the_torque_of_a_drive():
    """Traced: the hand meets the board at 3.2 s, which asks more of J6 than its drive's 38 Nm; it stays behind its
    set-point, and the controller trips. Nothing trips before the contact."""
    random = np.random.default_rng(8)
    random.uniform(-3.0, 3.0, (858, 7))  # those of the period of 1 ms
    wire = Wire(krc__period=0.005)
    wire.start()
    asked, touched = 0.0, False
    for tick in range(1200):
        if tick % 7 == 0:
            wire.velocity = random.uniform(-3.0, 3.0, 7)
        wire.tick()
        touched = touched or touching(wire)
        asked = max(asked, abs(wire.cell.truth()["external_torque"][5]))
        if wire.cell.fri_state != 2:
            break
    assert touched and asked > 38.0
    assert wire.cell.messages[-1][1] == "maximum torque exceeded J6"
