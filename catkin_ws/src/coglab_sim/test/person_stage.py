"""Object and robot hand around a virtual human, with the simplest contact, for tests of the person alone."""

import numpy as np
from coglab_msgs.msg import Say
from coglab_py.pose import Pose
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene, WorldView
from coglab_sim.person.virtual_human import VirtualHuman

DT = 0.01
PALM_TURN = np.array([0.5, 0.5, 0.5, 0.5])
WEIGHT = 0.31 * 9.81
STIFF = 600.0
"""N/m of the palm"""


class Stage:
    """``closes``: the fingers close a second after the first touch; ``carries``: the share of the weight that the robot
    then takes; ``says``: and says that it has the object; ``pace`` of its arm, m/s."""

    def __init__(self, person=None, robot_comes=True, closes=True, carries=1.0, says=False, human=None, pace=1.0):
        self.scene = Scene()
        self.human = human or VirtualHuman(person or Participant.draw(1, profile="accustomed"), self.scene)
        self.t = 0.0
        self.palm = np.array([0.58, -0.15, 0.58])
        self.robot_comes, self.closes, self.carries, self.says = robot_comes, closes, carries, says
        self.touched_at = self.waiting_since = None
        self.closure, self.pace = 0.3, pace
        self.phases, self.samples = ["idle"], []
        self.palms = []

    def object(self):
        """Pose of the object: in the person's hand, or in the robot's hand after the person has released it."""
        sample = self.samples[-1] if self.samples else None
        frame = sample.frame if sample else Pose(self.human.rest, self.human.rest_turn.as_quat())
        if sample is not None and sample.grip < 0.3 and self.closed():
            return self.left
        self.left = frame * Pose(self.human.scene.object_in_hand, self.human.scene.object_turn)
        return self.left

    def closed(self):
        """Whether the robot's fingers have closed."""
        return self.closes and self.touched_at is not None and self.t - self.touched_at > 1.0

    def step(self):
        """10 ms."""
        self.t += DT
        place = self.object()
        if self.robot_comes and self.waiting_since is not None and self.t - self.waiting_since > 0.3:
            goal = self.came_to
            way = goal - self.palm
            self.palm = self.palm + way * min(1.0, self.pace * DT / max(1e-9, np.linalg.norm(way)))
        deep = self.palm[1] - (place.position[1] - 0.04) if self.near(place) else -1.0
        force = STIFF * max(0.0, deep)
        if force > 0.3 and self.touched_at is None:
            self.touched_at = self.t
        if self.closed() and self.closure < 0.6:
            self.closure += DT
            if self.says and self.closure >= 0.6:
                self.human.hear(self.t, Say.I_HAVE_IT)
        share = self.carries if self.closed() and self.closure >= 0.6 else 0.0
        held = not self.samples or self.samples[-1].grip > 0.02
        load = np.array([0.0, force, -WEIGHT * (1.0 - share)]) if held else np.zeros(3)
        sample = self.human.step(self.t, WorldView(Pose(self.palm, PALM_TURN), self.closure, place, load))
        self.samples.append(sample)
        self.palms.append(self.palm)
        if sample.phase != self.phases[-1]:
            self.phases.append(sample.phase)
            if sample.phase == "waiting" and self.waiting_since is None:
                self.waiting_since = self.t
                self.came_to = self.object().position + np.array([0.0, -0.065, 0.05])
        return sample

    def near(self, place):
        """Whether the palm is beside the object."""
        return abs(place.position[0] - self.palm[0]) < 0.05

    def run(self, seconds):
        """Returns itself."""
        for _ in range(int(seconds / DT)):
            self.step()
        return self

    def first(self, phase):
        """s at which a phase began."""
        return next(i for i, sample in enumerate(self.samples) if sample.phase == phase) * DT


def give(behaviour="normal", seed=1, profile="accustomed", seconds=18.0, **kw):
    """Runs a person who gives."""
    changes = kw.pop("changes", {})
    fields = {"seed": seed, "behaviour": behaviour, "profile": profile, **changes}
    stage = Stage(Participant.from_mapping(fields), **kw).run(0.5)
    stage.human.hear(stage.t, Say.READY_TO_RECEIVE)
    return stage.run(seconds)
