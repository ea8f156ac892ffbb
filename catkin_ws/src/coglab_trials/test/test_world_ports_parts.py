"""Arm and hand of the virtual world in parts, on a rig that is what the test says: what they pass on and refuse, and
what becomes of a request to a node that is frozen."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.packages import package_path
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, HandState, Verdict
from coglab_smach.ports.pending import Polled, PortError
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.virtual_node import VirtualNode
from coglab_trials.world_ports import VirtualHand

REPORT = {
    **{"motion_allowed": True, "blocked_by": "", "blocked_code": 0, "standing": True, "fault": False, "reason": "why"},
    **{"position": [0.1] * 7, "measured_velocity": [0.0] * 7, "torque": [0.0] * 7, "external_torque": [0.0] * 7},
    "fri_period": 0.005,
}

URDF = package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8")


class Virtual:
    """In the place of LockstepRobot: answers as it is told, and keeps what was asked."""

    def __init__(self):
        self.asked, self.reason_code, self.frozen = [], 0, False
        self.answers = {"load_dmps": (True, "", 5), "add_ptp": (1, 3, ""), "ask_cancel": 7, "submit": 9}

    def __getattr__(self, name):
        def ask(*arguments):
            self.asked.append((name, *arguments))
            return self.answers.get(name, (True, "done"))

        return ask


class Rig:
    """The world, as far as the ports look at it."""

    def __init__(self):
        self.t, self.speed_scale, self.blind, self.trackers, self.sights = 10.0, 0.5, set(), {"object_mug": 1}, {}
        self.after_period, self.seen = [], {}
        virtual = self.virtual = Virtual()
        self.robot = SimpleNamespace(virtual=virtual, parameters={}, loaded={}, report=dict(REPORT), ended={}, debug=1)
        urdf = package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8")
        self.robot.urdf, self.robot.chain = urdf, default_arm()
        self.hand = SimpleNamespace(
            dead=False, calibrated=True, calibrating=False, holding=False, message="m", reason=4
        )
        self.hand.positions, self.hand.readings = (1, 2, 3, 4, 5), ()
        self.cell = SimpleNamespace(touch=lambda: {"palm": np.zeros(3)})

    def newest(self, name):
        return self.seen.get(name, (None, 1e9))


@pytest.fixture
def rig():
    return Rig()


def refused(pending, code):
    assert pending.done()
    with pytest.raises(PortError) as error:
        pending.result()
    assert error.value.code == code
    return error.value


# --- a node that can be frozen ----------------------------------------------------------------------------------------


def test_what_is_asked_of_a_frozen_node_acts_in_its_order_when_it_goes_on_unless_it_was_given_up():
    node, acted, cancelled = VirtualNode(), [], []
    act = lambda name: lambda: acted.append(name) or Polled(lambda: True, lambda: name, lambda: cancelled.append(name))  # noqa: E731
    assert node.ask(act("a")).result() == "a"
    node.freeze()
    b, c, d = (node.ask(act(name)) for name in "bcd")
    assert not b.done() and acted == ["a"]
    with pytest.raises(PortError) as error:
        b.result()
    assert error.value.code == ReasonCode.TIME_LIMIT
    c.cancel()
    node.thaw()
    assert acted == ["a", "b", "d"] and d.result() == "d" and b.done()
    refused(c, ReasonCode.CANCELLED)
    d.cancel()
    assert cancelled == ["d"]


# --- the arm ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frozen", [0.5, 0.51, 1.0, 1.01])
def test_a_frozen_robot_is_silent_to_its_joints_after_half_a_second_and_to_all_after_one(rig, frozen):
    arm = VirtualArm(rig)
    arm.freeze()
    rig.t += frozen
    silent = Verdict(False, "lwr/joint_states is silent", ReasonCode.NODE_SILENT)
    assert (arm.joint_positions() is None) == (frozen > 0.5)
    assert (arm.motion_allowed() == silent) == (arm.standing() == silent) == (frozen > 1.0)
    assert rig.virtual.frozen
    arm.thaw()
    assert arm.joint_positions() == (0.1,) * 7 and arm.motion_allowed().ok and not rig.virtual.frozen


def test_what_the_robot_reports_is_passed_on(rig):
    arm = VirtualArm(rig)
    rig.robot.report.update(motion_allowed=False, blocked_by="b", blocked_code=3, standing=False)
    assert arm.motion_allowed() == Verdict(False, "b", 3) and arm.standing() == Verdict(False, "the set-point moves")
    assert arm.speed_scale() == 0.5
    rig.virtual.answers["dmp_progress"] = {
        **{"motion": "running", "reason": "r", "primitive": "p", "phase": 0.2, "remaining_distance": 0.1},
        **{"reason_code": 4, "remaining_time": 0.3},
    }
    assert arm.dmp_progress() == DmpProgress("running", "r", "p", 0.2, 0.1, 4, 0.3)
    part = lambda name, enabled, activity: {"name": name, "enabled": enabled, "activity": activity}  # noqa: E731
    status = {"profile": "dmp", "controllers": [part("a", True, "active"), part("b", False, "off")]}
    rig.virtual.answers["feedback_status"] = status
    assert arm.profile_settled("dmp") == Verdict(True)
    assert arm.profile_settled("ptp") == Verdict(False, "profile 'dmp' is in force")
    status["controllers"][1]["activity"] = "stopping"
    assert arm.profile_settled("dmp") == Verdict(False, "b is stopping")


def test_a_controller_is_loaded_once_and_only_where_the_robot_takes_it(rig):
    arm = VirtualArm(rig)
    arm.load_controller("dmp", "T").result()
    assert rig.virtual.asked == [("load_controller", "dmp", "T"), ("set_ik_debug", True)]
    arm.load_controller("dmp", "T").result()
    assert len(rig.virtual.asked) == 2 and rig.robot.loaded == {"dmp": "T"}
    rig.virtual.answers["load_controller"], rig.virtual.reason_code = (False, "no"), 8
    assert refused(arm.load_controller("ptp", "U"), 8).sentence == "no" and rig.robot.loaded == {"dmp": "T"}
    assert arm.load_dmps("f").result() == 5 and arm.switch_controller("dmp").result() == "T"
    rig.virtual.answers["load_dmps"] = (False, "no", 0)
    refused(arm.load_dmps("f"), 8)


def test_a_reach_is_asked_for_with_all_its_fields(rig):
    arm = VirtualArm(rig)
    request = DmpRequest(
        "p", "f", (1.0, 2.0, 3.0), 1.5, True, (0.0, 0.0, 0.0, 1.0), (0, 0.05, 0), 0.05, (1,), (2,), 3.0, 4.0
    )
    arm.execute_dmp(request)
    fields = ("p", 1.5, [1.0, 2.0, 3.0], True, [0.0, 0.0, 0.0, 1.0])
    assert rig.virtual.asked == [("execute_dmp", *fields, "f", (1,), (2,), 3.0, 4.0, (0, 0.05, 0), 0.05)]
    assert arm.request is request and rig.robot.debug is None
    arm.switch_dmp(request)
    assert rig.virtual.asked[-1] == ("switch_dmp", *fields)


def test_commands_wait_for_their_outcome(rig):
    arm = VirtualArm(rig)
    rig.virtual.answers["outcome"] = None
    command = arm.lwr_command("start")
    assert not command.done()
    rig.virtual.answers["outcome"] = (True, "started", 0)
    assert command.done() and command.result() == "started"
    rig.virtual.answers["outcome"] = (False, "held", 5)
    assert "LWR command 'hold' failed: held" in refused(arm.hold("why"), 5).sentence
    rig.virtual.submit = lambda event: (_ for _ in ()).throw(ValueError("no such event"))
    refused(arm.lwr_command("dance"), ReasonCode.UNKNOWN_NAME)


@pytest.mark.parametrize(
    ("answer", "fails"),
    [
        ({"success": True, "message": "", "reason_code": 0}, False),
        ({"success": False, "message": "no", "reason_code": ReasonCode.NOT_ACTIVE}, False),
        ({"success": False, "message": "no", "reason_code": ReasonCode.HELD}, True),
    ],
)
def test_every_controller_that_is_loaded_is_cancelled(rig, answer, fails):
    arm = VirtualArm(rig)
    rig.robot.loaded = {"dmp": "T", "ptp": "U"}
    rig.virtual.answers["cancel_outcome"] = None
    pending = arm.cancel_motion("why")
    assert [each for each in rig.virtual.asked if each[0] == "ask_cancel"] == [
        ("ask_cancel", "dmp", "why"),
        ("ask_cancel", "ptp", "why"),
    ]
    for t, waited in ((12.0, 0.0), (12.5, 2.5)):
        rig.t = t
        assert not pending.done() and rig.virtual.asked[-1] == ("cancel_outcome", 7, waited)
    rig.virtual.answers["cancel_outcome"] = answer
    assert pending.done()
    if fails:
        refused(pending, ReasonCode.HELD)
    else:
        assert pending.result() is None
    pending.cancel()


def test_a_motion_ends_with_its_own_word_a_fault_or_a_block(rig):
    arm = VirtualArm(rig)
    rig.virtual.answers["cancel_outcome"] = {"success": True}
    motion = arm.move_ptp((0.1,) * 7, (0.2,) * 7)
    assert not motion.done() and rig.virtual.asked[-1] == ("add_ptp", [0.1] * 7, [0.2] * 7)
    rig.robot.ended[3] = {"executed": True}
    assert motion.done() and motion.result() is None
    rig.robot.ended[3] = {"executed": False, "reason": "cancelled", "reason_code": ReasonCode.CANCELLED}
    assert refused(arm.move_ptp((0.1,) * 7, ()), ReasonCode.CANCELLED).causes == ("cancelled",)
    rig.robot.ended.clear()
    rig.robot.report["fault"] = True
    assert refused(arm.move_ptp((0.1,) * 7, ()), 0).causes == ("why",)
    rig.robot.report.update(fault=False, motion_allowed=False, blocked_by="b", blocked_code=3)
    assert refused(arm.move_ptp((0.1,) * 7, ()), 3).causes == ("b",)
    rig.virtual.answers["add_ptp"], rig.virtual.reason_code = (2, 0, "too far"), 6
    assert refused(arm.move_ptp((0.1,) * 7, ()), 6).sentence == "add_ptp refused: too far"


# --- the hand ---------------------------------------------------------------------------------------------------------


def test_the_hand_says_what_it_is(rig):
    hand = VirtualHand(rig)
    assert hand.state() == HandState(True, True, False, False, "m", (1, 2, 3, 4, 5), 4)
    rig.hand.calibrating = True
    assert hand.state().positions == ()
    hand.freeze()
    assert hand.state() == HandState(message="hand_status is silent", event=ReasonCode.NODE_SILENT)
    hand.thaw()
    assert hand.state().connected and not rig.hand.dead


def test_orders_to_the_hand(rig):
    hand, begun, ended = VirtualHand(rig), [], []
    job = SimpleNamespace(verdict=None)
    rig.hand.begin = lambda name, **fields: begun.append((name, fields)) or job
    rig.hand.end = lambda job, text, reason: ended.append((text, reason))
    orders = [hand.preshape("m", "l"), hand.close_on_object(), hand.close(5), hand.open(6)]
    assert begun == [
        ("hand_preshape", {"mode": "m", "level": "l"}),
        ("hand_preshape_close", {}),
        ("hand_close", {"speed": 5}),
        ("hand_open", {"speed": 6}),
    ]
    assert not orders[0].done()
    orders[1].cancel()
    assert len(ended) == 1
    job.verdict = SimpleNamespace(ok=True, text="", reason=0)
    assert orders[2].done() and orders[2].result() is None
    hand.freeze()
    assert not orders[2].done(), "a frozen node tells nobody"
    hand.thaw()
    job.verdict = SimpleNamespace(ok=False, text="stuck", reason=504)
    assert refused(orders[3], 504).causes == ("stuck",)


def test_a_hand_that_holds_is_calibrated_after_two_seconds(rig):
    hand, told, over = VirtualHand(rig), [], [False]
    rig.hand.calibrate = lambda mode: told.append(mode)
    rig.hand.calibration_over = lambda t: over[0]
    rig.hand.holding = True
    order = hand.calibrate("fast")
    for t, orders in ((10.0, []), (12.0, []), (12.01, ["fast"]), (13.0, ["fast"])):
        rig.t = t
        assert not order.done() and told == orders
    over[0] = True
    assert order.done() and order.result() is None
    rig.hand.calibrate = lambda mode: "it holds"
    rig.hand.holding = False
    error = refused(hand.calibrate("complete"), ReasonCode.HAND_REFUSED)
    assert error.causes == ("it holds",) and "after the order 'complete'" in error.sentence
