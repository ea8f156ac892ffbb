"""The arm takes the weight without pulling its gentle fingers along an object that the person still holds. The robot
reports an object only if its fingers stand around it, and still do at home."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode, Say
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Polled
from coglab_smach.states import weight
from coglab_smach.states.hand import AT_END, stopped_by_object
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
WEIGHT = 0.31 * 9.81
"""N, of the mug"""


def height(trial):
    return float(default_arm().fk(np.asarray(trial.ctx.arm.joint_positions()))[0][2])


def receiving(script, **overrides):
    """Receive the mug from a person who lets go at the end of ``script``. It starts when the detector is armed for the
    weight."""
    trial = Trial(**overrides)
    trial.cell.partner.let_go_after = None
    let_go, trial.cell.let_go = trial.cell.let_go, lambda: None

    def walk(t):
        t.begin()
        t.until(lambda: "arm lift" in t.cell.called())
        script(t)
        let_go()
        t.until(t.ctx.requests.hub)

    return trial.run(walk)


def test_the_rise_stops_with_the_weight_and_continues_in_steps():
    rises = []

    def script(t):
        below, pause = height(t), float(t.ctx.config.get("hand.lift_pause"))
        t.clock.sleep(0.15)
        t.cell.push(-0.9 * WEIGHT)
        for wait in (0.3, pause + 0.3, 6.0 * pause):
            t.clock.sleep(wait)
            rises.append(height(t) - below)

    trial = receiving(script, **{"hand.load_timeout": 8.0})
    step, whole = (float(trial.ctx.config.get(f"hand.{name}")) for name in ("lift_step", "lift"))
    assert rises[0] < 0.4 * whole, "stopped by the weight"
    assert rises[1] == pytest.approx(rises[0] + step, abs=0.003)
    assert rises[2] == pytest.approx(whole, abs=0.006), "at most the whole rise"
    assert trial.result().outcome == "succeeded"


def test_repeated_closing_ends_when_the_person_has_let_go():
    ended = []

    def script(t):
        close = t.ctx.hand.close
        t.ctx.hand.close = lambda *order: Polled(lambda: False, lambda: None, lambda: ended.append(order))
        t.clock.sleep(1.0)
        t.cell.push(-0.9 * WEIGHT)
        t.clock.sleep(0.3)
        assert not ended, "they continue while the person holds the object"
        t.ctx.hand.close = close

    assert receiving(script).result().outcome == "succeeded" and len(ended) == 1


def test_the_arm_rises_fully_if_the_person_is_not_seen():
    rises = []

    def script(t):
        t.clock.sleep(0.15)
        t.cell.push(-0.9 * WEIGHT)
        t.wait_hub("wait_with_object")
        rises.append(t.ctx.journal.results[-1].marks["released"] - t.ctx.journal.results[-1].marks["loaded"])

    trial = Trial()
    trial.cell.faults.not_seen.add("human_hand")

    def walk(t):
        t.begin()
        t.until(lambda: "arm lift" in t.cell.called())
        script(t)

    trial.cell.partner.let_go_after = None
    trial.run(walk)
    assert rises[0] > 0.2, "duration of the rest of the rise"


@pytest.mark.parametrize(
    ("mode", "positions", "around"),
    [
        ("cylindrical", (245, 82, 254, 148, 158), True),
        ("cylindrical", (245, 254, 254, 254, 171), False),
        ("cylindrical", (245, 120, 254, 254, 254), False),
        ("tridigit", (245, 120, 160, 254, 0), True),
        ("tridigit", (245, 120, 254, 254, 0), False),
        ("lateral", (30, 120, 254, 254, 254), True),
        ("lateral", (30, 254, 254, 254, 254), False),
        ("cylindrical", (), True),
    ],
)
def test_fingers_around_an_object(mode, positions, around):
    assert stopped_by_object(mode, positions) == around


def edged(times, person_gone=False):
    """Receive the mug; the first ``times`` closings hold it only with the ring finger. ``person_gone``: the person
    has left by then."""
    trial, closings = Trial(), []
    state = trial.ctx.hand.state

    def seen():
        real = state()
        closed = [name for name in trial.cell.called("close")]
        closings[:] = closed
        edge = 0 < len(closed) <= times and real.holding
        if edge and person_gone:
            trial.cell.objects["human_hand"] = Pose([1.16, 0.03, 0.43])
        return replace(real, positions=(200, 254, 254, 254, 170)) if edge else real

    trial.ctx.hand.state = seen

    def script(t):
        t.begin()
        t.clock.sleep(0.5)
        t.until(t.ctx.requests.hub)

    return trial.run(script)


def test_an_object_held_by_an_edge_is_grasped_again():
    trial = edged(1)
    assert "missed" in trial.result().marks and trial.result().outcome == "succeeded"
    order = [name for name in trial.cell.called() if name in ("preshape cylindrical", "close", "arm lift")]
    again = order[order.index("close") + 1 : order.index("arm lift")]
    assert again[0] == "preshape cylindrical" and again[-1] == "close", order
    labels = [t.from_state for t in trial.ctx.journal.transitions if t.path.endswith("/exchange_human_to_robot")]
    assert labels[labels.index("open_to_regrasp") :][:4] == ["open_to_regrasp", "regrasp", "hand_close", "take_weight"]


def test_an_object_held_by_an_edge_is_kept_if_the_person_has_left():
    trial = edged(1, person_gone=True)
    assert trial.result().outcome == "succeeded" and "missed" not in trial.result().marks
    assert "tightened" in trial.result().marks


def test_an_object_held_by_an_edge_twice_stays_with_the_person():
    trial = edged(2)
    assert trial.result().outcome == "failed_empty" and trial.result().code == ReasonCode.OBJECT_NOT_SEEN
    assert "edge" in trial.ctx.journal.why() and trial.ctx.holding == ""


def test_an_object_that_falls_at_the_end_of_the_motion_is_no_success():
    trial = Trial()

    def script(t):
        t.begin()
        t.until(lambda: t.ctx.journal.marked("tightened"))
        home, here = np.asarray(t.ctx.config.get("postures.home")), lambda: np.asarray(t.ctx.arm.joint_positions())
        while np.max(np.abs(here() - home)) > 0.05:
            t.clock.sleep(0.01)
        t.cell.at_palm = None
        t.cell.objects["mug"] = Pose(np.array([0.4, -0.4, -0.5]))
        t.until(t.ctx.requests.hub)

    trial.run(script)
    assert trial.result().outcome == "failed_empty" and trial.result().code == ReasonCode.OBJECT_NOT_SEEN
    assert trial.ctx.holding == ""


def test_fingers_that_close_past_the_object_during_the_motion_hold_nothing():
    trial = Trial()
    state = trial.ctx.hand.state
    past = (200, AT_END, 254, 254, 254)
    trial.ctx.hand.state = lambda: (
        replace(state(), positions=past) if trial.ctx.journal.marked("tightened") else state()
    )

    def script(t):
        t.begin()
        t.clock.sleep(0.5)
        t.until(t.ctx.requests.hub)

    trial.run(script)
    assert trial.result().outcome == "failed_empty" and trial.result().code == ReasonCode.OBJECT_NOT_SEEN
    assert "past" in trial.ctx.journal.why()


def test_an_object_from_a_hidden_person_is_not_dropped():
    """Its weight was not measured. Later a hand is seen far away, and the arm measures that nobody holds it."""
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.let_go_after = t.cell.partner.take_after = None
        t.start("exchange_human_to_robot")
        t.until(lambda: t.ctx.journal.marked("contact"))
        t.cell.faults.not_seen.add("human_hand")
        t.until(lambda: "arm lift" in t.cell.called())
        t.clock.sleep(1.0)
        t.cell.objects["human_hand"] = Pose([2.0, 0.0, 0.4])
        t.cell.faults.not_seen.discard("human_hand")
        t.wait_hub("wait_with_object")
        assert t.cell.called("open") == [] and t.ctx.holding == "mug"

    trial.run(script)
    assert trial.result().outcome == "succeeded"


def test_the_person_is_informed_when_the_robot_carries_the_weight():
    told, trial = [], Trial()

    def say(code, text):
        told.append((code, trial.clock.now() if trial.ctx.journal.marked("loaded") else None))

    trial.ctx.say = say

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.let_go_after = 0.7
        t.start("exchange_human_to_robot")
        t.wait_hub("wait_with_object")

    trial.run(script)
    have = [loaded for code, loaded in told if code == Say.I_HAVE_IT]
    assert len(have) == 1 and have[0] is not None, told


def test_a_person_who_holds_on_is_never_informed_that_the_robot_has_it(monkeypatch):
    monkeypatch.setattr(weight, "from_palm", lambda state, track, *_: 0.1)
    told, trial = [], Trial()
    trial.ctx.say = lambda code, text: told.append(code)

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.let_go_after = None
        t.start("exchange_human_to_robot")
        t.wait_hub("wait_without_object")

    trial.run(script)
    assert trial.result().code == ReasonCode.NOT_RELEASED and Say.I_HAVE_IT not in told
