"""The virtual human: gives objects to the robot and takes them, with the timing, scatter and slips of people.

Phases: idle, reacting, reaching, waiting (hand at the handover point, the robot comes), placing (the object is brought
gently into the robot's palm; for receiving: the hand closes and lifts), holding, releasing, retreating. The person sees
the scene (WorldView) as a person would: the robot's hand, the object, the forces felt. All frames in world, SI units.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from coglab_py.pose import Pose

from .giving import Giving
from .involuntary import involuntary
from .participant import Participant
from .reach import CorrectedReach, Reach, duration_for
from .receiving import Receiving
from .scene import HandSample, Scene, WorldView

NEAR = 0.16
"""m between palm and object below which the person takes the robot's hand as arrived."""
STILL = 0.012
"""m/s below which the robot's hand looks still."""
REPLAN_PERIOD = 0.10
"""s between two looks at where the reach should end."""
SENSORIMOTOR_DELAY = 0.15
"""s from what is seen to what the hand does about it."""
CORRECTION_TIME = 0.45
"""s, a correction on the way takes at least this long."""


class VirtualHuman(Giving, Receiving):
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
        self._reach: CorrectedReach | None = None
        self._seen: deque[tuple[float, np.ndarray]] = deque()
        self._replan_at = 0.0
        self._height_in_palm = 0.0
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
        self._look(t, view)
        if self._pending is not None:
            self._take_up(t)
        getattr(self, f"_{self.phase}")(t, dt, view)
        shown = Pose(self._hand + involuntary(self.participant, self._noise_phase, t))
        return HandSample(shown, self._velocity.copy(), self._grip, self.participant.grip_force, self.phase)

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
        self._task = task or ""
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
        self._reach = CorrectedReach(
            Reach(self._hand.copy(), target, t, duration, bow=p.bow if self.phase == "reaching" else 0.0)
        )
        self._target = target

    def _look(self, t: float, view: WorldView) -> None:
        """Remember where the object is seen for as long as the way from the eye to the hand takes."""
        self._seen.append((t, view.object.position.copy()))
        while len(self._seen) > 1 and self._seen[1][0] <= t - SENSORIMOTOR_DELAY:
            self._seen.popleft()

    def _correct(self, t: float) -> None:
        """On-line correction while receiving: toward the object in the robot's hand when that is nearer than the place
        the person had in mind."""
        reach = self._reach
        assert reach is not None
        stamp, seen = self._seen[0]
        if self._task != "receive" or t < self._replan_at or t - stamp < SENSORIMOTOR_DELAY - 1e-9:
            return
        self._replan_at = t + REPLAN_PERIOD
        offered = seen - self.scene.object_in_hand
        nearer = np.linalg.norm(offered - self._hand) < np.linalg.norm(reach.end - self._hand)
        if nearer and np.linalg.norm(offered - reach.end) > 0.01:
            left = reach.begin + reach.duration - t
            reach.retarget(t, offered, max(CORRECTION_TIME, left))
            self._target = offered

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
                aside = reach.end + np.array([0.0, self.scene.other_side, 0.0])
                reach.retarget(
                    t, aside, duration_for(float(np.linalg.norm(aside - self._hand)), self.participant.reach_time)
                )
                self._target = aside
        self._correct(t)
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
