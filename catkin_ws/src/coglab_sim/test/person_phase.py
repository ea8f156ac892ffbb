"""A simulated person in one phase, with given percepts, for tests of the phase's end and of the hand's motion."""

import numpy as np
from coglab_py.pose import Pose
from coglab_sim.person.senses import Percept

DT = 0.01
WEIGHT = 0.31 * 9.81
FAR = (-5.0, 0.0, 0.0)


def percept(palm=FAR, thing=(0.0, 0.0, 0.0), load=(0.0, 0.0, 0.0), closure=0.0, closing=0.0, speed=0.0):
    """A percept without errors: palm and object without rotation, load on the person's hand in N."""
    still = np.zeros(6)
    places = [Pose(np.array(place, dtype=float)) for place in (palm, thing)]
    return Percept(places[0], still, speed, closure, closing, places[1], still, np.array(load, dtype=float))


def carried(share, aside=0.0):
    """Load (N) of a share of the mug's weight, and a force to the side."""
    return (0.0, aside, -share * WEIGHT)
