"""The detector of an arm at rest, sample by sample: its filter, its learning, its thresholds and its times, against
what the documentation says of them. No noise, and stamps that are exact in binary."""

import math

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.contact.detector import ContactDetector, DetectorSettings, confidence, sensitive_joints
from coglab_smach.contact.rest import RestTorque
from coglab_smach.contact.torque_signal import TorqueSignal
from coglab_smach.contact.trials import ContactTrial, push

DT = 1.0 / 128.0
JACOBIAN = np.array(
    [
        [0.0, 0.9, 0.0, 0.9, 0.0, 0.0, 0.0],
        [0.4, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0],
        [0.0, 0.5, 0.0, -0.3, 0.0, 0.0, 0.0],
    ]
)
"""m/rad: joints 1, 2 and 4 feel what is across the x axis"""
WATCHED = [1, 2, 4]
BLEND = 1.0 - math.exp(-2.0 * math.pi * 20.0 * DT)
"""of one sample, low-pass of 20 Hz"""
THRESHOLD = 6.0 * 0.02
"""Nm, six of the smallest standard deviations that are believed"""


class Rest:
    """A detector that is fed with what the test says, from rest on."""

    def __init__(self, jacobian=JACOBIAN, **settings):
        self.detector, self.n = ContactDetector(DetectorSettings(**settings), lambda q: jacobian), 0

    @property
    def t(self):
        return self.n * DT

    def feed(self, torque=0.0, samples=1, speed=0.0):
        """So many samples of one torque (Nm, all joints or each); (event, how many it took) or (None, samples)."""
        for k in range(samples):
            self.n += 1
            event = self.detector.feed(self.t, np.zeros(7) + torque, np.zeros(7), np.full(7, speed))
            if event is not None:
                return event, k + 1
        return None, samples

    def armed(self, mode="contact", timeout=100.0, **request):
        """Armed, and it watches."""
        self.feed(samples=150)
        self.detector.arm(mode, self.t, timeout, **request)
        assert self.feed() == (None, 1) and self.detector.state() == "watching"
        return self


def joint(number, torque):
    """Nm on one joint, as 1..7."""
    return torque * (np.arange(1, 8) == number)


def filtered(torque, samples):
    """Nm, of a step, after so many samples."""
    return torque * (1.0 - (1.0 - BLEND) ** samples)


def test_joints_with_half_of_the_largest_lever_across_the_persons_line_are_watched():
    jacobian = np.array([[0.0, 0.0, 9.0, 9.0, 0.0], [1.0, 0.5, 0.0, 0.4, 0.0], [0.0, 0.0, 0.0, 0.0, 0.49]])
    assert sensitive_joints(jacobian, (2.0, 0.0, 0.0), 0.5) == [0, 1]
    assert sensitive_joints(jacobian, (0.0, 3.0, 0.0), 0.5) == [2, 3]
    assert sensitive_joints(jacobian, (1.0, 0.0, 0.0), 0.45) == [0, 1, 4]


def test_confidence_is_that_of_normal_noise():
    assert [confidence(d) for d in (-1.0, 0.0, 1.0, 2.0)] == pytest.approx(
        [0.158655, 0.5, 0.841345, 0.977250], abs=1e-6
    )


def test_what_is_learnt_begins_after_a_quarter_of_a_second_of_rest():
    rest = Rest()
    rest.feed(samples=32)
    assert rest.detector.look().rest_samples == 0 and not rest.detector.still()
    rest.feed()
    assert rest.detector.look().rest_samples == 1 and rest.detector.still()
    rest.feed(samples=500)
    assert rest.detector.look().rest_samples == 400, "the newest ones count"


@pytest.mark.parametrize(("speed", "moves"), [(0.02, False), (-0.02, False), (0.021, True), (-0.021, True)])
def test_a_joint_that_is_faster_than_20_mrad_per_second_moves(speed, moves):
    rest = Rest()
    rest.feed(samples=100)
    rest.feed(speed=speed)
    assert rest.detector.still() is not moves


