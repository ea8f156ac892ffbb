"""The common base of all containers: construction, user data and the state of a run."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import smach
from smach.callbacks import Callbacks
from smach.exceptions import InvalidConstructionError, InvalidStateError, InvalidTransitionError
from smach.state import State
from smach.user_data import UserData

_STATE_METHODS = (
    "execute",
    "request_preempt",
    "preempt_requested",
    "recall_preempt",
    "get_registered_outcomes",
    "get_registered_input_keys",
    "get_registered_output_keys",
)


class Container(Callbacks, State):
    """A state that contains states. Base of StateMachine, Concurrence and Iterator.

    The children share `userdata`, which is kept between runs. At the start of a run every registered
    input key is copied into it from the parent; at the end every output key is copied back.

    User-defined containers override `__getitem__`, `get_children`, `get_initial_states`,
    `set_initial_state`, `get_active_states`, `get_internal_edges`, `check_consistency` and
    `execute`, and run inside `self._run()`.

    Example::

        machine = smach.StateMachine(outcomes=["done"])
        with machine:                               # open for construction
            smach.StateMachine.add("A", A(), transitions={"ok": "done"})
    """

    #: Containers open for construction, innermost last, and the lock that their thread holds meanwhile.
    _construction_stack: list[Container] = []
    _construction_lock = threading.RLock()
    _construction_thread: int | None = None

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.userdata = UserData()
        self._is_running = False
        self._run_thread: int | None = None
        self._preempt_lock = threading.RLock()
        self._init_callbacks()

    def __getstate__(self) -> dict:
        # Locks cannot be pickled; __setstate__ creates new ones.
        locks = ("_preempt_lock", "_callback_lock")
        return {key: value for key, value in self.__dict__.items() if key not in locks}

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        self._preempt_lock = threading.RLock()

    # Methods that a container must override.

    def __getitem__(self, key: str) -> State:
        """The child with this label. Raises KeyError if there is none. Example: `machine["GRASP"]`."""
        raise NotImplementedError(f"{type(self).__name__} must override __getitem__(label)")

    def get_children(self) -> dict[str, State]:
        """The children by label. Example: `list(machine.get_children())`."""
        raise NotImplementedError(f"{type(self).__name__} must override get_children()")

    def get_initial_states(self) -> list[str]:
        """Labels of the states with which a run begins. Example: `machine.get_initial_states()`."""
        raise NotImplementedError(f"{type(self).__name__} must override get_initial_states()")

    def set_initial_state(self, initial_states: Sequence[str], userdata: UserData | None = None) -> None:
        """Begin the next run with these states, and merge `userdata` into the container's user data.

        Example: `m.set_initial_state(["B"])`.
        """
        raise NotImplementedError(f"{type(self).__name__} must override set_initial_state(labels, userdata)")

    def get_active_states(self) -> list[str]:
        """Labels of the running children. Example: `machine.get_active_states()`."""
        raise NotImplementedError(f"{type(self).__name__} must override get_active_states()")

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Edges as (outcome, from label, to label or None).

        Example: `machine.get_internal_edges()`.
        """
        raise NotImplementedError(f"{type(self).__name__} must override get_internal_edges()")

    def check_consistency(self) -> None:
        """Raise InvalidStateError or InvalidTransitionError if the container cannot run.

        Example: `machine.check_consistency()`.
        """
        raise NotImplementedError(f"{type(self).__name__} must override check_consistency()")

    def is_running(self) -> bool:
        """True while `execute` runs. Example: `while machine.is_running(): ...`."""
        return self._is_running

    # Construction.

    def open(self) -> None:
        """Open the container for adding children; pair with `close`. Prefer `with container:`.

        Example: `machine.open()`.
        """
        Container._construction_lock.acquire()
        Container._construction_thread = threading.get_ident()
        Container._construction_stack.append(self)

    def close(self) -> None:
        """End the construction and log inconsistencies. Example: `machine.close()`.

        Raises InvalidStateError if another container was opened later and is still open.
        """
        if not self.is_opened():
            raise InvalidStateError(
                f"close() of {self._name()}: it is not the innermost open container "
                f"({_stack_text()}); close that one first"
            )
        self._pop()
        try:
            self.check_consistency()
        except (InvalidStateError, InvalidTransitionError) as error:
            smach.logerr(f"{self._name()} is inconsistent and will not run as it is: {error}")

    def is_opened(self) -> bool:
        """True if this is the innermost container open for construction.

        Example: `machine.is_opened()`.
        """
        stack = Container._construction_stack
        return bool(stack) and stack[-1] is self

    def assert_opened(self, msg: str = "") -> None:
        """Raise InvalidConstructionError unless the container is open.

        Example: `machine.assert_opened()`.
        """
        if not self.is_opened():
            raise InvalidConstructionError(
                f"{msg or 'the container must be open for construction'}: {self._name()} is not "
                "the innermost open "
                f"container ({_stack_text()}); use it inside 'with container:'"
            )

    def __enter__(self) -> Container:
        self.open()
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: Any) -> None:
        if error is None:
            self.close()
            return
        logged_when_made = (InvalidStateError, InvalidTransitionError)
        outermost = Container._construction_stack[0] is self if Container._construction_stack else True
        if outermost and not isinstance(error, logged_when_made):  # one line: the error itself goes on to the caller
            smach.logerr(f"construction of {self._name()} failed: {type(error).__name__}: {error}")
        # After any error inside, the construction lock must be free for other threads.
        if any(container is self for container in Container._construction_stack):
            while not self.is_opened():
                self._pop()
            self._pop()

    @contextmanager
    def opened(self, **_kwargs: Any) -> Iterator[Container]:
        """Same as `with machine:`. Keyword arguments are accepted and ignored.

        Example: `with machine.opened() as m: ...`.
        """
        with self:
            yield self

    @staticmethod
    def _pop() -> None:
        """Close the innermost open container."""
        Container._construction_stack.pop()
        if not Container._construction_stack:
            Container._construction_thread = None
        Container._construction_lock.release()

    @classmethod
    def _currently_opened(cls) -> Any:
        """The innermost container that this thread has open. It must be of this class."""
        stack = Container._construction_stack
        if not stack or Container._construction_thread != threading.get_ident():
            raise InvalidStateError(
                f"{cls.__name__}.add and the like need an open container; call them inside 'with container:'"
            )
        if not isinstance(stack[-1], cls):
            raise InvalidStateError(
                f"expected an open {cls.__name__}, but the innermost open container is a "
                f"{type(stack[-1]).__name__}; use the add method of its class"
            )
        return stack[-1]

    def _check_new_child(self, label: str, state: State, taken: Iterable[str]) -> None:
        if not isinstance(label, str):
            raise InvalidStateError(f"a label must be a string, got {label!r}")
        if isinstance(state, type):
            raise InvalidStateError(f"state {label!r}: expected an instance, got the class {state.__name__}; call it")
        missing = [name for name in _STATE_METHODS if not callable(getattr(state, name, None))]
        if missing:
            raise InvalidStateError(
                f"state {label!r}: expected a smach.State, got {type(state).__name__} {state!r} "
                f"without {', '.join(missing)}"
            )
        try:
            (
                state.get_registered_outcomes(),
                state.get_registered_input_keys(),
                state.get_registered_output_keys(),
            )
        except AttributeError as error:
            raise InvalidStateError(
                f"state {label!r} ({type(state).__name__}) is not initialised: {error}; "
                f"call smach.State.__init__(self, outcomes=[...]) in its __init__"
            ) from error
        if label in taken:
            raise InvalidStateError(
                f"label {label!r} is already taken in this {type(self).__name__}; labels: {', '.join(taken)}"
            )

    def _name(self) -> str:
        return f"{type(self).__name__} with outcomes {list(self.get_registered_outcomes())}"

    # A run.

    @contextmanager
    def _run(self) -> Iterator[dict[str, Any]]:
        """Context of one run: sets the flags and calls the end callbacks with `result["outcome"]`."""
        result: dict[str, Any] = {"outcome": None}
        with self._preempt_lock:
            if self._is_running:
                raise InvalidStateError(
                    f"{self._name()} is already running; one container object can be executed "
                    f"once at a time: make a second one"
                )
            self._drop_spent_preempt()
            self._is_running = True
            self._run_thread = threading.get_ident()
        try:
            yield result
        finally:
            with self._preempt_lock:
                self._is_running = False
                self._run_thread = None
                self._spend_preempt()
            self._call_end_cbs(result["outcome"])

    def request_preempt(self) -> None:
        """Request the container and its running children to end early. Example: `machine.request_preempt()`.

        A request before a run applies to the first children of the run. Thread-safe.
        """
        with self._preempt_lock:
            super().request_preempt()
            if self._is_running:
                self._forward_preempt()

    def _forward_preempt(self) -> None:
        """Pass the request to the running children. The caller holds the preempt lock."""

    @staticmethod
    def _tell(label: str, state: State) -> bool:
        """Pass the request to a child. True if the child accepted it."""
        try:
            state.request_preempt()
        except Exception:
            smach.logerr(
                f"request_preempt of state {label!r} raised; the request is kept for the next "
                "state:\n"
                f"{traceback.format_exc()}"
            )
            return False
        return True

    @staticmethod
    def _take_back(label: str, state: State) -> bool:
        """Clear a child's request flag at the end of its run. True if it was set: the child ignored the request."""
        try:
            if not state.preempt_requested():
                return False
            state.recall_preempt()
        except Exception:
            smach.logerr(f"preemption methods of state {label!r} raised:\n{traceback.format_exc()}")
        return True

    def _copy_input_keys(self, parent_ud: Any, keys: Iterable[str]) -> None:
        """Copy `keys` from the parent's user data, if there is a parent."""
        if parent_ud is not None:
            _copy(parent_ud, self.userdata, keys, f"input of {self._name()}")

    def _copy_output_keys(self, parent_ud: Any, keys: Iterable[str]) -> None:
        """Copy `keys` to the parent's user data, if there is a parent."""
        if parent_ud is not None:
            _copy(self.userdata, parent_ud, keys, f"output of {self._name()}")


def _copy(source: Any, target: Any, keys: Iterable[str], what: str) -> None:
    for key in keys:
        if key in source:
            target[key] = source[key]
        else:
            smach.logwarn(f"{what}: user data key {key!r} is missing; present: {', '.join(source.keys()) or 'none'}")


def _stack_text() -> str:
    return "open: " + (" > ".join(type(c).__name__ for c in Container._construction_stack) or "none")
