"""The virtual human: gives objects to the robot and takes them, with the timing, scatter and slips of people.

Phases: idle, reacting, reaching, waiting (hand at the handover point, the robot comes), placing (the object is brought
gently into the robot's palm; for receiving: the hand closes and lifts), holding, releasing, retreating. The person sees
the scene (WorldView) as a person would: the robot's hand, the object, the forces felt. All frames in world, SI units.
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .participant import Participant
from .reach import Reach, duration_for
from .rigid import IDENTITY, Frame


@dataclass
class Scene:
    """Where things are. The hand frame is world-aligned; a held object sits at ``object_in_hand`` in it."""

    rest: np.ndarray = field(default_factory=lambda: np.array([1.30, 0.20, 0.15]))
    handover_object: np.ndarray = field(default_factory=lambda: np.array([0.78, 0.03, 0.39]))
    """nominal position of the object at a handover"""
    region_low: np.ndarray = field(default_factory=lambda: np.array([0.72, -0.12, 0.29]))
    region_high: np.ndarray = field(default_factory=lambda: np.array([0.81, 0.16, 0.46]))
    object_in_hand: np.ndarray = field(default_factory=lambda: np.array([-0.08, 0.0, -0.05]))
    object_mass: float = 0.31
    other_side: float = -0.16
    """m, lateral shift of the handover point by a person who changes side"""


@dataclass
class WorldView:
    """What the person perceives at one moment."""

    robot_hand: Frame = field(default_factory=Frame)
    robot_speed: float = 0.0
    object: Frame = field(default_factory=Frame)
    palm_force: float = 0.0
    robot_load_share: float = 0.0
    human_load_share: float = 0.0
    held_by: str = "human"


@dataclass
class HandSample:
    """The person's hand now: frame, velocity (m/s), grip 0..1, grip force at full closure (N), phase."""

    frame: Frame
    velocity: np.ndarray
    grip: float
    grip_force: float
    phase: str


NEAR = 0.16
"""m between palm and object below which the person takes the robot's hand as arrived."""
STILL = 0.012
"""m/s below which the robot's hand looks still."""


