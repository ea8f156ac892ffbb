"""The closed list of commands, each with a JSON Schema. A browser cannot request anything else.

`python3 -m coglab_console.desk.commands` prints them as a table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jsonschema

STARTS = ("initialise", "reset", "exchange_human_to_robot", "exchange_robot_to_human", "take", "put")
"""Actions of the service coglab/start that are shipped. A configuration of the machines can add others."""
# \Z, because Python's $ also matches before a newline at the end.
_OBJECT = {"type": "string", "pattern": r"^([a-z][a-z0-9_]{0,31})?\Z"}
_ACTION = {"type": "string", "pattern": r"^[a-z][a-z0-9_]{0,63}\Z"}
_NAME = {"type": "string", "pattern": r"^[A-Za-z0-9_./-]{1,64}\Z"}
_LABEL = {"type": "string", "pattern": r"^[A-Za-z0-9_ .-]{1,40}\Z",
          "description": "letters A-Z, digits, spaces, _ . - (at most 40)"}  # fmt: skip
# JSON can contain single UTF-16 surrogates, which UTF-8 cannot encode.
_TEXT = {"type": "string", "minLength": 1, "maxLength": 500, "pattern": "^[^\ud800-\udfff]*\\Z"}


class BadCommand(Exception):
    """Unknown command or wrong arguments. The message gives what was expected and what was received."""


@dataclass(frozen=True)
class Command:
    """`operator`: only the operator may request it; `motion`: it moves the arm or the hand."""

    name: str
    about: str
    properties: dict[str, Any]
    required: tuple[str, ...] = ()
    operator: bool = True
    motion: bool = False

    def schema(self) -> dict[str, Any]:
        """JSON Schema of the arguments."""
        return {
            "type": "object",
            "additionalProperties": False,
            "properties": self.properties,
            "required": list(self.required),
        }


_ALL = (
    Command("stop", "brakes and holds the arm, ends the action", {}, operator=False),
    Command("note", "writes a note with the current time", {"text": _TEXT}, ("text",), operator=False),
    Command("take_over", "makes you the operator", {}, operator=False),
    Command("keep", "keeps you the operator when another browser takes over", {}),
    Command("invite", "makes a link for one more browser", {}),
    Command("parameters", "returns the ROS parameters", {}, operator=False),
    Command("acknowledge", "confirms that the cause of the stop with this number was read",
            {"stop": {"type": "integer", "minimum": 0}}, ("stop",)),
    Command("start", "starts an action of the state machine",
            {"action": _ACTION, "object_id": _OBJECT, "delivery": _ACTION}, ("action",), motion=True),
    Command("calibrate", "calibrates the hand", {"mode": {"enum": ["fast", "complete"]}, "force": {"type": "boolean"}},
            ("mode",), motion=True),
    Command("home", "moves the arm to its home posture", {}, motion=True),
    Command("speed_scale", "slows all motions down", {"value": {"type": "number", "minimum": 0, "maximum": 1}},
            ("value",)),
    Command("select_object", "chooses the object of the next action", {"object_id": _OBJECT}, ("object_id",)),
    Command("session_begin", "begins a session with a participant", {
        "participant": {"type": "string", "pattern": r"^[A-Za-z0-9_-]{1,32}\Z",
                        "description": "a pseudonym such as P07, of letters A-Z, digits, _ - (at most 32),"},
        "number": {"type": "integer", "minimum": 0, "maximum": 9999},
        "conditions": {"type": "array", "minItems": 1, "maxItems": 12, "uniqueItems": True, "items": _LABEL},
        "repetitions": {"type": "integer", "minimum": 1, "maximum": 50},
        "order": {"enum": ["as_listed", "latin_square", "random"]},
        "study": {"type": "string", "pattern": r"^([a-z0-9][a-z0-9_.-]{0,39})?\Z",
                  "description": "a name of letters a-z, digits, _ . - (at most 40)"},
    }, ("participant", "conditions", "repetitions", "order")),
    Command("session_end", "ends the session", {}),
    Command("trial_begin", "begins the next trial of the order", {}),
    Command("trial_end", "ends the trial", {"outcome": {"enum": ["done", "failed", "repeat", "skipped"]}},
            ("outcome",)),
    Command("answer", "writes answers to a questionnaire of the live study", {
        "questionnaire": _NAME,
        "of": {"type": "array", "minItems": 3, "maxItems": 3,  # participant, block, condition of the form
               "items": {"type": "string", "maxLength": 64}},
        "answers": {"type": "object", "maxProperties": 200, "additionalProperties": {"type": "number"}},
    }, ("questionnaire", "answers"), operator=False),
    Command("preview", "shows the path of a primitive toward the goal of the next action; empty: ends the preview",
            {"primitive": {"type": "string", "pattern": r"^[A-Za-z0-9_.-]{0,64}\Z"}}, ("primitive",), operator=False),
    Command("contact_learn", "learns the noise of the torques from 5 s at rest", {}),
    Command("contact_arm", "arms the contact detector, to try it", {
        "mode": {"enum": ["contact", "off"]},
        "k": {"type": "number", "minimum": 3, "maximum": 50},
        "timeout": {"type": "number", "minimum": 1, "maximum": 60},
        "joints": {"type": "array", "maxItems": 7, "uniqueItems": True,
                   "items": {"type": "integer", "minimum": 1, "maximum": 7}},
    }, ("mode",)),
    Command("objects_reload", "reads the object files again", {}),
    Command("feedback", "switches one feedback controller", {
        "verb": {"enum": ["enable", "disable", "pause", "resume"]}, "name": _NAME}, ("verb", "name")),
    Command("feedback_order", "sets the order of the feedback controllers", {
        "names": {"type": "array", "minItems": 1, "maxItems": 64, "items": _NAME}}, ("names",)),
)  # fmt: skip
COMMANDS = {command.name: command for command in _ALL}
# 2.0 is not an integer here, because range() does not accept a float.
_TYPES = jsonschema.Draft7Validator.TYPE_CHECKER.redefine(
    "integer", lambda _, value: isinstance(value, int) and not isinstance(value, bool)
)
_Validator = jsonschema.validators.extend(jsonschema.Draft7Validator, type_checker=_TYPES)
_VALIDATORS = {command.name: _Validator(command.schema()) for command in _ALL}


def judge(name: Any, arguments: Any) -> Command:
    """Returns the command. Raises BadCommand if the name is unknown or the arguments do not fit the schema."""
    if not isinstance(name, str) or name not in COMMANDS:
        which = f"'{name[:40]}'" if isinstance(name, str) else f"without a name of letters ({type(name).__name__})"
        raise BadCommand(f"there is no command {which}; there are: {', '.join(COMMANDS)}")
    try:
        error = jsonschema.exceptions.best_match(_VALIDATORS[name].iter_errors(arguments))
    except RecursionError:
        raise BadCommand(f"{name}: lists are nested too deeply") from None
    if error is not None:
        where = ".".join(str(part) for part in error.absolute_path)
        plain = error.schema.get("description", "") if error.validator == "pattern" else ""
        problem = f"{plain} is expected, got '{error.instance[:40]}'" if plain else error.message[:200]
        raise BadCommand(f"{name}{': ' + where if where else ''}: {problem}")
    return COMMANDS[name]


def _values(schema: dict[str, Any]) -> str:
    """Possible values of a field, in words."""
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema["type"] == "array":
        return f"list of {_values(schema['items'])}"
    if schema["type"] == "object":
        return f"{_values(schema['additionalProperties'])} by name"
    if "minimum" in schema:
        top = f" to {schema['maximum']}" if "maximum" in schema else " or more"
        return f"{schema['type']}, {schema['minimum']}{top}"
    return {"string": "text", "boolean": "true or false", "number": "number"}[schema["type"]]


def table() -> list[str]:
    """The commands as rows of Markdown; fields in brackets may be left out."""
    rows = ["| command | does | fields | by |", "| --- | --- | --- | --- |"]
    for one in _ALL:
        fields = []
        for name, schema in one.properties.items():
            text = f"`{name}`: {_values(schema)}"
            fields.append(text if name in one.required else f"[{text}]")
        who = "the operator" if one.operator else "everybody"
        rows.append(f"| `{one.name}` | {one.about} | {'; '.join(fields)} | {who} |")
    return rows


if __name__ == "__main__":
    print("\n".join(table()))
