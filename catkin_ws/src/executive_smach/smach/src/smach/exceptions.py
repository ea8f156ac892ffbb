"""The errors of the engine. Each error is written to `smach.logerr` when it is created, so that none is lost."""

from __future__ import annotations

import smach


class SmachError(Exception):
    """Base of all errors of this package; logs `ClassName: message` when created.

    Example::

        try:
            machine.execute()
        except smach.exceptions.SmachError as error:
            print(error.message)
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(message)
        self.message = message
        smach.logerr(f"{type(self).__name__}: {message}")


class InvalidStateError(SmachError):
    """A state or container is missing, exists twice, has the wrong type, or cannot do this now.

    Example: adding a second state under the label of the first raises it.
    """


class InvalidTransitionError(SmachError):
    """An unregistered outcome, or a transition to an unknown target.

    Example: `StateMachine.add("A", A(), transitions={"no_such_outcome": "B"})` raises it.
    """


class InvalidConstructionError(SmachError):
    """A container was used as if it were open for construction, but it is closed.

    Example: `machine.assert_opened()` outside of `with machine:` raises it.
    """


class InvalidUserCodeError(SmachError):
    """User code (a state, a callback) raised an exception or accessed user data that it had not declared.

    Example: reading `ud.x` in a state without `x` among its input keys raises it.
    """
