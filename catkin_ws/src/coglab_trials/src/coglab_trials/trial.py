"""Simulated trials in virtual time: the state machines of coglab_smach in a World, and their results."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import smach
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_perception.belief import BeliefFilter
from coglab_py.packages import package_path
from coglab_py.pose import Pose, length
from coglab_sim.person.in_cell import pose_of_truth
from coglab_smach.context.config import Config
from coglab_smach.context.context import Context
from coglab_smach.context.journal import ActionRecord, Journal, TransitionRecord
from coglab_smach.kinematics.board_room import BoardRoom
from coglab_smach.kinematics.reachability import default_arm, solve
from coglab_smach.machines import build_master

from coglab_trials.conditions import Conditions
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.virtual_clock import VirtualClock, using
from coglab_trials.world import BOARD, DT, World
from coglab_trials.world_ports import VirtualContact, VirtualDatabase, VirtualHand, VirtualPerception

RECEIVE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
MACHINES = str(package_path("coglab_smach", "config", "machines.yaml"))
LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))
TOUCH = 0.3  # N, total force on the robot's hand that counts as touched
LOG = logging.getLogger("coglab_trials")


@contextmanager
def engine_logs() -> Iterator[None]:
    """Inside the block, the SMACH engine logs to ``coglab_trials``; transitions as hidden debug messages."""
    before = smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr
    smach.set_loggers(LOG.debug, LOG.warning, LOG.debug, LOG.error)
    try:
        yield
    finally:
        smach.set_loggers(*before)


@dataclass(frozen=True)
class TrialResult:
    """Result of one action of a trial. Times in s of virtual time since the start of the trial."""

    action: str
    object_id: str
    outcome: str
    """"succeeded"; "failed_empty" or "failed_holding": the hand is empty or holds the object; "stopped" or "fault": the
    operator must help before the robot can continue"""
    code: int
    """coglab_msgs/ReasonCode; 0 after success"""
    reason: str
    """one sentence; empty after success"""
    causes: tuple[str, ...]
    """causes of the reason, nearest first"""
    started: float
    ended: float
    marks: Mapping[str, float]
    """times of events: "contact", "closing", ..."""

    @classmethod
    def of(cls, record: ActionRecord) -> TrialResult:
        """Converts the record from the journal of the state machines."""
        r = record
        return cls(r.kind, r.object_id, r.outcome, r.code, r.reason, r.causes, r.started, r.ended, dict(r.marks))


class VirtualTrial:
    """The robot's state machines in their own World. Requests actions and returns their results.

    Example::

        trial = VirtualTrial(seed=7, conditions=Conditions(object_id="bottle"))
        for result in trial.run("exchange_human_to_robot", "exchange_robot_to_human"):
            print(result.action, result.outcome, f"{result.ended - result.started:.1f} s", result.reason)
        print(trial.world.truth["held_by"], [reach.touched for reach in trial.reaches])

    The same arguments give the same trial, bit for bit. A trial runs once. Transitions of the machines are logged as
    debug messages of the logger ``coglab_trials``.

    Attributes: ``world``. ``clock``: virtual time, s. ``hub``, ``results``, ``why()``: state and results of the
    machines. ``begun``: accepted actions. ``reach``: the current Reach, or None. ``reaches``: the finished ones.
    ``said``: (s, code of coglab_msgs/Say) of each message to the person. ``beside``: called with the trial after each
    period, to observe or to interfere. ``ctx``: the Context of the machines, for tests of the machines.
    """

    def __init__(
        self,
        seed: int = 1,
        conditions: Conditions | None = None,
        *,
        world: World | None = None,
        settings: Mapping[str, Any] | None = None,
        recogniser: Any = None,
        touch: float | None = None,
        machine: Callable[[Context], Any] = build_master,
    ) -> None:
        """
        ``seed``, ``conditions``: of the world. ``world``: an existing world, instead of these.
        ``settings``: dotted names of machines.yaml with their values, e.g. ``{"handover.reach_ratio": 2.0}``.
        ``recogniser``: a coglab_perception Recogniser that receives the tracker's sights; None: no recognition.
        ``touch``: standard deviation (N) of the hand's touch sensors; None: no sensors.
        ``machine``: builds the state machine, like coglab_smach.machines.build_master.

        ValueError: conditions together with a world. ObjectError: unknown object. ConfigError: a setting does not exist
        or is out of range. ImportError: the simulation was not built.
        """
        if world is not None and conditions is not None:
            raise ValueError("give a world, or seed and conditions, not both: a world has its own")
        self.world = world or World(seed, conditions)
        self.recogniser, self.object_id = recogniser, self.world.conditions.object_id
        self.clock = VirtualClock()
        database = ObjectDatabase(objects_folder())
        database.reload()
        config = Config.load(MACHINES, {"auto_trigger": True, "dmp_library": LIBRARY, **(settings or {})})
        self.arm, self.contact = VirtualArm(self.world), VirtualContact(self.world, touch)
        self.ctx = Context(
            clock=self.clock,
            arm=self.arm,
            hand=VirtualHand(self.world),
            perception=VirtualPerception(self.world, recogniser, BeliefFilter()),
            database=VirtualDatabase(database),
            contact=self.contact,
            config=config,
            journal=Journal(self.clock.now),
            reachable=lambda pose: solve(default_arm(), pose) is not None,
            raised=BoardRoom(self.world.robot.urdf, config.get("postures.board")).raised,
            say=self._say,
        )
        self.ctx.journal.listen(self._on_transition)
        with using(self.clock):
            self.master = machine(self.ctx)
        if not isinstance(self.master, smach.State):
            raise ValueError(f"machine: it has to return a state machine (smach.State), got {self.master!r}")
        self.beside: Callable[[VirtualTrial], None] = lambda trial: None
        self.reach: Reach | None = None
        self.reaches: list[Reach] = []
        self.begun: list[str] = []
        self.said: list[tuple[float, int]] = []
        self.last_hub = ""
        """hub in which the machines waited at the end of the trial; empty if in none"""
        self._over = False
        self._failure: Exception | None = None

    def run(
        self, *actions: str, limit: float = 60.0, script: Callable[[VirtualTrial], None] | None = None
    ) -> list[TrialResult]:
        """Initialise the robot, then execute ``actions`` one after the other until one fails.

        ``actions``: "exchange_human_to_robot", "exchange_robot_to_human", "take", "put". ``limit``: virtual time (s)
        for each. ``script(trial)``: a function used instead of actions; it calls ``wait_hub``, ``ask_for`` and
        ``clock.sleep``. Returns the results of all actions except the initialisation.

        TimeoutError: an action does not end within the limit. RuntimeError: the trial has already run. Exceptions of
        the script are raised again.
        """
        if self._over:
            raise RuntimeError("a trial runs once: make another one with the same seed")
        with using(self.clock), engine_logs():
            self.clock.start_thread(self._run_world, "world")
            walk = script or (lambda trial: trial.ask_for(*actions, limit=limit))
            self.clock.start_thread(lambda: self._run_script(walk), "script")
            try:
                self.master.execute()
            finally:  # also if the clock has stalled: the world must not run on for ever
                self._over = True
        self._end_reach()  # a machine that was stopped leaves its reach open
        if self._failure is not None:
            raise self._failure
        return self.results

    @property
    def results(self) -> list[TrialResult]:
        """Results of the finished actions, without the initialisation."""
        return [TrialResult.of(r) for r in self.ctx.journal.results if r.kind != "coglab_init_system"]

    @property
    def hub(self) -> str:
        """Label of the state that waits for an action: "wait_without_object", "wait_with_object", "stopped", "fault".
        Empty while an action runs."""
        return self.ctx.requests.hub()

    def why(self) -> str:
        """Returns the reason why the last action failed, as shown to the operator: one sentence."""
        return self.ctx.journal.why()

    def submit(self, action: str, object_id: str | None = None) -> bool:
        """Request an action or "reset" from the hub. Returns True if it was accepted. Does not wait."""
        accepted: bool = self.ctx.requests.submit(action, self.object_id if object_id is None else object_id)[0]
        return accepted

    def wait_hub(self, label: str, limit: float = 60.0) -> None:
        """In a script: wait until this hub is active. TimeoutError after ``limit`` s."""
        self._wait(lambda: self.hub == label, 0.05, limit, f"hub '{label}' was not reached")

    def ask_for(self, *actions: str, limit: float = 60.0) -> None:
        """In a script: execute the actions one after the other, each in its hub, until one fails. TimeoutError if one
        takes longer than ``limit`` s."""
        for action in actions:
            end = self.clock.now() + limit
            self._wait(lambda: self.hub != "", 0.1, limit)
            if not self.submit(action):
                return  # the previous action failed, so this hub does not accept it
            self.begun.append(action)
            self._wait(self._one_more(), 0.05, end - self.clock.now(), f"'{action}' has not ended", limit)
            # Wait until the person's hand has returned, before the next action.
            self._wait(lambda: self.world.human.phase == "idle", 0.1, end - self.clock.now())
            self._wait(lambda: self.hub != "", 0.05, 10.0)

    def _one_more(self) -> Callable[[], bool]:
        """Returns a condition: an action has ended since now."""
        results = self.ctx.journal.results
        before = len(results)
        return lambda: len(results) > before

    def _wait(
        self, condition: Callable[[], bool], period: float, left: float, missed: str = "", limit: float = 0.0
    ) -> None:
        """In a script: wait until the condition is true, at most ``left`` s. Then TimeoutError with the text ``missed``
        and the ``limit`` (s; ``left`` without one), if there is a text."""
        end = self.clock.now() + left

        def over() -> bool:
            if condition():
                return True
            late = self.clock.now() >= end
            if late and missed:
                raise TimeoutError(f"{missed} within {limit or left:g} s: {self._last()}")
            return late

        self.clock.poll(over, period)

    def _last(self) -> str:
        transitions = self.ctx.journal.transitions
        return transitions[-1].sentence() if transitions else "nothing has happened yet"

    def period(self) -> None:
        """Advance the world by one FRI period (5 ms), update the current reach, and call ``beside``."""
        self.world.step()
        if self.reach is not None:
            self.reach.look()
        self.beside(self)

    def _run_world(self) -> None:
        try:
            while not self._over:
                self.period()
                self.clock.sleep(DT)
        except Exception as error:
            self._failure = error
            self.master.request_preempt()

    def _run_script(self, walk: Callable[[VirtualTrial], None]) -> None:
        try:
            walk(self)
        except Exception as error:
            self._failure = error
        finally:
            self.last_hub = self.hub
            self.master.request_preempt()

    def _say(self, code: int, text: str) -> None:
        """Pass the message to the person."""
        self.said.append((self.clock.now(), code))
        self.world.human.hear(self.world.t, code)

    def _on_transition(self, record: TransitionRecord) -> None:
        """Start and end the records of reaches."""
        if record.from_state == "execute_dmp" and record.outcome == "succeeded":
            self._end_reach()
            self.reach = Reach(self.world, self.arm.request, self.contact, self.begun[-1] if self.begun else "")
        if record.from_state == "wait_stop" and self.reach is not None:
            self.reach.leave(record.outcome == "succeeded")
        giving = self.begun[-1:] == [GIVE] and record.outcome == "succeeded"
        if record.from_state == "give_load" or (record.from_state == "wait_stop" and not giving):
            self._end_reach()

    def _end_reach(self) -> None:
        """Store the record of the finished reach, if there is one."""
        if self.reach is not None:
            self.reach.end()
            self.reaches.append(self.reach)
            self.reach = None


class Reach:
    """Record of one reach of the arm. Times in s of the world; None if the event did not happen.

    ``action``, ``request`` (DmpRequest). ``begin``: start. ``path``: (s, palm, goal in use) per cycle, positions in m.
    ``reached``: the motion arrived at its goal. ``over``: the machine left the state that waits for the arrival.
    ``met``: it left that state with success; if the arm still moved, the reason is a touch or an arriving person.
    ``stood``: the arm stood still at the end. Without ``stood`` and ``met``, the reach is unfinished.

    Distances (m, rad) of the palm when the arm stands still, or else at the end: ``to_goal``: to the goal as estimated
    by the motion. ``to_sight``: to the newest single sight. ``to_truth``: to the true grasp.

    ``touched``: first touch of the robot's hand. ``found``: contact was detected. ``moving``, ``moving_when_found``:
    the arm moved at that time.
    """

    def __init__(self, world: World, request: Any, contact: VirtualContact, action: str) -> None:
        self._world, self._contact = world, contact
        self.request, self.action = request, action
        self.begin = world.t
        self.path: list[tuple[float, Sequence[float], Sequence[float]]] = []
        self.reached: float | None = None
        self.over: float | None = None
        self.stood = self.met = False
        self.to_goal: tuple[float, float] | None = None
        self.to_sight: tuple[float, float] | None = None
        self.to_truth: tuple[float, float] | None = None
        self.touched: float | None = None
        self.found: float | None = None
        self.moving = self.moving_when_found = False

    def look(self) -> None:
        """Update the record; called after each period of the world."""
        robot, t = self._world.robot, self._world.t
        for record in robot.look_at_motion():
            self.path.append((record["time"], record["measured"][0], record["goal"][0]))
        if self.reached is None and robot.progress["motion"] == "reached":
            self.reached = t
        # Measure when the arm stands still and the detector starts to watch, before anybody touches the arm.
        contact = self._contact
        watching = contact.detector.state() == "watching" and (contact.moving.still() or self.action != GIVE)
        if not self.stood and self.reached is not None and watching:
            self.stood = True
            self._measure()
        if self.touched is None and length(self._world.cell.touch_total) > TOUCH:
            self.touched, self.moving = t, not robot.report["standing"]
        if self.found is None and self._contact.event() is not None:
            self.found, self.moving_when_found = t, not robot.report["standing"]

    def leave(self, succeeded: bool) -> None:
        """The machine no longer waits for the arrival. Later events, such as the load transfer, are not recorded."""
        self.over, self.met = self._world.t, succeeded
        if self.reached is None:
            self._measure()

    def end(self) -> None:
        """The reach is over. If the arm never stood still, measure it here, unless leave() has already measured it."""
        if not self.stood and (self.over is None or self.reached is not None):
            self._measure()

    def _measure(self) -> None:
        world, request, debug = self._world, self.request, self._world.robot.debug
        palm = world.robot.palm()
        goal = Pose(np.asarray(request.goal_offset, dtype=float), np.asarray(request.target_orientation))
        if debug is not None:
            position, orientation = map(np.asarray, debug["goal"])
            self.to_goal = palm.distance(Pose(position, orientation))
        frame = request.goal_frame.removesuffix("_ahead")
        seen, _ = world.newest(frame)
        truth = pose_of_truth(world.truth["human_hand" if frame == "human_hand" else "object"])
        self.to_sight = None if seen is None else palm.distance(seen * goal)
        self.to_truth = palm.distance((BOARD if request.goal_frame == "board" else truth) * goal)
