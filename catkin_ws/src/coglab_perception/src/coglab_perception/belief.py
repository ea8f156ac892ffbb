"""Estimates the person's intention: to offer an object, to request the one in the robot's hand, or neither.

The belief consists of probabilities. Every observation of the hand and of the objects updates it, from the beginning of
a reach. The hand's motion shows whether it goes to a handover (reach_bank). The motion of the objects shows whether the
hand carries one (carried). An offer needs an object in the person's hand, a request needs one in the robot's hand.
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
from .frames import CLOCK_TOLERANCE
from .reach_bank import Prediction, ReachBank, ReachSettings
from .recogniser import CLOCK_JUMP, PatternEnd

ROOM = 100.0  # m, upper bound of each coordinate of a hand
GONE = 0.05  # probability of a motion toward a handover below which the hand's return is not a withdrawal
EXTRAPOLATED = 0.10  # s for which the hand's motion is extrapolated, for an object observed after the hand
WAITING = 40  # largest number of observations of an object that wait for one of the hand
BESIDE = 0.02  # s between observations of object and hand that count as simultaneous


class CriticallyDamped:
    """Second-order low-pass filter without overshoot, solved exactly for samples at any times. It lags behind a
    constant velocity by two time constants, and settles within about five."""

    def __init__(self) -> None:
        self._value: np.ndarray | None = None
        self._rate = np.zeros(3)
        self._stamp = -math.inf

    def forget(self) -> None:
        """Forget the state. The next input becomes the output, at rest."""
        self._value = None

    def step(self, stamp: float, wanted: np.ndarray, time_constant: float) -> np.ndarray:
        """Output at ``stamp`` (s, later than the last one). ``wanted`` (3,) is the input since the last stamp. Both
        poles are at 1/``time_constant`` (1/s). With a time constant of 0 the output is the input."""
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
    """Settings of the belief. Lengths in m, times in s."""

    decision: float = 0.9
    """probability of an offer or a request at which the robot may act"""
    shown: float = 0.3
    """probability below which no place is predicted"""
    withdrawal: float = 0.10
    """distance by which a hand must return from its farthest point to cancel its intention"""
    unseen: float = 0.5
    """probability that the hand holds something if no object is observed"""
    max_gap: float = 1.0
    """time without an observation of the hand after which the belief is reset"""
    lost_time: float = 0.25
    """time of observations that do not fit the hand, after which they belong to another hand"""
    lost_sights: int = 4
    """smallest number of consecutive observations in that time"""
    pattern_deviation: float = 0.06
    """standard deviation of a reach's end about the end of its pattern, in addition to that of the pattern"""
    pattern_time: float = 0.15
    """time until a recognised pattern has its full weight in the prediction"""
    place_time: float = 0.2
    """time constant of the filter for the place of an offer, if the standard deviation is `unsure` or more"""
    unsure: float = 0.05
    """standard deviation (largest of the axes); below it the time constant is proportional to the deviation"""
    least_share: float = 0.15
    """smallest share of place_time that is used"""
    request_time: float = 0.14
    """time constant of the filter for the place of a request"""
    same_reach: float = 0.3
    """largest correction of the onset of one reach"""
    reach: ReachSettings = field(default_factory=ReachSettings)
    carried: CarriedSettings = field(default_factory=CarriedSettings)

    @staticmethod
    def from_mapping(data: Mapping[str, Any], source: str = "belief") -> BeliefSettings:
        """Settings from a parameter: fields by name; `reach` and `carried` are mappings. Missing fields keep their
        defaults. A ValueError names a field that is unknown or has an invalid value."""
        groups = {"reach": ReachSettings(), "carried": CarriedSettings()}
        own = _read(BeliefSettings(), {k: v for k, v in data.items() if k not in groups}, source)
        read = {k: _read(groups[k], data.get(k, {}), f"{source}/{k}") for k in groups}
        return replace(own, **read)


def _read(default: Any, data: Any, source: str) -> Any:
    """A copy of a settings object with the numbers of a mapping. Each number must be finite and not negative."""
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
    """The belief after the observation of the hand at ``stamp`` (s). Without a prediction ``place`` is None."""

    stamp: float
    offer: float = 0.0
    request: float = 0.0
    onset: float | None = None
    """s, stamp at which the motion toward a handover began"""
    object_id: str = ""
    pattern: str = ""
    """pattern used for the prediction, in addition to the motion itself; empty: none"""
    hand_place: np.ndarray | None = None
    """m, place where the hand will be at rest"""
    place: np.ndarray | None = None
    """m, place of the object then; without an object in the person's hand: place of the hand"""
    covariance: np.ndarray | None = None
    """m^2, (3, 3), covariance of both places"""
    time: float = 0.0
    """s from the stamp until the hand is at rest"""
    time_deviation: float = -1.0

    @property
    def either(self) -> float:
        """Probability of an offer or a request."""
        return self.offer + self.request


