"""A container that runs one state repeatedly, once per item."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import smach
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError, InvalidUserCodeError
from smach.ordered_set import names
from smach.state import State
from smach.user_data import UserData


class Iterator(Container):
    """Runs the contained state for each item of `it`: an iterable, or a function that returns one.

    The item is stored in the user data under `it_label`. The state receives the iterator's user data
    directly, without key checks.

    Example::

        each = smach.Iterator(outcomes=["done", "failed"], input_keys=[], output_keys=[],
                              it=lambda: range(3), it_label="index", exhausted_outcome="done")
        with each:
            smach.Iterator.set_contained_state("TRY", Try(), loop_outcomes=["ok"],
                                               final_outcome_map={"bad": "failed"})
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str],
        output_keys: Iterable[str],
        it: Iterable | Callable[[], Iterable] = (),
        it_label: str = "it_data",
        exhausted_outcome: str = "exhausted",
    ) -> None:
        super().__init__((*names("outcomes", outcomes), exhausted_outcome), input_keys, output_keys)
        self._items = it
        self._items_label = it_label
        self._exhausted_outcome = exhausted_outcome
        self._label: str | None = None
        self._state: State | None = None
        self._loop_outcomes: tuple[str, ...] = ()
        self._break_outcomes: tuple[str, ...] = ()
        self._final_outcome_map: dict[str, str] = {}
        self._executing = False  # True while the contained state executes

    # Construction.

    @staticmethod
    def set_contained_state(
        label: str,
        state: State,
        loop_outcomes: Iterable[str] = (),
        break_outcomes: Iterable[str] = (),
        final_outcome_map: Mapping[str, str] | None = None,
    ) -> State:
        """Set the state of the open iterator and return it.

        With `break_outcomes` these outcomes end the iteration and all others continue with the next
        item. With `loop_outcomes` alone these continue and all others end it. With neither it ends after
        the first item. `final_outcome_map` maps the last outcome of the state to that of the iterator.
        Example: see the class.
        """
        iterator = Iterator._currently_opened()
        iterator._check_new_child(label, state, [iterator._label] if iterator._label is not None else [])
        outcomes = state.get_registered_outcomes()
        breaks, loops = (
            names("break_outcomes", break_outcomes),
            names("loop_outcomes", loop_outcomes),
        )
        if breaks:
            loops = tuple(outcome for outcome in outcomes if outcome not in breaks)
        else:
            breaks = tuple(outcome for outcome in outcomes if outcome not in loops)
        iterator._label, iterator._state = label, state
        iterator._loop_outcomes, iterator._break_outcomes = loops, breaks
        iterator._final_outcome_map = dict(final_outcome_map or {})
        return state

    @staticmethod
    def set_iteritems(it: Iterable | Callable[[], Iterable], it_label: str = "it_data") -> None:
        """Set the items of the open iterator.

        Example: `Iterator.set_iteritems([1, 2, 3], "number")`.
        """
        iterator = Iterator._currently_opened()
        iterator._items, iterator._items_label = it, it_label

    # Looking inside.

    def __getitem__(self, key: str) -> State:
        if self._state is None or key != self._label:
            raise KeyError(f"no state {key!r} in this iterator; its label: {self._label!r}")
        return self._state

    def get_children(self) -> dict[str, State]:
        """The contained state under its label. Example: `each.get_children()`."""
        return {self._label: self._state} if self._label is not None and self._state is not None else {}

    def get_initial_states(self) -> list[str]:
        """The label of the contained state, as a list. Example: `each.get_initial_states()`."""
        return list(self.get_children())

    def set_initial_state(self, initial_states: Sequence[str], userdata: UserData | None = None) -> None:
        """Merge `userdata`. The contained state is the only initial state.

        Example: `each.set_initial_state([], ud)`.
        """
        if any(label != self._label for label in initial_states):
            smach.logwarn(f"an iterator begins with its only state {self._label!r}, not with {list(initial_states)}")
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """`[label]` while the iterator runs, else []. Example: `each.get_active_states()`."""
        return self.get_initial_states() if self._is_running else []

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Edges of loop outcomes back to the state, and of the other outcomes out of the iterator.

        Example: see the name.
        """
        if self._label is None:
            return []
        return [(outcome, self._label, self._label) for outcome in self._loop_outcomes] + [
            (outcome, self._label, self._final_outcome_map.get(outcome)) for outcome in self._break_outcomes
        ]

    def check_consistency(self) -> None:
        """Raise InvalidStateError without a contained state, InvalidTransitionError for unknown outcomes.

        Example: `each.check_consistency()`.
        """
        if self._state is None:
            raise InvalidStateError("iterator has no contained state; call Iterator.set_contained_state inside 'with'")
        known = self._state.get_registered_outcomes()
        unknown = [
            outcome
            for outcome in (*self._loop_outcomes, *self._break_outcomes, *self._final_outcome_map)
            if outcome not in known
        ]
        wrong = [outcome for outcome in self._final_outcome_map.values() if outcome not in self._outcomes]
        if unknown or wrong:
            raise InvalidTransitionError(
                f"iterator over {self._label!r}: {unknown} are not among the state's outcomes "
                f"{list(known)}, and "
                f"{wrong} of final_outcome_map not among the iterator's {list(self._outcomes)}"
            )

    # Running.

    def execute(self, parent_ud: Any = None) -> str | None:
        """Run the state for each item. Return the mapped last outcome or the exhausted outcome; None at shutdown.

        Raises InvalidStateError without a contained state, InvalidUserCodeError if the state or the
        function that returns the items raises, InvalidTransitionError for an outcome that the state has
        not registered. Example: `outcome = each.execute()`.
        """
        if self._state is None:
            raise InvalidStateError("iterator not executed: it has no contained state")
        with self._run() as result:
            result["outcome"] = self._execute(parent_ud)
            return result["outcome"]

    def _execute(self, parent_ud: Any) -> str | None:
        self._copy_input_keys(parent_ud, self._input_keys)
        self.call_start_cbs()
        smach.loginfo(f"Iterator starting over '{self._items_label}' with state '{self._label}'")
        items = self._begin()
        result = self._exhausted_outcome
        while True:
            if smach.is_shutdown():
                return None
            try:
                item = next(items)
            except StopIteration:
                break
            except Exception:
                smach.logerr(
                    f"the items of the iterator over '{self._label}' ended with an error; they count "
                    "as exhausted:"
                    f"\n{traceback.format_exc()}"
                )
                break
            self.userdata[self._items_label] = item
            outcome, asked = self._execute_state()
            if outcome is None:
                return None
            if asked or outcome in self._break_outcomes:
                result = self._final_outcome_map.get(outcome, outcome)
                if asked and result not in self._outcomes:
                    # A loop outcome that was interrupted by a preempt request is not an outcome of the iterator.
                    result = "preempted" if "preempted" in self._outcomes else self._exhausted_outcome
                break
            self.call_transition_cbs()
        self._copy_output_keys(parent_ud, self._output_keys)
        smach.loginfo(f"Iterator ending with '{result}'")
        self.call_termination_cbs(self._label, result)
        return result

    def _begin(self) -> Any:
        try:
            return iter(self._items() if callable(self._items) else self._items)
        except Exception as error:
            raise InvalidUserCodeError(
                f"the items of the iterator over '{self._label}' could not be obtained: "
                f"{type(error).__name__}: {error}\n{traceback.format_exc()}"
            ) from error

    def _execute_state(self) -> tuple[str | None, bool]:
        """Outcome of the state for the current item, and True if the iterator was requested to end."""
        label, state = str(self._label), self._state
        assert state is not None
        with self._preempt_lock:
            self._executing = True
            if self._preempt_requested:
                self._forward_preempt()
        try:
            outcome = state.execute(self.userdata)
        except InvalidUserCodeError:
            smach.logerr(f"... in state '{label}' ({type(state).__name__}) of an iterator")
            raise
        except Exception as error:
            raise InvalidUserCodeError(
                f"state '{label}' ({type(state).__name__}) of an iterator raised "
                f"{type(error).__name__}: {error}\n{traceback.format_exc()}"
            ) from error
        finally:
            with self._preempt_lock:
                self._executing = False
                self._take_back(label, state)
                asked = self._preempt_requested
                self._preempt_requested = False
        if outcome is None and smach.is_shutdown():
            return None, asked  # an inner container that stopped because of the same shutdown
        if outcome not in state.get_registered_outcomes():
            raise InvalidTransitionError(
                f"state '{label}' ({type(state).__name__}) of an iterator returned {outcome!r}, "
                f"which is not among its outcomes {list(state.get_registered_outcomes())}"
            )
        return outcome, asked

    def _forward_preempt(self) -> None:
        if self._executing and self._state is not None:
            self._tell(str(self._label), self._state)
