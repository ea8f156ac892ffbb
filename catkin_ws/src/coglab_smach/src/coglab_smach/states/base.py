"""The state every other one derives from: time limit, preemption, STOP, reasons; and containers that record them."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import smach
from coglab_msgs.msg import ReasonCode

from coglab_smach.context import wait_reasons
from coglab_smach.context.config import ConfigError
from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.context.journal import Failure, Wait
from coglab_smach.context.requests import command
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.motion import end_motion

POLL_PERIOD = 0.01  # s between two looks at a condition: well below the 60 ms in which a contact has to be found

RETOLD = 0.2  # s by which the end of a wait that is put off moves until it is told again


class Interrupted(Exception):
    """The wait of a state was ended from outside: by preemption (``stop=False``) or by STOP."""

    def __init__(self, stop: bool, reason: str) -> None:
        super().__init__(reason)
        self.stop = stop


class TimeLimit(PortError):
    """A state's time limit ran out; the sentence says what it waited for."""

    def __init__(self, sentence: str, causes: tuple[str, ...] = (), code: int = ReasonCode.TIME_LIMIT) -> None:
        super().__init__(sentence, causes, code)


class CoglabState(smach.State):
    """Leaf state. Subclasses implement ``run`` and wait only through ``wait_for``, ``await_pending`` and ``pause``.

    Outcomes always include failed and preempted. A PortError, a limit, STOP or a programming error ends the state with
    'failed' and leaves its sentence in the journal, so that no error can leave a machine stuck.
    """

    default_time_limit = 10.0
    """s; the configuration's ``time_limits.<label>`` wins."""

    ignores_stop = False
    """True for states that make things safe after STOP and must run to their end."""

    owns_motion = False
    """True for states that start a motion of the arm or wait for one: it has ended when they end without success."""

    essential = True
    """False where a failure of this state is no failure of its action: it is recorded as a transition alone, and what
    it waits for is told only where nothing else is done."""

    def __init__(
        self,
        ctx: Context,
        outcomes: Iterable[str] = ("succeeded",),
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        io_keys: Sequence[str] = (),
    ) -> None:
        every = list(dict.fromkeys([*outcomes, "failed", "preempted"]))
        super().__init__(
            outcomes=every, input_keys=list(input_keys), output_keys=list(output_keys), io_keys=list(io_keys)
        )
        self.ctx = ctx
        self.label = type(self).__name__
        self.container: Any | None = None
        self.targets: Mapping[str, str] = {}
        self.reason = ""
        self._deadline = 0.0
        self._waits = False  # a wait is under way

    def run(self, ud: Any) -> str:
        """Do the work; returns an outcome. ``self.reason`` may hold a sentence for it."""
        raise NotImplementedError

    def path(self) -> str:
        """Introspection path of the container this state is in."""
        return self.container.full_path() if self.container is not None else ""

    def execute(self, ud: Any) -> str:
        self.reason, self._deadline = "", self.ctx.clock.now() + self.time_limit()
        self.ctx.journal.entered(f"{self.path()}/{self.label}")
        try:
            outcome, failure = self._run(ud)
            if outcome not in ("failed", "preempted") and self.asked_to_end():
                # Asked for after the last look: the work is done, but nothing may follow it.
                outcome, failure = "preempted", Failure(f"{self.label} was preempted", (), ReasonCode.PREEMPTED)
            if outcome == "preempted":
                # Served here alone. A request that a failure has overtaken stays up, and the container passes it on.
                self.service_preempt()
            if self.owns_motion and outcome in ("failed", "preempted"):
                trouble = end_motion(self.ctx, failure.sentence)
                if trouble:
                    failure = Failure(f"{failure.sentence}; {trouble}", failure.causes, failure.code)
            if outcome == "failed" and self.essential:
                self.ctx.journal.failure(failure.sentence, failure.causes, failure.code)
            self.ctx.journal.transition(
                self.path(),
                self.label,
                outcome,
                self.targets.get(outcome) or outcome,
                failure.sentence,
                failure.causes,
                failure.code,
            )
        finally:
            self.ctx.journal.left(f"{self.path()}/{self.label}")
        return outcome

    def _run(self, ud: Any) -> tuple[str, Failure]:
        """Outcome of ``run`` and the sentence for it: whatever it raises becomes one."""
        try:
            self.check()
            outcome = self.run(ud)
            return outcome, Failure(self.reason or (f"{self.label} failed" if outcome == "failed" else ""))
        except Interrupted as interrupt:
            code = ReasonCode.STOP_LATCHED if interrupt.stop else ReasonCode.PREEMPTED
            return ("failed" if interrupt.stop else "preempted"), Failure(str(interrupt), (), code)
        except PortError as error:
            return "failed", Failure(f"{self.label}: {error.sentence}", error.causes, error.code)
        except (ConfigError, smach.InvalidUserCodeError) as error:
            return "failed", Failure(f"{self.label}: {error}", (), ReasonCode.BAD_FILE)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            smach.logerr(traceback.format_exc())
            return "failed", Failure(
                f"{self.label}: {type(error).__name__}: {error} ({last.name}:{last.lineno})", (), ReasonCode.UNEXPECTED
            )

    def time_limit(self) -> float:
        """Longest duration of this state, s."""
        return float(self._configured_limits().get(self.label, self.default_time_limit))

    def allow(self, duration: float) -> None:
        """From now on this state may take ``duration`` s, unless the configuration gives it a limit of its own."""
        if self.label not in self._configured_limits():
            self._deadline = self.ctx.clock.now() + duration

    def _configured_limits(self) -> dict[str, Any]:
        return dict(self.ctx.config.get("time_limits"))

    def left(self) -> float:
        """Time left before the limit, s."""
        return self._deadline - self.ctx.clock.now()

    def asked_to_end(self) -> bool:
        """Whether a preempt was requested of this state or of a container around it.

        Upstream's Concurrence takes a request and passes it to its children a moment later, in another thread. Nothing
        may begin in between; and nothing in these machines follows upon a preempt, so that the request stands for all.
        """
        asked: Any | None = self
        while asked is not None and not asked.preempt_requested():
            asked = asked.container
        return asked is not None

    def check(self) -> None:
        """Raise Interrupted if this state was preempted or STOP is latched."""
        if self.asked_to_end():
            raise Interrupted(False, f"{self.label} was preempted")
        if self.ctx.stop.pressed() and not self.ignores_stop:
            raise Interrupted(True, f"STOP: {self.ctx.stop.reason}; to go on {command('reset')}")

    def wait_for(
        self,
        condition: Callable[[], bool],
        what: str,
        limit: float | None = None,
        pace: Callable[[], float] | None = None,
        code: int = wait_reasons.ANSWER,
    ) -> None:
        """Wait until ``condition()``; TimeLimit naming ``what`` after ``limit`` s or at the end of the
        state's own limit. ``code`` of ``wait_reasons`` tells programs what it is.

        With ``pace`` (0..1, such as the speed scale) the limit counts in the time of a motion: it is used up so much
        slower, down to a tenth, and the state's own limit is put off likewise.
        """
        allowed = self.left() if limit is None else min(limit, self.left())
        left, before, told = allowed, self.ctx.clock.now(), -math.inf
        path = f"{self.path()}/{self.label}"
        # What a condition waits for itself, such as a sight, belongs to the wait that is told.
        within, self._waits = self._waits, True
        try:
            while True:
                self.check()
                if condition():
                    return
                now = self.ctx.clock.now()
                used = (now - before) * (min(1.0, max(0.1, pace())) if pace is not None else 1.0)
                left -= used
                self._deadline += now - before - used
                before = now
                if left <= 0.0:
                    raise TimeLimit(f"{what} within {max(0.0, allowed):.1f} s expected, it did not happen")
                if not within and now + left > told + RETOLD:
                    told = now + left
                    self.ctx.journal.waits(path, Wait(what, told, code, aside=not self.essential))
                self.ctx.clock.sleep(POLL_PERIOD)
        finally:
            self._waits = within
            if told > -math.inf:
                self.ctx.journal.waits(path, None)

    def await_pending(
        self,
        pending: Pending,
        what: str,
        limit: float | None = None,
        pace: Callable[[], float] | None = None,
        code: int = wait_reasons.ANSWER,
    ) -> Any:
        """The pending call's value; cancelled if the wait ends otherwise."""
        try:
            self.wait_for(pending.done, what, limit, pace, code)
        except (Interrupted, TimeLimit):
            pending.cancel()
            raise
        return pending.result()

    def pause(self, duration: float) -> None:
        """Wait for a duration, ended early by preemption or STOP. TimeLimit at the end of the state's own limit, so
        that what loops around it ends, too."""
        end = self.ctx.clock.now() + duration
        while self.ctx.clock.now() < end:
            self.check()
            if self.left() <= 0.0:
                raise TimeLimit(f"{self.label} had to end within {self.time_limit():.1f} s, it did not")
            self.ctx.clock.sleep(min(POLL_PERIOD, end - self.ctx.clock.now()))


