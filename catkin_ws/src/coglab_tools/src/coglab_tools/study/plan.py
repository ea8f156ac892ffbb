"""study.yaml: participants, conditions, trials and their order. `load` checks it, `Study.trials` is the whole plan."""

from __future__ import annotations

import itertools
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from coglab_py.orders import order_of
from coglab_py.packages import package_path
from coglab_py.yaml_file import Document, YamlError, read
from coglab_sim.person.participant import BEHAVIOURS, PROFILES, Participant

from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.files import write_whole
from coglab_tools.study import settings as condition_settings
from coglab_tools.study.own_files import OwnFiles
from coglab_tools.study.questionnaires import Questionnaire, Visit, find

FILE = "study.yaml"
OWN_FILES = "own files"  # key of their hashes in the plan
ORDERS = ("latin_square", "random", "fixed")
TAKES, GIVES = ("receive", "take"), ("give", "put")
MOST_TRIALS = 100_000
PSEUDONYM = re.compile(r"[A-Z]{1,2}[0-9]{1,4}\Z")
NAME = re.compile(r"[a-z0-9][a-z0-9_.-]{0,39}\Z")

SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "required": ["version", "name", "participants", "conditions", "trial"],
    "properties": {
        "version": {"const": 1},
        "name": {"type": "string"},
        "participants": {"type": ["integer", "array"], "minimum": 1, "maximum": 9999, "minItems": 1},
        "conditions": {"type": "object", "minProperties": 1},
        "trial": {"type": "array", "minItems": 1, "maxItems": 100, "items": {"enum": [*TAKES, *GIVES]}},
        "object": {"type": "string"},
        "repetitions": {"type": "integer", "minimum": 1, "maximum": 10_000},
        "blocks": {"type": "integer", "minimum": 1, "maximum": 1000},
        "order": {"enum": list(ORDERS)},
        "questionnaires": {"type": "array", "uniqueItems": True, "items": {"type": "string"}},
        "seed": {"type": "integer", "minimum": 0},
        "limit_s": {"type": "number", "exclusiveMinimum": 0, "maximum": 3600},
        "record": {"type": "boolean"},
        "simulated": {
            "type": "object",
            "additionalProperties": False,
            "properties": {
                "person": {"type": ["string", "object"]},
                "behaviour": {"enum": list(BEHAVIOURS)},
                "perfect_perception": {"type": "boolean"},
            },
        },
    },
}


@dataclass(frozen=True)
class PlannedTrial:
    """One trial of the plan: handovers of one participant under one condition."""

    number: int
    """place in the plan, from 1"""
    participant: str
    block: int
    """from 1"""
    condition: str
    repetition: int
    """from 1, in this block and condition"""
    person_seed: int
    """seed of the virtual person: the same for all trials of a participant"""
    seed: int
    """seed of the variation between trials: the same for all conditions of a block and repetition"""

    @property
    def visit(self) -> Visit:
        """Participant, block and condition, for which the questionnaires are filled in once."""
        return self.participant, self.block, self.condition

    @property
    def label(self) -> str:
        """Name of its recording."""
        return f"{self.participant}_{self.number:05d}_{self.condition}"


@dataclass(frozen=True)
class Study:
    """A checked study.yaml."""

    folder: Path
    name: str
    participants: tuple[str, ...]
    conditions: Mapping[str, Mapping[str, Any]]
    """settings by condition"""
    actions: tuple[str, ...]
    """handovers of a trial"""
    object_id: str
    repetitions: int
    blocks: int
    order: str
    questionnaires: tuple[Questionnaire, ...]
    seed: int
    limit: float
    """s, for one handover"""
    record: bool
    simulated: Mapping[str, Any]
    plan: Mapping[str, Any]
    """the file's values and the hashes of the own files; they must not change after the first trial"""
    own: OwnFiles
    """primitives and objects of the study's own"""

    def trials(self) -> list[PlannedTrial]:
        """The whole plan, participant by participant."""
        found: list[PlannedTrial] = []
        for index, participant in enumerate(self.participants):
            shown = order_of(list(self.conditions), self.blocks, self.order, self.seed + index)
            for place, condition in enumerate(shown):
                block = place // len(self.conditions)
                for repetition in range(self.repetitions):
                    found.append(
                        PlannedTrial(
                            len(found) + 1,
                            participant,
                            block + 1,
                            condition,
                            repetition + 1,
                            _seed(self.seed, index),
                            _seed(self.seed, index, block, repetition),
                        )
                    )
        return found

    def object_of(self, condition: str) -> str:
        """Id of the object under this condition."""
        return str(self.conditions[condition].get("object", self.object_id))

    def participant(self, name: str) -> str:
        """The name itself. UsageError if the study has no such participant."""
        if name not in self.participants:
            raise UsageError(
                f"participant: one of {', '.join(self.participants)} is expected, got '{name}'; {self.folder / FILE} "
                "lists them"
            )
        return name