def test_thresholds_are_k_robust_deviations_of_the_change_within_the_window():
    rest, rng = Rest(), np.random.default_rng(3)
    noise, low, seen = rng.normal(0.0, 0.2, (232, 7)), None, []
    for sample in noise:
        rest.feed(sample)
        low = sample if low is None else low + BLEND * (sample - low)
        seen.append(low)
    # The window of 40 ms goes back to the newest sample that is so old.
    changes = np.array([seen[k] - seen[k - 6] for k in range(32, 232)])
    deviation = np.median(np.abs(changes - np.median(changes, axis=0)), axis=0) / 0.674490
    told = rest.detector.look()
    assert told.threshold == pytest.approx(6.0 * deviation, rel=1e-4) and told.k == 6.0
    assert np.all(deviation > 0.1)
    # The largest change since the first sample for which there is one, with its sign.
    every = np.array([seen[k] - seen[k - 6] for k in range(6, 232)])
    largest = every[np.argmax(np.abs(every), axis=0), np.arange(7)]
    assert told.change == pytest.approx(largest)


def test_without_noise_the_smallest_deviation_is_believed():
    rest = Rest()
    assert rest.detector.look().threshold == pytest.approx([THRESHOLD] * 7)
    rest.feed(samples=200)
    assert rest.detector.look().threshold == pytest.approx([THRESHOLD] * 7)


def test_it_watches_once_100_samples_were_learnt():
    rest = Rest()
    rest.feed(samples=82)
    rest.detector.arm("contact", rest.t, 10.0)
    rest.feed(samples=50)
    assert (rest.detector.look().rest_samples, rest.detector.state()) == (100, "waiting")
    rest.feed()
    assert rest.detector.state() == "watching"
    assert [j + 1 for j, mine in enumerate(rest.detector.look().watched) if mine] == WATCHED


def test_a_step_is_an_event_with_the_third_sample_over_the_threshold():
    event, took = Rest().armed().feed(joint(2, -0.2), 10)
    margin = filtered(0.2, 3) / THRESHOLD
    assert took == 3 and event.contact and event.code == ReasonCode.CONTACT_FOUND
    assert event.margin == pytest.approx(margin)
    assert event.confidence == pytest.approx(confidence((margin - 1.0) * 6.0))
    assert event.message == "torque of joints [1, 2, 4] changed by 1.6 x its threshold within 40 ms"
    rest = Rest().armed()
    assert rest.feed(joint(2, 0.2), 2)[0] is None and rest.detector.margin == pytest.approx(filtered(0.2, 2) / 0.12)
    rest.feed(0.0, 20)
    assert rest.feed(joint(2, 0.2), 2)[0] is None, "two, and two more later, are not three in a row"


@pytest.mark.parametrize(("torque", "found"), [(0.118, False), (0.126, True)])
def test_less_than_the_threshold_is_no_event(torque, found):
    assert (Rest().armed().feed(joint(1, torque), 30)[0] is not None) == found


def test_a_request_may_name_joints_and_sensitivity():
    assert Rest().armed(joints=[3]).feed(joint(2, 5.0), 30)[0] is None
    assert Rest().armed(joints=[3]).feed(joint(3, 0.2), 30)[0] is not None
    assert Rest().armed(joints=[7]).feed(joint(7, 0.2), 30)[0] is not None
    assert Rest().armed(k=12.0).feed(joint(2, 0.2), 30)[0] is None
    rest = Rest().armed(k=12.0)
    assert rest.detector.look().threshold == pytest.approx([0.24] * 7) and rest.detector.look().k == 12.0
    for joints in ([0], [8], [1, 8]):
        with pytest.raises(ValueError, match="numbered 1..7"):
            rest.detector.arm("contact", 0.0, 1.0, joints=joints)
    for timeout in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="positive time"):
            rest.detector.arm("contact", 0.0, timeout)


def test_an_arming_lasts_to_the_end_of_its_time():
    rest = Rest().armed(timeout=1.0)
    rest.feed(samples=127)
    assert rest.detector.state() == "watching"
    rest.feed()
    assert rest.detector.state() == "off"


