"""What is the person about to do: offer an object, ask for the one in the robot's hand, or neither?

A belief with probabilities, updated by every sight of the hand and of objects, from the beginning of a reach on. The
motion of the hand says whether it goes to a handover (reach_bank), the objects say whether it carries one (carried). An
offer needs an object in the person's hand, a request one in the robot's.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from coglab_py.pose import length

from .carried import CarriedObject, CarriedSettings
from .reach_bank import Prediction, ReachBank, ReachSettings
from .recogniser import CLOCK_JUMP, PatternEnd

AHEAD = 0.05
"""s by which clocks that are synchronised differ; what is stamped later than that has not happened"""
ROOM = 100.0
"""m: no hand is farther away"""
GONE = 0.05
"""probability of a motion toward a handover below which there is none to take back"""
EXTRAPOLATED = 0.10
"""s for which the hand goes on as it did, for an object that was seen after it"""
WAITING = 40
"""most sights of an object that wait for one of the hand"""
BESIDE = 0.02
"""s by which a sight of an object is beside one of the hand"""


class CriticallyDamped:
    """A low-pass filter of second order without overshoot, solved exactly, for samples at any times: two time constants
    late behind a steady motion, at rest within about five."""

    def __init__(self) -> None:
        self._value: np.ndarray | None = None
        self._rate = np.zeros(3)
        self._stamp = -math.inf

    def forget(self) -> None:
        """What comes next is where it begins, at rest."""
        self._value = None

    def step(self, stamp: float, wanted: np.ndarray, time_constant: float) -> np.ndarray:
        """Where it is at ``stamp`` (s, later than the last one), with ``wanted`` (3,) and poles at 1/``time_constant``
        (s) since then; 0: what comes in goes out."""
        gap, self._stamp = stamp - self._stamp, stamp
        if self._value is None or time_constant <= 0.0:
            value, self._rate = np.array(wanted, dtype=float), np.zeros(3)
        else:
            pole = 1.0 / time_constant
            left = math.exp(-pole * gap)
            away = self._value - wanted
            drift = self._rate + pole * away
            value = wanted + left * (away + gap * drift)
            self._rate = left * (self._rate - pole * gap * drift)
        self._value = value
        return value


@dataclass(frozen=True)
class BeliefSettings:
    """Of the belief. Lengths in m, times in s."""

    decision: float = 0.9
    """probability of an offer or a request from which one may act on it"""
    shown: float = 0.3
    """probability below which there is no prediction of a place"""
    withdrawal: float = 0.10
    """a hand that goes back so far from where it had come to takes back what it was about"""
    unseen: float = 0.5
    """probability that a hand holds something where no object is seen"""
    max_gap: float = 1.0
    """without a sight of the hand, after which nothing is known any more"""
    lost_time: float = 0.25
    """of sights that do not fit the hand, after which this is another hand"""
    lost_sights: int = 4
    """and how many of them in a row"""
    pattern_deviation: float = 0.06
    """of the end of a reach about the one of its pattern, beside the spread of the pattern itself"""
    pattern_time: float = 0.15
    """in which a pattern that is recognised comes to its full weight in the prediction"""
    place_time: float = 0.2
    """time constant with which the place of an offer follows its predictions where they are as uncertain as `unsure`"""
    unsure: float = 0.05
    """largest standard deviation of the place on an axis from which it is that; below it is as much shorter, but not"""
    least_share: float = 0.15
    """less than this share of it"""
    request_time: float = 0.14
    """the same time constant for the place where somebody asks for the object"""
    same_reach: float = 0.3
    """by which the onset of one reach may be corrected"""
    reach: ReachSettings = field(default_factory=ReachSettings)
    carried: CarriedSettings = field(default_factory=CarriedSettings)

    @staticmethod
    def from_mapping(data: Mapping[str, Any], source: str = "belief") -> BeliefSettings:
        """From a parameter: fields by name, `reach` and `carried` as mappings of theirs; what is left out keeps its
        default. ValueError names a field that is unknown or not a number as it has to be."""
        groups = {"reach": ReachSettings(), "carried": CarriedSettings()}
        own = _read(BeliefSettings(), {k: v for k, v in data.items() if k not in groups}, source)
        read = {k: _read(groups[k], data.get(k, {}), f"{source}/{k}") for k in groups}
        return replace(own, **read)


def _read(default: Any, data: Any, source: str) -> Any:
    """A settings object with the numbers of a mapping in the place of its own; each has to be finite and not
    negative."""
    if not isinstance(data, Mapping):
        raise ValueError(f"{source}: expected a mapping of numbers, got {str(data)[:60]!r}")
    known = {
        f.name: getattr(default, f.name)
        for f in fields(default)
        if f.name not in ("reach", "carried") or isinstance(getattr(default, f.name), float)
    }
    unknown = sorted(set(map(str, data)) - set(known))
    if unknown:
        raise ValueError(f"{source}: unknown {', '.join(unknown)}; known: {', '.join(known)}")
    changes: dict[str, Any] = {}
    for name, value in data.items():
        many = isinstance(known[name], tuple)
        numbers = list(value) if many and isinstance(value, (list, tuple)) else [value]
        signed = name == "place"
        good = all(
            isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) and (signed or v > 0.0)
            for v in numbers
        )
        fixed = name in ("place", "place_deviation")
        if not good or not numbers or (fixed and len(numbers) != len(known[name])):
            wanted = f"{len(known[name]) if fixed else 'a list of'} numbers" if many else "a number"
            raise ValueError(
                f"{source}/{name}: expected {wanted}{'' if signed else ' above 0'}, got {str(value)[:60]!r}"
            )
        kind = type(known[name])
        changes[name] = tuple(float(v) for v in numbers) if many else kind(value)
    return replace(default, **changes)


@dataclass(frozen=True)
class Belief:
    """After the sight of the hand at ``stamp`` (s). Without a prediction ``place`` is None."""

    stamp: float
    offer: float = 0.0
    request: float = 0.0
    onset: float | None = None
    """s, stamp at which the motion began that is taken for a reach to a handover"""
    object_id: str = ""
    pattern: str = ""
    """that the prediction rests on beside the motion itself; empty: none"""
    hand_place: np.ndarray | None = None
    """m, where the hand will be at rest"""
    place: np.ndarray | None = None
    """m, where the object will be then; without one in the person's hand: the hand's"""
    covariance: np.ndarray | None = None
    """m^2, (3, 3), of both"""
    time: float = 0.0
    """s from the stamp until then"""
    time_deviation: float = -1.0

    @property
    def either(self) -> float:
        """Probability of an offer or a request."""
        return self.offer + self.request


class BeliefFilter:
    """One person's hand and the objects about. Feed it sights in the order in which they arrive, with the time now (s):
    what is late, from the future or not finite is left out."""

    def __init__(self, settings: BeliefSettings = BeliefSettings()) -> None:
        self.settings = settings
        self.belief = Belief(-math.inf)
        self._bank: ReachBank | None = None
        self._track: deque[tuple[float, np.ndarray]] = deque(maxlen=40)
        """stamps with position and velocity (6) of the hand"""
        self._objects: dict[str, CarriedObject] = {}
        """by id, after all sights"""
        self._settled_objects: dict[str, CarriedObject] = {}
        """the same after those alone that are not newer than the newest sight of the hand"""
        self._waiting: dict[str, deque[tuple[float, np.ndarray]]] = {}
        """stamps and positions of the newer ones"""
        self._robot_holds: bool | None = None
        self._misses: list[float] = []
        self._rest = self._furthest = np.zeros(3)
        self._place, self._onset = CriticallyDamped(), -math.inf
        self._pattern, self._pattern_weight, self._pattern_stamp = "", 0.0, -math.inf

    # -- sights ----------------------------------------------------------------------------------------------------

    def see_object(self, stamp: float, object_id: str, position: np.ndarray, now: float) -> None:
        """A sight of an object's frame (m, world)."""
        position = np.asarray(position, dtype=float)
        if self._bank is None or not _usable(stamp, position, now):
            return
        hand, velocity = self._hand_at(stamp)
        known = self._objects.get(object_id)
        if known is not None and stamp < known.stamp - CLOCK_JUMP:
            known = None
        if known is None:
            reach = self.settings.reach
            noise = reach.noise, reach.noise_time
            known = CarriedObject(stamp, position, hand, noise, self.settings.carried)
            self._objects[object_id] = self._settled_objects[object_id] = known
            self._waiting[object_id] = deque(maxlen=WAITING)
            return
        self._waiting[object_id].append((stamp, position))
        self._objects[object_id] = self._beside_hand(object_id)

    def _beside_hand(self, object_id: str) -> CarriedObject:
        """An object after all its sights. What was seen of it since the newest sight of the hand is judged by where
        the hand would be, as long as that is known, and again once the hand has been seen after it: a hand that is not
        seen for a while, or stops meanwhile, does not go on as it did."""
        newest, waiting = self._track[-1][0], self._waiting[object_id]
        known = self._settled_objects[object_id] = copy(self._settled_objects[object_id])
        while waiting and waiting[0][0] <= newest:
            stamp, position = waiting.popleft()
            seen = self._hand_seen_at(stamp)
            if seen is not None:
                known.step(stamp, position, *seen, 0.0)
        shown = copy(known)
        for stamp, position in waiting:
            late = stamp - newest
            if late > EXTRAPOLATED:
                break
            hand, velocity = self._hand_at(stamp)
            shown.step(stamp, position, hand, velocity, 0.2 * late * length(velocity) + 2.0 * late**2)
        return shown

    def _hand_seen_at(self, stamp: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Position and velocity of the hand at a stamp between two of its sights; None where these are far apart and
        the stamp is not beside one of them: what the hand did there nobody knows."""
        times = [t for t, _ in self._track]
        after = bisect_left(times, stamp)
        near = [i for i in (after - 1, after) if 0 <= i < len(times)]
        nearest = min(near, key=lambda i: abs(times[i] - stamp))
        if times[near[-1]] - times[near[0]] <= EXTRAPOLATED:
            return self._hand_at(stamp)
        if abs(times[nearest] - stamp) > BESIDE:
            return None
        state = self._track[nearest][1]
        return state[:3] + (stamp - times[nearest]) * state[3:], state[3:]

    def see_hand(
        self, stamp: float, position: np.ndarray, now: float, robot_holds: bool = False, end: PatternEnd | None = None
    ) -> Belief:
        """A sight of the hand (m, world). ``robot_holds``: whether the robot has something in its hand that the person
        can ask for; ``end``: what the recogniser says, where it is sure."""
        position = np.asarray(position, dtype=float)
        if not _usable(stamp, position, now):
            return self.belief
        bank = self._bank
        if bank is None or stamp < bank.stamp - CLOCK_JUMP or stamp > bank.stamp + self.settings.max_gap:
            self._begin(stamp, position, robot_holds)
        elif stamp <= bank.stamp:
            return self.belief
        else:
            if robot_holds != self._robot_holds:
                # What one hand held is in the other one: that handover is over, the next one needs a reach of its own.
                self._robot_holds = robot_holds
                bank.forget()
            self._step(bank, stamp, position)
        self.belief = self._judge(stamp, end)
        return self.belief

    def _begin(self, stamp: float, position: np.ndarray, robot_holds: bool) -> None:
        """A hand that was not seen before."""
        self._bank = ReachBank(stamp, position, self.settings.reach)
        self._robot_holds = robot_holds
        self._track.clear()
        self._track.append((stamp, np.concatenate([position, np.zeros(3)])))
        self._objects.clear()
        self._settled_objects.clear()
        self._waiting.clear()
        self._misses.clear()
        self._rest = self._furthest = position
        self._place.forget()
        self._pattern, self._pattern_weight, self._pattern_stamp = "", 0.0, stamp

    def _step(self, bank: ReachBank, stamp: float, position: np.ndarray) -> None:
        s = self.settings
        if not bank.step(stamp, position):
            self._misses.append(stamp)
            if len(self._misses) >= s.lost_sights and stamp - self._misses[0] >= s.lost_time:
                self._begin(stamp, position, bool(self._robot_holds))
            return
        self._misses.clear()
        self._track.append((stamp, np.concatenate([bank.position(), bank.velocity()])))
        for object_id in self._objects:
            self._objects[object_id] = self._beside_hand(object_id)
        prediction = bank.prediction()
        if prediction is None or bank.handover < GONE:
            self._rest = self._furthest = position
            return
        way = prediction.end - self._rest
        along = way / max(1e-6, length(way))
        advance = float((position - self._furthest) @ along)
        if advance > 0.0:
            self._furthest = position
        elif -advance > s.withdrawal:
            bank.forget()
            self._rest = self._furthest = position

    def _hand_at(self, stamp: float) -> tuple[np.ndarray, np.ndarray]:
        """m and m/s, where the hand was at a stamp, without the tracker's error, or where it would be."""
        newest, state = self._track[-1]
        if stamp >= newest:
            return state[:3] + min(stamp - newest, EXTRAPOLATED) * state[3:], state[3:]
        times = np.array([t for t, _ in self._track])
        states = np.array([p for _, p in self._track])
        then = np.array([np.interp(stamp, times, states[:, i]) for i in range(6)])
        return then[:3], then[3:]

    # -- judgement -------------------------------------------------------------------------------------------------

    def _carried(self, stamp: float) -> tuple[str, float, np.ndarray]:
        """Id, probability and place in the hand (m) of the object that is most probably in it."""
        seen = {k: o for k, o in self._objects.items() if abs(stamp - o.stamp) <= self.settings.carried.memory}
        if not seen:
            return "", self.settings.unseen, np.zeros(3)
        best = max(seen, key=lambda k: seen[k].carried)
        return best, seen[best].carried, seen[best].offset

    def _judge(self, stamp: float, end: PatternEnd | None) -> Belief:
        assert self._bank is not None
        handover = self._bank.handover
        object_id, carried, offset = self._carried(stamp)
        offer, request = (0.0, handover) if self._robot_holds else (handover * carried, 0.0)
        prediction = self._bank.prediction()
        if prediction is None or offer + request < self.settings.shown:
            self._pattern_weight = 0.0
            self._place.forget()
            return Belief(stamp, offer, request)
        if self._robot_holds:
            object_id, offset = "", np.zeros(3)
        place, covariance, pattern = self._with_pattern(stamp, prediction, end)
        place = self._settled(stamp, place, covariance, prediction.onset)
        return Belief(
            stamp,
            offer,
            request,
            prediction.onset,
            object_id,
            pattern,
            place,
            place + offset,
            covariance,
            max(0.0, prediction.arrival - stamp),
            prediction.arrival_deviation,
        )

    def _settled(self, stamp: float, place: np.ndarray, covariance: np.ndarray, onset: float) -> np.ndarray:
        """The predicted place (m) without the to and fro of its corrections: the hand goes to one place, so what the
        predictions of one reach differ in is their error. An offer has to be met, so its place counts as it is the
        sooner, the surer it is; who asks comes to what is held out."""
        s = self.settings
        if onset > self._onset + s.same_reach:
            self._place.forget()
        self._onset = onset
        spread = math.sqrt(float(np.max(np.diag(covariance)))) / s.unsure
        time = s.request_time if self._robot_holds else s.place_time * min(1.0, max(s.least_share, spread))
        return self._place.step(stamp, place, time)

    def _with_pattern(
        self, stamp: float, prediction: Prediction, end: PatternEnd | None
    ) -> tuple[np.ndarray, np.ndarray, str]:
        """End of the motion and of its pattern, each by its precision; a pattern gets its weight gradually, so that
        what follows the place is not pushed."""
        name = end.pattern if end is not None else ""
        if name != self._pattern:
            self._pattern, self._pattern_weight = name, 0.0
        elif name:
            step = (stamp - self._pattern_stamp) / self.settings.pattern_time
            self._pattern_weight = min(1.0, self._pattern_weight + step)
        self._pattern_stamp = stamp
        if end is None or self._pattern_weight <= 0.0:
            return prediction.end, prediction.covariance, ""
        precision = np.linalg.inv(prediction.covariance)
        of_pattern = self._pattern_weight / (end.variance + self.settings.pattern_deviation**2)
        covariance = np.linalg.inv(precision + np.diag(of_pattern))
        return covariance @ (precision @ prediction.end + of_pattern * end.place), covariance, name


def _usable(stamp: float, position: np.ndarray, now: float) -> bool:
    """Whether a sight is one: finite, of a place in a room, and not of the future."""
    fits = position.shape == (3,) and bool(np.all(np.abs(position) < ROOM))
    return math.isfinite(stamp) and stamp <= now + AHEAD and fits