class _Placed:
    """What both containers share: label, place in the hierarchy, and the record of how they ended."""

    ctx: Context
    label: str
    container: Any | None
    targets: Mapping[str, str]
    is_action: bool
    userdata: Any

    def place(self, ctx: Context, label: str) -> None:
        """Set the name until the container is added to another one."""
        self.ctx, self.label, self.container, self.targets = ctx, label, None, {}
        self.is_action = False
        self.userdata.grip = Grip()  # that of the container around it, where it has the key

    def begin(self, parent_ud: Any) -> Any:
        """Start of a run: an action opens its record in the journal. Returns user data, empty where none is given."""
        ud = parent_ud if parent_ud is not None else smach.UserData()
        if self.is_action:
            self.ctx.journal.begin_action(self.label, str(ud.object_id) if "object_id" in ud else "")
        return ud

    def full_path(self) -> str:
        """Introspection path of this container."""
        prefix = self.container.full_path() if self.container is not None else ""
        return f"{prefix}/{self.label}"

    def adopt(self, label: str, state: Any, transitions: Mapping[str, str]) -> None:
        """Tell a child where it is."""
        state.label, state.container, state.targets = label, self, dict(transitions)

    def record_end(self, outcome: str | None) -> None:
        """Record the container's own transition with the first failure as its reason; close the record of an action."""
        if outcome is None:
            return
        failure = self.ctx.journal.first_failure() if outcome != "succeeded" else Failure()
        if self.container is not None:
            self.ctx.journal.transition(
                self.container.full_path(),
                self.label,
                outcome,
                self.targets.get(outcome) or outcome,
                failure.sentence,
                failure.causes,
                failure.code,
            )
        if self.is_action:
            self.ctx.journal.end_action(outcome)


