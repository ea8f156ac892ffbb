"""A whole trial in virtual time: the master beside the world, and what its reaches did."""

import copy
from dataclasses import replace

import numpy as np
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_perception.belief import BeliefFilter
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_smach.context.config import Config
from coglab_smach.context.context import Context
from coglab_smach.context.journal import Journal
from coglab_smach.kinematics.board_room import BoardRoom
from coglab_smach.kinematics.reachability import default_arm, solve
from coglab_smach.machines import build_master
from coglab_smach.ports.pending import Ready

from coglab_trials.conditions import Conditions
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.virtual_clock import VirtualClock, using
from coglab_trials.world import BOARD, DT, LIMITS, World
from coglab_trials.world_ports import VirtualContact, VirtualDatabase, VirtualHand, VirtualPerception

GIVE = "exchange_robot_to_human"
MACHINES = str(package_path("coglab_smach", "config", "machines.yaml"))
LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))


class VirtualTrial:
    """One trial: ``actions`` one after the other, each from its hub; results in the journal.

    ``conditions`` of the world: by default people and tracker as they are; ``behaviour``, ``profile``, ``perfect`` and
    ``perception`` change them. ``reaches`` gets one ReachRecord per DMP motion, ``touches`` one TouchRecord per wait
    for contact, ``begun`` the actions that a hub has taken. ``touch``: N of noise of the hand's touch sensors; None:
    it has none.
    """

    def __init__(
        self,
        seed=1,
        behaviour="normal",
        perfect=False,
        object_on="human_hand",
        perception=None,
        recogniser=None,
        later_behaviour="",
        turned=0.0,
        limits=LIMITS,
        profile="drawn",
        conditions=None,
        recording=None,
        power=False,
        touch=None,
        **overrides,
    ):
        if conditions is None:
            perception = perception or PerceptionSettings(perfect=perfect)
            conditions = Conditions(behaviour, profile, perception=perception)
        self.rig = World(seed, conditions, object_on, turned, limits, recording)
        self.object_id = conditions.object_id
        self.clock = VirtualClock()
        self.recogniser, self.later_behaviour = recogniser, later_behaviour
        self.last_hub = ""
        database = ObjectDatabase(objects_folder())
        database.reload()
        config = Config.load(MACHINES, {"auto_trigger": True, "dmp_library": LIBRARY, **overrides})
        self.ctx = Context(
            clock=self.clock,
            arm=VirtualArm(self.rig),
            hand=VirtualHand(self.rig),
            perception=VirtualPerception(self.rig, recogniser, BeliefFilter()),
            database=PowerGrasps(database) if power else VirtualDatabase(database),
            contact=VirtualContact(self.rig, touch),
            config=config,
            journal=Journal(self.clock.now),
            reachable=lambda pose: solve(default_arm(), pose) is not None,
            raised=BoardRoom(self.rig.robot.urdf, config.get("postures.board")).raised,
            say=self._say,
        )
        self.ctx.journal.listen(self._on_transition)
        with using(self.clock):
            self.master = build_master(self.ctx)
        self.over = False
        self.failure = None
        self.reaches, self.touches, self.begun = [], [], []
        self.said = []
        self.beside = lambda trial: None
        self._reach = self._touch = None

    def _say(self, code, text):
        """The person hears it."""
        self.said.append((self.clock.now(), code))
        self.rig.human.hear(self.rig.t, code)

    def _on_transition(self, record):
        """Another person comes for the second exchange, if that was asked for; reaches are recorded."""
        if record.to_state == "exchange_robot_to_human" and self.later_behaviour:
            human = self.rig.human
            human.participant = replace(human.participant, behaviour=self.later_behaviour)
        if record.from_state == "execute_dmp" and record.outcome == "succeeded":
            self._end_reach()
            self._reach = ReachRecord(self.rig, self.ctx, self.begun[-1] if self.begun else "")
            self._touch = TouchRecord(self.rig, self.ctx.contact)
        if record.from_state == "wait_stop" and self._reach is not None:
            self._reach.leave(record.outcome == "succeeded")
        giving = self.begun[-1:] == [GIVE] and record.outcome == "succeeded"
        if record.from_state == "give_load" or (record.from_state == "wait_stop" and not giving):
            self._end_reach()

    def _end_reach(self):
        """Keep the records of the reach that is over, if one is."""
        if self._reach is not None:
            self._reach.end()
            self.reaches.append(self._reach)
            self.touches.append(self._touch)
            self._reach = self._touch = None

    def palm_off_grasp(self):
        """(m, rad) from the true palm to the true grasp of the reach that was asked for last."""
        request, robot = self.ctx.arm.request, self.rig.robot
        palm = Pose(*robot.chain.fk(robot.report["position"]))
        grasp = Pose(np.asarray(request.goal_offset, dtype=float), np.asarray(request.target_orientation))
        return palm.distance(pose_of_truth(self.rig.truth["object"]) * grasp)

    def run(self, *actions, limit=60.0, script=None):
        """Execute ``actions``, or ``script(trial)``; returns the results of the actions as the journal holds them."""
        with using(self.clock):
            self.clock.start_thread(self._world, "world")
            walk = script or (lambda trial: trial.ask_for(actions, limit))
            self.clock.start_thread(lambda: self._script(walk), "script")
            self.master.execute()
            self.over = True
        self._end_reach()  # of a machine that was stopped in it
        if self.failure is not None:
            raise self.failure
        return [r for r in self.ctx.journal.results if r.kind != "coglab_init_system"]

    def _world(self):
        try:
            while not self.over:
                self.rig.step()
                if self._reach is not None:
                    self._reach.look()
                    self._touch.look()
                self.beside(self)
                self.clock.sleep(DT)
        except Exception as error:
            self.failure = error
            self.master.request_preempt()

    def _script(self, walk):
        try:
            walk(self)
        except Exception as error:
            self.failure = error
        finally:
            self.last_hub = self.ctx.requests.hub()
            self.master.request_preempt()

    def wait_hub(self, label, limit=60.0):
        """Wait until this hub is open."""
        end = self.clock.now() + limit
        while self.ctx.requests.hub() != label:
            assert self.clock.now() < end, f"{label} not reached: {self.ctx.journal.transitions[-1].sentence()}"
            self.clock.sleep(0.05)

    def ask_for(self, actions, limit):
        """The actions one after the other, each in its hub, until one fails."""
        for action in actions:
            end = self.clock.now() + limit
            while self.ctx.requests.hub() == "" and self.clock.now() < end:
                self.clock.sleep(0.1)
            if not self.ctx.requests.submit(action, self.object_id)[0]:
                return  # the action before it failed, so that this hub does not take it
            self.begun.append(action)
            before = len(self.ctx.journal.results)
            while len(self.ctx.journal.results) == before:
                if self.clock.now() > end:
                    raise AssertionError(f"'{action}' is stuck: " + self.ctx.journal.transitions[-1].sentence())
                self.clock.sleep(0.05)
            # The person's hand comes back before the next action.
            while self.rig.human.phase != "idle" and self.clock.now() < end:
                self.clock.sleep(0.1)
            end = self.clock.now() + 10.0
            while self.ctx.requests.hub() == "" and self.clock.now() < end:
                self.clock.sleep(0.05)