def _seed(*path: int) -> int:
    """A seed from a path of numbers; the same on every computer."""
    return int(np.random.SeedSequence(path).generate_state(1)[0] >> 1)


def new(folder: Path) -> Path:
    """Write a commented study.yaml into a new folder. Returns the file."""
    name = folder.name
    if not NAME.match(name):
        raise UsageError(
            f"a study's name has letters a-z, digits, _ . -, at most 40, and no _ . - at its head; got '{name}'"
        )
    if (folder / FILE).exists():
        raise UsageError(f"{folder / FILE} exists: a folder holds one study; choose another name")
    template = package_path("coglab_tools", "templates", FILE).read_text(encoding="utf-8")
    made = not folder.exists()
    try:
        if not made and (not folder.is_dir() or any(folder.iterdir())):
            raise UsageError(f"{folder} exists and is not empty: choose another name")
    except OSError as error:
        raise CheckFailed(f"{folder} cannot be read: {error.strerror}; choose another place") from None
    try:
        return write_whole(folder / FILE, template.replace("NAME", name))
    except CheckFailed:
        if made:
            with suppress(OSError):
                folder.rmdir()
        raise


def load(place: str | os.PathLike[str]) -> Study:
    """Read and check the study in a folder (or its study.yaml). CheckFailed names file and line."""
    place = Path(place)
    folder = place.parent if place.name == FILE else place
    if not (folder / FILE).is_file():
        raise UsageError(
            f"{folder / FILE} is not there: ./coglab study init NAME makes one, or name the study's folder"
        )
    try:
        document = read(folder / FILE)
        document.check(SCHEMA)
        return _study(folder, document)
    except YamlError as error:
        raise CheckFailed(str(error)) from None


def _study(folder: Path, document: Document) -> Study:
    value = document.value

    def refuse(path: tuple[Any, ...], sentence: str) -> YamlError:
        return YamlError(document.sentence(path, sentence))

    if not NAME.match(value["name"]):
        raise refuse(("name",), f"letters a-z, digits, _ . - are expected, at most 40, got '{value['name']}'")
    own = OwnFiles.read(folder)
    object_id = value.get("object", "mug")
    if sentence := condition_settings.problem("object", object_id, set(), own):
        raise refuse(("object",), sentence)
    held = False
    for place, action in enumerate(value["trial"]):
        if held == (action in TAKES):
            stands = "holds the object already" if held else "is empty: receive or take comes first"
            raise refuse(("trial", place), f"'{action}' cannot follow: the hand {stands}")
        held = action in TAKES
    conditions = dict(_conditions(document, object_id, own))
    questionnaires = []
    for place, name in enumerate(value.get("questionnaires", [])):
        try:
            questionnaires.append(find(name, folder))
        except CheckFailed as error:
            raise refuse(("questionnaires", place), str(error)) from None
    study = Study(
        folder,
        value["name"],
        _participants(document),
        conditions,
        tuple(value["trial"]),
        object_id,
        value.get("repetitions", 1),
        value.get("blocks", 1),
        value.get("order", "latin_square"),
        tuple(questionnaires),
        value.get("seed", 1),
        float(value.get("limit_s", 60.0)),
        value.get("record", True),
        value.get("simulated", {}),
        json.loads(json.dumps({**value, OWN_FILES: own.hashes} if own else value)),
        own,
    )
    _check_person(document)
    total = len(study.participants) * len(conditions) * study.blocks * study.repetitions
    if total > MOST_TRIALS:
        raise refuse((), f"{total} trials; at most {MOST_TRIALS} are possible")
    return study


