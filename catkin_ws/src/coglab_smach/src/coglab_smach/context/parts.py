"""Parts of the machines from a user's package: actions, states and deliveries, by name in machines.yaml.

A name is ``module:function``. All names are imported when the machines are built. One that cannot be used ends the
start with a ConfigError, so that nothing is half-loaded.
"""

from __future__ import annotations

import inspect
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from coglab_smach.context.config import Config, ConfigError

HANDS = ("empty", "holding", "any")
"""States of the hand in which an action may start."""
BUILD = ("ctx",)
"""arguments of a function that builds an action or a state: the Context"""
DELIVER = ("entry", "hand")
"""arguments of a delivery: entry of the object, and the Pose of the person's hand"""


@dataclass(frozen=True)
class OwnAction:
    """An action of a user's package. ``hand``: one of HANDS. ``build(ctx)`` returns its machine or state."""

    name: str
    hand: str
    build: Callable[[Any], Any]


@dataclass
class Parts:
    """The parts of one configuration."""

    actions: tuple[OwnAction, ...] = ()
    states: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    """by "machine/state", the labels of the shipped state that it replaces: function of the Context -> state"""
    deliveries: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    """function of (entry of the object, pose of the person's hand in the base frame) -> delivery, as in an object's
    file"""
    places: set[str] = field(default_factory=set)
    """"machine/state" of all states that were added so far"""

    @staticmethod
    def load(config: Config) -> Parts:
        """Import the parts that a configuration names. ConfigError: one cannot be used."""
        actions, states, deliveries = (config.get(group) for group in ("actions", "states", "deliveries"))
        if config.path and (actions or states or deliveries):
            folder = os.path.dirname(os.path.abspath(config.path))
            if folder not in sys.path:
                sys.path.append(folder)  # a module beside machines.yaml
        own = []
        for name, value in actions.items():
            given = {"build": value} if isinstance(value, str) else value
            own.append(OwnAction(name, given.get("hand", "empty"), imported(f"actions.{name}", given["build"], BUILD)))
        return Parts(
            tuple(own),
            {place: imported(f"states.{place}", value, BUILD) for place, value in states.items()},
            {name: imported(f"deliveries.{name}", value, DELIVER) for name, value in deliveries.items()},
        )

    def all_placed(self) -> None:
        """ConfigError if a state of the user has found no place."""
        for place in self.states:
            if place not in self.places:
                machine = place.partition("/")[0]
                there = sorted(each for each in self.places if each.startswith(machine + "/")) or sorted(self.places)
                raise ConfigError(f"states.{place}: there is no such state; there are: {', '.join(there)}")


def imported(name: str, spec: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """Returns the function ``module:function`` that the field ``name`` of machines.yaml gives, and that takes
    ``arguments``. ConfigError with a reason."""
    module, _, function = spec.partition(":")
    if not function.isidentifier() or not all(word.isidentifier() for word in module.split(".")):
        raise ConfigError(f"{name}: 'module:function' is expected, such as my_lab.machines:build_polish, got '{spec}'")
    try:
        found = import_module(module)
    except ModuleNotFoundError as error:
        if error.name and (module == error.name or module.startswith(f"{error.name}.")):
            raise ConfigError(
                f"{name}: no module '{module}'; put its file beside machines.yaml, its folder on PYTHONPATH, or build "
                "it as a catkin package"
            ) from None
        raise ConfigError(f"{name}: module '{module}' needs the module '{error.name}', which is not there") from None
    except (Exception, SystemExit) as error:  # a script that ends itself must not end the node
        raise ConfigError(f"{name}: module '{module}' cannot be imported: {_where(error)}") from None
    part = getattr(found, function, None)
    if not callable(part):
        there = [each for each, value in vars(found).items() if callable(value) and not each.startswith("_")]
        what = "no function" if part is None else f"{type_name(part)}, no function,"
        raise ConfigError(f"{name}: module '{module}' has {what} '{function}'; it has: {', '.join(there) or 'none'}")
    try:
        inspect.signature(part).bind(*arguments)
    except TypeError:
        raise ConfigError(
            f"{name}: {function}{inspect.signature(part)} of {_file_and_line(part)} is called as "
            f"{function}({', '.join(arguments)}): give it these arguments"
        ) from None
    except ValueError:  # a compiled function has no signature
        pass
    return part


def built(name: str, build: Callable[[Any], Any], ctx: Any) -> Any:
    """Returns the state or machine that the user's function builds. ConfigError if it raises."""
    try:
        return build(ctx)
    except ConfigError:
        raise
    except Exception as error:
        raise ConfigError(f"{name}: its function raised {_where(error)}") from error


def _where(error: BaseException) -> str:
    """The error and its place in the user's file."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1] if frames else None
    place = f" ({os.path.basename(last.filename)}:{last.lineno})" if last else ""
    return f"{type(error).__name__}: {error}{place}"


def _file_and_line(part: Any) -> str:
    """File and line of a function or class of the user."""
    try:
        return f"{os.path.basename(inspect.getsourcefile(part) or '?')}:{inspect.getsourcelines(part)[1]}"
    except (OSError, TypeError):
        return str(getattr(part, "__module__", "its module"))


def type_name(value: Any) -> str:
    """Returns the type of a value for a sentence."""
    return "nothing" if value is None else f"a value of type {type(value).__name__}"
