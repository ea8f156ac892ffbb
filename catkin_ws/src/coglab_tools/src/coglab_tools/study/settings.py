"""Settings of a study's conditions, and their effect in virtual time. `live` applies them to the running system."""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import jsonschema
from coglab_objects.database import ObjectError
from coglab_py.packages import package_path
from coglab_py.yaml_file import read
from coglab_smach.context.config import Config, ConfigError
from coglab_smach.parameters import BY_NAME

from coglab_tools.study.own_files import OBJECTS, PRIMITIVES, OwnFiles

if TYPE_CHECKING:
    from coglab import World

OWN = {
    "object": "id of the object that is handed over",
    "speed": "factor on the speed of the arm's motions, 0.05 to 1",
    "profile": "feedback profile during a reach, such as dmp_compliant",
    "primitive": "motion primitive: a name for all, or {receive: NAME, give: NAME}",
    "delivery": "how the object is delivered: one of its `deliveries`",
    "feedback": "feedback controllers that are enabled, in execution order: [NAME, ...]; []: none",
}
"""Settings of a condition beside `timing` and the other parameters of machines.yaml: name and meaning."""
CLOSED = ("auto_trigger", "controllers", "default_object", "dmp_library", "lwr_commands", "timings")
"""Parameters of machines.yaml that belong to the cell and cannot be in a condition."""
ROLES = ("receive", "give", "take", "put")
SLOWEST = 0.05  # of `speed`


def problem(name: str, value: Any, objects: set[str], own: OwnFiles) -> str:
    """Reason why a condition cannot have this setting; empty if it can. ``objects``: ids of the study's objects.
    ``own``: primitives and objects of the study's own."""
    check = _CHECKS.get(name)
    if check is not None:
        return check(value, objects, own)
    if name not in BY_NAME or name in CLOSED:
        known = [*OWN, *(each for each in BY_NAME if each not in CLOSED)]
        near = next(iter(difflib.get_close_matches(name, known, 1, 0.5)), "")
        hint = f"; did you mean '{near}'?" if near else ""
        return (
            f"'{name}' is no setting of a condition{hint}; settings are timing, {', '.join(OWN)} and the parameters "
            "that python3 -m coglab_smach.parameters lists"
        )
    error = jsonschema.exceptions.best_match(jsonschema.Draft7Validator(BY_NAME[name].json_schema()).iter_errors(value))
    if error is not None:
        return str(error.message)
    if isinstance(value, float) and not math.isfinite(value):
        return f"a finite number is expected, got {value}"
    if name == "timing" and value not in _machines().get("timings"):
        return f"one of {', '.join(_machines().get('timings'))} is expected, got '{value}'"
    return ""


def machines_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The part of the settings that are parameters of machines.yaml, by dotted name."""
    found = {name: value for name, value in settings.items() if name not in OWN}
    if "profile" in settings:
        found["approach_profile"] = settings["profile"]
    return found


def object_with(entry: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of an object's entry, with the primitive and the delivery of a condition."""
    changed: dict[str, Any] = copy.deepcopy(dict(entry))
    primitive = settings.get("primitive")
    if isinstance(primitive, str):
        primitive = {role: primitive for role in ("receive", "give")}
    changed["dmp"].update(primitive or {})
    if "delivery" in settings:
        changed["default_delivery"] = settings["delivery"]
    return changed


def apply(world: World, settings: Mapping[str, Any]) -> None:
    """Apply the settings to a new World, except `machines_settings`, which are arguments of the World."""
    inside = world.virtual_trial
    entry = inside.ctx.database.get_object(world.conditions.object_id).result()
    entry.update(object_with(entry, settings))  # the entry belongs only to this World
    if "speed" in settings:
        world.cell.robot.virtual.speed_scale(float(settings["speed"]))
        world.cell.speed_scale = float(settings["speed"])
    if "feedback" in settings:
        chosen = list(settings["feedback"])
        others = [name for name in world.feedback.get_execution_order() if name not in chosen]
        world.feedback.set_execution_order([*chosen, *others])
        for name in [other for other in others if world.feedback.is_enabled(other)]:
            world.feedback.disable(name)
        for name in chosen:
            world.feedback.enable(name)


@lru_cache(maxsize=1)
def _machines() -> Config:
    try:
        return Config.load(str(package_path("coglab_smach", "config", "machines.yaml")))
    except ConfigError as error:
        raise ValueError(str(error)) from None


@lru_cache(maxsize=1)
def _feedback() -> Any:
    return read(package_path("ctrl_more", "config", "feedback.yaml")).value


def _object(value: Any, objects: set[str], own: OwnFiles) -> str:
    known = sorted(own.object_texts)
    hint = f"; objects of your own are files in {OBJECTS}/ of the study's folder"
    return "" if value in known else f"one of {', '.join(known)} is expected, got {value!r}{hint}"


def _speed(value: Any, objects: set[str], own: OwnFiles) -> str:
    fits = isinstance(value, int | float) and not isinstance(value, bool) and SLOWEST <= value <= 1.0
    return "" if fits else f"a number from {SLOWEST:g} to 1 is expected, got {value!r}"


def _profile(value: Any, objects: set[str], own: OwnFiles) -> str:
    known = ["", *_feedback().get("profiles", {})]
    return "" if value in known else f'one of {", ".join(known[1:])} or "" is expected, got {value!r}'


def _primitive(value: Any, objects: set[str], own: OwnFiles) -> str:
    named = value if isinstance(value, Mapping) else {"receive": value}
    for role, name in named.items():
        if role not in ROLES:
            return f"a name, or a mapping of {', '.join(ROLES)} to names, is expected, got '{role}'"
        if name not in own.primitive_names:
            return (
                f"one of {', '.join(own.primitive_names)} is expected, got {name!r}; primitives of your own are in "
                f"{PRIMITIVES} of the study's folder: ./coglab dmp train ... -o STUDY/{PRIMITIVES}"
            )
    return ""


def _delivery(value: Any, objects: set[str], own: OwnFiles) -> str:
    for object_id in sorted(objects):
        try:
            known = own.object(object_id)["deliveries"]
        except ObjectError as error:
            return str(error)
        if value not in known:
            return f"one of the deliveries of {object_id}, {', '.join(known)}, is expected, got {value!r}"
    return ""


def _feedback_list(value: Any, objects: set[str], own: OwnFiles) -> str:
    known = _feedback().get("loadControllers", [])
    if not isinstance(value, list) or len(set(map(str, value))) != len(value) or any(v not in known for v in value):
        return f"a list of {', '.join(known)} is expected, each once, got {value!r}"
    return ""


_CHECKS = {
    "object": _object,
    "speed": _speed,
    "profile": _profile,
    "primitive": _primitive,
    "delivery": _delivery,
    "feedback": _feedback_list,
}
