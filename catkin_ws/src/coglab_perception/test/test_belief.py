"""Belief in offers and requests: early and settled predictions, withdrawn and fallen objects, invalid sights."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from coglab_perception.belief import Belief, BeliefFilter, BeliefSettings
from coglab_perception.reach_bank import ReachSettings
from coglab_perception.recogniser import PatternEnd
from other_motions import KINDS, other_motion
from synthetic_reaches import START, share

END = np.array([0.84, 0.02, 0.46])
IN_HAND = np.array([-0.08, 0.0, -0.05])
LEVEL = BeliefSettings().decision
ONSET, TIME = 1.0, 1.15
OVER = ONSET + TIME
Path3 = Callable[[float], np.ndarray]


def there(t: float) -> np.ndarray:
    """A reach to END that begins at ONSET."""
    return START + (END - START) * share((t - ONSET) / TIME)


def and_back(t: float, at: float = OVER + 0.6, way: float = 1.0) -> np.ndarray:
    """The same reach, but the hand goes back from `at` on."""
    return there(t) + way * (START - END) * share((t - at) / TIME)


class Scene:
    """A hand and perhaps an object, watched at 30 Hz by a tracker whose error wanders; 60 ms late."""

    def __init__(self, seed: int = 0, holds: bool = False) -> None:
        self.rng = np.random.default_rng(seed)
        self.filter = BeliefFilter()
        self.holds = holds
        self.error = {name: self.rng.normal(0.0, 0.004, 3) for name in ("hand", "mug")}
        self.beliefs: list[Belief] = []

    def seen(self, name: str, place: np.ndarray) -> np.ndarray:
        keep = math.exp(-1 / 30 / 0.5)
        fresh = self.rng.normal(0.0, 0.004, 3)
        self.error[name] = keep * self.error[name] + math.sqrt(1 - keep**2) * fresh
        return place + self.error[name]

    def watch(self, hand: Path3, thing: Path3 | None, until: float, change=lambda t, p: p, begin: float = 0.0) -> Scene:
        """`change` of a sight of the hand at t: another place, None for no sight."""
        for k in range(round(begin * 30), round(until * 30)):
            t = k / 30
            if thing is not None:
                self.filter.see_object(t - 0.005, "mug", self.seen("mug", thing(t - 0.005)), t + 0.06)
            place = change(t, self.seen("hand", hand(t)))
            if place is not None:
                self.beliefs.append(self.filter.see_hand(t, place, t + 0.06, self.holds))
        return self

    def first(self, level: float = LEVEL, after: float = 0.0) -> float:
        return next((b.stamp for b in self.beliefs if b.stamp >= after and b.either >= level), math.inf)

    def gone(self, after: float, level: float = 0.1) -> float:
        return next((b.stamp for b in self.beliefs if b.stamp >= after and b.either <= level), math.inf)

    def at(self, t: float) -> Belief:
        return next(b for b in self.beliefs if b.stamp >= t - 1e-6)


def steps(beliefs: list[Belief]) -> list[float]:
    """Change of the predicted place from sight to sight, in standard deviations."""
    return [
        float(np.linalg.norm(b.place - a.place)) / math.sqrt(np.trace(a.covariance))
        for a, b in zip(beliefs, beliefs[1:], strict=False)
        if a.place is not None and b.place is not None
    ]


def carried(hand: Path3) -> Path3:
    return lambda t: hand(t) + IN_HAND


@pytest.mark.parametrize("holds", [False, True])
def test_a_reach_is_believed_from_its_beginning_and_its_end_settles(holds):
    for seed in (0, 1):
        scene = Scene(seed, holds).watch(there, carried(there), OVER + 0.8)
        assert not any(b.either >= LEVEL for b in scene.beliefs if b.stamp < ONSET)
        assert scene.first() <= ONSET + 0.31
        assert min(b.either for b in scene.beliefs if b.stamp > scene.first() + 0.1) > 0.7
        last = scene.beliefs[-1]
        assert (last.offer == 0.0) == holds and (last.request == 0.0) != holds
        assert last.object_id == ("" if holds else "mug")
        goal = END if holds else END + IN_HAND
        for t, error in ((ONSET + 0.3, 0.16), (ONSET + 0.5 * TIME, 0.10), (ONSET + 0.75 * TIME, 0.05), (OVER, 0.04)):
            b = scene.at(t)
            assert b.place is not None and np.linalg.norm(b.place - goal) < error
            assert abs(b.stamp + b.time - OVER) < 0.35 and b.onset == pytest.approx(ONSET, abs=0.15)
        assert np.linalg.norm(last.place - goal) < 0.012
        assert max(steps(scene.beliefs)) < 3.0, "no jump beyond what was said to be uncertain"


def test_a_hand_that_waits_is_believed_for_as_long():
    scene = Scene(13)
    scene.error = dict.fromkeys(scene.error, np.zeros(3))
    scene.seen = lambda name, place: place
    scene.watch(there, carried(there), OVER + 3.0)
    assert min(b.offer for b in scene.beliefs if b.stamp > OVER + 0.3) > 0.85


def test_without_an_object_in_either_hand_there_is_neither():
    scene = Scene(1).watch(there, lambda t: START + [0.0, -0.15, 0.0], OVER + 0.5)
    assert max(b.either for b in scene.beliefs) < LEVEL
    assert max(b.offer for b in scene.beliefs if b.stamp > ONSET + 0.4) < 0.05
    unseen = Scene(1).watch(there, None, OVER)
    assert unseen.beliefs[-1].offer == pytest.approx(0.5, abs=0.05)


def test_offers_and_withdraws_five_times():
    def hand(t: float) -> np.ndarray:
        return and_back(ONSET + (t - ONSET) % 3.6 if t > ONSET else t)

    scene = Scene(2).watch(hand, carried(hand), ONSET + 18.0)
    for k in range(5):
        onset = ONSET + 3.6 * k
        assert scene.first(after=onset) < onset + 0.4
        sight = next(
            b.stamp for b in scene.beliefs if b.stamp > onset + 1.6 and np.linalg.norm(hand(b.stamp) - END) > 0.1
        )
        assert scene.gone(after=onset + 1.5) <= sight + 0.2
        assert max(b.either for b in scene.beliefs if sight + 0.2 < b.stamp < onset + 3.6) < LEVEL


def test_a_hand_that_goes_back_a_little_has_withdrawn():
    hand = lambda t: and_back(t, way=0.22)  # noqa: E731  (0.13 m)
    scene = Scene(3, True).watch(hand, None, OVER + 2.2)
    assert scene.at(OVER + 0.5).request > 0.8
    sight = next(b.stamp for b in scene.beliefs if b.stamp > OVER + 0.6 and np.linalg.norm(hand(b.stamp) - END) > 0.11)
    assert scene.gone(after=OVER) <= sight + 0.2


@pytest.mark.parametrize("fall", [ONSET + 0.6, OVER + 0.5])
def test_an_object_that_falls_is_no_offer(fall):
    speed = (there(fall) - there(fall - 0.01)) / 0.01

    def thing(t: float) -> np.ndarray:
        since = max(0.0, t - fall)
        drop = [0.0, 0.0, 0.5 * 9.81 * since**2]
        return there(min(t, fall)) + IN_HAND + speed * since - drop

    scene = Scene(4).watch(there, thing, fall + 0.4)
    assert scene.at(fall - 0.05).offer > 0.8
    assert scene.gone(after=fall) <= fall + 0.2
    assert scene.beliefs[-1].place is None


def test_resting_hand_after_a_handover_is_not_a_request():
    scene = Scene(5).watch(there, carried(there), OVER + 0.3)
    scene.holds = True
    scene.watch(there, carried(there), OVER + 1.0, begin=OVER + 0.3)
    assert max(b.either for b in scene.beliefs if b.stamp > OVER + 0.35) < 0.3


def test_outliers_swaps_and_dropouts_on_the_way_change_little():
    def change(t: float, p: np.ndarray) -> np.ndarray | None:
        k = round(t * 30)
        if 42 <= k < 46:
            return p + IN_HAND
        if k == 52:
            return p + [0.0, 0.5, 0.0]
        return None if k in (36, 37, 48, 49, 50) else p

    scene = Scene(6).watch(there, carried(there), OVER + 0.5, change)
    assert scene.first() < ONSET + 0.3
    after = [b for b in scene.beliefs if b.stamp > ONSET + 0.35]
    assert min(b.offer for b in after) > 0.5
    assert np.linalg.norm(after[-1].place - END - IN_HAND) < 0.02
    assert max(steps(after)) < 3.0


@pytest.mark.parametrize("unseen", [(44, 54), (50, 60), (52, 66)])
def test_an_object_stays_where_it_is_in_a_hand_that_is_not_seen_for_a_while(unseen):
    change = lambda t, p: None if unseen[0] <= round(t * 30) < unseen[1] else p  # noqa: E731
    for seed in (8, 9):
        scene = Scene(seed).watch(there, carried(there), OVER + 0.6, change)
        after = [b for b in scene.beliefs if b.stamp > ONSET + 0.35]
        assert min(b.offer for b in after) > 0.7
        assert max(np.linalg.norm(b.place - b.hand_place - IN_HAND) for b in after) < 0.03


def test_briefly_confused_object_is_still_offered():
    class Swapped(Scene):
        def seen(self, name: str, place: np.ndarray) -> np.ndarray:
            seen = super().seen(name, place)
            self.count = getattr(self, "count", 0) + (name == "mug")
            return seen - IN_HAND if name == "mug" and 56 <= self.count < 60 else seen

    scene = Swapped(10).watch(there, carried(there), OVER + 0.6)
    after = [b for b in scene.beliefs if b.stamp > ONSET + 0.35]
    assert min(b.offer for b in after) > 0.7
    assert max(np.linalg.norm(b.place - b.hand_place - IN_HAND) for b in after) < 0.03


@pytest.mark.parametrize("period", [1, 12])
def test_a_frame_that_jumps_between_two_hands_is_no_offer(period):
    other = np.array([1.05, -0.45, 0.35])
    hand = lambda t: START if round(t * 30) // period % 2 else other  # noqa: E731
    scene = Scene(7, True).watch(hand, None, 4.0)
    assert max(b.either for b in scene.beliefs) < LEVEL


def test_invalid_sights_are_ignored():
    clean, dirty = Scene(8), Scene(8)
    clean.watch(there, carried(there), ONSET + 0.5)

    def change(t: float, p: np.ndarray) -> np.ndarray:
        f = dirty.filter
        far, none = np.full(3, 1e300), np.full(3, np.nan)
        for stamp, place in (
            (t + 10.0, p),
            (t, none),
            (math.nan, p),
            (math.inf, p),
            (t - 1.0 if t > 0.0 else math.nan, p),
            (t, far),
            (t, p[:2]),
        ):
            assert f.see_hand(stamp, place, t) is f.belief
        f.see_object(t + 10.0, "mug", p, t)
        f.see_object(t, "mug", np.full(3, math.inf), t)
        return p

    dirty.watch(there, carried(there), ONSET + 0.5, change)
    assert [b.either for b in dirty.beliefs] == pytest.approx([b.either for b in clean.beliefs])
    # A clock that is set back, and a long gap, are new beginnings.
    assert dirty.filter.see_hand(-20.0, START, 0.0).offer < 0.3
    assert dirty.filter.see_hand(500.0, END, 500.0).either < 0.6


def test_resting_hands_and_most_other_motions_are_no_offer():
    rest = Scene(9, True).watch(lambda t: START, None, 5.0)
    assert max(b.either for b in rest.beliefs) < LEVEL
    crossed = 0
    rng = np.random.default_rng(10)
    for k in range(3):
        motion = other_motion(KINDS[k % 3], rng, 0.6)
        scene = Scene(k, k % 2 == 0).watch(motion.at, carried(motion.at), motion.segments[0].duration + 1.0)
        crossed += any(b.either >= LEVEL for b in scene.beliefs)
    assert crossed == 0


def test_a_recognised_pattern_comes_into_the_prediction_gradually():
    end = PatternEnd("high", END + [0.0, 0.0, 0.05], np.full(3, 1e-4))
    plain, helped = Scene(11, True), Scene(11, True)
    plain.watch(there, None, ONSET + 0.5)
    see = helped.filter.see_hand
    helped.filter.see_hand = lambda t, p, now, holds: see(t, p, now, holds, end if t > ONSET + 0.3 else None)
    helped.watch(there, None, ONSET + 0.5)
    shifts = [np.linalg.norm(b.place - a.place) if a.place is not None else 0.0
              for a, b in zip(plain.beliefs, helped.beliefs, strict=True)]  # fmt: skip
    assert plain.beliefs[-1].pattern == "" and helped.beliefs[-1].pattern == "high"
    assert max(np.diff(shifts)) < 0.03
    assert np.trace(helped.beliefs[-1].covariance) < 0.7 * np.trace(plain.beliefs[-1].covariance)


def test_settings_change_what_they_name_and_faults_are_refused():
    changed = BeliefSettings.from_mapping({"reach": {"place": [0.8, -0.1, 0.4]}, "decision": 0.85})
    assert changed == replace(BeliefSettings(), decision=0.85, reach=ReachSettings(place=(0.8, -0.1, 0.4)))
    for wrong, words in (
        ({"decison": 0.9}, "unknown decison"),
        ({"decision": "high"}, "belief/decision: expected a number above 0"),
        ({"reach": {"noise": 0.0}}, "reach/noise: expected a number above 0"),
        ({"reach": {"place": [1.0, 2.0]}}, "reach/place: expected 3 numbers"),
        ({"reach": 3}, "belief/reach: expected a mapping"),
        ({"carried": {"memory": math.nan}}, "carried/memory"),
    ):
        with pytest.raises(ValueError, match=words):
            BeliefSettings.from_mapping(wrong)


def test_predicted_place_does_not_oscillate():
    """The arm follows this place, so each reversed correction changes its speed. Without the filter the predictions
    move at least twice as far in total."""

    def way(seed: int, **times: float) -> tuple[float, float]:
        scene = Scene(seed)
        scene.filter = BeliefFilter(BeliefSettings(**times))
        places = [
            b.place for b in scene.watch(there, lambda t: there(t) + IN_HAND, OVER + 0.5).beliefs if b.place is not None
        ]
        return float(np.sum(np.linalg.norm(np.diff(places, axis=0), axis=1))), float(
            np.linalg.norm(places[-1] - END - IN_HAND)
        )

    at_once = [way(seed, place_time=1e-3) for seed in range(10)]
    settled = [way(seed) for seed in range(10)]
    assert np.median([w for w, _ in settled]) < 0.5 * np.median([w for w, _ in at_once])
    assert np.median([off for _, off in settled]) < 0.012, "and it comes to where the object is"