class ReachRecord:
    """What one DMP motion of ``action`` did: (time, measured palm, goal in use) per cycle, and the errors once the arm
    stands still; if it never ``stood``, at the reach's end. ``over``: when the wait for it was left; ``met``: with
    success, which without standing still is a touch or a person who has come. Neither ``stood`` nor ``met``:
    unfinished.

    ``to_goal``: (m, rad) from the measured palm to the latched goal, as the motion has estimated it, None where
    there was none yet; ``to_sight``: to the pose as received, the newest single sight at that moment; ``to_truth``: to
    where the grasp pose really is.
    """

    def __init__(self, rig, ctx, action):
        self.rig, self.request, self.contact, self.action = rig, ctx.arm.request, ctx.contact, action
        self.begin = rig.t
        self.path = []
        self.reached = None
        self.over = None
        self.stood = self.met = False
        self.to_goal = self.to_sight = self.to_truth = None

    def look(self):
        """After each period of the rig."""
        robot, rig = self.rig.robot, self.rig
        for record in robot.look_at_motion():
            self.path.append((record["time"], record["measured"][0], record["goal"][0]))
        if self.reached is None and robot.progress["motion"] == "reached":
            self.reached = rig.t
        # Measured when the detector begins to watch an arm that stands still and nobody has touched yet.
        detector = self.contact.detector
        watching = detector.state() == "watching" and (detector.moving.still() or self.action != GIVE)
        if not self.stood and self.reached is not None and watching:
            self.stood = True
            self._measure()

    def leave(self, succeeded):
        """Nobody waits for its end any more; what comes then, such as the giving of the load, is no part of it."""
        self.over, self.met = self.rig.t, succeeded
        if self.reached is None:
            self._measure()

    def end(self):
        """The reach is over: one that never stood still is measured where it is, unless it was when it was left."""
        if not self.stood and (self.over is None or self.reached is not None):
            self._measure()

    def _measure(self):
        rig, request, debug = self.rig, self.request, self.rig.robot.debug
        palm = Pose(*rig.robot.chain.fk(rig.robot.report["position"]))
        goal = Pose(np.asarray(request.goal_offset, dtype=float), np.asarray(request.target_orientation))
        if debug is not None:
            self.to_goal = palm.distance(Pose(*map(np.asarray, debug["goal"])))
        frame = request.goal_frame.removesuffix("_ahead")
        seen, _ = rig.newest(frame)
        truth = pose_of_truth(rig.truth["human_hand" if frame == "human_hand" else "object"])
        self.to_sight = palm.distance(seen * goal)
        self.to_truth = palm.distance((BOARD if request.goal_frame == "board" else truth) * goal)


TOUCH = 0.3
"""N on the robot's hand, all in all, from which something touches it: the object or the hand that holds it"""


class TouchRecord:
    """When something first touched the robot's hand in one reach (s), and when contact was found; None: never. And
    whether the arm moved at either moment."""

    def __init__(self, rig, contact):
        self.rig, self.contact = rig, contact
        self.touched = self.found = None
        self.moving = self.moving_when_found = False

    def look(self):
        """After each period of the rig."""
        if self.touched is None and np.linalg.norm(sum(self.rig.cell.touch().values())) > TOUCH:
            self.touched = self.rig.t
            self.moving = not self.rig.robot.report["standing"]
        if self.found is None and self.contact.event() is not None:
            self.found = self.rig.t
            self.moving_when_found = not self.rig.robot.report["standing"]

    @property
    def false_alarm(self):
        """Found before anything had touched the hand."""
        return self.found is not None and (self.touched is None or self.found < self.touched)

    def figures(self):
        """As plain data."""
        names = ("touched", "found", "moving", "moving_when_found", "false_alarm")
        return {name: getattr(self, name) for name in names}


class PowerGrasps(VirtualDatabase):
    """The objects, each grasped with all fingers, whatever its file asks for."""

    def get_object(self, object_id):
        pending = super().get_object(object_id)
        entry = copy.deepcopy(pending.result())
        for grasp in entry["grasps"].values():
            level = grasp["hand"]["level"] if grasp["hand"]["mode"] == "cylindrical" else "medium"
            grasp["hand"] = {"mode": "cylindrical", "level": level}
        return Ready(entry)
