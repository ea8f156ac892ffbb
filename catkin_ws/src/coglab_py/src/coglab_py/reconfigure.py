"""Numbers of a node that rqt_reconfigure and other clients of dynamic_reconfigure can show and change.

The numbers come from the program at run time, so no .cfg file describes them. The library's own server is not used: it
silently limits values to their range, and does not reject values that are no numbers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import rospy
from dynamic_reconfigure.msg import Config, ConfigDescription, DoubleParameter, Group, GroupState, ParamDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse


class Field(NamedTuple):
    """One number: a parameter of the node."""

    name: str
    text: str
    """a sentence with its unit"""
    value: float
    least: float
    most: float


class ReconfigureServer:
    """Serves numbers below the node's name: service ``~set_parameters``, latched topics ``~parameter_descriptions`` and
    ``~parameter_updates``. If a name is unknown, or a value is no number within its range, nothing changes: the reply
    has the values in force, the log the reason."""

    def __init__(self, fields: Sequence[Field], use: Callable[[dict[str, float]], None]) -> None:
        """``use`` is called with all numbers after each change, from the thread of the service."""
        self._fields = {each.name: each for each in fields}
        self._values = {each.name: float(each.value) for each in fields}
        self._use, self._lock = use, threading.Lock()
        described = [ParamDescription(each.name, "double", 0, each.text, "") for each in fields]
        self._descriptions = rospy.Publisher("~parameter_descriptions", ConfigDescription, latch=True, queue_size=1)
        self._updates = rospy.Publisher("~parameter_updates", Config, latch=True, queue_size=1)
        self._descriptions.publish(
            ConfigDescription(
                [Group("Default", "", described, 0, 0)],
                self._config({each.name: each.most for each in fields}),
                self._config({each.name: each.least for each in fields}),
                self._config(self._values),
            )
        )
        self._updates.publish(self._config(self._values))
        self._service = rospy.Service("~set_parameters", Reconfigure, self._set)

    @staticmethod
    def _config(values: dict[str, float]) -> Config:
        doubles = [DoubleParameter(name, float(value)) for name, value in values.items()]
        return Config(doubles=doubles, groups=[GroupState("Default", True, 0, 0)])

    def _set(self, request: Any) -> ReconfigureResponse:
        """Returns the values in force: the protocol has no field for a reason."""
        with self._lock:
            try:
                self._change(request.config)
            except ValueError as error:
                rospy.logwarn(f"{rospy.get_name()}/set_parameters refused: {error}; nothing changed")
            config = self._config(self._values)
            self._updates.publish(config)
        return ReconfigureResponse(config)

    def _change(self, asked: Any) -> None:
        changed = {each.name: float(each.value) for each in (*asked.doubles, *asked.ints)}
        for name in (each.name for each in (*asked.bools, *asked.strs)):
            raise ValueError(f"{name}: expected a number, got a flag or a text")
        for name, value in changed.items():
            field = self._fields.get(name)
            if field is None:
                raise ValueError(f"no number named {name}; there are: {', '.join(self._fields)}")
            if not field.least <= value <= field.most:
                raise ValueError(f"{name}: expected a number from {field.least:g} to {field.most:g}, got {value:g}")
        self._use({**self._values, **changed})
        self._values.update(changed)
