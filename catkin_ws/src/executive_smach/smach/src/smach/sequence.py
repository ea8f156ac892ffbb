"""A state machine whose states run in the order in which they are added."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import smach
from smach.state import State
from smach.state_machine import StateMachine


class Sequence(StateMachine):
    """The connector outcome of each state leads to the next state, unless the state has its own transition for it.

    The connector outcome of the last state is an outcome of the sequence.

    Example::

        sequence = smach.Sequence(outcomes=["succeeded", "aborted"], connector_outcome="succeeded")
        with sequence:
            smach.Sequence.add("OPEN", Open())
            smach.Sequence.add("MOVE", Move(), transitions={"blocked": "aborted"})
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        connector_outcome: str,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self._connector_outcome = connector_outcome
        self._last_label: str | None = None

    @staticmethod
    def add(  # type: ignore[override]
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
    ) -> State:
        """Add a state at the end of the open sequence and return it.

        Raises the errors of StateMachine.add. Example: `Sequence.add("MOVE", Move())`.
        """
        sequence = Sequence._currently_opened()
        previous = sequence._last_label
        sequence._add(label, state, transitions, remapping)
        if sequence._connector_outcome not in state.get_registered_outcomes():
            smach.logerr(
                f"state {label!r} lacks the sequence's connector outcome "
                f"{sequence._connector_outcome!r} (it "
                f"has {list(state.get_registered_outcomes())}): only its transitions lead to "
                "other states"
            )
        if previous is not None:
            edges = sequence._transitions[previous]
            if sequence._connector_outcome in edges and edges[sequence._connector_outcome] is None:
                edges[sequence._connector_outcome] = label
        sequence._last_label = label
        return state
