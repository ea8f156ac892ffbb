"""A simulated person in one of their phases, who is told directly what they perceive: for tests of when a phase ends
and what the hand does in it."""

import numpy as np
from coglab_py.pose import Pose
from coglab_sim.person.senses import Percept

DT = 0.01
WEIGHT = 0.31 * 9.81
FAR = (-5.0, 0.0, 0.0)


def percept(palm=FAR, thing=(0.0, 0.0, 0.0), load=(0.0, 0.0, 0.0), closure=0.0, closing=0.0, speed=0.0):
    """What is perceived, without any error: palm and object not turned, load in N on the person's hand."""
    still = np.zeros(6)
    places = [Pose(np.array(place, dtype=float)) for place in (palm, thing)]
    return Percept(places[0], still, speed, closure, closing, places[1], still, np.array(load, dtype=float))


def carried(share, aside=0.0):
    """N, of that share of the mug's weight, and a force to the side."""
    return (0.0, aside, -share * WEIGHT)