@pytest.mark.parametrize(("offset", "found"), [(1.19, False), (-1.19, False), (1.21, True), (-1.21, True)])
def test_an_offset_of_1_2_newton_metres_is_an_early_contact(offset, found):
    rest = Rest()
    rest.feed(samples=150)
    rest.feed(samples=20, speed=0.3)
    rest.detector.arm("contact", rest.t, 100.0)
    event, took = rest.feed(joint(4, offset), 60)
    assert (event is not None) == found
    if found:
        assert (event.source, event.code, took) == ("torque_offset", ReasonCode.CONTACT_CAME_EARLY, 33)
        assert event.margin == pytest.approx(1.21 / 1.2) and event.confidence == pytest.approx(confidence(0.01 / 0.02))
        assert event.message == "torque offset 1.21 Nm on arming: the object was there already"


def test_who_carries_something_has_no_early_contact():
    rest = Rest()
    rest.feed(samples=150)
    rest.feed(samples=20, speed=0.3)
    rest.detector.arm("contact", rest.t, 100.0, carries=True)
    assert rest.feed(joint(4, 5.0), 60)[0] is None and rest.detector.state() == "watching"


def weighs(newton):
    """Torque of so many N that pull the hand down."""
    return -newton * JACOBIAN[2]


def test_half_of_the_weight_for_0_3_s_is_a_load():
    rest = Rest().armed()
    needed = 0.5 * 0.4 * 9.81
    rest.detector.arm("load", rest.t, 100.0, mass=0.4)
    rest.feed()
    assert rest.feed(weighs(0.98 * needed), 200)[0] is None
    assert rest.detector.margin == pytest.approx(0.98)
    event, took = rest.feed(weighs(1.01 * needed), 200)
    # As soon as the filter has passed the share, and 0.3 s more; of the joints that are watched.
    passes = next(m for m in range(1, 30) if 0.98 + 0.03 * (1.0 - (1.0 - BLEND) ** m) >= 1.0)
    assert took == passes + 39 and event.contact and event.code == ReasonCode.LOAD_CARRIED
    deviation = 0.02 / math.hypot(0.5, 0.3)
    assert event.margin == pytest.approx(1.01)
    assert event.confidence == pytest.approx(confidence(0.01 * needed / deviation))
    assert event.message == f"{1.01 * needed:.1f} N carried now (needed {needed:.1f} N)"


def test_a_load_that_goes_again_is_counted_anew():
    rest = Rest().armed()
    rest.detector.arm("load", rest.t, 100.0, mass=0.4, load_share=0.25)
    rest.feed()
    for _ in range(3):
        assert rest.feed(weighs(2.0), 36)[0] is None
        assert rest.feed(0.0, 36)[0] is None
    assert rest.feed(weighs(2.0), 41)[0].margin == pytest.approx(2.0 / (0.25 * 0.4 * 9.81), rel=1e-3)


def test_the_share_of_the_weight_that_has_gone_for_50_ms_is_a_release():
    rest = Rest()
    rest.feed(weighs(4.0), 150)
    rest.detector.arm("release", rest.t, 100.0, mass=0.4)
    rest.feed(weighs(4.0))
    event, took = rest.feed(weighs(4.0 - 1.5 * 1.962), 60)
    passes = next(m for m in range(1, 30) if 1.5 * (1.0 - (1.0 - BLEND) ** m) >= 1.0)
    assert took == passes + 7 and not event.contact and event.code == ReasonCode.LOAD_RELEASED
    assert "of the load are gone (needed 2.0 N)" in event.message


@pytest.mark.parametrize(("gap", "state"), [(0.09, "watching"), (0.12, "waiting"), (0.95, "waiting")])
def test_a_gap_of_a_tenth_of_a_second_begins_the_change_anew(gap, state):
    rest = Rest().armed()
    rest.detector.feed(rest.t + gap, np.zeros(7), np.zeros(7), np.zeros(7))
    assert rest.detector.state() == state


@pytest.mark.parametrize("aside", [-0.5, 0.0, 1.2, 40.0])
def test_one_sample_that_does_not_follow_is_ignored(aside):
    """Alone it says nothing: neither a torque nor a clock that was set."""
    rest = Rest().armed()
    assert rest.detector.feed(rest.t + aside, np.full(7, 50.0), np.zeros(7), np.zeros(7)) is None
    assert rest.detector.state() == "watching"
    assert rest.feed(0.0, 20)[0] is None and rest.feed(joint(2, 0.2), 5)[0] is not None


