"""The virtual human: gives objects to the robot and takes them, with the timing, scatter and slips of people.

Phases: idle, reacting, reaching, waiting (hand at the handover point, the robot comes), placing (the object is brought
gently into the robot's palm; for receiving: the hand closes and lifts), holding, releasing, retreating. The person
knows of the cell what eyes and hand perceive (senses), and of the robot's intention what it says (coglab_msgs/Say).
All frames in world, SI units.
"""

from __future__ import annotations

import numpy as np
from coglab_msgs.msg import Say
from coglab_py.pose import Pose, length
from scipy.spatial.transform import Rotation

from coglab_sim.person.giving import Giving
from coglab_sim.person.grip import GripForce
from coglab_sim.person.involuntary import involuntary
from coglab_sim.person.participant import Participant
from coglab_sim.person.phases import NEAR, REGRIPS, STILL
from coglab_sim.person.reach import CorrectedReach, Reach, Turn, duration_for
from coglab_sim.person.receiving import Receiving
from coglab_sim.person.scene import HandSample, Scene, WorldView
from coglab_sim.person.senses import Percept, Senses

REPLAN_PERIOD = 0.10
"""s between two looks at where the reach should end"""
CORRECTION_TIME = 0.45
"""s, a correction on the way takes at least this long"""
GONE = 0.35
"""m: a robot's hand that has been near and is then farther away than this has given up"""
WITHDRAWALS, COMES = 5, 0.25
"""offers that are taken back by who does that, and m from the object at which the robot's hand makes them do it"""
LOST, AWAY, LOST_FOR = 0.2, 0.35, 0.3
"""share of the weight below which the object is felt no more, m from the hand at which it is seen elsewhere, and s for
both of them after which it is lost"""
TASKS = {Say.READY_TO_RECEIVE: "give", Say.READY_TO_GIVE: "receive", Say.GIVEN_UP: "rest", Say.PLEASE_STEP_BACK: "rest"}
"""What a prompt asks of the person."""


