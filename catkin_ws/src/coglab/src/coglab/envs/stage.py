"""A world ready for a handover: arm in command mode, hand preshaped, object at its start, stream open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from coglab_msgs.msg import Say
from coglab_objects.database import objects_folder, read_object
from coglab_py.pose import Pose
from coglab_trials.conditions import Conditions
from coglab_trials.world import DT, World
from ih2_hand.errors import HandError, RefusedError

from coglab.envs.referee import RECEIVE

LONGEST = 10.0  # s, limit of each step of the preparation
LOOKS = 0.2  # s, sights of hand and object before the start
OPEN, CLOSING, CLOSED, OPENING = range(4)  # phases of the robot's hand


class Stage:
    """One handover from its beginning. ``world``: the cell. ``goal``: pose of the palm in the frame ``anchor`` (the
    object to receive; the person's hand to give to) at which the object changes hands, from the object's file."""

    def __init__(self, seed: int, conditions: Conditions, task: str, stream: str) -> None:
        """``stream``: "twist_stream" or "joint_velocity_stream". RuntimeError: the robot does not start."""
        self.task = task
        self.world = World(seed, conditions, "human_hand" if task == RECEIVE else "world")
        thing, _ = read_object(objects_folder() / f"{conditions.object_id}.yaml")
        grasp = thing["grasps"][thing["default_grasp"]]
        self._preshape = grasp["hand"]
        in_object = Pose.from_dict(grasp["pose"])
        delivery = Pose.from_dict(thing["deliveries"][thing["default_delivery"]]["pose"])
        self.goal = in_object if task == RECEIVE else delivery * in_object
        self.anchor = self.world.object_frame if task == RECEIVE else "human_hand"
        self._job: Any = None
        self._closed = False
        self._told = True
        self._prepare(in_object.inverse(), stream)

    # -- preparation ---------------------------------------------------------------------------------------------

    def _prepare(self, in_palm: Pose, stream: str) -> None:
        world = self.world
        world.step()  # the person takes the object
        world.hand.emulator.calibration_scale = 0.0  # skip the 1.7 s of a calibration
        self._until(lambda: world.cell.quality == 3 and not world.hand.holding, "the robot controller does not connect")
        ticket, outcome = world.robot.virtual.submit("start"), []
        refused = world.hand.calibrate("fast")
        if refused is not None:
            raise RuntimeError(f"the hand does not calibrate: {refused}")

        def started() -> bool:
            answer = world.robot.virtual.outcome(ticket)
            if answer is not None:
                outcome.append(answer)
            return bool(outcome)

        self._until(lambda: not world.hand.calibrating, "the hand does not calibrate")
        self._order(False)
        self._until(started, "the arm does not start")
        if not outcome[0][0]:
            raise RuntimeError(f"the arm does not start: {outcome[0][1]}")
        self._until(self._done, "the hand does not take its preshape")
        if self.task != RECEIVE:
            # Give the order from the preshape: closed fingers would open to their preshape first and drop it.
            self._order(True)
            world.cell.place("robot_hand", in_palm.position, in_palm.orientation)
            self._until(self._done, "the hand does not close on the object")
        self._told = True
        good, why = world.robot.virtual.open_stream(stream)
        if not good:
            raise RuntimeError(f"the stream of velocities does not open: {why}")
        for _ in range(round(LOOKS / DT)):
            world.step()

    def _until(self, over: Callable[[], bool], what: str) -> None:
        """Runs robot and hand, without person and tracker."""
        world, robot = self.world, self.world.robot
        end = robot.virtual.now + LONGEST
        while not over():
            if robot.virtual.now > end:
                raise RuntimeError(f"{what} within {LONGEST:g} s: {world.hand.message or robot.report['reason']}")
            world.hand.step(robot.virtual.now)
            robot.step()
        world.t = robot.virtual.now

    # -- the handover --------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """The robot asks the person for the object, or to take it."""
        self._say(Say.READY_TO_RECEIVE if self.task == RECEIVE else Say.READY_TO_GIVE)

    def command_hand(self, close: bool) -> None:
        """Closes the hand, or opens it to its preshape. The same command again changes nothing. A hand that is still
        taking its preshape does not close before."""
        failed = self._done() and not self._job.verdict.ok
        if close == self._closed and not (failed and not close):
            return
        if close and not self._done():
            return
        try:
            self._order(close)
        except (HandError, RefusedError):
            self._order(False)  # its preshape was lost: take it first

    def look(self) -> None:
        """Call after each period. The robot announces the action of its hand, like the shipped machines."""
        if self._told or not self._done():
            return
        self._told = True
        verdict = self._job.verdict
        if self._closed and verdict.ok and self.world.hand.holding:
            self._say(Say.I_HAVE_IT)
        elif not self._closed and verdict.ok and self.task != RECEIVE:
            self._say(Say.YOU_HAVE_IT)

    @property
    def phase(self) -> int:
        """Phase of the robot's hand: OPEN, CLOSING, CLOSED or OPENING."""
        if self._closed:
            return CLOSED if self._done() else CLOSING
        return OPEN if self._done() else OPENING

    def palm(self) -> Pose:
        """Pose of the palm in the base frame, from the measured joints."""
        return self.world.robot.palm()

    def fingers(self) -> np.ndarray:
        """Positions of the five motors as last polled, (5,), 0 open to 1 closed."""
        positions = self.world.hand.positions
        return np.asarray(positions, dtype=float) / 255.0 if len(positions) == 5 else np.zeros(5)

    def _order(self, close: bool) -> None:
        hand = self.world.hand
        if close:
            self._job = hand.begin("hand_preshape_close")
        else:
            self._job = hand.begin("hand_preshape", mode=self._preshape["mode"], level=self._preshape["level"])
        self._closed, self._told = close, False

    def _done(self) -> bool:
        return self._job is None or self._job.verdict is not None

    def _say(self, code: int) -> None:
        self.world.human.hear(self.world.t, code)
