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
