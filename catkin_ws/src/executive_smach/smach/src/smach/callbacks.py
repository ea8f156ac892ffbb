"""Callbacks of containers: at the start of a run, at transitions, at an outcome, and at the end."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from typing import Any

import smach


class Callbacks:
    """Callbacks on the start, the transitions and the end of a container's runs. An exception in a
    callback is logged, and the run continues.
    """

    userdata: Any
    get_initial_states: Callable[[], list[str]]
    get_active_states: Callable[[], list[str]]
    _name: Callable[[], str]

    def _init_callbacks(self) -> None:
        self._start_cbs: list[tuple[Callable, Sequence]] = []
        self._transition_cbs: list[tuple[Callable, Sequence]] = []
        self._termination_cbs: list[tuple[Callable, Sequence]] = []
        self._end_cbs: list[tuple[Callable, Sequence]] = []

    def register_start_cb(self, start_cb: Callable, cb_args: Sequence = ()) -> None:
        """Call `start_cb(userdata, initial_states, *cb_args)` at the start of each run.

        Example: `machine.register_start_cb(lambda ud, labels: print(labels))`.
        """
        self._start_cbs.append(_callback("start_cb", start_cb, cb_args))

    def register_transition_cb(self, transition_cb: Callable, cb_args: Sequence = ()) -> None:
        """Call `transition_cb(userdata, active_states, *cb_args)` at each transition between children.

        Example: `machine.register_transition_cb(lambda ud, labels: print(labels))`.
        """
        self._transition_cbs.append(_callback("transition_cb", transition_cb, cb_args))

    def register_termination_cb(self, termination_cb: Callable, cb_args: Sequence = ()) -> None:
        """Call `termination_cb(userdata, terminal_states, outcome, *cb_args)` when a run ends with an
        outcome.

        Example: `machine.register_termination_cb(lambda ud, labels, outcome: print(outcome))`.
        """
        self._termination_cbs.append(_callback("termination_cb", termination_cb, cb_args))

    def register_end_cb(self, end_cb: Callable, cb_args: Sequence = ()) -> None:
        """Call `end_cb(userdata, outcome, *cb_args)` after every run, when the container is idle.

        `outcome` is None if the run ended with an error or at shutdown.
        Example: `machine.register_end_cb(lambda ud, outcome: print(machine.get_active_states()))`.
        """
        self._end_cbs.append(_callback("end_cb", end_cb, cb_args))

    def unregister_cb(self, cb: Callable) -> None:
        """Remove `cb` from all kinds of callbacks.

        Example: `machine.unregister_cb(my_start_cb)`.
        """
        for name in ("_start_cbs", "_transition_cbs", "_termination_cbs", "_end_cbs"):
            setattr(self, name, [entry for entry in getattr(self, name) if entry[0] != cb])

    def call_start_cbs(self) -> None:
        """Call the start callbacks.

        Example: `self.call_start_cbs()` in your own `execute`.
        """
        self._call("start", self._start_cbs, self.get_initial_states)

    def call_transition_cbs(self) -> None:
        """Call the transition callbacks. Example: `self.call_transition_cbs()`."""
        self._call("transition", self._transition_cbs, self.get_active_states)

    def call_termination_cbs(self, terminal_states: Any, outcome: str | None) -> None:
        """Call the termination callbacks.

        Example: `self.call_termination_cbs([label], outcome)`.
        """
        self._call("termination", self._termination_cbs, lambda: terminal_states, outcome)

    def _call(
        self,
        what: str,
        callbacks: list[tuple[Callable, Sequence]],
        states: Callable[[], Any],
        *more: Any,
    ) -> None:
        for cb, args in callbacks:
            try:
                cb(self.userdata, states(), *more, *args)
            except Exception:
                smach.logerr(
                    f"{what} callback {_cb_name(cb)} of {self._name()} raised; the run goes on:\n"
                    f"{traceback.format_exc()}"
                )

    def _call_end_cbs(self, outcome: str | None) -> None:
        for cb, args in self._end_cbs:
            try:
                cb(self.userdata, outcome, *args)
            except Exception:
                smach.logerr(f"end callback {_cb_name(cb)} of {self._name()} raised:\n{traceback.format_exc()}")


def _callback(what: str, cb: Callable, cb_args: Sequence) -> tuple[Callable, Sequence]:
    if not callable(cb):
        raise TypeError(f"{what}: expected a callable, got {type(cb).__name__}")
    return cb, tuple(cb_args)


def _cb_name(cb: Callable) -> str:
    return getattr(cb, "__qualname__", None) or repr(cb)
