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
ACTIONS = {"offer": "exchange_human_to_robot", "request": "exchange_robot_to_human"}
PATTERNS = {"centre": "reach_human", "left": "reach_human", "right": "reach_human", "high": "reach_human_high"}

TABLE = (
    _other("controllers", NO_DEFAULT, "", "id: plug-in type, loaded in this order", type="object", minProperties=1,
           additionalProperties=WORD),
    _other("lwr_commands", ["position", "start"], "", "sent while motion is not allowed", type="array", items=WORD),
    Parameter("dmp_library", NO_DEFAULT, "", "file of the primitives", schema=TEXT),
    Parameter("auto_trigger", False, "", "coglab_init_robot does not wait for 'initialise'"),
    _above("trigger_timeout", 3600.0, "s", "wait for 'initialise'", DAY),
    Parameter("default_object", "mug", "", "object of a trigger that names none"),
    _other("postures", NO_DEFAULT, "rad", "joint positions by name, in wire order", type="object", required=["home"],
           additionalProperties=JOINTS),
    _other("ptp_velocity", [], "rad/s", "per joint; empty: the controller's defaults",
           oneOf=[{"type": "array", "maxItems": 0}, SPEEDS]),
    _above("ptp_tolerance", 0.03, "rad", "largest difference at the end of a point-to-point motion", 1),
    _row("ptp_timeout", 5.0, "s", "beyond 1.5 times what way, limits and speed scale ask for", 0, DAY),
    Parameter("timing", "", "", "the one of `timings` that is in force; its values win over those of the file"),
    Parameter("timings", {}, "", "name: values by dotted name of the parameters that a timing may set"),
    Parameter("approach_profile", "", "", "feedback profile of a reach, left at its end; empty: none"),
    _row("goal_lost_time", 1.0, "s", "wait at the start of a motion for a goal that perception has just lost", 0, DAY),
    _row("reach_timeout", 6.0, "s", "of a reach, beyond what distance, primitive, limits and speed scale ask for",
         0, DAY),
    _above("contact_within", 0.12, "m", "to go, from which on contact is watched for", 2),
    _above("contact_near", 0.09, "m", "from the grasp, within which a touch is the object, else the arm comes again",
           2),
    _above("contact_timeout", 6.0, "s", "from then to contact; an object's entry wins", DAY),
    _above("release_timeout", 8.0, "s", "until the person takes the load; an object's entry wins", DAY),
    _other("hand.calibration", "fast", "", "order to the hand",
           enum=["fast", "complete", "fast force", "complete force"]),
    Parameter("hand.calibrate_always", False, "", "calibrate at each initialisation, even a calibrated hand"),
    _row("hand.open_speed", 400, "wire speed", "of opening", 1, 511),
    _row("hand.settle_after_close", 0.3, "s", "until the hand reports whether it holds something", 0, DAY),
    _row("hand.settle_after_start", 2.0, "s", "in which a hand node that has started counts as holding until it was "
         "seen empty", 0, DAY),
    _row("hand.tighten.medium", 140, "wire speed", "and with it the force, of closing firmly once the person has let "
         "go, for grasps of this level. The emulated hand's model; no real hand has confirmed it", 1, 511),
    _row("hand.tighten.high", 200, "wire speed", "the same for grasps of this level", 1, 511),
    _above("hand.lift", 0.03, "m", "highest rise to take the weight", 0.1),
    _above("hand.lift_speed", 0.055, "m/s", "of the rise", 0.1, timed=True),
    _row("hand.lift_after", 0.05, "s", "from closing to the rise; the weight is counted from what is felt then", 0, 10,
         timed=True),
    _above("hand.lift_step", 0.01, "m", "by which the arm rises on with the weight while the person holds on", 0.1),
    _row("hand.lift_pause", 0.5, "s", "until then, and between two such steps", 0, 10),
    _above("hand.load_share", 0.5, "", "share of the weight that has to come to the arm", 1),
    _above("hand.let_go", 0.04, "m", "by which the person's hand has to go away from the palm", 1),
    _row("hand.load_timeout", 5.0, "s", "from closing until the person has let go", 0, DAY),
    _above("motion.end_timeout", 3.0, "s", "in which a cancelled motion has to stand; then the arm is held", DAY),
    _row("hub.blocked_time", 0.5, "s", "of a blocked arm, after which a hub gives way to `stopped`", 0, DAY),
    _row("hub.silent_time", 2.0, "s", "of a silent robot node, after which a hub gives way to `fault`", 0, DAY),
    _row("give.touch_within", 0.08, "m", "to go, from which a touch ends the reach", 0, 2),
    _above("give.goal_leaves", 0.007, "m", "by which the goal goes away again where the reach ends, too", 2),
    _above("give.near", 0.25, "m", "from the palm, within which the person's hand is there", 2),
    _above("give.begins", 0.2, "", "share of the weight in the person's hand from which the grip loosens; below half "
           "of it the grip closes again", 1),
    _row("give.back_time", 0.1, "s", "after which it does", 0, 10, timed=True),
    _above("give.slip", 0.03, "m", "by which the object sinks in the loosened hand until it closes again", 1),
    _row("give.loosen", 4.0, "of 254", "counts by which the fingers are looser at last, before they open", 0, 50),
    _row("give.ease", 12.0, "of 254", "the same for a hand that feels its grip, which falls in proportion to the load",
         0, 50),
    _row("give.grip_safety", 2.0, "", "times the grip that friction needs for what the hand still carries", 1, 10),
    _row("give.loosen_speed", 40, "wire speed", "of loosening", 1, 511),
    _row("give.ease_speed", 140, "wire speed", "the same for a hand that feels its grip", 1, 511),
    _row("give.close_speed", 60, "wire speed", "and with it the force, of closing again beside the person's fingers",
         1, 511),
    _row("give.bring_after", 1.0, "s", "after which the object is brought to a hand that waits elsewhere", 0, DAY),
    _above("give.bring_speed", 0.08, "m/s", "of bringing it", 0.25),
    _row("give.lower_after", 3.0, "s", "without a share of the load, after which the arm sinks if the person's hand is "
         "at the object", 0, DAY, timed=True),
    _above("give.lower", 0.03, "m", "by which the arm sinks", 0.1),
    _above("give.lower_speed", 0.03, "m/s", "of sinking", 0.1),
    _row("give.draw_back", 0.06, "m", "by which the palm draws back outward while the hand opens; 0: not", 0, 0.2),
    _above("give.draw_back_speed", 0.25, "m/s", "of drawing back", 1),
    _above("pull.begins", 6.5, "N", "of a person's pull, from which the palm goes along", 200),
    _row("pull.time", 0.05, "s", "for which somebody has to pull", 0, 10),
    _row("pull.ends", 3.0, "N", "below which the palm stands again", 0, 200),
    _row("pull.way", 0.05, "m", "by which it goes along in all; 0: not", 0, 0.2),
    _above("pull.speed", 0.2, "m/s", "of going along", 0.5),
    _other("perception.human_hand", "human_hand", "", "tf2 frame of the person's hand, unless the parameter "
           "`perception/frames` names it", **WORD),
    _other("perception.board", "board", "", "tf2 frame of the storage board, likewise", **WORD),
    _above("perception.locate_timeout", 5.0, "s", "wait for a sight", DAY),
    _above("perception.max_age", 0.5, "s", "older sights do not count", DAY),
    _other("handover.region_low", [0.45, -0.50, 0.05], "m", "low corner of the region, in the base frame, in which an "
           "object, or a hand that asks for one, counts as offered", **TRIPLE),
    _other("handover.region_high", [0.86, 0.50, 0.85], "m", "its high corner", **TRIPLE),
    _row("handover.still_margin", 0.10, "m", "by which the region is wider for an object that is held still", 0, 2),
    _row("handover.hand_margin", 0.10, "m", "by which the region is wider for a hand that asks for the object", 0, 2),
    _row("handover.belief", 0.85, "", "probability of an offer from which the arm starts; 0: not before the object or "
         "hand is seen in the region", 0, 1, timed=True),
    Parameter("handover.belief_request", None, "", "the same for a request; left out: as of an offer", 0, 1,
              timed=True),
    _row("handover.start_after", 0.0, "s", "from then to the start", 0, 10, timed=True),
    _above("handover.reach_ratio", 1.0, "", "factor on the objects' dmp_ratio; 0.9 is the pace of a person", 10,
           timed=True),
    _row("handover.retreat", 0.10, "m", "that the goal may go back before the reach ends", 0, 2),
    _row("handover.drop", 0.08, "m", "that an object may be below its average height of the last 0.15 s", 0, 2),
    _row("handover.doubt", 0.1, "", "probability below which a reach pauses for an object or hand that is not seen in "
         "the region", 0, 1, timed=True),
    _row("handover.pause", 3.0, "s", "for which it waits then, before it is given up", 0, 60, timed=True),
    _row("handover.arrival_speed", 0.05, "m/s", "at which the hand comes to its goal; 0: as the primitive has it",
         0, 0.45, timed=True),
    _row("handover.approach", 0.05, "m", "last of the way, along the grasp's approach axis", 0, 0.3),
    _row("handover.close_within", 0.03, "m", "to go, from which the fingers close on an object that is seen between "
         "them; 0: at contact", 0, 0.1),
    _row("handover.feel", 0.3, "s", "at the goal, after which a hand that feels nothing goes on", 0, 10, timed=True),
    _row("handover.deeper", 0.02, "m", "by which it does, along the approach axis", 0, 0.1),
    _row("handover.standoff", 0.0, "m", "by which a reach for an object ends short of its grasp", 0, 0.2),
    _above("handover.offer_timeout", 8.0, "s", "wait for an offer", DAY, timed=True),
    Parameter("handover.check_reach", True, "", "refuse an offer without a posture before the arm moves"),
    Parameter("monitor.enabled", True, "", "switch to another primitive on a recognised reach"),
    _row("monitor.confidence", 0.9, "", "from which a pattern counts", 0, 1),
    _other("monitor.primitives", PATTERNS, "", "reaching pattern: primitive to switch to, among those listed",
           type="object", additionalProperties=WORD),
    Parameter("recognition_trigger.enabled", False, "", "a belief in an offer or a request leaves a hub"),
    _row("recognition_trigger.belief", 0.9, "", "probability from which it does; it has to have been below "
         "`handover.doubt` in this hub before", 0, 1, timed=True),
    _other("recognition_trigger.actions", ACTIONS, "", "offer or request: the action that it starts; left out: none",
           type="object", additionalProperties=False, properties={"offer": TEXT, "request": TEXT}),
    _row("board.room", 0.01, "m", "that hand and forearm keep above the board", 0, 0.3),
    _row("board.lift", 0.03, "m", "by which a goal is raised for it at most; else it is refused", 0, 0.3),
    _row("take.sights", 10, "", "sights of the object that are averaged", 1, 10000),
    _row("take.clearance", 0.012, "m", "between palm and object at the end of the precise motion", 0, 0.3),
    _row("take.approach", 0.05, "m", "last of the way, along the grasp's approach axis", 0, 0.3),
    _other("take.preshape", "before", "", "before or during the precise motion; read when the machine is built",
           enum=["before", "during"]),
    _other("time_limits", {}, "s", "by state label; wins over the built-in limits", type="object",
           additionalProperties={"type": "number", "exclusiveMinimum": 0}),
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
