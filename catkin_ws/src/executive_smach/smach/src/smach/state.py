"""The smallest part of a machine: something with outcomes and keys that can be executed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from smach.ordered_set import OrderedSet, names
from smach.util import has_smach_interface


class State:
    """Base of all states. Declare outcomes and keys, override `execute`.

    Nothing interrupts a running `execute`: a state that takes long polls `preempt_requested()`, and
    if asked calls `service_preempt()` and returns. A request it does not serve is passed on by its
    container to the next state.

    Example::

        class Count(smach.State):
            def __init__(self):
                smach.State.__init__(self, outcomes=["again", "done"], io_keys=["n"])

            def execute(self, ud):
                ud.n += 1
                return "done" if ud.n >= 3 else "again"
    """

    # Also for subclasses that never call State.__init__.
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
        """Do the state's work and return one of its outcomes; `ud` is its view of the user data.

        Example: see the class. The base raises NotImplementedError.
        """
        raise NotImplementedError(f"{type(self).__name__} must override execute(self, ud)")

    def register_outcomes(self, new_outcomes: Iterable[str]) -> None:
        """Add outcomes. Example: `self.register_outcomes(["failed"])`."""
        self._outcomes.update(names("outcomes", new_outcomes))

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """The outcomes in the order of declaration. Example: `state.get_registered_outcomes()`."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read and written. Example: `self.register_io_keys(["n"])`."""
        keys = names("io_keys", keys)
        self._input_keys.update(keys)
        self._output_keys.update(keys)

    def register_input_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read. Example: `self.register_input_keys(["goal"])`."""
        self._input_keys.update(names("input_keys", keys))

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """The keys that may be read, in order. Example: `state.get_registered_input_keys()`."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are written. Example: `self.register_output_keys(["result"])`."""
        self._output_keys.update(names("output_keys", keys))

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """The keys that may be written, in order. Example: `state.get_registered_output_keys()`."""
        return tuple(self._output_keys)

    # Preemption. `_preempt_requested` is the flag under the name that user code touches. A flag
    # that is still up when its run ends is "spent": it shows that the run ignored a request, and
    # the next run drops it. A new request, also by assignment, makes it fresh again.

    @property
    def _preempt_requested(self) -> bool:
        return self._preempt_flag

    @_preempt_requested.setter
    def _preempt_requested(self, value: bool) -> None:
        self._preempt_spent = False
        self._preempt_flag = bool(value)

    def request_preempt(self) -> None:
        """Ask the state to end early. May come from any thread.

        Example: `machine.request_preempt()`.
        """
        self._preempt_requested = True

    def service_preempt(self) -> None:
        """Say that the request has been served.

        Example: `self.service_preempt(); return "preempted"`.
        """
        self._preempt_requested = False

    def recall_preempt(self) -> None:
        """Take the request back. Example: `state.recall_preempt()`."""
        self._preempt_requested = False

    def preempt_requested(self) -> bool:
        """Whether the state has been asked to end early.

        Example: `if self.preempt_requested(): ...`.
        """
        return self._preempt_requested

    def _drop_spent_preempt(self) -> None:
        """At the start of a run: forget a request that an earlier run has ignored."""
        if self._preempt_spent:
            self._preempt_requested = False

    def _spend_preempt(self) -> None:
        """At the end of a run: a request still up belongs to this run, not to the next."""
        self._preempt_spent = self._preempt_flag


class CBState(State):
    """A state made of a function: `execute` returns `cb(ud, *cb_args, **cb_kwargs)`.

    Outcomes and keys of a `cb_interface`-decorated function are merged in. Example::

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
