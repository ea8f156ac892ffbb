"""Base class of all states: time limit, preemption, STOP, reasons; and containers that record these."""

from __future__ import annotations

import math
import os
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import smach
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.config import ConfigError
from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.context.journal import Failure, Wait
from coglab_smach.context.parts import built, type_name
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.motion import POLL_PERIOD, end_motion

RETOLD = 0.2  # s, smallest extension of a wait that is published again


class Interrupted(Exception):
    """A preemption (``stop=False``) or STOP has ended the wait of a state."""

    def __init__(self, stop: bool, reason: str) -> None:
        super().__init__(reason)
        self.stop = stop


class TimeLimit(PortError):
    """A time limit has run out. The sentence names the awaited event."""

    def __init__(self, sentence: str, causes: tuple[str, ...] = (), code: int = ReasonCode.TIME_LIMIT) -> None:
        super().__init__(sentence, causes, code)


class CoglabState(smach.State):
    """Leaf state. Subclasses implement ``run`` and wait only with ``wait_for``, ``await_pending`` and ``pause``.

    The outcomes always include failed and preempted. A PortError, a time limit, STOP or a programming error ends the
    state with 'failed' and a sentence in the journal. No error can leave a machine stuck.
    """

    default_time_limit = 10.0
    """s; ``time_limits.<label>`` in the configuration overrides it."""

    ignores_stop = False
    """True for states that restore safety after STOP and must run to their end."""

    owns_motion = False
    """True for states that start a motion of the arm or wait for one. If they fail, the motion ends too."""

    essential = True
    """False if a failure of this state does not fail its action. Then it is only recorded as a transition, and its wait
    is published only if no other state is active."""

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
        self._waits = False  # True during a wait

    def run(self, ud: Any) -> str:
        """Do the work; returns an outcome. ``self.reason`` may contain a sentence about it."""
        raise NotImplementedError

    def path(self) -> str:
        """Returns the introspection path of the container of this state."""
        return self.container.full_path() if self.container is not None else ""

    def execute(self, ud: Any) -> str:
        self.reason, self._deadline = "", self.ctx.clock.now() + self.time_limit()
        self.ctx.journal.entered(f"{self.path()}/{self.label}")
        try:
            outcome, failure = self._run(ud)
            if outcome not in ("failed", "preempted") and self.asked_to_end():
                # The request came after the last check. The work is done, but no further state may start.
                outcome, failure = "preempted", Failure(f"{self.label} was preempted", (), ReasonCode.PREEMPTED)
            if outcome == "preempted":
                # Only here is the request served. After a failure it stays set, and the container passes it on.
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
        """Returns the outcome of ``run`` and its sentence. Every exception becomes an outcome."""
        try:
            self.check()
            outcome = self.run(ud)
            if outcome not in self.get_registered_outcomes():  # of a user's state; the machine must go on
                known = ", ".join(self.get_registered_outcomes())
                text = f"{self.label}: run() of {type(self).__name__} returned {outcome!r}; expected one of {known}"
                return "failed", Failure(text, (), ReasonCode.UNEXPECTED)
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
                f"{self.label}: {type(error).__name__}: {error} ({os.path.basename(last.filename)}:{last.lineno})",
                (),
                ReasonCode.UNEXPECTED,
            )

    def time_limit(self) -> float:
        """Returns the longest duration of this state, s."""
        return float(self._configured_limits().get(self.label, self.default_time_limit))

    def allow(self, duration: float) -> None:
        """Set the time limit to ``duration`` s from now, unless the configuration sets one for this state."""
        if self.label not in self._configured_limits():
            self._deadline = self.ctx.clock.now() + duration

    def _configured_limits(self) -> dict[str, Any]:
        return dict(self.ctx.config.get("time_limits"))

    def left(self) -> float:
        """Returns the time left before the limit, s."""
        return self._deadline - self.ctx.clock.now()

    def asked_to_end(self) -> bool:
        """Returns whether this state or a container around it was requested to preempt.

        The upstream Concurrence takes a request and passes it to its children slightly later, in another thread.
        Nothing may start in between. In these machines, nothing follows a preempt, so the request counts for all states
        inside.
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
            raise Interrupted(True, f"STOP: {self.ctx.stop.reason}")

    def wait_for(
        self,
        condition: Callable[[], bool],
        what: str,
        limit: float | None = None,
        pace: Callable[[], float] | None = None,
        code: int = ReasonCode.WAITS_FOR_ANSWER,
        looks: bool = False,
    ) -> None:
        """Wait until ``condition()``. After ``limit`` s or at the state's own limit: TimeLimit that names ``what``.
        ``code``: a ``ReasonCode.WAITS_FOR_...``, for programs.

        ``pace`` (0..1, e.g. the speed scale): the limit counts the time of a slowed motion. The used time is multiplied
        by the pace (at least 0.1), and the state's own limit is extended accordingly.

        ``looks``: the condition only looks; it does not wait for anything itself. That saves time in simulated trials.
        """
        allowed = self.left() if limit is None else min(limit, self.left())
        left, before, told = allowed, self.ctx.clock.now(), -math.inf
        path = f"{self.path()}/{self.label}"
        # A wait inside a condition, e.g. for a sight, is published as part of the outer wait.
        within, self._waits = self._waits, True

        def over() -> bool:
            nonlocal left, before, told
            self.check()
            if condition():
                return True
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
            return False

        try:
            if looks:
                self.ctx.clock.poll(over, POLL_PERIOD)
                return
            while not over():
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
        code: int = ReasonCode.WAITS_FOR_ANSWER,
    ) -> Any:
        """Wait for the pending call and return its value. Cancel the call if the wait ends otherwise."""
        try:
            self.wait_for(pending.done, what, limit, pace, code, looks=True)
        except (Interrupted, TimeLimit):
            pending.cancel()
            raise
        return pending.result()

    def pause(self, duration: float) -> None:
        """Wait for a duration (s); preemption or STOP ends it. At the state's own limit: TimeLimit, so that loops
        around it end too."""
        clock = self.ctx.clock
        end = clock.now() + duration

        def nearly_over() -> bool:
            self.check()
            if self.left() <= 0.0:
                raise TimeLimit(f"{self.label} had to end within {self.time_limit():.1f} s, it did not")
            return end - clock.now() <= POLL_PERIOD

        if duration > 0.0:
            clock.poll(nearly_over, POLL_PERIOD)
            clock.sleep(max(0.0, end - clock.now()))


class _Placed:
    """Common part of both containers: label, place in the hierarchy, and the record of their end."""

    ctx: Context
    label: str
    container: Any | None
    targets: Mapping[str, str]
    is_action: bool
    userdata: Any

    def place(self, ctx: Context, label: str) -> None:
        """Initialise. The container has no parent until it is added to another one."""
        self.ctx, self.label, self.container, self.targets = ctx, label, None, {}
        self.is_action = False
        self.userdata.grip = Grip()  # replaced by the grip of the outer container, if it passes the key

    def begin(self, parent_ud: Any) -> Any:
        """Start of a run. An action opens its record in the journal. Returns the user data; empty if there are none."""
        ud = parent_ud if parent_ud is not None else smach.UserData()
        if self.is_action:
            self.ctx.journal.begin_action(self.label, str(ud.object_id) if "object_id" in ud else "")
        return ud

    def full_path(self) -> str:
        """Returns the introspection path of this container."""
        prefix = self.container.full_path() if self.container is not None else ""
        return f"{prefix}/{self.label}"

    def adopt(self, label: str, state: Any, transitions: Mapping[str, str]) -> None:
        """Set label, container and transitions of a child."""
        state.label, state.container, state.targets = label, self, dict(transitions)

    def own_or(self, label: str, shipped: Any) -> Any:
        """Returns the user's state for this place of the machine (``states`` in machines.yaml); without one, the
        shipped state. ConfigError if the user's state cannot stand there."""
        parts, place = self.ctx.parts, f"{self.label}/{label}"
        parts.places.add(place)
        if place not in parts.states:
            return shipped
        state = built(f"states.{place}", parts.states[place], self.ctx)
        if not isinstance(state, CoglabState | CoglabMachine | CoglabConcurrence):
            raise ConfigError(f"states.{place}: a CoglabState is expected, its function returned {type_name(state)}")
        outcomes, allowed = set(state.get_registered_outcomes()), set(shipped.get_registered_outcomes())
        if outcomes != allowed:
            raise ConfigError(
                f"states.{place}: its outcomes have to be {', '.join(sorted(allowed))}; they are "
                f"{', '.join(sorted(outcomes))}"
            )
        return state

    def record_end(self, outcome: str | None) -> None:
        """Record the container's own transition; its reason is the first failure. Close the record of an action."""
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
    """Clear all preempt requests that the children of a container have not served, at all levels."""
    for child in container.get_children().values():
        child.recall_preempt()
        if isinstance(child, smach.Container):
            withdraw_requests(child)