def withdraw_requests(container: Any) -> None:
    """Clear what preempts were requested of the children of a container, all the way down, and not served."""
    for child in container.get_children().values():
        child.recall_preempt()
        if isinstance(child, smach.Container):
            withdraw_requests(child)


class CoglabMachine(_Placed, smach.StateMachine):
    """A state machine of labelled states that records how it ended."""

    def __init__(
        self,
        ctx: Context,
        label: str,
        outcomes: Sequence[str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        io_keys: Sequence[str] = (),
    ) -> None:
        smach.StateMachine.__init__(
            self, outcomes=list(outcomes), input_keys=[*input_keys, *io_keys], output_keys=[*output_keys, *io_keys]
        )
        self.place(ctx, label)

    def add_state(
        self, label: str, state: Any, transitions: Mapping[str, str], remapping: Mapping[str, str] | None = None
    ) -> Any:
        """Add a state inside ``with machine:``; outcomes left out of ``transitions`` are outcomes of the machine."""
        smach.StateMachine.add(label, state, transitions=dict(transitions), remapping=dict(remapping or {}))
        self.adopt(label, state, transitions)
        return state

    def execute(self, parent_ud: Any = None) -> str | None:
        outcome = smach.StateMachine.execute(self, self.begin(parent_ud))
        self.record_end(outcome)
        return outcome


class CoglabConcurrence(_Placed, smach.Concurrence):
    """Children side by side. ``decide(outcomes)`` is asked after each child's end: True preempts those still
    running."""

    def __init__(
        self,
        ctx: Context,
        label: str,
        outcomes: Sequence[str],
        default_outcome: str,
        decide: Callable[[Mapping[str, str | None]], bool],
        conclude: Callable[[Mapping[str, str]], str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        io_keys: Sequence[str] = (),
    ) -> None:
        smach.Concurrence.__init__(
            self,
            outcomes=list(outcomes),
            default_outcome=default_outcome,
            input_keys=[*input_keys, *io_keys],
            output_keys=[*output_keys, *io_keys],
            outcome_cb=conclude,
            child_termination_cb=decide,
        )
        self.place(ctx, label)

    def add_state(self, label: str, state: Any, remapping: Mapping[str, str] | None = None) -> Any:
        """Add a child inside ``with concurrence:``."""
        smach.Concurrence.add(label, state, remapping=dict(remapping or {}))
        self.adopt(label, state, {})
        return state

    def execute(self, parent_ud: Any = None) -> str:
        outcome = smach.Concurrence.execute(self, self.begin(parent_ud))
        # A child that fails while its siblings' end is asked of it leaves the request standing. In upstream's engine it
        # would end the next run of that child. What was asked of this container from above stays with it.
        withdraw_requests(self)
        self.record_end(outcome)
        return outcome


def require_all(essential: Sequence[str]) -> tuple[Callable[..., bool], Callable[..., str]]:
    """Rule for a concurrence: it succeeds when all essential children have; the first failure ends the others.

    Children that are not essential run until the essential ones have ended. Returns (decide, conclude).
    """

    def decide(outcomes: Mapping[str, str | None]) -> bool:
        ended = [outcomes[name] for name in essential if outcomes[name] is not None]
        return any(outcome != "succeeded" for outcome in ended) or len(ended) == len(essential)

    def conclude(outcomes: Mapping[str, str]) -> str:
        results = [outcomes[name] for name in essential]
        if all(result == "succeeded" for result in results):
            return "succeeded"
        return "failed" if "failed" in results else "preempted"

    return decide, conclude
