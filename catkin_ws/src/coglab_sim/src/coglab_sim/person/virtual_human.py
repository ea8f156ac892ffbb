"""The virtual human: gives objects to the robot and takes them, with the timing, scatter and errors of people.

Phases of both tasks: idle, reacting, reaching, hesitating, waiting (at the handover point, for the robot's hand),
releasing, retreating. Giving: placing (moves the object gently into the robot's palm), holding. Taking: grasping,
lifting. The person perceives the cell by sight and touch (senses), and the robot's intention by its speech
(coglab_msgs/Say). All frames are in world, SI units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from coglab_msgs.msg import Say
from coglab_py.pose import Pose, length
from coglab_py.rotation import Rotation

from coglab_sim.person.grip import GripForce
from coglab_sim.person.participant import Participant
from coglab_sim.person.reach import CorrectedReach, Reach, Turn, duration_for
from coglab_sim.person.scene import HandSample, Scene, WorldView
from coglab_sim.person.senses import Percept, Senses

# Seeing and reaching
NEAR = 0.10  # m, gap below which the robot's hand, or the object in it, counts as arrived
STILL = 0.02  # m/s; a slower robot hand looks still
REPLAN_PERIOD = 0.10  # s between two corrections of the reach's target
CORRECTION_TIME = 0.45  # s, shortest duration of a correction
GONE = 0.35  # m; beyond this gap, a robot hand that was near counts as gone
WITHDRAWALS = 5  # a person with the behaviour `withdraws` takes the offer back in this many first trials
COMES = 0.25  # m, gap at which this person takes the offer back
# Giving
BEYOND = 0.05  # m; the person stops this far beyond the seen palm
PLACES_WITHIN = 4.0  # s, longest placing without touch
AFTER_TOUCH = 0.02  # m/s, pressing speed after first touch
RAMP = 0.15  # s until the hand reaches its placing speed
FOLLOW_UP = 0.015  # m, longest path after first touch
CLOSED = 0.08  # seen change of the fingers' closure (0..1) above which they count as closed
CLOSING = 0.1  # 1/s; slower fingers look as if they had finished closing
TOUCH_PART = 0.7  # weight of the sign "closed hand and felt grip"; the person lets go at a sum of 1
TOLD_PART = 0.4  # weight of the sign "I have it" was heard
AGAIN = 0.5  # s without enough touch, after which a person with this habit presses again
REGRIPS = 0.10  # s in which partly opened fingers close again
LOOSE = 0.5  # grip at which the fingers stop opening until the person feels that the robot carries
RELEASE_PAUSE = 0.5  # s, longest pause with half-open fingers
SINK_SPEED = 0.03  # m/s, sinking speed of a relaxed arm during the pause
CARRIES = 0.7  # if the person feels less than this share of the weight, the robot carries
# Taking
THERE = 0.010  # m; the fingers close when the object is nearer than this
LIFT_SPEED = 0.03  # m/s
LIFT = 0.03  # m
MORE_THAN_WEIGHT = 1.2  # share of the expected weight at which the hand stops rising
OPENED = 0.08  # seen change of the fingers' closure (0..1) above which they count as open
OPEN_FOR = 0.2  # s that they must count as open
GRASPS_WITHIN = 4.0  # s, longest time to get to the object
# Losing an object
LOST = 0.2  # share of the weight below which the person does not feel the object any more
AWAY = 0.35  # m, distance from the hand at which the object is seen elsewhere
LOST_FOR = 0.3  # s of both conditions after which the object is lost

TASKS = {Say.READY_TO_RECEIVE: "give", Say.READY_TO_GIVE: "receive", Say.GIVEN_UP: "rest", Say.PLEASE_STEP_BACK: "rest"}
"""task that each prompt of the robot gives to the person"""


def involuntary(p: Participant, f: Sequence[Sequence[float]], t: float) -> np.ndarray:
    """Displacement (m) by sway (0.3-1 Hz) and tremor (8-12 Hz) at time t (s): bounded, smooth sums of sines with four
    phases (rad) for each of three axes."""
    sin, turn = math.sin, 2.0 * math.pi * t
    slow, less_slow, quick, quicker = 0.35 * turn, 0.8 * turn, 9.1 * turn, 11.3 * turn
    sway, tremor = p.sway / 1.5, p.tremor / 1.6
    return np.array(
        [
            sway * (sin(slow + a) + 0.5 * sin(less_slow + b)) + tremor * (sin(quick + c) + 0.6 * sin(quicker + d))
            for a, b, c, d in f
        ]
    )


class VirtualHuman:
    """The simulated person. step() takes time and view and returns the hand. The same seed and steps give the same
    result."""

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
        self._noise_phase = self.rng.uniform(0, 2 * np.pi, size=(3, 4)).tolist()
        self._last: float | None = None
        self._interrupted = False
        self._tries = 0
        self._travelled = self._sunk = 0.0

    def command(self, text: str) -> None:
        """Sets the task 'give <object>', 'receive <object>' or 'rest' for the next step. ValueError for others."""
        task = text.split()[0] if text.split() else "rest"
        if task not in ("give", "receive", "rest"):
            raise ValueError(f"the task of a person must be give, receive or rest, got '{text}'")
        self._pending = task

    def hear(self, t: float, code: int) -> None:
        """The robot says ``code`` (of coglab_msgs/Say) to the person at time t (s)."""
        self._heard.append((t + self.participant.hearing_delay, int(code)))

    def holds(self) -> bool:
        """True if the person's hand is closed on an object."""
        return self._grip > 0.5

    def meets(self, scene: Scene, knows_weight: bool) -> None:
        """Another object is in the cell: takes its mass, friction, size and grips from ``scene``, keeps the rest pose.
        ``knows_weight``: the object lies in the person's hand."""
        self.scene = scene
        self.grip_force = GripForce(self.participant, scene, knows_weight)

    def step(self, t: float, view: WorldView) -> HandSample:
        """Makes one step at time t (s, increasing)."""
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

    # -- choice of the task --------------------------------------------------------------------------------------

    def _understand(self, t: float) -> None:
        """Acts on speech that is older than the hearing delay."""
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
        """Moves the hand along the reach."""
        assert self._reach is not None and self._turning is not None
        self._hand, self._velocity = self._reach.at(t)
        self._turn, self._spin = self._turning.at(t)

    def _correct(self, t: float, seen: Percept) -> None:
        """Corrects a reach to receive toward the object in the robot's hand if the object is nearer than the planned
        target."""
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
        """Target of the hand (m, orientation): handover point with this person's offset and this trial's scatter."""
        p, s = self.participant, self.scene
        point = (
            s.handover_object * self._side
            + np.asarray(p.point_offset)
            + self.rng.normal(0, 1, 3) * np.asarray(p.point_sigma)
        )
        if p.inside_box:
            point = np.clip(point, s.region_low, s.region_high)
        turn = Rotation.from_rotvec(np.radians(p.tilt) * self.rng.normal(0, 1, 3))
        # The middle of the object comes to the handover point in any orientation.
        in_hand = s.object_in_hand if self._task == "give" else s.taken_in_hand
        return point + s.object_middle - turn.apply(in_hand + s.object_middle), turn

    def _middle(self) -> np.ndarray:
        """Middle (m) of the held object. The person knows it without looking."""
        turned = Rotation.from_quat(self.scene.object_turn).apply(self.scene.object_middle)
        middle: np.ndarray = self._hand + self._turn.apply(self.scene.object_in_hand + turned)
        return middle

    def _gap(self, palm: Pose, place: Pose) -> float:
        """m between the robot's palm and the surface of the object at ``place``."""
        away = np.abs(place.rotation.inv().apply(palm.position - place.position) - self.scene.object_middle).tolist()
        half = (self.scene.object_size / 2).tolist()
        return math.hypot(*(max(0.0, far - inside) for far, inside in zip(away, half, strict=True)))

    def _way_to(self, place: Pose) -> float:
        """Distance (m) from the hand to the pose where it takes the object at ``place``."""
        return length(place.position - self._turn.apply(self.scene.taken_in_hand) - self._hand)

    def _weight(self) -> float:
        """N, weight that the person expects."""
        return max(1e-3, self.grip_force.expected)

    def _load_share(self, seen: Percept) -> float:
        """Felt share of the weight on the person's hand."""
        return float(-seen.load[2]) / self._weight()

    # -- until both hands meet -----------------------------------------------------------------------------------

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
        """True in the first trials of the behaviour `withdraws`, when the robot's hand comes near."""
        teases = self.participant.behaviour == "withdraws" and self._task == "give" and self.trial <= WITHDRAWALS
        return teases and gap < COMES

    def _hesitating(self, t: float, dt: float, seen: Percept) -> None:
        self._velocity *= np.exp(-dt / 0.08)
        self._hand = self._hand + self._velocity * dt
        if t - self._since > 0.7:
            self.phase = "reaching"
            self._plan(t, self._target, self._target_turn)

    def _waiting(self, t: float, dt: float, seen: Percept) -> None:
        """Holds still until the robot's hand is near and the person trusts it."""
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
        # A person looks for a moment before trusting that the robot has stopped.
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
        if self._grip > 0.0:  # partly opened fingers close again
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

    # -- giving -------------------------------------------------------------------------------------------------

    def _taken_already(self, seen: Percept, near: bool) -> bool:
        """True if, during waiting, the person sees the robot's hand close or feels it press on the object."""
        if not near or self.participant.used_to_touch:
            self._held_load = seen.load
        self._closure = min(self._closure, seen.hand_closure) if near else seen.hand_closure
        pressed = length(seen.load - self._held_load) >= self.participant.press
        return pressed or seen.hand_closure - self._closure > CLOSED

    def _placing(self, t: float, dt: float, seen: Percept) -> None:
        """Moves the object into the palm, against the palm's outward axis, until the person feels it; then presses."""
        p = self.participant
        normal, along = seen.robot_hand.axis(0), seen.robot_hand.axis(2)
        to_object = self._middle() - seen.robot_hand.position
        gap = float(to_object @ normal) - self._thickness(normal)
        pressing = length(seen.load - self._held_load)
        if self._felt_since is None and pressing > 0.0:
            self._felt_since, self._travelled = t, 0.0
        if self._felt_since is not None and p.behaviour == "early_release":
            self._go("releasing", t)
            return
        if self._felt_since is not None and (pressing >= p.press or self._travelled >= FOLLOW_UP):
            if p.behaviour == "pull_back":
                self._retreat(t)
            else:
                self._go("holding", t)
            return
        if self._felt_since is None and (gap < -BEYOND or t - self._since > PLACES_WITHIN):
            self._go("holding", t)
            return
        ramp = min(1.0, (t - self._since) / RAMP)
        speed = ramp * min(p.place_speed, 2.0 * max(gap, 0.0) + 0.04)
        self._velocity = -normal * (AFTER_TOUCH if self._felt_since is not None else speed)
        aside = float(to_object @ along)
        if self._felt_since is None and abs(aside) > p.aligns_within:
            self._velocity = self._velocity - ramp * along * float(np.clip(2.0 * aside, -0.05, 0.05))
        self._hand = self._hand + self._velocity * dt
        self._travelled += length(self._velocity) * dt

    def _thickness(self, direction: np.ndarray) -> float:
        """Half of the object's extent along a direction, m."""
        turned = self._turn * Rotation.from_quat(self.scene.object_turn)
        return float(np.abs(turned.inv().apply(direction)) @ self.scene.object_size) / 2

    def _holding(self, t: float, dt: float, seen: Percept) -> None:
        """Holds the object until load and felt grip show that the robot has it."""
        self._velocity = np.zeros(3)
        p = self.participant
        self._grip = min(1.0, self._grip + dt / REGRIPS)
        if self._sunk > 0.0:  # rise again after an attempt to let go
            self._sink(SINK_SPEED, dt)
        closed = seen.hand_closure - self._closure > CLOSED and seen.closing_speed < CLOSING
        if p.behaviour == "tug" and closed:
            self._tug(t, dt)
            return
        if p.behaviour == "never_release":
            if t - self._since > p.patience:
                self._retreat(t)
            return
        if not closed and self._lost_touch(t, seen):
            self._tries += 1
            self._go("placing", t)
            return
        if self._signs(t, seen, closed) < 1.0:
            self._sure_since = None
        elif self._sure_since is None:
            self._sure_since = t
        if self._sure_since is not None and t - self._sure_since > p.assurance:
            self._go("releasing", t)
        elif t - self._since > p.patience:
            self._retreat(t)

    def _lost_touch(self, t: float, seen: Percept) -> bool:
        """True if the robot's open hand has backed away and the person has an attempt left to press again."""
        touch = length(seen.load - self._held_load)
        if touch >= 0.5 * self.participant.press or seen.robot_speed >= STILL or seen.closing_speed > CLOSING:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = t
        away = self._still_since is not None and t - self._still_since > AGAIN
        return away and self._tries < self.participant.presses_again and self._gap(seen.robot_hand, seen.object) < NEAR

    def _signs(self, t: float, seen: Percept, closed: bool) -> float:
        """Sum of the signs that the robot holds. The person lets go at 1 or more."""
        signs = max(0.0, 1.0 - self._load_share(seen)) / self.participant.release_share
        if not closed:
            self._felt_since = None
            return signs
        if self._felt_since is None:
            self._felt_since, self._touched = t, self._held_load
        grip_felt = bool(np.any(seen.load != self._touched)) or t - self._felt_since > self.participant.believes_closed
        return signs + TOUCH_PART * grip_felt + TOLD_PART * (self._told == Say.I_HAVE_IT)

    def _tug(self, t: float, dt: float) -> None:
        """Pulls to and fro before letting go."""
        if self._sure_since is None:
            self._sure_since = t
        since = t - self._sure_since
        rate = 2 * np.pi * 1.5
        self._velocity = np.array([0.012 * rate * np.cos(rate * since), 0.0, 0.0])
        self._hand = self._hand + self._velocity * dt
        if since > 3.0 and abs(np.sin(rate * since)) < 0.2:
            self._go("releasing", t)

    def _releasing(self, t: float, dt: float, seen: Percept) -> None:
        """Opens the grip. Halfway, a giver waits to feel that the robot carries, and otherwise holds again."""
        self._velocity = np.zeros(3)
        p = self.participant
        careful = self._task == "give" and p.behaviour != "early_release"
        if careful and self._grip <= LOOSE and not self._checked:
            self._feel_who_carries(t, dt, seen)
            return
        self._grip = max(0.0, self._grip - dt / p.release_time)
        if self._grip == 0.0:
            self._retreat(t)

    def _feel_who_carries(self, t: float, dt: float, seen: Percept) -> None:
        """Checks that the felt weight has decreased. A relaxed arm sinks a little: an object that the robot holds does
        not sink with it."""
        loosened = self.participant.release_time * (1.0 - LOOSE) + self.participant.feeling_delay
        self._checked = self._load_share(seen) < CARRIES and t - self._since > loosened
        if self._checked:
            return
        if self.participant.relaxes and self._sunk < SINK_SPEED * RELEASE_PAUSE:
            self._sink(-SINK_SPEED, dt)
        elif t - self._since > loosened + RELEASE_PAUSE:
            self._go("holding", t)

    def _sink(self, speed: float, dt: float) -> None:
        self._velocity = np.array([0.0, 0.0, speed])
        self._hand = self._hand + self._velocity * dt
        self._sunk -= speed * dt

    # -- taking -------------------------------------------------------------------------------------------------

    def _grasping(self, t: float, dt: float, seen: Percept) -> None:
        """Moves the hand to the seen object and grips it."""
        error = seen.object.position - self._turn.apply(self.scene.taken_in_hand) - self._hand
        distance = length(error)
        if self._grip == 0.0 and distance > THERE:
            speed = min(self.participant.place_speed, 4.0 * distance)
            self._velocity = error / distance * speed
            self._hand = self._hand + self._velocity * min(dt, distance / speed)
            if t - self._since > GRASPS_WITHIN:
                self._retreat(t)
            return
        self._velocity = np.zeros(3)
        self._grip = min(1.0, self._grip + dt / self.participant.grip_time)
        if self._grip < 1.0:
            return
        if self.participant.behaviour in ("early_release", "pull_back"):
            self._go("releasing", t)
        else:
            self._closure = seen.hand_closure
            self._go("lifting", t)

    def _lifting(self, t: float, dt: float, seen: Percept) -> None:
        """Takes the weight: the hand rises slowly until the person sees the robot's hand open."""
        opened = self._closure - seen.hand_closure > OPENED or self._told == Say.YOU_HAVE_IT
        self._velocity = np.zeros(3)
        if opened:
            if self._sure_since is None:
                self._sure_since = t
            if t - self._sure_since > OPEN_FOR:
                self.grip_force.has_felt(max(self._weight(), float(-seen.load[2])))
                self._retreat(t)
            return
        p = self.participant
        limit = 0.0 if p.behaviour == "never_release" else LIFT
        if self._travelled < limit and self._load_share(seen) < MORE_THAN_WEIGHT:
            self._velocity = np.array([0.0, 0.0, LIFT_SPEED])
            self._hand = self._hand + self._velocity * dt
            self._travelled += LIFT_SPEED * dt
        if t - self._since > p.patience:
            self._go("releasing", t)
