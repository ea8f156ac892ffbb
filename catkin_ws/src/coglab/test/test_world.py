"""The robot in virtual time: motions, exchanges, stops, faults, refusals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import FrozenInstanceError

import coglab
import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.requests import TriggerReply, ask_for
from coglab_smach.machines import build_master

_shared: list[coglab.World] = []


def close_shared():
    while _shared:
        _shared.pop().close()


@pytest.fixture(scope="module", autouse=True)
def last():
    yield
    close_shared()


@pytest.fixture
def world():
    """A world that many tests share, at home and with an empty hand."""
    if not _shared:
        _shared.append(coglab.World(seed=3, person="accustomed", perfect_perception=True))
    yield _shared[0]
    _shared[0].robot.reset()
    _shared[0].robot.arm.move_joints(_shared[0].robot.arm.home)


@pytest.fixture
def alone():
    """Closes the shared world: this test opens its own worlds."""
    close_shared()


def test_arm_reaches_joints_in_the_requested_time(world):
    arm, target = world.robot.arm, world.robot.arm.home + 0.2
    result = arm.move_joints(target, duration=3.0)
    assert result.ok and result.duration == pytest.approx(3.0, abs=0.3)
    assert np.abs(result.joints - target).max() < 0.005 and result.joints.shape == (7,)
    with pytest.raises(ValueError, match="at least"):
        arm.move_joints(arm.home, duration=0.01)


def test_palm_reaches_poses_and_frames(world):
    arm = world.robot.arm
    here = arm.palm
    there = coglab.Pose(here.position + [0.05, 0.1, -0.05], here.orientation)
    for result in (arm.move_to(there), arm.reach("reach_human", here), arm.reach("reach_human", here.position + 0.05)):
        assert result.ok, str(result)
    assert np.linalg.norm(arm.palm.position - here.position - 0.05) < 0.006
    seven = [*here.position, *here.orientation]
    for target, where in ((seven, here.position), (there.position, there.position)):  # a position keeps the orientation
        assert arm.move_to(target).ok
        assert np.linalg.norm(arm.palm.position - where) < 0.001
        assert abs(np.dot(arm.palm.orientation, here.orientation)) > 0.9999
    with pytest.raises(coglab.Refused) as refused:
        arm.move_to((here.position + [2.0, 0.0, 0.0], here.orientation))
    assert refused.value.name == "GOAL_UNREACHABLE"


def test_palm_follows_a_function_of_time(world):
    start = world.robot.arm.palm.position
    result = world.robot.arm.follow(lambda t: start + [0.0, 0.04 * t, 0.0], 4.0)
    assert result.ok and result.remaining < 0.04 and result.duration == pytest.approx(4.0, abs=0.3)
    assert world.robot.state.standing


def test_time_passes_only_inside_calls(world):
    before = world.time
    time.sleep(0.3)
    assert world.time == before
    world.step(0.5)
    assert world.time == pytest.approx(before + 0.5)


def test_a_motion_ends_with_its_block(world):
    arm = world.robot.arm
    with arm.start_joints(arm.home - 0.5, duration=6.0) as motion:
        world.step(1.0)
        assert not motion.done and not world.robot.state.standing
    assert (motion.result.ok, motion.result.reason) == (False, "CANCELLED")
    assert world.robot.state.standing and np.abs(arm.joints - arm.home).max() < 0.3


def test_a_motion_that_takes_too_long_is_stopped_and_named(world):
    arm = world.robot.arm
    with pytest.raises(TimeoutError, match="'move_joints'"):
        arm.move_joints(arm.home - 0.5, duration=5.0, limit=0.5)
    assert world.robot.state.standing


def test_interrupt_stops_the_motion(world):
    arm, fired = world.robot.arm, []

    def press(_):
        if not fired and world.time > begun + 1.0:
            fired.append(world.time)
            os.kill(os.getpid(), signal.SIGINT)

    begun = world.time
    world.after_period.append(press)
    try:
        with pytest.raises(KeyboardInterrupt):
            arm.move_joints(arm.home - 0.5, duration=6.0)
    finally:
        world.after_period.remove(press)
    assert world.robot.state.standing and world.time < begun + 3.0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("latch", ["hold", "stop"])
def test_hold_and_stop_are_latched_until_reset(world, latch):
    robot = world.robot
    assert getattr(robot, latch)().ok
    with pytest.raises(coglab.Refused, match=r"robot.reset\(\)"):
        robot.arm.move_joints(robot.arm.home)
    world.step(1.0)
    with pytest.raises(coglab.Refused, match=r"robot.reset\(\)"):
        robot.receive()
    assert robot.reset().ok and robot.arm.move_joints(robot.arm.home).ok


def test_reset_asks_again_if_the_brain_has_gone_on_meanwhile(world, monkeypatch):
    asked = []

    def gone_on(context, action, object_id):
        asked.append(action)
        late = TriggerReply(False, "fault takes initialise", ReasonCode.WRONG_STATE)
        return late if len(asked) == 1 else ask_for(context, action, object_id)

    monkeypatch.setattr("coglab.world.ask_for", gone_on)
    world.robot.stop()
    world.step(1.0)
    assert world.robot.reset().ok and len(asked) == 2


def test_robot_is_reset_after_the_controller_left_command_mode(world):
    arm = world.robot.arm
    with arm.start_joints(arm.home - 0.5, duration=6.0) as motion:
        world.step(1.0)
        world.leave_command_mode()
        result = motion.wait()
    assert not result.ok and result.reason == "NOT_IN_COMMAND_MODE", str(result)
    assert world.robot.reset().ok and arm.move_joints(arm.home).ok


def test_hand_makes_preshapes_closes_and_opens(world):
    hand = world.robot.hand
    assert hand.preshape("cylindrical").ok
    assert hand.close(300).ok
    closed = hand.fingers
    assert hand.open().ok and sum(hand.fingers) < sum(closed)
    with pytest.raises(ValueError, match="cylindrical"):
        hand.preshape("fist of fury")
    with pytest.raises(coglab.Refused, match="high"):
        hand.preshape("lateral", "low")
    for wrong in (0, 512, 2.5, None, "fast"):
        with pytest.raises(ValueError, match="1 .. 511"):
            hand.open(wrong)


@pytest.mark.parametrize(
    "joints", [[0.0] * 6, [[0.0] * 7], [float("nan")] * 7, [9.0] + [0.0] * 6, "home", None, [1j] * 7]
)
def test_wrong_joints_are_refused_with_a_reason(world, joints):
    with pytest.raises(ValueError, match="joints"):
        world.robot.arm.move_joints(joints)


def test_wrong_poses_and_names_are_refused_with_a_reason(world):
    arm, place = world.robot.arm, [0.6, 0.0, 0.5]
    for wrong in ([0.6], (place, [0, 0, 0, 0]), (place, [0, 0, 1]), (place[:2], [0, 0, 0, 1]), 2.0 * np.eye(4)):
        with pytest.raises(ValueError, match="target"):
            arm.move_to(wrong)
    with pytest.raises(coglab.Refused, match="never seen"):
        arm.move_to("object_of_desire")
    with pytest.raises(coglab.Refused, match="reach_the_moon"):
        arm.reach("reach_the_moon", "human_hand")
    with pytest.raises(coglab.Refused):
        arm.reach("reach_human", "object_of_desire")
    with pytest.raises(ValueError, match=r"target\(t\)"):
        arm.follow(lambda t: [0.6, t], 1.0)
    for limit in (0.0, -1.0, float("inf"), float("nan"), "long"):
        with pytest.raises(ValueError, match="limit"):
            arm.move_joints(arm.home, limit=limit)
    assert world.robot.state.standing and world.robot.state.can_move


def test_a_thread_has_one_world_and_uses_only_its_own(world):
    with pytest.raises(RuntimeError, match="seed 3.*close"):
        coglab.World(seed=1)
    said = []

    def use():
        with coglab.World(seed=2) as other:
            said.append(other.time > 0.0)
        try:
            world.step()
        except RuntimeError as error:
            said.append(str(error))

    thread = threading.Thread(target=use)
    thread.start()
    thread.join(60)
    assert said[0] is True and "another thread" in said[1]


def test_a_fork_of_an_open_world_is_refused(world):
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            world.step()
        except RuntimeError as error:
            os.write(write, str(error).encode())
        os._exit(0)
    os.waitpid(child, 0)
    assert b"forked" in os.read(read, 1000)
    os.close(read)
    os.close(write)


def test_a_function_of_the_period_may_not_let_time_pass(world):
    world.after_period.append(lambda w: w.step())
    try:
        with pytest.raises(RuntimeError, match="after_period"):
            world.step()
    finally:
        world.after_period.clear()
    world.step()


def test_arguments_of_a_world_are_checked(world):
    def other(**arguments):
        thread_error = []

        def make():
            try:
                coglab.World(**arguments).close()
            except ValueError as error:
                thread_error.append(str(error))

        thread = threading.Thread(target=make)
        thread.start()
        thread.join(300)
        return thread_error[0]

    assert "mug" in other(object="teapot") and "accustomed" in other(person="robot")
    assert "trust" in other(person={"trsut": 1.0}) and "pull_back" in other(behaviour="rude")
    assert "calm" in other(settings={"timing": "frantic"})
    assert "board" in other(object_on="moon") and "seed" in other(seed=-1)
    assert "trust" in other(person={"trust": float("nan")}) and "touch" in other(touch=-1.0)
    assert "settings" in other(settings=[1]) and "machine" in other(machine=lambda ctx: None)


def test_a_world_that_fails_leaves_its_thread_free(alone):
    with pytest.raises(AttributeError, match="update"):
        coglab.World(seed=1, recogniser=object())
    coglab.World(seed=1)
    coglab.World.opened().close()
    assert coglab.World.opened() is None


def test_an_action_without_an_object_uses_that_of_the_world(alone):
    with coglab.World(seed=3, person="accustomed", object="ball", perfect_perception=True) as world:
        with pytest.raises(coglab.Refused, match="'dance'.*receive"):
            world.robot.do("dance")
        assert world.robot.receive().object_id == "ball"


def test_hidden_things_and_losses_are_named(world):
    with pytest.raises(ValueError, match="human_hand"):
        world.hide("elephant")
    with pytest.raises(ValueError, match="shares"):
        world.lose(2.0)
    with pytest.raises(ValueError, match="500 N"):
        world.push([1e4, 0.0, 0.0], 1.0)


def test_a_push_acts_and_ends(world):
    before = world.robot.arm.joints
    world.push([0.0, 60.0, 0.0], 0.2)
    world.step(0.1)
    assert np.abs(world.robot.arm.joints - before).max() > 1e-4
    world.step(1.0)
    assert np.abs(world.robot.arm.joints - before).max() < 1e-3


def test_receive_and_give_back_with_their_marks_events_and_refusals(alone):
    with coglab.World(seed=3, person="accustomed", perfect_perception=True) as world:
        robot = world.robot
        with pytest.raises(coglab.Refused, match=r"receive\(\)"):
            robot.give()
        with pytest.raises(coglab.Refused, match="teapot.*mug") as refused:
            robot.receive("teapot")
        assert refused.value.code == ReasonCode.OBJECT_UNKNOWN
        received = robot.receive("mug")
        assert received.ok and received.object_id == "mug" and robot.state.holding == "mug", str(received)
        assert received.started < received.marks["closed"] < received.ended <= world.time
        assert world.truth["held_by"] == "robot"
        with pytest.raises(coglab.Refused, match="mug"):
            robot.hand.open()
        with pytest.raises(coglab.Refused, match=r"give\(\)"):
            robot.take()
        with pytest.raises(FrozenInstanceError):
            received.ok = False
        assert robot.give().ok and world.truth["held_by"] == "human"
        events = robot.events()
        assert {event.kind for event in events} == {"transition", "result", "said"} and robot.events() == []
    with pytest.raises(RuntimeError, match="closed"):
        robot.receive()


def test_an_exchange_that_fails_is_a_result_with_a_reason(alone):
    with coglab.World(seed=30, person="accustomed", behaviour="never_release", perfect_perception=True) as world:
        result = world.robot.receive()
        assert not result and result.outcome == "failed_empty" and result.sentence and result.reason == "NOT_RELEASED"


def test_an_exchange_that_takes_too_long_stops_the_robot(alone):
    with coglab.World(seed=3, person="accustomed", perfect_perception=True) as world:
        with pytest.raises(TimeoutError, match="'receive'.*robot.reset"):
            world.robot.receive(limit=2.0)
        assert world.robot.state.standing and "reset" in world.robot.state.actions
        assert world.robot.reset().ok and world.robot.receive().ok


def test_same_calls_give_the_same_world(alone):
    ends = []
    for _ in range(2):
        with coglab.World(seed=11) as world:
            result = world.robot.receive()
            ends.append((result, world.time, world.truth["object"]["position"].tolist()))
    assert ends[0] == ends[1]


def test_an_error_in_an_own_machine_is_raised_in_the_caller(alone):

    def machine(ctx):
        master = build_master(ctx)
        master.execute = lambda *_: 1 / 0
        return master

    with pytest.raises(RuntimeError, match="division by zero"):
        coglab.World(seed=1, machine=machine)
    coglab.World(seed=1).close()


def test_a_seed_ends_alike_with_any_number_of_threads():
    program = (
        "import coglab, hashlib\n"
        "with coglab.World(seed=5, person='drawn') as world:\n"  # the arm is shifted at the person
        "    trial = world.trial('receive', 'give')\n"
        "    print(hashlib.sha256(trial.joints.tobytes()).hexdigest(), trial.results)"
    )
    ends = [
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            timeout=240,
            check=True,
        ).stdout
        for threads in ("1", "2")
    ]
    assert ends[0] == ends[1]
