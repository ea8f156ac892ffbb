"""The estimate of what acts on a moving arm, its change and its limits, against their formulas: an arm whose terms are
plain numbers, and stamps that are exact in binary."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from coglab_smach.contact.momentum_observer import MomentumObserver, Residual
from coglab_smach.contact.motion_thresholds import (
    FEATURES,
    Change,
    ChangeOfResidual,
    Offset,
    ThresholdError,
    Thresholds,
    explained,
    largest_confirmed,
    learn,
    limit_of,
)
from coglab_smach.contact.moving_contact import MovingContact
from moving_arm import SHIPPED
from scipy.stats import gumbel_r

DT = 1.0 / 128.0
KEEP = math.exp(-40.0 * DT)
PALM = np.hstack([np.eye(3), np.zeros((3, 4))])
"""m/rad: the first three joints feel one axis each"""


class Plain:
    """Terms of an arm with this inertia (kg m^2), gravity (Nm) and transposed C (Nm s)."""

    def __init__(self, inertia=0.0, gravity=0.0, coupling=0.0):
        self.inertia, self.gravity, self.coupling, self.payloads = inertia, gravity, coupling, []

    def evaluate(self, q, v):
        return SimpleNamespace(
            momentum=self.inertia * v, transposed=self.coupling * v, gravity=np.full(7, float(self.gravity))
        )

    def set_payload(self, mass, centre):
        self.payloads.append((mass, tuple(centre)))


def seven(value):
    return np.full(7, float(value))


# --- the observer -----------------------------------------------------------------------------------------------------


def test_one_estimate_of_three_samples_that_are_not_equally_far_apart():
    observer = MomentumObserver(Plain(2.0, 3.0, 0.5))
    observer.lag = 0.001
    assert observer.feed(0.0, seven(0.0), seven(9.0)) is None
    assert observer.feed(0.004, seven(0.004), seven(1.0)) is None
    first = observer.feed(0.012, seven(0.028), seven(4.0))
    # Velocities 1 and 3 rad/s, 6 ms from middle to middle; each torque counts over its own interval.
    rate, torque = 3.0 / 0.006, (0.004 * 1.0 + 0.008 * 4.0) / 0.012
    outside = 2.0 * 2.0 / 0.006 + 3.0 - 0.5 * (0.5 * 1.0 + 0.5 * 3.0) - torque - 0.001 * rate
    assert first.torque == pytest.approx(seven(outside)) and first.fresh
    assert first.velocity == pytest.approx(seven(3.0)) and first.position == pytest.approx(seven(0.028))
    assert first.acceleration == pytest.approx(seven(2.0 / 0.006)) and first.rate == pytest.approx(seven(rate))
    assert first.stamp == 0.012


def test_an_estimate_follows_as_a_low_pass_of_40_per_second():
    observer = MomentumObserver(Plain())
    found = [observer.feed(k * DT, seven(0.0), seven(-1.0 if k > 4 else 0.0)) for k in range(8)]
    # The sample of the step counts as half of it.
    expected = [0.5 * (1.0 - KEEP)]
    for _ in range(2):
        expected.append(KEEP * expected[-1] + 1.0 - KEEP)
    assert [each.torque[0] for each in found[5:]] == pytest.approx(expected)
    assert found[5].rate[0] == pytest.approx(-(1.0 - KEEP) / DT) and found[6].rate[0] == pytest.approx(
        -KEEP * (1.0 - KEEP) / DT
    )
    assert [each.fresh for each in found[2:]] == [True, *[False] * 5]
    assert MomentumObserver(Plain(), gain=1e-3).gain == 1e-3
    for gain in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="gain"):
            MomentumObserver(Plain(), gain)


def fed(observer, stamps):
    """What it says to an arm at rest under 1 Nm, at these stamps (s)."""
    return [observer.feed(stamp, seven(0.0), seven(-1.0)) for stamp in stamps]


@pytest.mark.parametrize(("gap", "fresh"), [(0.0499, False), (0.0501, True), (0.2, True), (-0.001, True), (-1.0, True)])
def test_gaps_of_50_ms_are_bridged(gap, fresh):
    observer = MomentumObserver(Plain())
    fed(observer, [0.0, 0.005, 0.010])
    begin = 0.010 + gap
    found = [each for each in fed(observer, [begin, begin + 0.005, begin + 0.010]) if each is not None]
    assert found[0].fresh == fresh and len(found) == (1 if fresh else 3)


def test_a_stamp_that_was_there_already_says_nothing_and_breaks_nothing():
    observer = MomentumObserver(Plain())
    fed(observer, [0.0, 0.005, 0.010])
    assert fed(observer, [0.010]) == [None] and not fed(observer, [0.015])[0].fresh


@pytest.mark.parametrize(("aside", "told"), [(0.35, True), (-0.35, True), (0.45, False), (-0.45, False), (2.3, True)])
def test_stamps_beside_the_grid_of_the_measurements(aside, told):
    """Within 0.4 of a period they are of the nearest one; beyond, nobody can say, but the estimate stays."""
    observer = MomentumObserver(Plain(), period=DT)
    fed(observer, [k * DT for k in range(10)])
    found = fed(observer, [(10 + aside) * DT])[0]
    assert (found is not None) == told
    later = [each for each in fed(observer, [(14 + k) * DT for k in range(3)]) if each is not None]
    assert later and not any(each.fresh for each in later)


def test_late_stamps_are_no_push_where_the_robots_own_time_is_known():
    """A fast motion that nothing touches; one sample in twenty is received up to 0.4 s late, as on a busy computer."""
    rng, observer = np.random.default_rng(5), MomentumObserver(Plain(2.0), period=DT)
    time = DT * np.arange(600)
    position, velocity = 0.3 * np.sin(4.0 * time), 1.2 * np.cos(4.0 * time)
    torque = 2.0 * np.diff(velocity, prepend=velocity[0]) / DT
    late = np.where(rng.random(600) < 0.05, rng.uniform(0.0, 0.4, 600), rng.exponential(8e-4, 600))
    stamps = np.maximum.accumulate(time + late) + 1e-6 * np.arange(600)
    found = [observer.feed(s, seven(q), seven(t), m) for s, q, t, m in zip(stamps, position, torque, time, strict=True)]
    assert all(each is not None for each in found[2:])
    assert max(np.abs(each.torque).max() for each in found[2:]) < 0.2, "Nm, of 10 Nm that the motion takes"


def test_the_grid_follows_stamps_slowly():
    """A twentieth of what they are late; after ten samples that are 0.3 late, 0.22 early is still beside it."""
    for early, told in ((0.22, True), (0.36, False)):
        observer = MomentumObserver(Plain(), period=DT)
        fed(observer, [k * DT for k in range(10)])
        fed(observer, [(10 + k + 0.3) * DT for k in range(10)])
        assert (fed(observer, [(20 - early) * DT])[0] is not None) == told
    observer = MomentumObserver(Plain(), period=DT)
    drifting = fed(observer, [1.002 * k * DT for k in range(600)])
    assert all(each is not None for each in drifting[2:]), "a clock that goes 2 parts in 1000 slower"


@pytest.mark.parametrize(("jump", "doubted"), [(23.6, False), (24.4, True), (-23.6, False), (-24.4, True)])
def test_a_jump_of_more_than_12_newton_metres_is_doubted_twice(jump, doubted):
    observer = MomentumObserver(Plain())
    torque = lambda k: -jump if k >= 10 else 0.0  # noqa: E731
    found = [observer.feed(k * DT, seven(0.0), seven(torque(k))) for k in range(20)]
    assert (found[10] is None) == doubted, "half of it with the first sample"
    if doubted:
        assert found[10:14] == [None] * 4 and found[14].torque == pytest.approx(seven((1.0 - KEEP) * jump))
        assert not found[14].fresh


# --- the change -------------------------------------------------------------------------------------------------------


def residual(k, torque=0.0, speed=0.0, acceleration=0.0, rate=0.0, q=0.0, fresh=False):
    return Residual(k * DT, seven(torque), seven(q), seven(speed), seven(acceleration), seven(rate), fresh)


def test_a_change_is_counted_from_the_mean_of_half_a_second_ago():
    """From 0.10 s to 0.60 s ago: of a ramp of 1 Nm/s that is 44.5 samples back."""
    changes = ChangeOfResidual(lambda q: PALM)
    found = [changes.feed(residual(k, k * DT, rate=2.0 * k), 0.0) for k in range(200)]
    first = next(k for k, each in enumerate(found) if each is not None)
    assert first == 32, "20 samples are 0.10 s old"
    assert found[199].torque == pytest.approx(seven(44.5 * DT)) and found[199].rate == pytest.approx(seven(89.0))
    assert changes.past == pytest.approx(seven((199 - 22.5) * DT)), "from 0.10 s to 0.25 s ago"
    assert found[199].stamp == 199 * DT and found[199].jacobian is PALM
    assert changes.feed(residual(200, fresh=True), 0.0) is None, "begun anew"


def test_what_a_variance_grows_with():
    changes = ChangeOfResidual(lambda q: PALM)
    for k in range(200):
        found = changes.feed(residual(k, speed=-0.5, acceleration=-3.0), 0.0)
    assert found.features == pytest.approx(np.tile([1.0, 0.5, 0.25, 0.25, 9.0, 0.0], (7, 1)))
    later = changes.feed(residual(200, speed=1.5, acceleration=0.0), 0.0)
    blend = 1.0 - math.exp(-DT / 0.025)
    square = 0.25 + blend * (2.25 - 0.25)
    assert later.features[0] == pytest.approx([1.0, math.sqrt(square), square, 0.25, 0.0, 0.0])


def test_what_the_load_needs_is_its_weight_and_its_inertia():
    """A palm that turns under a load: the torque of 2 kg on the first joint grows with its position."""
    lever = lambda q: np.array([[0.0] * 7, [0.0] * 7, [q[0], *[0.0] * 6]])  # noqa: E731
    changes = ChangeOfResidual(lever)
    for k in range(300):
        found = changes.feed(residual(k, q=k * DT), 2.0)
    assert found.features[0, 5] == pytest.approx((2.0 * 9.81 * 44.5 * DT) ** 2, rel=1e-3)
    assert found.features[1:, 5] == pytest.approx([0.0] * 6)
    hastened = ChangeOfResidual(lambda q: PALM)
    for k in range(300):
        found = hastened.feed(residual(k, speed=4.0 * max(0.0, k - 250) * DT), 2.0)
    # 4 m/s^2 upward for 36 of the 64 samples that the change is counted from; the low-pass is late by 2.7 of them.
    blend = 1.0 - math.exp(-DT / 0.025)
    share = (36.0 - (1.0 - blend) / blend) / 64.0
    assert math.sqrt(found.features[2, 5]) == pytest.approx(8.0 * (1.0 - share), rel=1e-3)


def of(torque, features=None, jacobian=PALM, rate=0.0):
    features = np.tile([1.0, 0, 0, 0, 0, 0], (7, 1)) if features is None else features
    return Change(0.0, np.asarray(torque, dtype=float), features, seven(rate), np.zeros(7), lambda q: jacobian)


# --- thresholds -------------------------------------------------------------------------------------------------------


def thresholds(constant=0.04, **rest):
    variance = np.zeros((7, len(FEATURES)))
    variance[:, 0] = constant
    return Thresholds(variance, 5.0, seven(0.3), 4.0, **rest)


def test_a_force_is_counted_in_deviations():
    force, size = thresholds().force(of([0.4, 0.0, -0.3, 0, 0, 0, 9.0]))
    assert force == pytest.approx([0.4, 0.0, -0.3], rel=1e-6) and size == pytest.approx(0.5 / 0.2)
    assert thresholds(1e-9).deviation(np.ones((7, 6))) == pytest.approx(seven(0.01)), "the smallest that is believed"
    steady, size = thresholds().steady_force(Offset(np.array([0.0, 0.5, 0, 0, 0, 0, 0]), PALM), of(seven(0)).features)
    assert steady[1] == pytest.approx(0.5) and size == pytest.approx(0.5 / math.hypot(0.3, 0.2))
    stretched, size = explained(seven(0.2), seven(0.2), np.vstack([PALM[:2], np.zeros(7)]))
    assert np.all(np.isfinite(stretched)) and size == pytest.approx(math.sqrt(2.0))


def test_a_limit_is_exceeded_with_the_chosen_probability():
    rng = np.random.default_rng(5)
    largest = rng.gumbel(3.0, 0.4, 400)
    spread = np.std(largest) * math.sqrt(6.0) / math.pi
    mode = np.mean(largest) - np.euler_gamma * spread
    assert limit_of(largest, 0.01) == pytest.approx(max(gumbel_r.isf(0.01, mode, spread), 1.05 * largest.max()))
    assert limit_of([1.0, 2.0, 3.0], 1e-3) == pytest.approx(gumbel_r.isf(1e-3, 2.0 - 0.36747, 0.63662), rel=1e-4)
    assert limit_of([2.0, 2.0], 1e-3) == pytest.approx(2.1), "never less than was seen"
    assert largest_confirmed([1.0, 9.0, 2.0, 3.0, 4.0, 1.0]) == 3.0


def reaches(lag=0.0, count=20, samples=40):
    """Changes with 0.2 Nm of noise, and what a lag (s) adds."""
    rng, found = np.random.default_rng(2), []
    for _ in range(count):
        rates = rng.normal(0.0, 100.0, (samples, 7))
        noise = rng.normal(0.0, 0.2, (samples, 7))
        features = np.tile([1.0, 0, 0, 0, 0, 0], (7, 1))
        found.append(
            [
                Change(0.0, noise[i] + lag * rates[i], features, rates[i], np.zeros(7), lambda q: PALM)
                for i in range(samples)
            ]
        )
    return found


@pytest.mark.parametrize(
    ("lag", "before", "learnt"),
    [(0.003, 0.0, 0.003), (-0.002, 0.001, -0.001), (0.03, 0.004, 0.01), (-0.05, 0.0, -0.01)],
)
def test_a_lag_is_learnt_within_10_ms(lag, before, learnt):
    got = learn(reaches(lag), lag=before)
    assert got.lag == pytest.approx(learnt, abs=2e-4) and got.reaches == 20
    if abs(learnt) < 0.01:
        assert got.variance[:, 0] == pytest.approx(seven(0.04), rel=0.15)
        assert 2.0 < got.limit < 8.0


def test_offsets_count_once_twenty_were_seen():
    with pytest.raises(ThresholdError, match="at least 20 reaches without contact, got 19"):
        learn(reaches(count=19))
    rng = np.random.default_rng(4)
    offsets = [Offset(rng.normal(0.0, 0.1, 7), PALM) for _ in range(20)]
    few, enough = learn(reaches(), offsets[:19]), learn(reaches(), offsets)
    assert few.steady == pytest.approx(seven(0.3)) and few.steady_limit == pytest.approx(1.05 * 4.0)
    assert enough.steady == pytest.approx(np.sqrt(np.mean([o.torque**2 for o in offsets], axis=0)))
    assert enough.steady_limit != few.steady_limit and 2.0 < enough.steady_limit < 8.0
    usual = learn(reaches()).limit
    assert learn(reaches(), alarm_share=1e-4).limit > usual == learn(reaches(), alarm_share=2e-3).limit


BAD = {
    "lag: 0.000639": ("lag: 0.0101", "lag: -0.0101", "lag: .nan"),
    "limit: 5.359": ("limit: 0.0", "limit: 1000.0", "limit: .nan"),
    "steady_limit: 4.2": ("steady_limit: 0.0", "steady_limit: 1000.0"),
    "steady: [0.3, ": ("steady: [-0.3, ", "steady: [.inf, ", "steady: ["),
}


@pytest.mark.parametrize(("good", "bad"), [(good, bad) for good, every in BAD.items() for bad in every])
def test_thresholds_that_cannot_be_are_refused(tmp_path, good, bad):
    file, text = tmp_path / "thresholds.yaml", SHIPPED.read_text()
    assert text.count(good) == 1 or good.startswith("limit")
    file.write_text(text.replace("\n" + good, "\n" + bad))
    with pytest.raises((ThresholdError, ValueError)):
        Thresholds.load(file)
    file.write_text(text.replace("lag: 0.000639", "lag: 0.01").replace("reaches: 400\n", ""))
    assert (Thresholds.load(file).lag, Thresholds.load(file).reaches) == (0.01, 0)


def test_thresholds_are_written_with_the_figures_that_count(tmp_path):
    file, wrote = tmp_path / "thresholds.yaml", thresholds(0.0412345678, reaches=7, lag=0.00123456)
    wrote.save(file)
    read = Thresholds.load(file)
    assert read.variance[0, 0] == 0.041235 and read.lag == 0.00123 and read.reaches == 7
    assert (read.limit, read.steady_limit, read.steady[0]) == (5.0, 4.0, 0.3)


# --- the moving contact -----------------------------------------------------------------------------------------------


class Moved:
    """A MovingContact on an arm without inertia, fed with positions (rad) and what acts on its first joints (N)."""

    def __init__(self, period=DT):
        self.arm, self.k, self.period = Plain(), 0, period
        self.contact = MovingContact(thresholds(lag=0.002), self.arm, lambda q: PALM)

    def feed(self, force=(0.0, 0.0, 0.0), samples=1, by=0.0):
        """``by``: rad that each sample is farther than the one before."""
        for _ in range(samples):
            self.k += 1
            self.q = getattr(self, "q", 0.0) + by
            self.contact.feed(self.k * self.period, seven(self.q), -np.array([*force, 0.0, 0.0, 0.0, 0.0]))
        return self.contact


def test_a_residual_is_of_a_free_arm_after_a_quarter_of_a_second_of_rest():
    moved = Moved()
    assert moved.contact.observer.lag == 0.002, "as learnt with the thresholds"
    moved.contact.observer.lag = 0.0
    contact = moved.feed((0.0, 0.0, -3.0), 3 + 31)  # the first two samples are no estimate yet
    assert not contact.still() and contact.before_motion() is None and contact.weight_before_motion() is None
    assert moved.feed((0.0, 0.0, -3.0)).still() and contact.before_motion()[2] == pytest.approx(-3.0)
    moved.feed((0.0, 0.0, -4.0))
    felt = -3.0 - 0.5 * (1.0 - KEEP)
    assert contact.before_motion()[2] == pytest.approx(-3.0 + DT / 0.25 * (felt + 3.0)), "as much as its time"
    assert contact.weight_before_motion() is None, "it has not moved"
    moved.feed((0.0, 0.0, -4.0), 200)
    moved.feed((0.0, 0.0, -9.0), 1, by=0.021 * DT)
    assert not contact.still() and contact.weight_before_motion() == pytest.approx(4.0, abs=0.1)
    assert contact.before_motion()[2] == pytest.approx(-4.0, abs=0.1)
    assert contact.weight_since(np.zeros(7)) == pytest.approx(-contact.residual.torque[2])


@pytest.mark.parametrize("period", [0.002, 0.005, 0.010])
def test_a_push_at_rest_is_forgotten_as_fast_at_every_period(period):
    contact = (moved := Moved(period)).feed((0.0, 0.0, 0.0), int(1.0 / period))
    moved.feed((0.0, 0.0, -8.0), int(1.0 / period))
    moved.feed((0.0, 0.0, 0.0), int(0.5 / period))
    assert -contact.before_motion()[2] == pytest.approx(8.0 * np.exp(-0.5 / 0.25), abs=0.25)


@pytest.mark.parametrize(("speed", "still"), [(0.019, True), (0.021, False)])
def test_slow_creeping_is_rest(speed, still):
    assert Moved().feed(samples=60, by=speed * DT).still() == still


@pytest.mark.parametrize(
    ("speed", "acceleration", "slow"),
    [(0.149, 0.0, True), (0.151, 0.0, False), (0.1, 0.99, True), (-0.1, -1.01, False)],
)
def test_an_arm_that_is_slow_and_gentle(speed, acceleration, slow):
    contact = Moved().contact
    assert not contact.slow()
    contact.residual = residual(1, speed=speed, acceleration=acceleration)
    assert contact.slow() == slow


def test_a_force_is_told_30_ms_ahead_of_how_it_grows():
    moved = Moved()
    moved.contact.observer.lag = 0.0
    assert moved.contact.force_since(np.zeros(7)) is None
    moved.feed((2.0, 0.0, 0.0), 50)
    assert moved.contact.force_since(np.zeros(7)) == pytest.approx([2.0, 0.0, 0.0])
    assert moved.contact.force_since(seven(0.5))[:2] == pytest.approx([1.5, -0.5])
    grown = [moved.feed((4.0, 0.0, 0.0)).residual.torque[0] for _ in range(6)]
    # 20 ms are two samples and a half.
    ahead = grown[5] + 0.03 * (grown[5] - grown[3]) / (2 * DT)
    assert moved.contact.force_since(np.zeros(7))[0] == pytest.approx(ahead)


def test_evidence_takes_two_samples_and_counts_for_30_ms():
    moved = Moved()
    moved.contact.observer.lag = 0.0
    assert moved.contact.evidence() is None
    moved.feed(samples=100)
    quiet = moved.contact.evidence()
    assert quiet.margin == pytest.approx(0.0, abs=1e-9) and quiet.until - quiet.stamp == pytest.approx(0.03)
    sizes = []
    for _ in range(4):
        moved.feed((8.0, 0.0, 0.0))
        sizes.append(np.linalg.norm(moved.contact.change.torque[:3]) / 0.2 / 5.0)
        evidence = moved.contact.evidence()
        assert evidence.margin == pytest.approx(min([0.0, *sizes][-2:])) and evidence.stamp == moved.k * DT
    assert evidence.message.startswith(f"{np.linalg.norm(moved.contact.change.torque[:3]):.1f} N on the hand, ")


def test_what_was_there_before_is_told_of_an_empty_hand_alone():
    moved = Moved()
    moved.contact.observer.lag = 0.0
    moved.feed((0.0, 1.0, 0.0), samples=60)
    assert moved.contact.steady() is None, "it has not moved"
    moved.feed((0.0, 3.0, 0.0), 80, by=0.1 * DT)
    steady = moved.contact.steady()
    # Joints go with 0.1 rad/s, of which these thresholds know nothing.
    assert steady.margin == pytest.approx(2.0 / math.hypot(0.3, 0.2) / 4.0, rel=0.02)
    assert steady.until - steady.stamp == pytest.approx(0.03)
    assert moved.contact.offset().torque[1] == pytest.approx(2.0, rel=0.02)
    assert moved.contact.offset_of_motion() is None
    moved.feed((0.0, 3.0, 0.0), 60)
    assert moved.contact.offset_of_motion().torque[1] == pytest.approx(2.0, rel=0.02)
    moved.contact.load = 0.1
    assert moved.contact.steady() is None
    moved.contact.set_payload(0.4)
    assert moved.arm.payloads == [(0.4, (0.0, 0.0, 0.0))] and moved.contact.load == 0.4
    assert moved.contact.change is None and not moved.contact.still() and moved.contact.before_motion() is None
    assert moved.contact.evidence() is None and moved.contact.force_since(np.zeros(7)) is None