class CoglabMachine(_Placed, smach.StateMachine):
    """A state machine of labelled states that records its end."""

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
        """Add a state inside ``with machine:``. An outcome without a transition must be an outcome of the machine."""
        state = self.own_or(label, state)
        smach.StateMachine.add(label, state, transitions=dict(transitions), remapping=dict(remapping or {}))
        self.adopt(label, state, transitions)
        return state

    def execute(self, parent_ud: Any = None) -> str | None:
        outcome = smach.StateMachine.execute(self, self.begin(parent_ud))
        self.record_end(outcome)
        return outcome


class CoglabConcurrence(_Placed, smach.Concurrence):
    """Children that run in parallel. ``decide(outcomes)`` is called at the end of each child. If it returns True, the
    other children are preempted."""

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
        state = self.own_or(label, state)
        smach.Concurrence.add(label, state, remapping=dict(remapping or {}))
        self.adopt(label, state, {})
        return state

    def execute(self, parent_ud: Any = None) -> str:
        outcome = smach.Concurrence.execute(self, self.begin(parent_ud))
        # A child that fails while it is preempted leaves the request set. In the upstream engine, this would end the
        # next run of that child. A request to this container from outside remains.
        withdraw_requests(self)
        self.record_end(outcome)
        return outcome


def require_all(essential: Sequence[str]) -> tuple[Callable[..., bool], Callable[..., str]]:
    """Rule for a concurrence: it succeeds when all essential children have succeeded. The first failure ends the
    others.

    Other children run until the essential ones have ended. Returns (decide, conclude).
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
