"""The whole cell in virtual time: person, tracker, robot, hand and state machines in one process, without ROS."""

from __future__ import annotations

import logging
import math
import os
import signal
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import TYPE_CHECKING, Any

from coglab_msgs.msg import ReasonCode
from coglab_objects.database import objects_folder
from coglab_py.pose import Pose
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.person.participant import BEHAVIOURS, PROFILES, Participant
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_smach.context.config import ConfigError
from coglab_smach.context.context import Context
from coglab_smach.context.journal import TransitionRecord
from coglab_smach.context.master_state import MasterState, StateWatch
from coglab_smach.context.requests import TriggerReply, ask_for
from coglab_smach.machines import build_master
from coglab_smach.ports.interfaces import ArmPort, HandPort
from coglab_trials import Conditions, TrialResult, VirtualTrial, using
from coglab_trials import World as Cell
from coglab_trials.trial import engine_logs
from coglab_trials.virtual_clock import VirtualClock
from coglab_trials.world import DT

from coglab.control.in_cycle import InCycle
from coglab.control.motion import Motion as OwnMotion
from coglab.results import ACTIONS, Event, Exchange, MotionResult, Refused
from coglab.robot import Robot
from coglab.trial import Recording, Trial
from coglab.values import finite, number, path_of, whole

if TYPE_CHECKING:
    from ctrl_more import FeedbackControllersManager

LOG = logging.getLogger("coglab")
START_LIMIT = 60.0  # s of virtual time, limit of the initialisation
REST_LIMIT = 20.0  # s of virtual time, limit for the return of the person's hand after a trial
KEPT_EVENTS = 10_000
PUSH_LIMIT = 500.0  # N, largest push

_open_worlds: dict[int, weakref.ref[World]] = {}  # thread -> its open world
_HERE = threading.Lock()