class BeliefFilter:
    """Belief about one person's hand and the objects nearby. Pass observations in the order of their arrival, with the
    current time (s). Observations that are late, from the future or not finite are ignored."""

    def __init__(self, settings: BeliefSettings = BeliefSettings()) -> None:
        self.settings = settings
        self.belief = Belief(-math.inf)
        self._bank: ReachBank | None = None
        self._track: deque[tuple[float, np.ndarray]] = deque(maxlen=40)
        """stamps with position (m) and velocity (m/s) of the hand (6)"""
        self._objects: dict[str, CarriedObject] = {}
        """by id, after all observations"""
        self._settled_objects: dict[str, CarriedObject] = {}
        """the same, but without observations that are newer than the newest one of the hand"""
        self._waiting: dict[str, deque[tuple[float, np.ndarray]]] = {}
        """stamps and positions of these newer observations"""
        self._robot_holds: bool | None = None
        self._misses: list[float] = []
        self._rest = self._furthest = np.zeros(3)
        self._place, self._onset = CriticallyDamped(), -math.inf
        self._pattern, self._pattern_weight, self._pattern_stamp = "", 0.0, -math.inf

    # -- observations ----------------------------------------------------------------------------------------------

    def see_object(self, stamp: float, object_id: str, position: np.ndarray, now: float) -> None:
        """Process an observation of an object's frame (m, world)."""
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
        """An object after all its observations. Observations newer than the newest one of the hand are first evaluated
        with the hand's extrapolated motion, and again when the hand has been observed after them: a hand that is not
        observed for a while, or stops, does not move as extrapolated."""
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
        """Position (m) and velocity (m/s) of the hand at a stamp between two of its observations. None if the two are
        far apart and neither is close to the stamp: the motion in between is unknown."""
        after = bisect_left(self._track, stamp, key=_stamp_of)
        near = [self._track[i] for i in (after - 1, after) if 0 <= i < len(self._track)]
        if near[-1][0] - near[0][0] <= EXTRAPOLATED:
            return self._hand_at(stamp)
        nearest, state = min(near, key=lambda seen: abs(seen[0] - stamp))
        if abs(nearest - stamp) > BESIDE:
            return None
        return state[:3] + (stamp - nearest) * state[3:], state[3:]

    def see_hand(
        self, stamp: float, position: np.ndarray, now: float, robot_holds: bool = False, end: PatternEnd | None = None
    ) -> Belief:
        """Process an observation of the hand (m, world) and return the belief. ``robot_holds``: the robot holds an
        object that the person can request. ``end``: end of the reach from the recogniser, if it has decided."""
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
                # The object changed hands: this handover is over, and the next one needs a new reach.
                self._robot_holds = robot_holds
                bank.forget()
            self._step(bank, stamp, position)
        self.belief = self._judge(stamp, end)
        return self.belief

    def _begin(self, stamp: float, position: np.ndarray, robot_holds: bool) -> None:
        """Start with a new hand."""
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
        """Position (m) and velocity (m/s) of the hand at a stamp, filtered or extrapolated."""
        newest, state = self._track[-1]
        if stamp >= newest:
            return state[:3] + min(stamp - newest, EXTRAPOLATED) * state[3:], state[3:]
        after = bisect_left(self._track, stamp, key=_stamp_of)
        if after == 0:
            then = self._track[0][1]
        else:
            (begin, before), (end, behind) = self._track[after - 1], self._track[after]
            then = before + (stamp - begin) / (end - begin) * (behind - before)
        return then[:3], then[3:]

    # -- judgement -------------------------------------------------------------------------------------------------

    def _carried(self, stamp: float) -> tuple[str, float, np.ndarray]:
        """Id, probability and offset from the hand (m) of the object that is most probably in the hand."""
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
        """The predicted place (m), filtered. The hand goes to one place, so differences between the predictions of one
        reach are errors. For an offer the filter is the faster, the more certain the prediction is, because the robot
        must meet the hand. For a request the person comes to the object."""
        s = self.settings
        if onset > self._onset + s.same_reach:
            self._place.forget()
        self._onset = onset
        spread = math.sqrt(max(covariance[i, i] for i in range(3))) / s.unsure
        time = s.request_time if self._robot_holds else s.place_time * min(1.0, max(s.least_share, spread))
        return self._place.step(stamp, place, time)

    def _with_pattern(
        self, stamp: float, prediction: Prediction, end: PatternEnd | None
    ) -> tuple[np.ndarray, np.ndarray, str]:
        """End of the motion combined with the end of its pattern, weighted by precision. The weight of a pattern grows
        gradually, so that a motion toward the place does not jump. Returns place, covariance and pattern."""
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


def _stamp_of(seen: tuple[float, np.ndarray]) -> float:
    return seen[0]


def _usable(stamp: float, position: np.ndarray, now: float) -> bool:
    """True if an observation is finite, within a room, and not from the future."""
    fits = position.shape == (3,) and all(abs(value) < ROOM for value in position.tolist())
    return math.isfinite(stamp) and stamp <= now + CLOCK_TOLERANCE and fits
