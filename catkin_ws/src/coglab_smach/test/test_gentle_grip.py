"""Near a person's hand the fingers close with the lowest force; after it has let go, firmly."""

import pytest
from coglab_objects.database import objects_folder
from coglab_smach.ports.pending import PortError, Ready
from coglab_smach.states import hand as hand_states
from coglab_smach.states import weight
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
LOWEST = 60
"""wire speed of the lowest force level"""
OBJECTS = sorted(path.stem for path in objects_folder().glob("*.yaml"))


def receive(trial):
    """Receive the mug (level medium). Returns (level, motion) of all orders to the hand."""
    asked, preshape, close = [], trial.ctx.hand.preshape, trial.ctx.hand.close
    trial.ctx.hand.preshape = lambda mode, level: asked.append(level) or preshape(mode, level)
    trial.ctx.hand.close = lambda speed: asked.append(speed) or close(speed)

    trial.run(Trial.receive)
    return asked


def track(monkeypatch, distance):
    """The person's hand is ``distance(state)`` m from the palm."""
    for module in (hand_states, weight):
        monkeypatch.setattr(module, "from_palm", lambda state, track, *_: distance(state))
    monkeypatch.setattr(hand_states, "hand_from_palm", distance)


def test_the_hand_closes_firmly_when_the_person_has_let_go():
    trial = Trial()
    asked = receive(trial)
    assert set(asked[:-1]) == {"low", LOWEST} and asked[-1] == trial.ctx.config.get("hand.tighten.medium")
    marks = trial.result().marks
    assert marks["released"] <= marks["tightened"]
    calls = [name for _, name in trial.cell.calls]
    home = len(calls) - 1 - calls[::-1].index("move_ptp")
    assert calls.index("close") < len(calls) - 1 - calls[::-1].index("close") < home


def test_a_hand_that_refuses_to_tighten_keeps_the_object():
    trial = Trial()
    refusal = Ready(error=PortError("hand_close refused", ("the port is gone",)))
    trial.ctx.hand.close = lambda speed: refusal

    trial.run(Trial.receive)
    assert trial.result().outcome == "failed_holding" and "hand_tighten" in trial.result().reason
    assert trial.ctx.holding == "mug"


@pytest.mark.parametrize(("modes", "chosen"), [(("lateral", "tridigit"), "tridigit"), (("lateral",), "lateral")])
def test_grasps_without_a_gentle_level_are_not_used_near_a_person(modes, chosen):
    """Mode lateral has no gentle level. All grasps are at the same place, and the first one is preferred."""
    trial = Trial()
    shipped = trial.database.get("screwdriver")
    grasps = {mode: {**shipped["grasps"]["handle"], "hand": {"mode": mode, "level": "high"}} for mode in modes}
    entry = {**shipped, "grasps": grasps, "default_grasp": "lateral"}
    trial.ctx.database.get_object = lambda object_id: Ready(entry)
    trial.cell.objects["screwdriver"] = trial.cell.objects["mug"]

    def script(t):
        t.begin(object_id="screwdriver")
        t.until(lambda: t.ctx.journal.marked("motion_started"))

    trial.run(script)
    assert trial.master.get_children()[RECEIVE].userdata.grasp_name == chosen


@pytest.mark.parametrize(
    ("way", "firm_at"),
    [
        (lambda since: 0.2, "hand_tighten"),
        (lambda since: 0.06, "tighten_at_home"),  # gone by hand.let_go, but its fingers may be at the object
        (
            lambda since: 0.2 if since % 0.3 < 0.13 else 0.0,
            "tighten_at_home",
        ),  # confused with another hand in single frames
    ],
)
def test_the_hand_closes_firmly_only_if_the_persons_hand_stays_away(monkeypatch, way, firm_at):
    trial, since = Trial(), []

    def distance(state):
        if trial.ctx.journal.marked("tightened") or state.label == "tighten_at_home":
            return 1.0
        if state.label == "hand_tighten":
            since.append(trial.clock.now())
            return 0.1 + way(since[-1] - since[0])
        return 0.1 + (0.06 if state.label == "take_weight" and trial.ctx.contact.event() is not None else 0.0)

    track(monkeypatch, distance)
    asked = receive(trial)
    assert asked[-1] == trial.ctx.config.get("hand.tighten.medium")
    reasons = {t.from_state: t.reason for t in trial.ctx.journal.transitions if "tighten" in t.from_state}
    assert "wire speed" in reasons[firm_at], reasons
    assert trial.grip.firm == 0


def test_at_home_the_grip_stays_gentle_near_a_persons_hand(monkeypatch):
    trial = Trial()
    track(monkeypatch, lambda state: 0.1 if state.label != "take_weight" else 0.2)
    asked = receive(trial)
    assert set(asked) == {"low", LOWEST} and "tightened" not in trial.result().marks
    assert trial.ctx.holding == "mug" and trial.grip.firm == trial.ctx.config.get("hand.tighten.medium")