class World:
    """A simulated cell in virtual time. Time passes only inside calls: of ``step``, ``trial``, and of ``robot``.

    The same arguments and calls give the same handover, bit for bit. A thread holds one open World at a time, and only
    that thread may use it. Example::

        import coglab

        with coglab.World(seed=3, object="bottle") as world:
            print(world.robot.receive())
            print(world.truth["held_by"], world.time)
            trial = world.trial("give")
            trial.plot().savefig("give.png")
    """

    def __init__(
        self,
        seed: int = 1,
        person: str | Mapping[str, Any] = "drawn",
        object: str = "mug",
        *,
        behaviour: str = "normal",
        perfect_perception: bool = False,
        conditions: Conditions | None = None,
        object_on: str = "person",
        settings: Mapping[str, Any] | None = None,
        machine: Callable[[Context], Any] = build_master,
        recogniser: Any = None,
        touch: float | None = None,
        feedback: str | Path = "",
        signals: str | Path = "",
        managers: str | Path = "",
    ) -> None:
        """
        ``seed``: of person, noise and tracker. ``person``: "drawn" (by the seed), "patient" or "accustomed"; or fields
        of coglab_sim.person.participant.Participant that override those of the drawn person: {"trust": 0.1}.
        ``object``: an object of the database. ``behaviour``: of the person, such as "slow" or "never_release".
        ``perfect_perception``: the tracker has no noise, delay or gaps.
        ``conditions``: a coglab_trials.Conditions instead of the four arguments above.
        ``object_on``: "person": in the person's hand, "board": on the board.
        ``settings``: dotted names of machines.yaml with their values, such as {"timing": "calm"}, or actions, states
        and deliveries of your own: {"actions": {"polish": "my_lab.machines:build_polish"}}.
        ``machine``: builds the state machine from the Context, as coglab_smach.machines.build_master does.
        ``recogniser``: a coglab_perception Recogniser, see VirtualTrial. ``touch``: standard deviation (N) of touch
        sensors in the hand; None: no sensors.
        ``feedback``, ``signals``, ``managers``: files of feedback controllers, of their signals and of managers, as the
        arguments of coglab.launch; ``feedback="palm"``: those that use IMU and wrench sensor in the palm.

        ValueError: an argument is not one of these. RuntimeError: this thread has an open World.
        """
        self._trial: VirtualTrial | None = None
        self._clock: VirtualClock | None = None
        self._pid, self._thread = os.getpid(), threading.get_ident()
        self._claim_thread()
        try:
            if conditions is None:
                conditions = _conditions(person, object, behaviour, perfect_perception)
            elif not isinstance(conditions, Conditions):
                raise ValueError(f"conditions: a coglab.Conditions is expected, got {conditions!r}")
            _check_object(conditions.object_id)
            if object_on not in ("person", "board"):
                raise ValueError(f"object_on: 'person' or 'board' is expected, got {object_on!r}")
            if settings is not None and not isinstance(settings, Mapping):
                raise ValueError(f"settings: a dict of names and values is expected, got {settings!r}")
            if touch is not None and number(touch, "touch", "N", -math.inf) < 0.0:
                raise ValueError(f"touch: 0 N or more is expected, got {touch!r}")
            if not callable(machine):
                raise ValueError(f"machine: a function of the Context is expected, got {machine!r}")
            self.seed, self.conditions = whole(seed, "seed"), conditions
            files = {
                "feedback_file": path_of(feedback, "feedback"),
                "signals_file": path_of(signals, "signals"),
                "central_file": path_of(managers, "managers"),
            }
            cell = Cell(
                self.seed,
                conditions,
                "human_hand" if object_on == "person" else "world",
                files={name: file for name, file in files.items() if file},
            )
            self._stack = ExitStack()
            trial = VirtualTrial(world=cell, settings=settings, recogniser=recogniser, touch=touch, machine=machine)
        except ConfigError as error:
            self._release_thread()
            raise ValueError(f"settings: {error}") from None
        except BaseException:
            self._release_thread()
            raise
        self._trial, self._clock = trial, trial.clock
        self.cell = cell
        self.after_period: list[Callable[[World], None]] = []
        """functions that are called with this World after each period of 5 ms, to observe or to interfere"""
        self._recording: Recording | None = None
        self._machine_error: BaseException | None = None
        self._interrupted = 0
        self._inside = False
        try:
            self._stack.enter_context(using(trial.clock))
            self._stack.enter_context(engine_logs())
            self._back_end = _VirtualBackEnd(self, trial)
            self.robot = Robot(self._back_end, lambda: None)
            self._machine = trial.clock.start_thread(self._run_machine, "machine", daemon=True)
            self.run_until(lambda: trial.hub != "", START_LIMIT, "the first hub of the machines")
        except BaseException:
            self.close()
            raise

    # --- time ---

    @property
    def time(self) -> float:
        """Virtual time since the start, s."""
        return 0.0 if self._clock is None else round(self._clock.now(), 6)

    def step(self, seconds: float = DT) -> None:
        """Let ``seconds`` pass, in periods of 5 ms; at least one."""
        self._check()
        self._advance(max(1, round(number(seconds, "seconds", "s", 0.0) / DT)))

    def run_until(self, condition: Callable[[], bool], limit: float = 60.0, what: str = "the condition") -> None:
        """Let time pass until ``condition()`` is true. TimeoutError after ``limit`` s of virtual time."""
        self._check()
        end = self.time + number(limit, "limit", "s", 0.0)
        while not condition():
            if self.time >= end:
                raise TimeoutError(f"{what} did not come within {limit:g} s: {self.robot._now_in_words()}")
            self._advance(1)

    def _advance(self, periods: int) -> None:
        """Run periods of the cell. Every wait of this package comes here."""
        trial = self._trial
        assert trial is not None  # _check() was called
        if self._inside:
            raise RuntimeError("a function of after_period cannot let time pass: it may only look and act")
        clock = trial.clock
        clock.let_think(False)
        self._inside = True
        try:
            with self._signals():
                for _ in range(periods):
                    trial.period()
                    for look in self.after_period:
                        look(self)
                    if self._recording is not None:
                        self._recording._look()
                    self._back_end.look()
                    clock.sleep(DT)
                    if self._machine_error is not None:
                        error, self._machine_error = self._machine_error, None
                        raise RuntimeError(f"the state machine has ended with an error: {error!r}") from error
                    if self._interrupted:
                        self._interrupted = 0
                        raise KeyboardInterrupt
        finally:
            self._inside = False
            clock.let_think(True)

    @contextmanager
    def _signals(self) -> Iterator[None]:
        """Ctrl-C takes effect between two periods, so that no wait of the clock is cut. The third at once."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.getsignal(signal.SIGINT)
        if before is not signal.default_int_handler:
            yield
            return

        def on_interrupt(*_: object) -> None:
            self._interrupted += 1
            if self._interrupted == 2:
                os.write(2, b"the control cycle does not return; Ctrl-C once more ends it at once\n")
            if self._interrupted > 2:
                raise KeyboardInterrupt

        signal.signal(signal.SIGINT, on_interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _run_machine(self) -> None:
        assert self._trial is not None
        try:
            self._trial.master.execute()
        except BaseException as error:
            self._machine_error = error

    # --- state, and actions on the cell ---

    @property
    def truth(self) -> Mapping[str, Any]:
        """True state of the cell, SI units, base frame: "held_by", "dropped", poses of "object", "human_hand" and
        "robot_hand" (dicts of position [3] and rotation [4]), "touch_force" and "human_force" [3] N, ..."""
        self._check()
        truth: Mapping[str, Any] = self.cell.cell.truth()
        return truth

    def true_pose(self, name: str) -> Pose:
        """True pose of "object", "human_hand" or "robot_hand" (the palm) in the base frame."""
        truth = self.truth
        if name not in ("object", "human_hand", "robot_hand"):
            raise ValueError(f"name: 'object', 'human_hand' or 'robot_hand' is expected, got {name!r}")
        return pose_of_truth(truth[name])

    @property
    def person(self) -> VirtualHuman:
        """The simulated person: ``command("give")``, ``phase``, ``participant`` (may be replaced)."""
        self._check()
        human: VirtualHuman = self.cell.human
        return human

    @property
    def virtual_trial(self) -> VirtualTrial:
        """The coglab_trials.VirtualTrial inside, with its ``ctx`` and ``reaches``, for tests of state machines."""
        self._check()
        assert self._trial is not None
        return self._trial

    # -- own controllers -------------------------------------------------------------------------

    @property
    def feedback(self) -> FeedbackControllersManager:
        """The robot's own ``ctrl_more.FeedbackControllersManager``: load a list file with C++ and Python controllers,
        order, enable, pause and tune them here. The control cycle runs them."""
        self._check()
        manager: FeedbackControllersManager = self.cell.robot.virtual.feedback
        return manager

    def add_motion(self, name: str, motion: OwnMotion) -> None:
        """Load a motion of ``coglab.control`` into the control cycle, as ``./coglab controller run`` does on the
        running robot. Refused: the name is in use. ValueError: no motion; and the errors of ``configure``."""
        self._check()
        missing = [each for each in ("configure", "start", "reference", "done") if not hasattr(motion, each)]
        if isinstance(motion, type) or missing:
            raise ValueError(
                f"motion: an object of a class derived from coglab.control.Motion is expected, got {motion!r}"
            )
        robot = self.cell.robot
        in_cycle = InCycle(motion, SimpleNamespace(chain=robot.chain, limits=robot.limits))
        loaded, sentence = robot.virtual.add_motion(name, in_cycle)
        if not loaded:
            raise Refused(sentence, robot.virtual.reason_code)

    def run_motion(self, name: str, limit: float = 60.0, **arguments: float) -> MotionResult:
        """Start a motion of ``add_motion`` with these arguments and wait for its end. A motion that raises, or returns
        no reference, is aborted: the arm brakes, and ``causes`` has the Python message.

        ``limit``: virtual time, s; TimeoutError after it, and the arm is stopped, as by Ctrl-C. Refused: unknown
        argument, out of range, or not now. ValueError: no finite number, or no such motion.
        """
        self._check()
        robot, begun = self.cell.robot, self.time
        arguments = {each: number(value, each, "argument", -math.inf) for each, value in arguments.items()}
        accepted, sentence, begun_as = robot.virtual.start_motion(name, arguments)
        if not accepted:
            raise Refused(sentence, robot.virtual.reason_code)

        def over() -> bool:
            progress = robot.virtual.motion_progress(name)
            return progress["number"] == begun_as and progress["state"] in ("reached", "aborted")

        try:
            self.run_until(over, limit, f"the end of motion '{name}'")
        except BaseException:
            self.robot._halt(f"the caller of motion '{name}' has given up waiting")
            raise
        end = robot.virtual.motion_progress(name)
        return MotionResult(
            what=name,
            ok=end["state"] == "reached",
            code=end["reason_code"],
            sentence=end["reason"],
            causes=(end["error"],) if end["error"] else (),
            started=begun,
            ended=self.time,
            joints=robot.report["position"],
            palm=robot.palm(),
        )

    def push(self, force: Sequence[float], seconds: float) -> None:
        """Push the palm with a force ([3] N, base frame) from now on for ``seconds``. Time does not pass."""
        self._check()
        wrench = finite(force, "force", (3,))
        if float((wrench**2).sum()) > PUSH_LIMIT**2:
            raise ValueError(f"force: at most {PUSH_LIMIT:g} N is expected, got {force!r}")
        self._back_end.push(wrench.tolist(), self.time + number(seconds, "seconds", "s", 0.0))

    def hide(self, *frames: str) -> None:
        """The tracker does not see these frames any more: "human_hand", "object_mug"."""
        self._check()
        self.cell.blind.update(self._trackable(frames))

    def show(self, *frames: str) -> None:
        """The tracker sees these frames again."""
        self._check()
        self.cell.blind.difference_update(self._trackable(frames))

    def lose(self, to_pc: float = 0.0, from_pc: float = 0.0) -> None:
        """Share of datagrams between robot controller and computer that are lost from now on, 0 .. 1 each way."""
        self._check()
        shares = [number(each, "to_pc, from_pc", "share", -math.inf) for each in (to_pc, from_pc)]
        if not all(0.0 <= each <= 1.0 for each in shares):
            raise ValueError(f"to_pc, from_pc: shares 0 .. 1 are expected, got {to_pc!r}, {from_pc!r}")
        self.cell.cell.set_loss(*shares)

    def leave_command_mode(self, reason: str = "the robot controller left command mode") -> None:
        """The robot controller falls back to monitor mode, as after an own fault."""
        self._check()
        self.cell.cell.leave_command_mode(reason)

    def block(self, on: bool = True) -> None:
        """Hold the arm in place by force, or release it."""
        self._check()
        self.cell.cell.block(bool(on))

    def _trackable(self, frames: Sequence[str]) -> Sequence[str]:
        for frame in frames:
            if frame not in self.cell.trackers:
                raise ValueError(f"frames: one of {', '.join(self.cell.trackers)} is expected, got {frame!r}")
        return frames

    # --- trials ---

    def trial(self, *actions: str, limit: float = 60.0) -> Trial:
        """Execute actions one after the other until one fails, and record them.

        ``actions``: "receive", "give", "take", "put" or one of your own in ``settings``, such as
        ``trial("receive", "give")``. ``limit``: s of virtual time for each. The record ends when the person's hand is
        back. TimeoutError: an action does not end; the robot is stopped.
        Refused: the first action does not fit the state of the hand.
        """
        self._check()
        known = [*ACTIONS, *(own.name for own in self.virtual_trial.ctx.parts.actions)]
        if not actions:
            raise ValueError(f"actions: at least one of {', '.join(known)} is expected")
        for action in actions:
            if action not in known:
                raise ValueError(f"actions: one of {', '.join(known)} is expected, got {action!r}")
        with self.record() as recording:
            for action in actions:
                result: Exchange = self.robot.do(action, limit=limit)
                self._await_person()
                if not result.ok:
                    break
        return recording.trial

    def _await_person(self) -> None:
        end = self.time + REST_LIMIT
        while self.person.phase != "idle" and self.time < end:
            self._advance(1)

    @contextmanager
    def record(self) -> Iterator[Recording]:
        """Record the events inside the block; then ``recording.trial`` is the Trial. Example::

        with world.record() as recording:
            world.robot.receive()
        recording.trial.save("out/first")
        """
        self._check()
        if self._recording is not None:
            raise RuntimeError("this World is being recorded already: end that block first")
        assert self._trial is not None
        recording = self._recording = Recording(self._trial, self.seed, self.conditions)
        try:
            yield recording
        finally:
            self._recording = None
            recording._end()

    # --- its end ---

    def close(self) -> None:
        """Stop the arm, wait until it stands, end the machines. May be called twice; other uses are refused."""
        trial = self._trial
        if trial is None:
            return
        if os.getpid() != self._pid or threading.get_ident() != self._thread:
            self._check()
        try:
            if hasattr(self, "robot") and self._machine.is_alive():
                self.robot.close()
        except (TimeoutError, RuntimeError) as error:
            LOG.warning("the arm did not come to rest before the World was closed: %s", error)
        finally:
            try:
                self._end_machine(trial)
            finally:  # after any error of an own part, this thread may open another World
                self._trial = None
                self._stack.close()
                self._release_thread()

    def _end_machine(self, trial: VirtualTrial) -> None:
        """Preempt the machines and let time pass until they have ended."""
        trial.master.request_preempt()
        trial.clock.let_think(False)
        deadline = trial.clock.now() + START_LIMIT
        while hasattr(self, "_machine") and self._machine.is_alive() and trial.clock.now() < deadline:
            trial.period()  # a state that ends its motion waits for the arm
            trial.clock.sleep(DT)

    def __enter__(self) -> World:
        self._check()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @staticmethod
    def opened() -> World | None:
        """Returns the open World of this thread, or None. Use it to close a World without a variable."""
        with _HERE:
            there = _open_worlds.get(threading.get_ident())
        world = there() if there is not None else None
        return None if world is None or world._trial is None or world._pid != os.getpid() else world

    def _claim_thread(self) -> None:
        other = self.opened()
        if other is not None:
            raise RuntimeError(
                f"this thread has an open World (seed {other.seed}): close() it first (coglab.World.opened() returns "
                "it), or use 'with coglab.World(...)'; several at a time: coglab.trials()"
            )
        with _HERE:
            _open_worlds[self._thread] = weakref.ref(self)

    def _release_thread(self) -> None:
        with _HERE:
            there = _open_worlds.get(self._thread)
            if there is not None and there() is self:
                del _open_worlds[self._thread]

    def _check(self) -> None:
        """RuntimeError with a reason if this World cannot be used here."""
        if os.getpid() != self._pid:
            raise RuntimeError(
                "this World was opened before the process forked, and a fork does not take its threads along: open it "
                "in the child, start the child by 'spawn' or 'forkserver', or use coglab.trials()"
            )
        if self._trial is None:
            raise RuntimeError("this World is closed: open another one with the same seed")
        if threading.get_ident() != self._thread:
            raise RuntimeError("this World belongs to another thread: open one World in each thread")

    def __repr__(self) -> str:
        state = "closed" if self._trial is None else f"{self.time:.3f} s"
        return f"<coglab.World seed={self.seed} {state}>"


class _VirtualBackEnd:
    """The BackEnd of a World."""

    frame_delay = DT

    def __init__(self, world: World, trial: VirtualTrial) -> None:
        self._world, self._trial = world, trial
        self.actions: Mapping[str, str] = ACTIONS
        self._watch = StateWatch(trial.ctx, lambda state: None)
        self._frames: dict[str, Pose] = {}
        self._push_until = 0.0
        self._before = 0  # results before the last trigger
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._said = 0
        trial.ctx.journal.listen(self._on_transition)
        trial.ctx.journal.listen_results(
            lambda r: self._events.append(Event(r.ended, "result", f"{r.kind}: {r.outcome}", r.code))
        )

    @property
    def arm(self) -> ArmPort:
        return self._trial.arm

    @property
    def hand(self) -> HandPort:
        return self._trial.ctx.hand

    def check(self) -> None:
        self._world._check()

    def now(self) -> float:
        return self._world.time

    def clock(self) -> float:
        return self._world.time

    def pause(self, seconds: float) -> None:
        self._world._check()
        self._world._advance(max(1, round(seconds / DT)))

    def state(self) -> MasterState:
        return self._watch.now()

    def submit(self, action: str, object_id: str) -> TriggerReply:
        before = len(self._trial.results)
        if not object_id and action in ACTIONS.values() and not self.state().object_id:
            object_id = self._world.conditions.object_id  # the only object of this world
        answer = ask_for(self._trial.ctx, action, object_id)
        if answer.ok:
            self._before = before
            self._trial.begun.append(action)
        return answer

    def result(self, action: str) -> Exchange | None:
        for result in reversed(self._trial.results[self._before :]):
            if result.action == action:
                return exchange_of(result)
        return None

    def stop(self, reason: str) -> None:
        self._trial.ctx.stop.press(reason)
        self._trial.ctx.arm.hold(reason)

    def frame(self, name: str) -> tuple[Pose | None, float]:
        if name == "palm":
            return self._world.robot.arm.palm, 0.0
        if name in self._frames:
            return self._frames[name], 0.0
        return self._world.cell.newest(name)

    def show_frame(self, name: str, pose: Pose) -> None:
        self._frames[name] = pose
        self._set_frame(name, pose)

    def _set_frame(self, name: str, pose: Pose) -> None:
        self._world.cell.robot.virtual.set_frame(name, pose.position, pose.orientation)

    def events(self) -> list[Event]:
        events = list(self._events)
        self._events.clear()
        return events

    def push(self, force: Sequence[float], until: float) -> None:
        self._push_until = until
        self._world.cell.cell.set_push(list(force))

    def look(self) -> None:
        """After each period: show the caller's frames again, end a push, collect messages."""
        for name, pose in self._frames.items():
            self._set_frame(name, pose)
        if self._push_until and self._world.time >= self._push_until:
            self._push_until = 0.0
            self._world.cell.cell.set_push([0.0, 0.0, 0.0])
        for when, code in self._trial.said[self._said :]:
            self._events.append(Event(when, "said", say_name(code), code))
        self._said = len(self._trial.said)

    def _on_transition(self, record: TransitionRecord) -> None:
        self._events.append(
            Event(
                record.stamp,
                "transition",
                record.sentence(),
                record.code,
                record.path,
                record.from_state,
                record.outcome,
                record.to_state,
            )
        )


