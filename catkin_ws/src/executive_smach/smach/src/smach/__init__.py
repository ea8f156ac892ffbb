"""Hierarchical state machines in Python.

A state has outcomes. A container of states maps the outcome of one state to the start of the next. A
container is also a state. The README beside this package explains how to write a machine.

Example::

    import smach

    class Hello(smach.State):
        def __init__(self):
            smach.State.__init__(self, outcomes=["done"])

        def execute(self, ud):
            print("hello")
            return "done"

    machine = smach.StateMachine(outcomes=["end"])
    with machine:
        smach.StateMachine.add("HELLO", Hello(), transitions={"done": "end"})
    assert machine.execute() == "end"
"""

# The loggers come first: the other modules look them up here at each message.
from smach.concurrence import Concurrence
from smach.container import Container
from smach.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
)
from smach.iterator import Iterator
from smach.log import (
    is_shutdown,
    logdebug,
    logerr,
    loginfo,
    logwarn,
    set_loggers,
    set_shutdown_check,
)  # isort: skip
from smach.sequence import Sequence
from smach.state import CBState, State
from smach.state_machine import StateMachine
from smach.user_data import Remapper, UserData
from smach.util import CBInterface, cb_interface, has_smach_interface

__all__ = [
    "CBInterface",
    "CBState",
    "Concurrence",
    "Container",
    "InvalidConstructionError",
    "InvalidStateError",
    "InvalidTransitionError",
    "InvalidUserCodeError",
    "Iterator",
    "Remapper",
    "Sequence",
    "State",
    "StateMachine",
    "UserData",
    "cb_interface",
    "has_smach_interface",
    "is_shutdown",
    "logdebug",
    "logerr",
    "loginfo",
    "logwarn",
    "set_loggers",
    "set_shutdown_check",
]
