"""The errors of the engine. Each is written to `smach.logerr` when it is made, so none passes
unseen.
"""

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
    """A state or container is missing, doubled, of the wrong kind, or in no condition to do what is
    asked.

    Example: adding a second state under the label of the first raises it.
    """


class InvalidTransitionError(SmachError):
    """An outcome nobody registered, or a transition that leads nowhere.

    Example: `StateMachine.add("A", A(), transitions={"no_such_outcome": "B"})` raises it.
    """


class InvalidConstructionError(SmachError):
    """A container was used as if it were open for construction, and it is not.

    Example: `machine.assert_opened()` outside of `with machine:` raises it.
    """


class InvalidUserCodeError(SmachError):
    """Code of the user (a state, a callback) raised, or touched user data it had not declared.

    Example: reading `ud.x` in a state without `x` among its input keys raises it.
    """