def exchange_of(result: TrialResult) -> Exchange:
    """Converts the result of a trial."""
    short = next((name for name, action in ACTIONS.items() if action == result.action), result.action)
    ok = result.outcome == "succeeded"
    return Exchange(
        short,
        ok,
        result.code if not ok else ReasonCode.NONE,
        result.reason,
        result.causes,
        result.started,
        result.ended,
        result.object_id,
        result.outcome,
        dict(result.marks),
    )


def say_name(code: int) -> str:
    """Name of a message to the person (coglab_msgs/Say), such as "READY_TO_GIVE"."""
    from coglab_msgs.msg import Say

    names = {value: name for name, value in vars(Say).items() if name.isupper() and isinstance(value, int)}
    return names.get(code, str(code))


def _conditions(person: str | Mapping[str, Any], object_id: str, behaviour: str, perfect: bool) -> Conditions:
    """Conditions from the short arguments of a World."""
    if behaviour not in BEHAVIOURS:
        raise ValueError(f"behaviour: one of {', '.join(BEHAVIOURS)} is expected, got {behaviour!r}")
    own: Mapping[str, Any] = {}
    profile = "drawn"
    if isinstance(person, str):
        if person not in PROFILES:
            raise ValueError(
                f"person: one of {', '.join(PROFILES)} is expected, or a dict of fields of Participant, got {person!r}"
            )
        profile = person
    elif isinstance(person, Mapping):
        known = {field.name for field in fields(Participant)} | {"profile"}
        unknown = sorted(map(str, set(person) - known))
        if unknown:
            raise ValueError(f"person: a Participant has no {', '.join(unknown)}; it has {', '.join(sorted(known))}")
        profile = str(person.get("profile", "drawn"))
        if profile not in PROFILES:
            raise ValueError(f"person: profile must be one of {', '.join(PROFILES)}, got {profile!r}")
        own = {name: value for name, value in person.items() if name != "profile"}
    else:
        raise ValueError(f"person: a profile or a dict of fields of Participant is expected, got {person!r}")
    return Conditions(behaviour, profile, own, PerceptionSettings(perfect=bool(perfect)), str(object_id))


def _check_object(object_id: str) -> None:
    known = sorted(file.stem for file in objects_folder().glob("*.yaml"))
    if object_id not in known:
        raise ValueError(f"object: one of {', '.join(known)} is expected, got {object_id!r}")