class VirtualHuman(Giving, Receiving):
    """Step it with the time and the view; it answers with its hand. Deterministic for a seed and a sequence
    of steps."""

    def __init__(self, participant: Participant, scene: Scene | None = None, holds_object: bool = True) -> None:
        self.participant = participant
        self.scene = scene or Scene()
        self.rng = np.random.default_rng([participant.seed, 23])
        self.senses = Senses(participant, np.random.default_rng([participant.seed, 29]))
        self.grip_force = GripForce(participant, self.scene, holds_object)
        side = np.array([1.0, -1.0 if participant.left_handed else 1.0, 1.0])
        self.rest, self._side = self.scene.rest * side, side
        self.rest_turn = Rotation.identity()
        self.phase = "idle"
        self.trial = 0
        self._task = "rest"
        self._pending: str | None = None
        self._heard: list[tuple[float, int]] = []
        self._told = Say.NOTHING
        self._hand = self.rest.copy()
        self._turn = Rotation.identity()
        self._velocity, self._spin = np.zeros(3), np.zeros(3)
        self._grip = 1.0 if holds_object else 0.0
        self._since = 0.0
        self._reach: CorrectedReach | None = None
        self._turning: Turn | None = None
        self._replan_at = 0.0
        self._target, self._target_turn = self.rest.copy(), Rotation.identity()
        self._still_since: float | None = None
        self._felt_since: float | None = None
        self._sure_since: float | None = None
        self._lost_since: float | None = None
        self._met = self._checked = False
        self._held_load, self._touched = np.zeros(3), np.zeros(3)
        self._closure = 0.0
        self._noise_phase = self.rng.uniform(0, 2 * np.pi, size=(3, 4))
        self._last: float | None = None
        self._interrupted = False
        self._tries = 0
        self._travelled = self._sunk = 0.0

    def command(self, text: str) -> None:
        """'give <object>', 'receive <object>' or 'rest'; taken up at the next step."""
        task = text.split()[0] if text.split() else "rest"
        if task not in ("give", "receive", "rest"):
            raise ValueError(f"a person can be asked to give, receive or rest, not '{text}'")
        self._pending = task

    def hear(self, t: float, code: int) -> None:
        """Something is said to the person at time t (s); ``code`` of coglab_msgs/Say."""
        self._heard.append((t + self.participant.hearing_delay, int(code)))

    def holds(self) -> bool:
        """Whether the person's hand is closed on something."""
        return self._grip > 0.5

    def meets(self, scene: Scene, knows_weight: bool) -> None:
        """Another object is there: what it weighs, how smooth and large it is, where it is held and taken; the place
        of rest stays. ``knows_weight``: it lies in the person's hand."""
        self.scene = scene
        self.grip_force = GripForce(self.participant, scene, knows_weight)

    def step(self, t: float, view: WorldView) -> HandSample:
        """One step at time t (s, increasing)."""
        dt = 0.0 if self._last is None else max(0.0, t - self._last)
        self._last = t
        seen = self.senses.step(t, view)
        self._understand(t)
        if self._pending is not None:
            self._take_up(t)
        self._spin = np.zeros(3)
        getattr(self, f"_{self.phase}")(t, dt, seen)
        coming = self.participant.press if self.phase in ("placing", "holding") and self._task == "give" else 0.0
        force = self.grip_force.step(dt, length(seen.load), coming)
        shown = Pose(self._hand + involuntary(self.participant, self._noise_phase, t), self._turn.as_quat())
        return HandSample(shown, self._velocity.copy(), self._grip, force, self.phase, self._spin.copy())

    # -- what to do ---------------------------------------------------------------------------------------------

    def _understand(self, t: float) -> None:
        """Act on what was said long enough ago."""
        while self._heard and self._heard[0][0] <= t:
            code = self._heard.pop(0)[1]
            self._told = code
            if code in TASKS:
                self._pending = TASKS[code]

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
        self._interrupted = self._met = False
        self._sunk, self._tries = 0.0, 0
        p = self.participant
        reaction = float(np.exp(np.log(p.reaction_median) + self.rng.normal(0, p.reaction_sigma)))
        reaction *= (1 - p.learning) ** min(self.trial - 1, 3)
        self._reaction = reaction * (2.0 if p.behaviour == "slow" else 1.0)
        self._go("reacting", t)

    def _go(self, phase: str, t: float) -> None:
        self.phase = phase
        self._since = t
        self._still_since = self._felt_since = self._sure_since = self._lost_since = None
        self._checked = False
        self._travelled = 0.0

    def _plan(self, t: float, target: np.ndarray, turn: Rotation, slower: float = 1.0) -> None:
        p = self.participant
        duration = duration_for(length(target - self._hand), p.reach_time) * slower
        duration *= float(np.exp(self.rng.normal(0, p.reach_sigma)))
        self._reach = CorrectedReach(
            Reach(self._hand.copy(), target, t, duration, bow=p.bow if self.phase == "reaching" else 0.0)
        )
        self._turning = Turn(self._turn, turn, t, duration)
        self._target, self._target_turn = target, turn

    def _follow(self, t: float) -> None:
        """The hand goes on along the reach."""
        assert self._reach is not None and self._turning is not None
        self._hand, self._velocity = self._reach.at(t)
        self._turn, self._spin = self._turning.at(t)

    def _correct(self, t: float, seen: Percept) -> None:
        """On-line correction while receiving: toward the object in the robot's hand when that is nearer than the place
        the person had in mind."""
        reach = self._reach
        assert reach is not None
        if self._task != "receive" or t < self._replan_at or t - reach.begin < self.participant.seeing_delay:
            return
        self._replan_at = t + REPLAN_PERIOD
        offered = seen.object.position - self._target_turn.apply(self.scene.taken_in_hand)
        nearer = length(offered - self._hand) < length(reach.end - self._hand)
        if nearer and length(offered - reach.end) > 0.02:
            left = reach.begin + reach.duration - t
            reach.retarget(t, offered, max(CORRECTION_TIME, left))
            self._target = offered

    def _handover_pose(self) -> tuple[np.ndarray, Rotation]:
        """Where the hand goes: the handover point with this person's habits and this trial's scatter and turn."""
        p, s = self.participant, self.scene
        point = (
            s.handover_object * self._side
            + np.asarray(p.point_offset)
            + self.rng.normal(0, 1, 3) * np.asarray(p.point_sigma)
        )
        if p.inside_box:
            point = np.clip(point, s.region_low, s.region_high)
        turn = Rotation.from_rotvec(np.radians(p.tilt) * self.rng.normal(0, 1, 3))
        # The middle of the object comes to the handover point, however it is turned.
        in_hand = s.object_in_hand if self._task == "give" else s.taken_in_hand
        return point + s.object_middle - turn.apply(in_hand + s.object_middle), turn

    # -- phases -------------------------------------------------------------------------------------------------

    def _idle(self, t: float, dt: float, seen: Percept) -> None:
        self._velocity = np.zeros(3)

    def _reacting(self, t: float, dt: float, seen: Percept) -> None:
        if t - self._since >= self._reaction:
            self._go("reaching", t)
            self._plan(t, *self._handover_pose(), 2.0 if self.participant.behaviour == "slow" else 1.0)

    def _reaching(self, t: float, dt: float, seen: Percept) -> None:
        reach = self._reach
        assert reach is not None
        share = (t - reach.begin) / reach.duration
        behaviour = self.participant.behaviour
        if not self._interrupted and share >= 0.45:
            if behaviour == "hesitant":
                self._interrupted = True
                self._follow(t)
                self._go("hesitating", t)
                return
            if behaviour == "change_side":
                self._interrupted = True
                aside = reach.end + np.array([0.0, self.scene.other_side, 0.0])
                reach.retarget(t, aside, duration_for(length(aside - self._hand), self.participant.reach_time))
                self._target = aside
        self._correct(t, seen)
        self._follow(t)
        if self._withdraws(self._gap(seen.robot_hand, seen.object)):
            self._retreat(t)
        elif reach.over(t):
            self._go("waiting", t)

    def _withdraws(self, gap: float) -> bool:
        """Who does that takes the offer back when the robot's hand is seen to come, the first five times."""
        teases = self.participant.behaviour == "withdraws" and self._task == "give" and self.trial <= WITHDRAWALS
        return teases and gap < COMES

    def _hesitating(self, t: float, dt: float, seen: Percept) -> None:
        self._velocity *= np.exp(-dt / 0.08)
        self._hand = self._hand + self._velocity * dt
        if t - self._since > 0.7:
            self.phase = "reaching"
            self._plan(t, self._target, self._target_turn)

    def _waiting(self, t: float, dt: float, seen: Percept) -> None:
        """Hold still until the robot's hand has come near and is trusted."""
        self._velocity = np.zeros(3)
        p = self.participant
        gap = self._gap(seen.robot_hand, seen.object) if self._task == "give" else self._way_to(seen.object)
        near, moves = gap < NEAR, seen.robot_speed >= STILL
        self._met = self._met or near
        if self._task == "give" and self._taken_already(seen, near):
            self._go("holding", t)
            return
        if self._withdraws(gap):
            self._retreat(t)
            return
        early = p.behaviour == "early_contact" and self._task == "give" and gap < NEAR + 0.1 and moves
        if early or (near and p.places_while_moving):
            self._begin_exchange(t)
            return
        if not near or moves:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = t
        # A person looks a moment before trusting that the robot has stopped.
        if self._still_since is not None and t - self._still_since > p.trust:
            self._begin_exchange(t)
        elif t - self._since > p.patience or (self._met and gap > GONE):
            self._retreat(t)

    def _begin_exchange(self, t: float) -> None:
        self._go("placing" if self._task == "give" else "grasping", t)

    def _retreat(self, t: float) -> None:
        self._go("retreating", t)
        self._plan(t, self.rest.copy(), self.rest_turn)

    def _retreating(self, t: float, dt: float, seen: Percept) -> None:
        assert self._reach is not None
        self._follow(t)
        if self._grip > 0.0:  # who had begun to let go holds on again
            self._grip = min(1.0, self._grip + dt / REGRIPS)
        felt = length(seen.load) > LOST * self._weight()
        if self._grip == 0.0 or felt or length(seen.object.position - self._hand) < AWAY:
            self._lost_since = None
        elif self._lost_since is None:
            self._lost_since = t
        elif t - self._lost_since > LOST_FOR:
            self._grip = 0.0
        if self._reach.over(t):
            self._task = "rest"
            self._go("idle", t)
