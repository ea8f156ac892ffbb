"""The ports of the machines on the virtual rig, and a whole trial: the master beside the world, in virtual time."""
from pathlib import Path

import ih2_hand.progress as progress
import numpy as np
import smach
from coglab_smach.config import Config
from coglab_smach.context import Context
from coglab_smach.journal import Journal
from coglab_smach.machines import build_master
from coglab_smach.object_database import ObjectDatabase
from coglab_smach.pending import Polled, PortError, Ready
from coglab_smach.ports import DmpProgress, HandState, Located, Recognition
from coglab_smach.simulated_ports import SimulatedDatabase
from smach.virtual_clock import VirtualClock
from virtual_rig import BOARD, DT, Rig

SHARE = Path(__file__).resolve().parent.parent
LIBRARY = str(SHARE.parent / "coglab_controllers" / "config" / "primitives.xml")


class VirtualArm:
    """ArmPort on the rig."""

    def __init__(self, rig):
        self.rig = rig
        self.request = None

    def load_controller(self, controller_id, controller_type):
        return Ready()

    def load_dmps(self, filename):
        return Ready(self.rig.arm.library.load(filename))

    def lwr_command(self, event):
        ticket = self.rig.bridge.submit(event)
        outcome = []

        def done():
            if not outcome:
                answer = self.rig.bridge.outcome(ticket)
                if answer is not None:
                    outcome.append(answer)
            return bool(outcome)

        def value():
            good, message = outcome[0]
            if not good:
                raise PortError(f"LWR command '{event}' failed: {message}")
            return message

        return Polled(done, value)

    def motion_allowed(self):
        sample = self.rig.arm.sample
        return (False, "no measurement yet") if sample is None else (sample["motion_allowed"], sample["reason"])

    def switch_controller(self, controller_id):
        arm = self.rig.arm
        arm.active, arm.motion, arm.ptp = controller_id, None, None
        return Ready(controller_id)

    def execute_dmp(self, request):
        arm = self.rig.arm
        try:
            if arm.active != "dmp":
                raise PortError(f"execute_dmp refused: '{arm.active}' is active")
            if request.primitive_id not in arm.library:
                raise PortError(f"primitive '{request.primitive_id}' does not exist; loaded: "
                                f"{', '.join(arm.library.ids())}")
        except PortError as error:
            return Ready(error=error)
        self.request = request
        goal = self.rig.goal_of(request.goal_frame, request.goal_offset, np.array(request.target_orientation))
        arm.start_dmp(request.primitive_id, goal, request.dmp_ratio)
        return Ready()

    def switch_dmp(self, request):
        arm = self.rig.arm
        arm.motion.switch_to(arm.library[request.primitive_id], *arm.last_goal, ratio=request.dmp_ratio)
        return Ready()

    def dmp_progress(self):
        arm = self.rig.arm
        if arm.aborted:
            return DmpProgress("aborted", arm.aborted)
        if arm.motion is None:
            return DmpProgress("idle")
        return DmpProgress("reached" if arm.motion.phase == "ended" else "running", "", self.request.primitive_id, 0.0,
                           arm.motion.remaining_distance)

    def move_ptp(self, position, max_velocity):
        arm = self.rig.arm
        arm.start_ptp(np.array(position))

        def done():
            if not arm.sample["motion_allowed"]:
                raise PortError("the arm does not follow any more", (arm.sample["reason"],))
            return arm.ptp_done()

        return Polled(done, lambda: None)

    def joint_positions(self):
        return tuple(self.rig.arm.sample["position"])

    def hold(self, reason):
        return self.lwr_command("hold")


class VirtualHand:
    """HandPort on the rig."""

    def __init__(self, rig):
        self.rig = rig

    def _task(self, task):
        hand = self.rig.hand
        try:
            hand.begin(task)
        except Exception as error:
            return Ready(error=PortError(str(error)))

        def value():
            if not hand.verdict.ok:
                raise PortError(f"{task.name} ended without success", (hand.verdict.text,))

        return Polled(lambda: hand.verdict is not None, value)

    def calibrate(self, mode):
        hand = self.rig.hand
        hand.driver.calibration(mode)
        due = hand.clock.monotonic()

        def value():
            hand.calibrated = True

        return Polled(lambda: self.rig.t >= due, value)

    def preshape(self, mode, level):
        return self._task(progress.PreshapeTask(mode, level, True, 8.0))

    def close_on_object(self):
        return self._task(progress.GraspTask((1, 2, 3, 4), 8.0))

    def open(self, speed):
        return self._task(progress.OpenTask(speed))

    def state(self):
        hand = self.rig.hand
        return HandState(True, hand.calibrated, False, hand.holding, hand.message, hand.positions)


