"""Numbers of a node that rqt_reconfigure and other clients of dynamic_reconfigure can show and change."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import rospy
from dynamic_reconfigure.server import Server


class Field(NamedTuple):
    """One number: a parameter of the node."""

    name: str
    text: str
    """a sentence with its unit"""
    value: float
    least: float
    most: float


def serve(fields: Sequence[Field], use: Callable[[dict[str, float]], None]) -> Server:
    """Serve these numbers below the node's name, and call ``use`` with all of them after each change.

    The first values come from the parameters of the node if they are set. A number out of its range becomes the nearest
    one in it, as with every server of dynamic_reconfigure; one that is no number changes nothing.
    """
    first = {each.name: float(each.value) for each in fields}

    class Description:
        """What a file made from a .cfg has; the protocol's library reads these names."""

        min = {each.name: float(each.least) for each in fields}
        max = {each.name: float(each.most) for each in fields}
        defaults = first
        level = dict.fromkeys(first, 0)
        type = dict.fromkeys(first, "double")
        all_level = 1
        config_description = {
            "name": "Default",
            "type": "",
            "state": True,
            "id": 0,
            "parent": 0,
            "groups": [],
            "parameters": [
                {
                    "name": each.name,
                    "type": "double",
                    "default": float(each.value),
                    "level": 0,
                    "description": each.text,
                    "min": float(each.least),
                    "max": float(each.most),
                    "edit_method": "",
                }
                for each in fields
            ],
        }

    known = dict(first)

    def changed(config: dict[str, float], _level: int) -> dict[str, float]:
        numbers = {name: config[name] for name in first}
        if not all(map(math.isfinite, numbers.values())):
            rospy.logwarn("set_parameters: expected finite numbers, got %s; nothing was changed", numbers)
            config.update(known)
            return config
        use(numbers)
        known.update(numbers)
        return config

    return Server(Description, changed)
