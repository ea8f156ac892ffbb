"""A container whose children run at the same time, each in its thread."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import smach
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError, InvalidUserCodeError
from smach.state import State
from smach.user_data import Remapper, UserData

Outcomes = dict[str, Any]

#: Interval (s) at which `smach.is_shutdown()` is checked while children run.
SHUTDOWN_POLL = 0.2


class Concurrence(Container):
    """A container that starts all of its states together and ends when all of them have ended.

    `outcome_map` is {outcome: {label: child's outcome}}. An entry matches if all of its conditions
    hold; the matching entry with most conditions determines the outcome. Before that,
    `outcome_cb({label: outcome})` determines the outcome if it returns a string. If neither applies,
    the outcome is `default_outcome`. `child_termination_cb({label: outcome or None})` is called after
    the end of each child; if it returns a true value, the running children are preempted.

    The outcome of a preempted concurrence is 'preempted', unless a child ignored the request. Register
    this outcome.

    Example::

        both = smach.Concurrence(outcomes=["done", "failed", "preempted"], default_outcome="failed",
                                 outcome_map={"done": {"MOVE": "ok", "WATCH": "ok"}},
                                 child_termination_cb=lambda outcomes: True)
        with both:
            smach.Concurrence.add("MOVE", Move())
            smach.Concurrence.add("WATCH", Watch())
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        default_outcome: str,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcome_map: Mapping[str, Mapping[str, str]] | None = None,
        outcome_cb: Callable[[Outcomes], str | None] | None = None,
        child_termination_cb: Callable[[Outcomes], Any] | None = None,
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        if not isinstance(default_outcome, str) or default_outcome not in self._outcomes:
            raise InvalidStateError(
                f"Concurrence: default_outcome {default_outcome!r} is not among its outcomes {list(self._outcomes)}"
            )
        for outcome in outcome_map or {}:
            if outcome not in self._outcomes:
                raise InvalidStateError(
                    f"Concurrence: outcome_map has {outcome!r}, which is not among its outcomes {list(self._outcomes)}"
                )
        for what, cb in (
            ("outcome_cb", outcome_cb),
            ("child_termination_cb", child_termination_cb),
        ):
            if cb and not callable(cb):
                raise InvalidStateError(f"Concurrence: {what} must be callable, got {type(cb).__name__}")
        self._states: dict[str, State] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._default_outcome = default_outcome
        self._outcome_map = {outcome: dict(conditions) for outcome, conditions in (outcome_map or {}).items()}
        self._outcome_cb = outcome_cb
        self._child_termination_cb = child_termination_cb
        self._callback_lock = threading.Lock()
        self._child_outcomes: Outcomes = {}
        self._live: dict[str, None] = {}  # children of this run that have not ended
        self._told: set[str] = set()  # children that received the container's preempt request
        self._ignored: set[str] = set()  # children that did not accept it, or ended without serving it
        self._errors: list[Exception] = []
        self._pending = 0  # threads that have not ended
        self._abandoned = False  # a thread could not be started: no child may begin

    def __setstate__(self, state: dict) -> None:
        super().__setstate__(state)
        self._callback_lock = threading.Lock()

    # Construction.

    @staticmethod
    def add(label: str, state: State, remapping: Mapping[str, str] | None = None) -> State:
        """Add a child to the open concurrence and return it; `remapping` is {its key: the container's key}.

        Raises InvalidStateError if the label exists. Example: `Concurrence.add("WATCH", Watch())`.
        """
        concurrence = Concurrence._currently_opened()
        concurrence._check_new_child(label, state, concurrence._states)
        concurrence._states[label] = state
        concurrence._remappings[label] = dict(remapping or {})
        return state

    # Looking inside.

    def __getitem__(self, key: str) -> State:
        try:
            return self._states[key]
        except KeyError:
            raise KeyError(
                f"no state {key!r} in this concurrence; labels: {', '.join(self._states) or 'none'}"
            ) from None

    def get_children(self) -> dict[str, State]:
        """The children by label, in the order of addition. Example: `both.get_children()`."""
        return dict(self._states)

    def get_initial_states(self) -> list[str]:
        """All labels. Example: `both.get_initial_states()`."""
        return list(self._states)

    def set_initial_state(self, initial_states: Sequence[str], userdata: UserData | None = None) -> None:
        """Merge `userdata`. Every run begins with all children, so other labels only cause a warning.

        Example: `both.set_initial_state([], userdata)`.
        """
        if len(initial_states) > 0 and set(initial_states) != set(self._states):
            smach.logwarn(
                f"a concurrence begins with all its children {list(self._states)}, not only with {list(initial_states)}"
            )
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """Labels of the children that have not ended; [] when idle.

        Example: `both.get_active_states()`.
        """
        with self._preempt_lock:
            return list(self._live)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """The outcome map as (child's outcome, label, container's outcome).

        Example: `both.get_internal_edges()`.
        """
        return [
            (child_outcome, label, outcome)
            for outcome, conditions in self._outcome_map.items()
            for label, child_outcome in conditions.items()
        ]

    def check_consistency(self) -> None:
        """Raise InvalidTransitionError if the outcome map names unknown labels or child outcomes.

        Example: `both.check_consistency()`.
        """
        faults = []
        for child_outcome, label, outcome in self.get_internal_edges():
            if label not in self._states:
                faults.append(f"{outcome!r} depends on {label!r}, which is not among its labels {list(self._states)}")
            elif child_outcome not in self._states[label].get_registered_outcomes():
                faults.append(
                    f"{outcome!r} depends on outcome {child_outcome!r} of {label!r}, which has "
                    "only "
                    f"{list(self._states[label].get_registered_outcomes())}"
                )
        if faults:
            raise InvalidTransitionError(f"outcome_map of the concurrence is wrong: {'; '.join(faults)}")

    # Running.

    def execute(self, parent_ud: Any = None) -> str:
        """Run all children to their ends and return the outcome.

        Raises InvalidStateError without children, or if a child raises or returns an unregistered outcome
        (after the other children were preempted and have ended); InvalidUserCodeError if a callback
        raises; InvalidTransitionError if the outcome map is wrong. Example: `outcome = both.execute()`.
        """
        if not self._states:
            raise InvalidStateError("concurrence not executed: it has no children; add at least one")
        self.check_consistency()
        with self._run() as result:
            try:
                result["outcome"] = self._execute(parent_ud)
            finally:
                self._live = {}
            return result["outcome"]

    def _execute(self, parent_ud: Any) -> str:
        smach.loginfo(f"Concurrence starting with children {list(self._states)}")
        self._copy_input_keys(parent_ud, self._input_keys)
        with self._preempt_lock:
            self._child_outcomes = dict.fromkeys(self._states)
            self._told, self._ignored, self._errors, self._abandoned = set(), set(), [], False
            self._live = dict.fromkeys(self._states)
        self.call_start_cbs()
        self._run_children()
        if self._errors:
            raise self._errors[0]
        outcome = self._choose_outcome()
        smach.loginfo(f"Concurrence ending with '{outcome}', children {self._child_outcomes}")
        self.call_termination_cbs(list(self._states), outcome)
        self._copy_output_keys(parent_ud, self._output_keys)
        return outcome

    def _run_children(self) -> None:
        released, all_ended = threading.Event(), threading.Event()
        with self._preempt_lock:
            if self._preempt_requested:  # requested before the start: each child sees it when it begins
                self._forward_preempt()
        threads = []
        for label in self._states:
            thread = threading.Thread(
                target=self._run_child,
                args=(label, released, all_ended),
                name=f"concurrent_split:{label}",
            )
            try:
                thread.start()
            except RuntimeError as error:  # the system cannot create more threads
                with self._preempt_lock:
                    self._abandoned = True
                    self._errors.append(
                        _error(
                            InvalidStateError,
                            f"thread of concurrent state '{label}' did not start: {error}",
                            error,
                        )
                    )
                break
            threads.append(thread)
        self._pending = len(threads)
        if not threads:
            all_ended.set()
        released.set()
        try:
            self._await_children(all_ended)
        except BaseException:  # Ctrl-C in the main thread: end the children, too
            self._preempt_children()
            self._await_children(all_ended)
            raise
        finally:
            for thread in threads:
                thread.join()

    def _await_children(self, all_ended: threading.Event) -> None:
        logged = False
        while not all_ended.wait(SHUTDOWN_POLL):
            if not logged and smach.is_shutdown():
                logged = True
                self._preempt_children()

    def _run_child(self, label: str, released: threading.Event, all_ended: threading.Event) -> None:
        state = self._states[label]
        outcome, error, stop = None, None, False
        released.wait()
        try:
            if not self._abandoned:
                self.call_transition_cbs()
                outcome, error = self._execute_child(label, state)
            with self._preempt_lock:
                self._live.pop(label, None)
                self._child_outcomes[label] = outcome
                if self._take_back(label, state) and label in self._told:
                    self._ignored.add(label)
                    smach.logwarn(
                        f"concurrent state '{label}' was requested to end early but did not serve the request"
                    )
            self.call_transition_cbs()
            if error is None and self._child_termination_cb and not self._abandoned:
                stop, error = self._ask_termination_cb(label)
            if error is not None:
                with self._preempt_lock:
                    self._errors.append(error)
            if stop or error is not None:
                self._preempt_children()
        finally:
            with self._preempt_lock:
                self._live.pop(label, None)
                self._pending -= 1
                last = self._pending == 0
            if last:
                all_ended.set()

    def _execute_child(self, label: str, state: State) -> tuple[Any, Exception | None]:
        """The child's outcome, or the error with which the container must end."""
        ud = Remapper(
            self.userdata,
            state.get_registered_input_keys(),
            state.get_registered_output_keys(),
            self._remappings[label],
        )
        kind = type(state).__name__
        try:
            outcome = state.execute(ud)
        except BaseException as error:
            traceback.print_exc()
            return None, _error(
                InvalidStateError,
                f"concurrent state '{label}' ({kind}) raised {type(error).__name__}: {error}\n{traceback.format_exc()}",
                error,
            )
        registered = state.get_registered_outcomes()
        if outcome is None and smach.is_shutdown():
            return None, None  # an inner container that stopped because of the same shutdown
        if outcome not in registered:
            return None, _error(
                InvalidStateError,
                f"concurrent state '{label}' ({kind}) returned {outcome!r}, which is "
                f"not among its outcomes {list(registered)}; does every path of its execute() "
                "return?",
            )
        return outcome, None

    def _ask_termination_cb(self, label: str) -> tuple[bool, Exception | None]:
        try:
            with self._callback_lock:
                return bool(self._child_termination_cb(self._child_outcomes)), None  # type: ignore[misc]
        except Exception as error:
            return True, _error(
                InvalidUserCodeError,
                f"child_termination_cb raised after the end of '{label}': "
                f"{type(error).__name__}: {error}\n{traceback.format_exc()}",
                error,
            )

    def _choose_outcome(self) -> str:
        with self._preempt_lock:
            # Also valid for a request after the last child's end: no child is left that could ignore it.
            if self._preempt_requested and not self._ignored:
                self._preempt_requested = False
                return "preempted"
        if self._outcome_cb:
            try:
                outcome = self._outcome_cb(dict(self._child_outcomes))
            except Exception as error:
                raise InvalidUserCodeError(
                    f"outcome_cb of the concurrence raised {type(error).__name__}: {error}\n{traceback.format_exc()}"
                ) from error
            if isinstance(outcome, str) and outcome:
                return outcome
            if outcome:
                smach.logerr(
                    f"outcome_cb of the concurrence returned {outcome!r}; expected one of "
                    f"{list(self._outcomes)} or None; ignored"
                )
        satisfied = [
            (len(conditions), outcome)
            for outcome, conditions in self._outcome_map.items()
            if all(self._child_outcomes[label] == wanted for label, wanted in conditions.items())
        ]
        if satisfied:
            return max(satisfied, key=lambda entry: entry[0])[1]  # among equals the first declared
        return self._default_outcome

    # Preemption.

    def _forward_preempt(self) -> None:
        for label in self._live:
            (self._told if self._tell(label, self._states[label]) else self._ignored).add(label)

    def _preempt_children(self) -> None:
        """Request the running children to end, without a request to the container itself."""
        with self._preempt_lock:
            for label in self._live:
                self._tell(label, self._states[label])


def _error(kind: type[smach.exceptions.SmachError], message: str, cause: BaseException | None = None) -> Exception:
    error = kind(message)
    error.__cause__ = cause
    return error
