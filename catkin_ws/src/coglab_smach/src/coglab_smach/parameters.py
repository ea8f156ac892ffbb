"""Parameters of the state machines, one row each: source of the ranges, the check of machines.yaml and the reference.

``python3 -m coglab_smach.parameters`` prints the reference as a Markdown table.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

NO_DEFAULT: Any = object()  # default of a parameter that the file must set


@dataclass(frozen=True)
class Parameter:
    """One parameter and its dotted name."""

    name: str
    default: Any
    unit: str
    text: str
    low: float | None = None
    high: float | None = None
    above: bool = False
    """True: the value must be above ``low``"""
    timed: bool = False
    """True: a timing may set this parameter"""
    schema: Mapping[str, Any] = field(default_factory=dict)
    """JSON schema (draft 7), if type and range are not sufficient"""

    def json_schema(self) -> dict[str, Any]:
        """Returns the JSON schema of the value."""
        if self.schema:
            return dict(self.schema)
        if isinstance(self.default, bool):
            return {"type": "boolean"}
        if isinstance(self.default, str):
            return {"type": "string"}
        schema: dict[str, Any] = {"type": "integer" if isinstance(self.default, int) else "number"}
        if self.low is not None:
            schema["exclusiveMinimum" if self.above else "minimum"] = self.low
        if self.high is not None:
            schema["maximum"] = self.high
        return schema


def _row(name: str, default: Any, unit: str, text: str, low: float, high: float, **more: Any) -> Parameter:
    return Parameter(name, default, unit, text, low, high, **more)


def _above(name: str, default: Any, unit: str, text: str, high: float, **more: Any) -> Parameter:
    return Parameter(name, default, unit, text, 0, high, above=True, **more)


def _other(name: str, default: Any, unit: str, text: str, **schema: Any) -> Parameter:
    return Parameter(name, default, unit, text, schema=schema)


DAY = 86400.0
TEXT = {"type": "string"}
WORD = {"type": "string", "minLength": 1}
TRIPLE = {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number", "minimum": -10, "maximum": 10}}
JOINTS = {"type": "array", "minItems": 7, "maxItems": 7, "items": {"type": "number", "minimum": -3.2, "maximum": 3.2}}
SPEEDS = {"type": "array", "minItems": 7, "maxItems": 7, "items": {"type": "number", "exclusiveMinimum": 0}}
PART = {"type": "string"}  # "module:function", checked when it is imported
OWN_ACTION = {
    "oneOf": [
        PART,
        {
            "type": "object",
            "additionalProperties": False,
            "required": ["build"],
            "properties": {"build": PART, "hand": {"enum": ["empty", "holding", "any"]}},
        },
    ]
}
LABEL = {"pattern": "^[a-z][a-z0-9_]{0,63}$"}
ACTIONS = {"offer": "exchange_human_to_robot", "request": "exchange_robot_to_human"}
PATTERNS = {"centre": "reach_human", "left": "reach_human", "right": "reach_human", "high": "reach_human_high"}

TABLE = (
    _other("controllers", NO_DEFAULT, "",
           "Plug-ins to load, in this order: id and type.", type="object", minProperties=1, additionalProperties=WORD),
    _other("lwr_commands", ["position", "start"], "",
           "Commands sent to the robot interface while motion is not allowed.", type="array", items=WORD),
    Parameter("dmp_library", NO_DEFAULT, "", "File of the primitives.", schema=TEXT),
    Parameter("auto_trigger", False, "", "If true, coglab_init_robot does not wait for the request 'initialise'."),
    _above("trigger_timeout", 3600.0, "s", "Longest wait for the request 'initialise'.", DAY),
    Parameter("default_object", "mug", "", "Object of a request that names none."),
    _other("postures", NO_DEFAULT, "rad",
           "Named arm postures: joint positions in wire order.",
           type="object", required=["home"], additionalProperties=JOINTS),
    _other("ptp_velocity", [], "rad/s",
           "Joint speeds of point-to-point motions. Empty: the controller's defaults.",
           oneOf=[{"type": "array", "maxItems": 0}, SPEEDS]),
    _above("ptp_tolerance", 0.03, "rad", "Largest joint error at the end of a point-to-point motion.", 1),
    _row("ptp_timeout", 5.0, "s", "Time allowed beyond 1.5 times the planned duration.", 0, DAY),
    Parameter("timing", "", "", "Active entry of `timings`. Its values replace those of the file."),
    Parameter("timings", {}, "", "Named sets of values for the parameters that a timing may set."),
    Parameter("approach_profile", "", "", "Feedback profile during a reach. Empty: none."),
    _row("goal_lost_time", 1.0, "s",
         "Longest wait at the start of a motion for a goal that perception has just lost.", 0, DAY),
    _row("reach_timeout", 6.0, "s", "Time allowed for a reach beyond its planned duration.", 0, DAY),
    _above("contact_within", 0.12, "m", "Contact is watched for when at most this distance is left to the goal.", 2),
    _above("contact_near", 0.09, "m",
           "A touch within this distance of the grasp is the object. Elsewhere the arm backs off and tries again.", 2),
    _above("contact_timeout", 6.0, "s",
           "Longest wait for contact, from the moment it is watched for. An object's own value wins.", DAY),
    _above("release_timeout", 8.0, "s",
           "Longest wait until the person takes the load. An object's own value wins.", DAY),
    _other("hand.calibration", "fast", "",
           "Calibration order for the hand.", enum=["fast", "complete", "fast force", "complete force"]),
    Parameter("hand.calibrate_always", False, "",
              "If true, each initialisation calibrates the hand, even a calibrated one."),
    _row("hand.open_speed", 400, "wire speed", "Speed of opening.", 1, 511),
    _row("hand.settle_after_close", 0.3, "s",
         "Wait after closing, before the hand reports whether it holds something.", 0, DAY),
    _row("hand.settle_after_start", 2.0, "s",
         "For this time after its start the hand node counts as holding, unless the hand was seen empty.", 0, DAY),
    _row("hand.tighten.medium", 140, "wire speed",
         "Speed, and with it force, of the firm grip after the person has let go, for grasps of level medium. From "
         "the emulated hand; not confirmed on a real one.",
         1, 511),
    _row("hand.tighten.high", 200, "wire speed", "The same for grasps of level high.", 1, 511),
    _above("hand.lift", 0.03, "m", "Highest rise to take over the weight.", 0.1),
    _above("hand.lift_speed", 0.055, "m/s", "Speed of this rise.", 0.1, timed=True),
    _row("hand.lift_after", 0.05, "s",
         "Pause between closing and the rise. The weight is measured from the forces at its end.", 0, 10, timed=True),
    _above("hand.lift_step", 0.01, "m", "Further rise while the person still holds on.", 0.1),
    _row("hand.lift_pause", 0.5, "s", "Pause before each further rise.", 0, 10),
    _above("hand.load_share", 0.5, "", "Share of the weight that the arm must carry.", 1),
    _above("hand.let_go", 0.04, "m", "The person has let go when their hand is this much farther from the palm.", 1),
    _row("hand.load_timeout", 5.0, "s", "Longest time from closing until the person has let go.", 0, DAY),
    _above("motion.end_timeout", 3.0, "s",
           "A cancelled motion must stand within this time; otherwise the arm is held.", DAY),
    _row("hub.blocked_time", 0.5, "s", "A hub goes to `stopped` after the arm has been blocked for this time.", 0, DAY),
    _row("hub.silent_time", 2.0, "s",
         "A hub goes to `fault` after the robot node has been silent for this time.", 0, DAY),
    _row("give.touch_within", 0.08, "m",
         "A touch ends the reach when at most this distance is left to the goal.", 0, 2),
    _above("give.goal_leaves", 0.007, "m", "A reach also ends when its goal moves away again by this distance.", 2),
    _above("give.near", 0.25, "m",
           "The person's hand is at the object when it is within this distance of the palm.", 2),
    _above("give.begins", 0.2, "",
           "The grip loosens when the person carries this share of the weight, and closes again below half of it.", 1),
    _row("give.back_time", 0.1, "s", "Delay before the grip closes again.", 0, 10, timed=True),
    _above("give.slip", 0.03, "m", "The grip closes again when the object has sunk this far in the loosened hand.", 1),
    _row("give.loosen", 4.0, "of 254", "Total loosening of the fingers before they open, in position counts.", 0, 50),
    _row("give.ease", 12.0, "of 254",
         "The same for a hand with force sensors, whose grip falls in proportion to the load.", 0, 50),
    _row("give.grip_safety", 2.0, "",
         "Safety factor on the grip force that friction needs for the load that is still in the hand.", 1, 10),
    _row("give.loosen_speed", 40, "wire speed", "Speed of loosening.", 1, 511),
    _row("give.ease_speed", 140, "wire speed", "The same for a hand with force sensors.", 1, 511),
    _row("give.close_speed", 60, "wire speed",
         "Speed, and with it force, of closing again beside the person's fingers.", 1, 511),
    _row("give.bring_after", 1.0, "s",
         "The object is brought to a hand that has waited elsewhere for this time.", 0, DAY),
    _above("give.bring_speed", 0.08, "m/s", "Speed of bringing it.", 0.25),
    _row("give.lower_after", 3.0, "s",
         "The arm sinks if the person's hand is at the object for this time and takes no load.", 0, DAY, timed=True),
    _above("give.lower", 0.03, "m", "Distance by which the arm sinks.", 0.1),
    _above("give.lower_speed", 0.03, "m/s", "Speed of sinking.", 0.1),
    _row("give.draw_back", 0.06, "m",
         "Distance by which the palm moves back while the hand opens. 0: it does not.", 0, 0.2),
    _above("give.draw_back_speed", 0.25, "m/s", "Speed of moving back.", 1),
    _above("pull.begins", 6.5, "N", "The palm follows a person who pulls with more than this force.", 200),
    _row("pull.time", 0.05, "s", "A pull must last this long.", 0, 10),
    _row("pull.ends", 3.0, "N", "The palm stands again when the pull falls below this force.", 0, 200),
    _row("pull.way", 0.05, "m", "Longest distance that the palm follows. 0: it does not follow.", 0, 0.2),
    _above("pull.speed", 0.2, "m/s", "Speed of following.", 0.5),
    _other("perception.human_hand", "human_hand", "",
           "tf2 frame of the person's hand, unless `perception/frames` names another one.", **WORD),
    _other("perception.board", "board", "",
           "tf2 frame of the storage board, unless `perception/frames` names another one.", **WORD),
    _above("perception.locate_timeout", 5.0, "s", "Longest wait for a sight.", DAY),
    _above("perception.max_age", 0.5, "s", "Largest age of a sight.", DAY),
    _other("handover.region_low", [0.45, -0.50, 0.05], "m",
           "Low corner of the handover region, in the base frame. An object in it counts as offered, an empty hand "
           "in it as a request.",
           **TRIPLE),
    _other("handover.region_high", [0.86, 0.50, 0.85], "m", "High corner of the handover region.", **TRIPLE),
    _row("handover.still_margin", 0.10, "m",
         "The region is larger by this margin for an object that is held still.", 0, 2),
    _row("handover.hand_margin", 0.10, "m",
         "The region is larger by this margin for a hand that requests the object.", 0, 2),
    _row("handover.belief", 0.85, "",
         "The arm starts at this probability of an offer. 0: only when the object or hand is seen in the region.",
         0, 1, timed=True),
    Parameter("handover.belief_request", None, "",
              "The same for a request. Left out: as for an offer.", 0, 1, timed=True),
    _row("handover.start_after", 0.0, "s", "Delay between this belief and the start of the arm.", 0, 10, timed=True),
    _above("handover.reach_ratio", 1.0, "",
           "Factor on the objects' dmp_ratio. 0.9 is a person's pace.", 10, timed=True),
    _row("handover.retreat", 0.10, "m", "The reach ends when its goal has moved back by more than this.", 0, 2),
    _row("handover.drop", 0.08, "m",
         "The reach ends when the object is this far below its mean height of the last 0.15 s.", 0, 2),
    _row("handover.doubt", 0.1, "",
         "The reach pauses below this probability if no object or hand is seen in the region.", 0, 1, timed=True),
    _row("handover.pause", 3.0, "s", "Length of this pause; then the reach is given up.", 0, 60, timed=True),
    _row("handover.arrival_speed", 0.05, "m/s",
         "Speed of the hand at its goal. 0: as the primitive has it.", 0, 0.45, timed=True),
    _row("handover.approach", 0.05, "m", "The last part of the way, straight along the grasp's approach axis.", 0, 0.3),
    _row("handover.close_within", 0.03, "m",
         "The fingers close at this distance from the goal if the object is seen between them. 0: they close at "
         "contact.",
         0, 0.1),
    _row("handover.feel", 0.3, "s",
         "If the hand feels nothing for this time at its goal, it goes deeper.", 0, 10, timed=True),
    _row("handover.deeper", 0.02, "m", "Distance by which it goes deeper, along the approach axis.", 0, 0.1),
    _row("handover.standoff", 0.0, "m", "A reach for an object ends this far before its grasp.", 0, 0.2),
    _above("handover.offer_timeout", 8.0, "s", "Longest wait for an offer.", DAY, timed=True),
    Parameter("handover.check_reach", True, "",
              "If true, an offer that the arm cannot reach is refused before the arm moves."),
    Parameter("monitor.enabled", True, "",
              "If true, a recognised pattern of the person's reach may change the primitive."),
    _row("monitor.confidence", 0.9, "", "Confidence from which a pattern counts.", 0, 1),
    _other("monitor.primitives", PATTERNS, "",
           "Primitive for each pattern of the person's reach.", type="object", additionalProperties=WORD),
    Parameter("recognition_trigger.enabled", False, "", "If true, a belief in an offer or a request starts an action."),
    _row("recognition_trigger.belief", 0.9, "",
         "Probability that starts it. It must first have been below `handover.doubt` in this hub.", 0, 1, timed=True),
    _other("recognition_trigger.actions", ACTIONS, "",
           "Action for an offer and for a request. Left out: none.",
           type="object", additionalProperties=False, properties={"offer": TEXT, "request": TEXT}),
    _row("board.room", 0.01, "m", "Smallest distance of hand and forearm from the board.", 0, 0.3),
    _row("board.lift", 0.03, "m",
         "A goal is raised by at most this distance to keep it. If that is not enough, the goal is refused.", 0, 0.3),
    _row("take.sights", 10, "", "Number of sights of the object that are averaged.", 1, 10000),
    _row("take.clearance", 0.012, "m", "Distance between palm and object at the end of the precise motion.", 0, 0.3),
    _row("take.approach", 0.05, "m", "The last part of the way, straight along the grasp's approach axis.", 0, 0.3),
    _other("take.preshape", "before", "",
           "Preshape before or during the precise motion. Read when the machine is built.", enum=["before", "during"]),
    _other("grasp.choice", "ranked", "",
           "Grasp of an object that a person offers. `ranked`: the best one for how it is held; `nominal`: always its "
           "`default_grasp`, as in D4.10.",
           enum=["ranked", "nominal"]),
    _other("actions", {}, "",
           "Actions of your own: name and `module:function`, or `{build: module:function, hand: empty|holding|any}`. "
           "Read at the start.",
           type="object", propertyNames=LABEL, additionalProperties=OWN_ACTION),
    _other("states", {}, "",
           "States of your own: `machine/state`, the labels of a shipped state, and the `module:function` of the one "
           "that replaces it. Read at the start.",
           type="object", additionalProperties=PART),
    _other("deliveries", {}, "",
           "Deliveries of your own, for every object: name and `module:function`. Read at the start.",
           type="object", propertyNames=LABEL, additionalProperties=PART),
    _other("time_limits", {}, "s",
           "Time limits by state label. They win over the built-in ones.",
           type="object", additionalProperties={"type": "number", "exclusiveMinimum": 0}),
)  # fmt: skip
BY_NAME = {row.name: row for row in TABLE}


@lru_cache(maxsize=1)
def schema() -> dict[str, Any]:
    """Returns the JSON schema of machines.yaml."""
    timed = {row.name: row.json_schema() for row in TABLE if row.timed}
    timing = {"type": "object", "additionalProperties": False, "properties": timed}
    top = _group()
    for row in TABLE:
        *above, last = row.name.split(".")
        group = top
        for part in above:
            group = group["properties"].setdefault(part, _group())
        group["properties"][last] = row.json_schema()
    top["properties"]["timings"] = {"type": "object", "additionalProperties": timing}
    return top


def _group() -> dict[str, Any]:
    return {"type": "object", "additionalProperties": False, "properties": {}}


def unknown(values: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yields the path to each unknown name in a file, and the nearest known name or ''."""
    groups = {".".join(name.split(".")[:k]) for name in BY_NAME for k in range(1, name.count(".") + 1)}
    open_ways: list[tuple[tuple[str, ...], Any]] = [((str(name),), value) for name, value in values.items()]
    while open_ways:
        way, value = open_ways.pop(0)
        name = ".".join(way)
        if name in groups and isinstance(value, Mapping):
            open_ways += [((*way, str(each)), below) for each, below in value.items()]
        elif name not in BY_NAME and name not in groups:
            yield way, next(iter(difflib.get_close_matches(name, [*BY_NAME, *groups], 1, 0.6)), "")


def markdown() -> str:
    """Returns the table for the reference."""
    lines = ["| parameter | default | range | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    for row in TABLE:
        default = "" if row.default in (NO_DEFAULT, None) else f"`{json.dumps(row.default)}`"
        limits = "" if row.low is None else f"{'> ' if row.above else ''}{row.low:g} .. {row.high:g}"
        limits = ", ".join(row.schema.get("enum", ())) or limits
        lines.append(f"| `{row.name}` | {default} | {limits} | {row.unit} | {row.text} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(markdown())
