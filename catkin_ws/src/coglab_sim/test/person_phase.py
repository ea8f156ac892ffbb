"""A simulated person in one of their phases, who is told directly what they perceive: for tests of when a phase ends
and what the hand does in it."""

from dataclasses import replace

import numpy as np
from coglab_py.pose import Pose
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene
from coglab_sim.person.senses import Percept
from coglab_sim.person.virtual_human import VirtualHuman

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


class Acting:
    """The person with the mug's scene, in a phase since time 0."""

    def __init__(self, phase, task="give", hand=(0.0, 0.0, 0.0), scene=None, **changes):
        person = replace(Participant(seed=1, reaction_sigma=0.0, reach_sigma=0.0), **changes)
        self.human = VirtualHuman(person, scene or Scene(), task == "give")
        self.human._task = task
        self.human._hand = np.array(hand, dtype=float)
        self.human._go(phase, 0.0)
        self.t = 0.0

    def step(self, seen, dt=DT):
        """The phase goes on by ``dt`` s; the phase then."""
        self.t += dt
        getattr(self.human, f"_{self.human.phase}")(self.t, dt, seen)
        return self.human.phase

    def until_over(self, seen, limit=20.0):
        """s until the phase ends, while the same is perceived; infinite if it does not within the limit."""
        phase = self.human.phase
        for _ in range(round(limit / DT)):
            if self.step(seen) != phase:
                return round(self.t, 6)
        return np.inf