class VirtualPerception:
    """PerceptionPort on the rig's trackers."""

    def __init__(self, rig):
        self.rig = rig

    def init_vision(self, time_limit):
        return Ready("rig")

    def locate_object(self, object_id, time_limit):
        name = object_id if object_id in ("board", "human_hand") else f"object_{object_id}"
        end = self.rig.t + time_limit
        known = name == "board" or name in self.rig.trackers

        def fresh():
            return known and self.rig.newest(name)[1] < 0.5

        def value():
            if not fresh():
                raise PortError(f"'{name}' was not seen within {time_limit:.1f} s")
            frame, age = self.rig.newest(name)
            return Located(name, "world", tuple(frame.position), tuple(frame.orientation), age)

        return Polled(lambda: fresh() or self.rig.t >= end, value)

    def free_places(self, object_id, time_limit):
        return Ready([Located("", "board", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 0.0)])

    def recognition(self):
        return Recognition()


class VirtualContact:
    """ContactPort on the rig's detector."""

    def __init__(self, rig):
        self.rig = rig

    def arm(self, mode, time_limit, settings):
        self.rig.event = None
        try:
            self.rig.detector.arm(mode, self.rig.t, time_limit, float(settings.get("k", 0.0)),
                                  settings.get("joints", ()), float(settings.get("mass", 0.0)),
                                  float(settings.get("load_share", 0.0)))
        except ValueError as error:
            return Ready(error=PortError(str(error)))
        return Ready()

    def disarm(self):
        self.rig.detector.disarm()

    def event(self):
        return self.rig.event


class VirtualTrial:
    """One trial: ``actions`` one after the other, each from its hub; results in the journal."""

    def __init__(self, seed=1, behaviour="normal", perfect=False, object_on="human_hand", **overrides):
        self.rig = Rig(seed, behaviour, perfect, object_on)
        self.clock = VirtualClock()
        database = ObjectDatabase(str(SHARE / "objects"))
        database.reload()
        config = Config.load(str(SHARE / "config" / "machines.yaml"),
                             {"auto_trigger": True, "dmp_library": LIBRARY, **overrides})
        self.ctx = Context(clock=self.clock, arm=VirtualArm(self.rig), hand=VirtualHand(self.rig),
                           perception=VirtualPerception(self.rig), database=None, contact=VirtualContact(self.rig),
                           config=config, journal=Journal(self.clock.now))
        cell = type("Calls", (), {"answer": staticmethod(lambda port, method, after, value: _immediately(value))})
        self.ctx.database = SimulatedDatabase(cell, database)
        self.ctx.journal.listen(self._on_transition)
        self.master = build_master(self.ctx)
        self.over = False
        self.palm_error = None
        self.failure = None

    def _on_transition(self, record):
        """The person sees what the robot is about to do; the end of a reach is measured."""
        if record.path == "/coglab_master":
            task = {"exchange_human_to_robot": "give", "exchange_robot_to_human": "receive"}
            if record.to_state in task:
                self.rig.human.command(task[record.to_state])
            elif record.from_state in task and record.outcome != "succeeded":
                self.rig.human.command("rest")
        if record.from_state == "wait_stop" and record.outcome == "succeeded" and self.palm_error is None:
            self.palm_error = self._goal_error()

    def _goal_error(self):
        """(m, rad) between the palm and the goal as the motion latched it."""
        arm = self.rig.arm
        if arm.motion is None:
            return None
        p, o = arm.chain.fk(arm.sample["position"])
        d = abs(float(np.dot(o, arm.last_goal[1])))
        return float(np.linalg.norm(p - arm.motion.goal)), 2 * float(np.arccos(min(1.0, d)))

    def run(self, *actions, limit=60.0, between=None):
        """Execute; returns the results of the actions as the journal holds them."""
        with smach.clock.using(self.clock):
            self.clock.start_thread(self._world, "world")
            self.clock.start_thread(lambda: self._script(actions, limit, between), "script")
            self.master.execute()
            self.over = True
        if self.failure is not None:
            raise self.failure
        return [r for r in self.ctx.journal.results if r.kind != "coglab_init_system"]

    def _world(self):
        try:
            while not self.over:
                self.rig.step()
                self.clock.sleep(DT)
        except Exception as error:
            self.failure = error
            self.master.request_preempt()

    def _script(self, actions, limit, between):
        try:
            for action in actions:
                end = self.clock.now() + limit
                while self.ctx.requests.hub() == "" and self.clock.now() < end:
                    self.clock.sleep(0.1)
                if not self.ctx.requests.submit(action, "mug")[0]:
                    return  # the action before it failed, so that this hub does not take it
                before = len(self.ctx.journal.results)
                while len(self.ctx.journal.results) == before:
                    if self.clock.now() > end:
                        raise AssertionError(f"'{action}' is stuck: " + self.ctx.journal.transitions[-1].sentence())
                    self.clock.sleep(0.05)
                # The person's hand comes back before the next action.
                while self.rig.human.phase != "idle" and self.clock.now() < end:
                    self.clock.sleep(0.1)
        except Exception as error:
            self.failure = error
        finally:
            self.master.request_preempt()


def _immediately(value):
    try:
        return Ready(value())
    except PortError as error:
        return Ready(error=error)


__all__ = ["BOARD", "VirtualTrial"]
