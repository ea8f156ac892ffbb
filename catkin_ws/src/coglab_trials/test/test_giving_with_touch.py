"""Whole trials with touch sensors in the hand: the grip force follows the load, as with people."""

import os

import numpy as np
import pytest
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_trials import GIVE, RECEIVE, Conditions, VirtualTrial

LONG = os.environ.get("COGLAB_LONG") == "1"
NOISE = 0.05
"""N, noise of one component of a touch sensor"""


class Given:
    """A trial in which an object is received and given back. ``rows``: time (s), share of the load that has gone, grip
    (N), at 100 Hz while the load is given. ``last``: grip (N) at the end."""

    def __init__(self, object_id, seed, **overrides):
        self.trial = VirtualTrial(seed, Conditions(object_id=object_id), touch=NOISE, settings=overrides)
        self.rows = []
        self.last, self.trial.beside = 0.0, self._look
        self.results = self.trial.run(RECEIVE, GIVE)
        self.rows = np.array(self.rows)

    def _look(self, trial):
        contact = trial.ctx.contact
        share, grip = contact.share_gone(), contact.grip()
        self.last = self.last if grip is None else grip
        if trial.world.ticks % 2 == 0 and None not in (share, grip):
            self.rows.append((trial.world.t, share, grip))


@pytest.mark.parametrize(
    ("object_id", "seed"),
    [("mug", 7000), ("screwdriver", 7004), *[("bottle", 7001), ("ball", 7007), ("tea_box", 7003)] * LONG],
)
def test_the_grip_falls_as_the_person_takes_the_load(object_id, seed):
    given = Given(object_id, seed)
    assert [r.outcome for r in given.results] == ["succeeded", "succeeded"], [r.reason for r in given.results]
    _, share, grip = given.rows.T
    correlation = np.corrcoef(share, grip)[0, 1]
    print(f"{object_id}: share and grip correlate with {correlation:.2f}, {grip[0]:.1f} N to {grip[-1]:.1f} N")
    assert correlation < -0.7
    # Mean grip over growing share: it does not rise again, except within the dead band of the fingers.
    means = [grip[(low <= share) & (share < low + 0.2)] for low in np.arange(-0.1, 0.9, 0.2)]
    means = np.array([each.mean() for each in means if len(each)])
    assert np.all(np.diff(means) < 0.05 * grip[0]) and means[-1] < 0.85 * means[0], means


def test_the_grip_closes_again_when_the_load_returns(monkeypatch):
    """The person lifts until they carry half of the load, waits, and sinks again."""
    begun, risen, enough = [], [0.0], [False]

    def half(self, t, dt, seen):
        begun.append(t)
        since = t - begun[0]
        enough.append(enough[-1] or self._load_share(seen) > 0.12)  # 0.12: measured late, the share reaches one half
        speed = 0.0 if enough[-1] else 0.003
        if since > 2.0:
            speed = -min(0.003, risen[0] / dt)
        self._velocity = np.array([0.0, 0.0, speed])
        self._hand = self._hand + self._velocity * dt
        risen[0] += speed * dt
        if since > 6.0:
            self._go("releasing", t)

    monkeypatch.setattr(VirtualHuman, "_lifting", half)
    # A sinking arm would lay the object into the person's hand.
    given = Given("mug", 7000, **{"give.lower_after": 60.0})
    t, share, grip = given.rows.T
    loose = int(np.argmin(grip))
    print(f"share {share.max():.2f}, grip {grip[0]:.1f} N, {grip[loose]:.1f} N, {grip[-1]:.1f} N")
    assert grip[loose] < 0.75 * grip[0], "it was loosened"
    # Near the person's fingers the grip closes only with the lowest force, perhaps the present one.
    assert grip[-1] >= 0.98 * grip[loose] and t[-1] > t[loose], "the grip does not loosen further"
    assert given.last > 0.75 * grip[0], "at home the grip is firm"
    assert share[-1] < 0.1 and t[-1] > t[loose] + 0.5
    assert given.results[-1].outcome == "failed_holding" and given.trial.ctx.holding == "mug"
    assert not given.trial.world.truth["dropped"]
