"""The smallest part of a machine: an executable object with outcomes and keys."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from smach.ordered_set import OrderedSet, names
from smach.util import has_smach_interface


class State:
    """Base of all states. Declare outcomes and keys, override `execute`.

    Nothing interrupts a running `execute`. A state that takes long polls `preempt_requested()`; if True
    it calls `service_preempt()` and returns. If a state does not serve a request, its container passes
    it to the next state.

    Example::

        class Count(smach.State):
            def __init__(self):
                smach.State.__init__(self, outcomes=["again", "done"], io_keys=["n"])

            def execute(self, ud):
                ud.n += 1
                return "done" if ud.n >= 3 else "again"
    """

    # Class attributes, so that subclasses need not call State.__init__.
    _preempt_flag = False
    _preempt_spent = False

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        self._outcomes = OrderedSet(names("outcomes", outcomes))
        io_keys = names("io_keys", io_keys)
        self._input_keys = OrderedSet((*names("input_keys", input_keys), *io_keys))
        self._output_keys = OrderedSet((*names("output_keys", output_keys), *io_keys))
        self._preempt_requested = False

    def execute(self, ud: Any) -> str | None:
        """Do the work of the state and return one of its outcomes; `ud` is the state's view of the user data.

        Example: see the class. The base class raises NotImplementedError.
        """
        raise NotImplementedError(f"{type(self).__name__} must override execute(self, ud)")

    def register_outcomes(self, new_outcomes: Iterable[str]) -> None:
        """Add outcomes. Example: `self.register_outcomes(["failed"])`."""
        self._outcomes.update(names("outcomes", new_outcomes))

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """The outcomes in the order of declaration. Example: `state.get_registered_outcomes()`."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Iterable[str]) -> None:
        """Add keys for reading and writing. Example: `self.register_io_keys(["n"])`."""
        keys = names("io_keys", keys)
        self._input_keys.update(keys)
        self._output_keys.update(keys)

    def register_input_keys(self, keys: Iterable[str]) -> None:
        """Add keys for reading. Example: `self.register_input_keys(["goal"])`."""
        self._input_keys.update(names("input_keys", keys))

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """The keys for reading, in order. Example: `state.get_registered_input_keys()`."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Iterable[str]) -> None:
        """Add keys for writing. Example: `self.register_output_keys(["result"])`."""
        self._output_keys.update(names("output_keys", keys))

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """The keys for writing, in order. Example: `state.get_registered_output_keys()`."""
        return tuple(self._output_keys)

    # Preemption. `_preempt_requested` is the name of the flag that user code accesses. If the flag is still
    # set at the end of a run, it is "spent": the run ignored a request, and the next run clears it. A new
    # request, also by assignment, replaces a spent one.

    @property
    def _preempt_requested(self) -> bool:
        return self._preempt_flag

    @_preempt_requested.setter
    def _preempt_requested(self, value: bool) -> None:
        self._preempt_spent = False
        self._preempt_flag = bool(value)

    def request_preempt(self) -> None:
        """Request the state to end early. Thread-safe.

        Example: `machine.request_preempt()`.
        """
        self._preempt_requested = True

    def service_preempt(self) -> None:
        """Clear the request flag: the state serves the request.

        Example: `self.service_preempt(); return "preempted"`.
        """
        self._preempt_requested = False

    def recall_preempt(self) -> None:
        """Cancel the request. Example: `state.recall_preempt()`."""
        self._preempt_requested = False

    def preempt_requested(self) -> bool:
        """True if the state has been requested to end early.

        Example: `if self.preempt_requested(): ...`.
        """
        return self._preempt_requested

    def _drop_spent_preempt(self) -> None:
        """At the start of a run, clear a request that an earlier run ignored."""
        if self._preempt_spent:
            self._preempt_requested = False

    def _spend_preempt(self) -> None:
        """At the end of a run, mark a remaining request as spent: it does not apply to the next run."""
        self._preempt_spent = self._preempt_flag


class CBState(State):
    """A state from a function: `execute` returns `cb(ud, *cb_args, **cb_kwargs)`.

    The outcomes and keys of a function decorated with `cb_interface` are added. Example::

        @smach.cb_interface(outcomes=["done"], input_keys=["x"])
        def show(ud):
            print(ud.x)
            return "done"

        StateMachine.add("SHOW", CBState(show))
    """

    def __init__(
        self,
        cb: Callable[..., str],
        cb_args: Sequence = (),
        cb_kwargs: Mapping[str, Any] | None = None,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        if not callable(cb):
            raise TypeError(f"CBState: expected a callable, got {type(cb).__name__}")
        self._cb = cb
        self._cb_args = tuple(cb_args)
        self._cb_kwargs = dict(cb_kwargs or {})
        if has_smach_interface(cb):
            declared: Any = cb
            self.register_outcomes(declared.get_registered_outcomes())
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())

    def execute(self, ud: Any) -> str:
        """Call the function.

        Example: `CBState(lambda ud: "done", outcomes=["done"]).execute(ud)`.
        """
        return self._cb(ud, *self._cb_args, **self._cb_kwargs)