class VirtualHuman:
    """Step it with the time and the view; it answers with its hand. Deterministic for a seed and a sequence
    of steps."""

    def __init__(self, participant: Participant, scene: Scene | None = None, holds_object: bool = True) -> None:
        self.participant = participant
        self.scene = scene or Scene()
        self.rng = np.random.default_rng([participant.seed, 23])
        self.phase = "idle"
        self.trial = 0
        self._task = "rest"
        self._pending: str | None = None
        self._hand = self.scene.rest.copy()
        self._velocity = np.zeros(3)
        self._grip = 1.0 if holds_object else 0.0
        self._since = 0.0
        self._reach: Reach | None = None
        self._target = self.scene.rest.copy()
        self._still_since: float | None = None
        self._felt_since: float | None = None
        self._load_since: float | None = None
        self._noise_phase = self.rng.uniform(0, 2 * np.pi, size=(3, 4))
        self._last: float | None = None
        self._interrupted = False
        self._travelled = 0.0

    def command(self, text: str) -> None:
        """'give <object>', 'receive <object>' or 'rest'; taken up at the next step."""
        task = text.split()[0] if text.split() else "rest"
        if task not in ("give", "receive", "rest"):
            raise ValueError(f"a person can be asked to give, receive or rest, not '{text}'")
        self._pending = task

    def holds(self) -> bool:
        """Whether the person's hand is closed on something."""
        return self._grip > 0.5

    def step(self, t: float, view: WorldView) -> HandSample:
        """One step at time t (s, increasing)."""
        dt = 0.0 if self._last is None else max(0.0, t - self._last)
        self._last = t
        if self._pending is not None:
            self._take_up(t)
        getattr(self, f"_{self.phase}")(t, dt, view)
        sway = self._involuntary(t)
        return HandSample(Frame(self._hand + sway, np.array(IDENTITY)), self._velocity.copy(), self._grip,
                          self.participant.grip_force, self.phase)

    # -- what to do ---------------------------------------------------------------------------------------------

    def _take_up(self, t: float) -> None:
        task, self._pending = self._pending, None
        if task == "rest":
            if self.phase not in ("idle", "retreating"):
                self._retreat(t)
            return
        if self.phase != "idle" and self._task == task:
            return
        if (task == "give") != self.holds() or self.participant.behaviour == "absent":
            return
        self._task = task
        self.trial += 1
        self._interrupted = False
        p = self.participant
        reaction = float(np.exp(np.log(p.reaction_median) + self.rng.normal(0, p.reaction_sigma)))
        reaction *= (1 - p.learning) ** min(self.trial - 1, 3)
        self._reaction = reaction * (2.0 if p.behaviour == "slow" else 1.0)
        self._go("reacting", t)

    def _go(self, phase: str, t: float) -> None:
        self.phase = phase
        self._since = t
        self._still_since = self._felt_since = self._load_since = None
        self._travelled = 0.0

    def _plan(self, t: float, target: np.ndarray, slower: float = 1.0) -> None:
        p = self.participant
        duration = duration_for(float(np.linalg.norm(target - self._hand)), p.reach_time) * slower
        duration *= float(np.exp(self.rng.normal(0, p.reach_sigma)))
        self._reach = Reach(self._hand.copy(), target, t, duration, bow=p.bow if self.phase == "reaching" else 0.0)
        self._target = target

    def _handover_hand(self) -> np.ndarray:
        """Where the hand goes: the handover point with this person's habits and this trial's scatter."""
        p, s = self.participant, self.scene
        point = s.handover_object + np.asarray(p.point_offset) + self.rng.normal(0, 1, 3) * np.asarray(p.point_sigma)
        return np.clip(point, s.region_low, s.region_high) - s.object_in_hand

    # -- phases -------------------------------------------------------------------------------------------------

    def _idle(self, t: float, dt: float, view: WorldView) -> None:
        self._velocity = np.zeros(3)

    def _reacting(self, t: float, dt: float, view: WorldView) -> None:
        if t - self._since >= self._reaction:
            self._go("reaching", t)
            self._plan(t, self._handover_hand(), 2.0 if self.participant.behaviour == "slow" else 1.0)

    def _reaching(self, t: float, dt: float, view: WorldView) -> None:
        reach = self._reach
        assert reach is not None
        share = (t - reach.begin) / reach.duration
        behaviour = self.participant.behaviour
        if not self._interrupted and share >= 0.45:
            if behaviour == "hesitant":
                self._interrupted = True
                self._hand, self._velocity = reach.at(t)
                self._go("hesitating", t)
                return
            if behaviour == "change_side":
                self._interrupted = True
                self._hand, _ = reach.at(t)
                self._plan(t, reach.end + np.array([0.0, self.scene.other_side, 0.0]))
                return
        self._hand, self._velocity = reach.at(t)
        if reach.over(t):
            self._go("waiting", t)

    def _hesitating(self, t: float, dt: float, view: WorldView) -> None:
        self._velocity *= np.exp(-dt / 0.08)
        self._hand = self._hand + self._velocity * dt
        if t - self._since > 0.7:
            target = self._target
            self.phase = "reaching"
            self._plan(t, target)

    def _waiting(self, t: float, dt: float, view: WorldView) -> None:
        """Hold still until the robot's hand has come near and stopped."""
        self._velocity = np.zeros(3)
        near = float(np.linalg.norm(view.robot_hand.position - view.object.position)) < NEAR
        if self.participant.behaviour == "early_contact" and self._task == "give":
            near_early = float(np.linalg.norm(view.robot_hand.position - view.object.position)) < NEAR + 0.1
            if near_early and view.robot_speed > STILL:
                self._go("placing", t)
                return
        still = near and view.robot_speed < STILL
        if not still:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = t
        # A person looks a moment before trusting that the robot has stopped; it also lets the detector settle.
        if self._still_since is not None and t - self._still_since > self.participant.look_time:
            self._go("placing" if self._task == "give" else "grasping", t)
        elif t - self._since > self.participant.patience:
            self._retreat(t)

    def _placing(self, t: float, dt: float, view: WorldView) -> None:
        """Bring the object into the palm, against the palm's outward axis, until it is felt; then press a little."""
        p = self.participant
        toward_palm = -view.robot_hand.axis(0)
        speed = p.place_speed * min(1.0, (t - self._since) / 0.15)
        if self._felt_since is None and view.palm_force > 0.3:
            self._felt_since = t
            self._travelled = 0.0
        if self._felt_since is not None and p.behaviour == "early_release":
            self._go("releasing", t)
            return
        if self._felt_since is not None and self._travelled >= p.press:
            if p.behaviour == "pull_back":
                self._retreat(t)
                return
            self._go("holding", t)
            return
        if self._felt_since is None and self._travelled > (0.2 if p.behaviour == "early_contact" else 0.09):
            # Nothing was met where the palm should be: stop and wait for the robot.
            self._go("holding", t)
            return
        self._velocity = toward_palm * speed
        self._hand = self._hand + self._velocity * dt
        self._travelled += speed * dt

    def _holding(self, t: float, dt: float, view: WorldView) -> None:
        """Hold on until the robot carries enough."""
        self._velocity = np.zeros(3)
        p = self.participant
        if p.behaviour == "tug" and view.held_by == "both":
            pull = 0.012 * np.sin(2 * np.pi * 1.5 * (t - self._since))
            self._velocity = np.array([0.012 * 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * (t - self._since)), 0, 0])
            self._hand = self._hand + self._velocity * dt
            if t - self._since > 3.0 and abs(pull) < 0.002:
                self._go("releasing", t)
            return
        if p.behaviour == "never_release":
            if t - self._since > p.patience:
                self._retreat(t)
            return
        carried = view.robot_load_share >= p.release_share or view.held_by in ("both", "robot")
        if not carried:
            self._load_since = None
        elif self._load_since is None:
            self._load_since = t
        if self._load_since is not None:
            needed = p.release_delay + (0.0 if view.robot_load_share >= p.release_share else 0.35)
            if t - self._load_since > needed:
                self._go("releasing", t)
                return
        if t - self._since > p.patience:
            self._retreat(t)

    def _releasing(self, t: float, dt: float, view: WorldView) -> None:
        self._velocity = np.zeros(3)
        duration = self.participant.release_time + 0.1 * self.scene.object_mass
        self._grip = max(0.0, self._grip - dt / duration)
        if self._grip == 0.0:
            self._retreat(t)

    def _grasping(self, t: float, dt: float, view: WorldView) -> None:
        """Receiving: close the last way to the object, grip it, then lift until the robot lets go."""
        wanted = view.object.position - self.scene.object_in_hand
        error = wanted - self._hand
        distance = float(np.linalg.norm(error))
        if self._grip == 0.0 and distance > 0.004:
            speed = min(self.participant.place_speed, 4.0 * distance + 0.01)
            self._velocity = error / distance * speed
            self._hand = self._hand + self._velocity * min(dt, distance / speed)
            if t - self._since > 4.0:
                self._retreat(t)
            return
        self._velocity = np.zeros(3)
        self._grip = min(1.0, self._grip + dt / 0.25)
        if self._grip == 1.0:
            if self.participant.behaviour == "early_release":
                self._go("releasing", t)
            elif self.participant.behaviour == "pull_back":
                self._go("releasing", t)
            else:
                self._go("lifting", t)

    def _lifting(self, t: float, dt: float, view: WorldView) -> None:
        """Take the weight: the hand rises slowly until the robot's hand carries nothing any more."""
        if view.held_by == "human":
            if self._load_since is None:
                self._load_since = t
            if t - self._load_since > 0.2:
                self._retreat(t)
            return
        self._load_since = None
        p = self.participant
        limit = 0.0 if p.behaviour == "never_release" else 0.03
        if self._travelled < limit and view.human_load_share < 1.2:
            self._velocity = np.array([0.0, 0.0, 0.03])
            self._hand = self._hand + self._velocity * dt
            self._travelled += 0.03 * dt
        else:
            self._velocity = np.zeros(3)
        if t - self._since > p.patience:
            self._go("releasing", t)

    def _retreat(self, t: float) -> None:
        self._go("retreating", t)
        self._plan(t, self.scene.rest.copy())

    def _retreating(self, t: float, dt: float, view: WorldView) -> None:
        assert self._reach is not None
        self._hand, self._velocity = self._reach.at(t)
        slipped = float(np.linalg.norm(view.object.position - self._hand - self.scene.object_in_hand)) > 0.06
        if self._grip > 0.0 and slipped:
            self._grip = 0.0
        if self._reach.over(t):
            self._task = "rest"
            self._go("idle", t)

    def _involuntary(self, t: float) -> np.ndarray:
        """Sway (0.3-1 Hz) and tremor (8-12 Hz): sums of sines with random phases, bounded and smooth."""
        p = self.participant
        f = self._noise_phase
        sway = np.sin(2 * np.pi * 0.35 * t + f[:, 0]) + 0.5 * np.sin(2 * np.pi * 0.8 * t + f[:, 1])
        tremor = np.sin(2 * np.pi * 9.1 * t + f[:, 2]) + 0.6 * np.sin(2 * np.pi * 11.3 * t + f[:, 3])
        return p.sway / 1.5 * sway + p.tremor / 1.6 * tremor
