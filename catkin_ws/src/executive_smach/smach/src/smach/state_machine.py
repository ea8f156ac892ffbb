"""A container whose children run one after another; each outcome leads to the next child."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import smach
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError, InvalidUserCodeError
from smach.state import State
from smach.user_data import Remapper, UserData


class StateMachine(Container):
    """States and the transitions between them.

    A transition leads to the label of a sibling or to an outcome of the machine. If it is None or
    missing, the state's outcome is the machine's outcome. The first state added is the initial state.

    Example::

        machine = smach.StateMachine(outcomes=["done", "failed"])
        with machine:
            smach.StateMachine.add("LOOK", Look(), transitions={"found": "GRASP", "lost": "failed"})
            smach.StateMachine.add("GRASP", Grasp(), transitions={"ok": "done", "slipped": "LOOK"})
        outcome = machine.execute()
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self._states: dict[str, State] = {}
        self._transitions: dict[str, dict[str, str | None]] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._constants: dict[str, dict[str, Any]] = {}
        self._initial_state_label: str | None = None
        self._connector_outcomes: tuple[str, ...] = ()
        self._connector_label: str | None = None
        self._current_label: str | None = None
        self._current_state: State | None = None  # only while it executes
        self._current_told = False  # True if that state has received the current preempt request

    # Construction.

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> State:
        """Add a state to the open machine and return it.

        `transitions` is {outcome: label, machine outcome or None}. `remapping` is {the state's key: the
        machine's key}. `constants` is {the machine's key: value}, written before each run of the state.
        Raises InvalidTransitionError for an outcome that the state lacks, InvalidStateError if the label
        exists.

        Example: `StateMachine.add("A", A(), transitions={"ok": "B"}, remapping={"x": "count"})`.
        """
        return StateMachine._currently_opened()._add(label, state, transitions, remapping, constants)

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Iterable[str],
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> State:
        """Like `add`, but each connector outcome leads to the state that is added next.

        Raises InvalidStateError for a connector outcome that the state lacks.
        Example: `StateMachine.add_auto("A", A(), connector_outcomes=["ok"])`.
        """
        machine = StateMachine._currently_opened()
        connector_outcomes = tuple(connector_outcomes)
        machine._check_new_child(label, state, machine._states)
        outcomes = state.get_registered_outcomes()
        for outcome in connector_outcomes:
            if outcome not in outcomes:
                raise InvalidStateError(
                    f"state {label!r}: connector outcome {outcome!r} is not among its outcomes {list(outcomes)}"
                )
        machine._add(label, state, transitions, remapping, constants)
        machine._connector_label, machine._connector_outcomes = label, connector_outcomes
        return state

    def _add(
        self,
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> State:
        self._check_new_child(label, state, self._states)
        outcomes = state.get_registered_outcomes()
        for outcome, target in (transitions or {}).items():
            if outcome not in outcomes:
                raise InvalidTransitionError(
                    f"state {label!r}: transition from {outcome!r}, which is not among its outcomes {list(outcomes)}"
                )
            if target is not None and not isinstance(target, str):
                raise InvalidTransitionError(
                    f"state {label!r}: transition from {outcome!r} to {target!r}; expected a "
                    f"label, an outcome of the machine, or None"
                )
        if self._connector_label is not None:
            self._transitions[self._connector_label].update(dict.fromkeys(self._connector_outcomes, label))
            self._connector_label = None
        self._states[label] = state
        self._transitions[label] = {**dict.fromkeys(outcomes), **(transitions or {})}
        self._remappings[label] = dict(remapping or {})
        self._constants[label] = dict(constants or {})
        if self._initial_state_label is None:
            self._initial_state_label = label
        return state

    # Looking inside.

    def __getitem__(self, key: str) -> State:
        try:
            return self._states[key]
        except KeyError:
            raise KeyError(f"no state {key!r} in this machine; labels: {', '.join(self._states) or 'none'}") from None

    def get_children(self) -> dict[str, State]:
        """The states by label, in the order of addition. Example: `machine.get_children()`."""
        return dict(self._states)

    def get_initial_states(self) -> list[str]:
        """`[label]` of the state with which a run begins. Example: `machine.get_initial_states()`."""
        return [str(self._initial_state_label)]

    def set_initial_state(self, initial_states: Sequence[str], userdata: UserData | None = None) -> None:
        """Begin with the first label ([]: no change), and merge `userdata`.

        Example: `machine.set_initial_state(["GRASP"])`. Labels are checked by `check_consistency`.
        """
        smach.logdebug(f"initial state set to {list(initial_states)}")
        if len(initial_states) > 1:
            smach.logwarn(f"a state machine begins with one state; it uses the first of {list(initial_states)}")
        if len(initial_states) > 0:
            self._initial_state_label = initial_states[0]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """`[label]` of the running state, `['None']` when idle.

        Example: `machine.get_active_states()`.
        """
        return [str(self._current_label)]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """(outcome, from, to) of every transition; `to` is None if the outcome is the machine's outcome.

        Example: see the name.
        """
        return [
            (outcome, label, target)
            for label, transitions in self._transitions.items()
            for outcome, target in transitions.items()
        ]

    def check_consistency(self) -> None:
        """Raise InvalidTransitionError without an initial state or if a transition has an unknown target.

        Example: `machine.check_consistency()`. The message lists all faults.
        """
        faults = []
        if not self._states:
            faults.append("there are no states in it")
        elif self._initial_state_label not in self._states:
            faults.append(f"the initial state {self._initial_state_label!r} is not among its labels")
        for outcome, label, target in self.get_internal_edges():
            if target is None and outcome not in self._outcomes:
                faults.append(
                    f"outcome {outcome!r} of state {label!r} has no transition and is not an outcome of the machine"
                )
            elif target is not None and target not in self._states and target not in self._outcomes:
                faults.append(
                    f"outcome {outcome!r} of state {label!r} leads to {target!r}, which is neither "
                    "a label "
                    f"nor an outcome of the machine"
                )
        if faults:
            raise InvalidTransitionError(
                f"state machine cannot run: {'; '.join(faults)}. Labels: "
                f"{list(self._states)}, outcomes: {list(self._outcomes)}"
            )

    # Running.

    def execute(self, parent_ud: Any = None) -> str | None:
        """Run from the initial state to an outcome of the machine. Return None if inconsistent or at shutdown.

        Raises InvalidUserCodeError if a state raises, InvalidTransitionError if a state returns an
        outcome that it has not registered. Example: `outcome = machine.execute()`.
        """
        try:
            self.check_consistency()
        except (InvalidStateError, InvalidTransitionError) as error:
            smach.logerr(f"state machine not executed, it is inconsistent: {error}")
            return None
        with self._run() as result:
            try:
                result["outcome"] = self._execute(parent_ud)
            finally:
                self._current_label = None
            return result["outcome"]

    def _execute(self, parent_ud: Any) -> str | None:
        label = self._current_label = str(self._initial_state_label)
        self._copy_input_keys(parent_ud, self._input_keys)
        smach.loginfo(f"State machine starting in initial state '{label}' with user data {self.userdata.keys()}")
        self.call_start_cbs()
        while not smach.is_shutdown():
            outcome = self._execute_state(label)
            if outcome is None and smach.is_shutdown():
                break  # an inner container that stopped because of the same shutdown
            target = self._target(label, outcome)
            if target not in self._states:
                smach.loginfo(f"State machine terminating '{label}':'{outcome}':'{target}'")
                self.call_termination_cbs([label], target)
                self._copy_output_keys(parent_ud, self._output_keys)
                return target
            smach.loginfo(f"State machine transitioning '{label}':'{outcome}'-->'{target}'")
            label = self._current_label = target
            self.call_transition_cbs()
        return None

    def _execute_state(self, label: str) -> Any:
        state = self._states[label]
        for key, value in self._constants[label].items():
            self.userdata[key] = value
        ud = Remapper(
            self.userdata,
            state.get_registered_input_keys(),
            state.get_registered_output_keys(),
            self._remappings[label],
        )
        with self._preempt_lock:
            self._current_state = state
            self._current_told = self._preempt_requested and self._tell(label, state)
        try:
            return state.execute(ud)
        except InvalidUserCodeError:
            smach.logerr(f"... in state '{label}' ({type(state).__name__})")
            raise
        except Exception as error:
            raise InvalidUserCodeError(
                f"state '{label}' ({type(state).__name__}) raised "
                f"{type(error).__name__}: {error}\n{traceback.format_exc()}"
            ) from error
        finally:
            with self._preempt_lock:
                self._current_state = None
                if not self._take_back(label, state) and self._current_told:
                    self._preempt_requested = False  # served below: neither the next state nor the parent gets it
                self._current_told = False

    def _target(self, label: str, outcome: Any) -> str:
        transitions = self._transitions[label]
        try:
            if outcome in transitions:
                target = transitions[outcome]
                return outcome if target is None else target
            if outcome in self._states[label].get_registered_outcomes() and outcome in self._outcomes:
                return outcome  # registered after the state was added
        except TypeError:
            pass  # not hashable
        raise InvalidTransitionError(
            f"state '{label}' ({type(self._states[label]).__name__}) returned {outcome!r}, which "
            "is not among its "
            f"outcomes {list(self._states[label].get_registered_outcomes())}; does every path of "
            "its execute() return?"
        )

    def _forward_preempt(self) -> None:
        if self._current_state is not None and self._tell(str(self._current_label), self._current_state):
            self._current_told = True