def test_the_largest_number_of_an_arm_is_taken_and_no_larger_one():
    rest = Rest()
    rest.feed(samples=40)
    for size, taken in ((1e4, True), (1.1e4, False), (-1.1e4, False)):
        before = rest.detector._last_stamp
        rest.feed(joint(7, size))
        assert (rest.detector._last_stamp != before) == taken


def test_at_rest_a_sample_counts_as_much_as_its_time_and_a_jolt_is_no_motion():
    rest = RestTorque()
    rest.learn(np.zeros(7), 0.005)
    rest.learn(np.ones(7), 0.005)
    rest.move(0.125, np.full(7, 0.16))  # 20 mrad
    assert not rest.travels and rest.before_motion is None
    rest.move(0.125, np.full(7, 1e-3))
    assert rest.travels and rest.before_motion == pytest.approx([0.02] * 7)
    rest.stand()
    assert not rest.travels
    rest.learn(np.full(7, 3.0), 0.010)
    rest.learn(np.full(7, 3.0), 1.0)
    rest.move(0.125, np.full(7, 0.1))
    rest.move(0.125, np.full(7, -0.1))
    assert not rest.travels, "to and fro"
    rest.move(0.125, np.full(7, -0.2))
    assert rest.travels and rest.before_motion == pytest.approx([3.0] * 7)


def test_synthetic_torques_are_what_they_say():
    jacobian, still = JACOBIAN, np.zeros(7)
    plain = TorqueSignal(1, sigma=0.0, bias=0.0)
    assert plain.sample(0.005, jacobian, (1.0, 2.0, 3.0), still) == pytest.approx(jacobian.T @ [1.0, 2.0, 3.0])
    moving = plain.sample(0.005, jacobian, np.zeros(3), np.full(7, 0.05))
    assert moving == pytest.approx([0.3 * np.tanh(1.0)] * 7)
    noise = TorqueSignal(1, bias=0.0)
    rows = np.array([noise.sample(0.005, jacobian, np.zeros(3), still) for _ in range(6000)])
    assert rows.std() == pytest.approx(0.05, rel=0.05)
    together = float(np.mean(rows[1:] * rows[:-1]) / np.mean(rows**2))
    assert together == pytest.approx(math.exp(-0.5), abs=0.03)
    biases = np.array([TorqueSignal(seed, sigma=0.0).sample(0.005, jacobian, np.zeros(3), still) for seed in range(60)])
    assert np.abs(biases).max() == pytest.approx(0.4, abs=0.01) and abs(biases.mean()) < 0.04
    fast = TorqueSignal(2, bias=0.0)
    quick = np.full(7, 0.5)
    rows = [fast.sample(0.005, jacobian, np.zeros(3), quick) for _ in range(3000)]
    assert np.std(rows) == pytest.approx(0.05 * (1.0 + 8.0 * 0.5), rel=0.06)


def test_a_push_of_the_trials_rises_within_60_ms():
    force = push((0.0, 0.0, -1.0), 5.0)
    assert force(0.03) == pytest.approx([0.0, 0.0, -2.5]) and force(0.5) == pytest.approx([0.0, 0.0, -5.0])
    assert push((0.0, 2.0, 0.0), 1.0, rise=0.1)(0.05) == pytest.approx([0.0, 1.0, 0.0])
    trial = ContactTrial((np.zeros(7), JACOBIAN), 1)
    assert trial.feed(0.5) == (None, 0.5) and trial.t == pytest.approx(0.5)
    steps, trial.signal.sample = [], lambda dt, *_: steps.append(dt) or np.zeros(7)
    trial.feed(0.1)
    assert steps == [0.005] * 20, "200 Hz"
    trial = ContactTrial((np.zeros(7), JACOBIAN), 1, cutoff=15.0)
    assert trial.rest_and_arm() is None and trial.t == pytest.approx(1.7) and trial.detector.settings.cutoff == 15.0