def _participants(document: Document) -> tuple[str, ...]:
    given = document.value["participants"]
    if isinstance(given, int):
        width = max(2, len(str(given)))
        return tuple(f"P{number:0{width}d}" for number in range(1, given + 1))
    for place, name in enumerate(given):
        if not isinstance(name, str) or not PSEUDONYM.match(name):
            raise YamlError(
                document.sentence(
                    ("participants", place),
                    f"a pseudonym such as P03 is expected, got '{name}'; keep names of people out of the study's files",
                )
            )
        if name in given[:place]:
            raise YamlError(document.sentence(("participants", place), f"'{name}' appears twice"))
    return tuple(given)


def _conditions(document: Document, object_id: str, own: OwnFiles) -> Iterator[tuple[str, Mapping[str, Any]]]:
    given = document.value["conditions"]
    if all(isinstance(levels, list) for levels in given.values()):
        paths: dict[str, dict[str, tuple[Any, ...]]] = {}
        made = list(_combinations(document, given, paths))
    else:
        made = [(str(name), changes if changes is not None else {}) for name, changes in given.items()]
        paths = {}
    seen: set[str] = set()
    for name, changes in made:
        path: tuple[Any, ...] = ("conditions",) if name in paths else ("conditions", name)
        if not NAME.match(name) or name in seen:
            twice = "appears twice" if name in seen else "letters a-z, digits, _ . - are expected"
            raise YamlError(document.sentence(path, f"the name of a condition: {twice}, got '{name}'"))
        seen.add(name)
        if not isinstance(changes, Mapping):
            raise YamlError(
                document.sentence(
                    path, "settings such as {timing: calm} are expected; or a list of levels for every setting"
                )
            )
        handed = {str(changes.get("object", object_id))}
        for setting, value in changes.items():
            if sentence := condition_settings.problem(str(setting), value, handed & set(own.object_texts), own):
                where = paths.get(name, {}).get(setting, (*path, setting))
                raise YamlError(document.sentence(where, sentence))
        yield name, dict(changes)


def _combinations(
    document: Document, given: Mapping[str, list[Any]], paths: dict[str, dict[str, tuple[Any, ...]]]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """All combinations of the levels; their names are made of the levels."""
    for setting, levels in given.items():
        if not levels:
            raise YamlError(document.sentence(("conditions", setting), "at least one level is expected"))
    for places in itertools.product(*(range(len(levels)) for levels in given.values())):
        chosen = {setting: given[setting][place] for setting, place in zip(given, places, strict=True)}
        name = "-".join(_level(setting, value) for setting, value in chosen.items())[:40]
        paths[name] = {setting: ("conditions", setting, at) for setting, at in zip(given, places, strict=True)}
        yield name, chosen


def _level(setting: str, value: Any) -> str:
    """Part of a condition's name for one level, such as "calm" or "speed0.5"."""
    if isinstance(value, str) and value:
        text = value
    elif isinstance(value, list):
        text = "_".join(map(str, value)) or f"no_{setting}"
    else:
        text = f"{setting.rpartition('.')[2]}{value}"
    return re.sub(r"[^a-z0-9_.]+", "_", text.lower()).strip("_.") or setting


def _check_person(document: Document) -> None:
    person = document.value.get("simulated", {}).get("person", "drawn")
    path: tuple[Any, ...] = ("simulated", "person")
    if isinstance(person, str):
        if person not in PROFILES:
            raise YamlError(document.sentence(path, f"one of {', '.join(PROFILES)} is expected, got '{person}'"))
        return
    known = {field.name for field in fields(Participant)} - {"seed", "behaviour"} | {"profile"}
    for name, value in person.items():
        if name not in known:
            raise YamlError(document.sentence((*path, name), f"one of {', '.join(sorted(known))} is expected"))
        if name == "profile" and value not in PROFILES:
            raise YamlError(document.sentence((*path, name), f"one of {', '.join(PROFILES)} is expected"))
        if name != "profile" and not isinstance(value, int | float | list):
            raise YamlError(document.sentence((*path, name), f"a number is expected, got {value!r}"))
