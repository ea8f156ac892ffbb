"""Questionnaires: their items, scales and scores, and the answers of a study (``questionnaires.csv``, row per answer).

A questionnaire is a YAML file: title, source, low, high, step, ends, scales (scale: [item, ...]), reversed ([item]),
wording (item: sentence that is shown). The score of a scale is the mean of its items; a reversed item counts
low + high - answer.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coglab_py.packages import package_path
from coglab_py.yaml_file import YamlError, read

from coglab_tools.command import CheckFailed
from coglab_tools.files import alone, write_whole

if TYPE_CHECKING:
    from coglab_tools.study.plan import Study

ANSWERS = "questionnaires.csv"
COLUMNS = ("participant", "block", "condition", "questionnaire", "item", "answer")
Visit = tuple[str, int, str]  # participant, block, condition
LARGEST = 20_000_000  # bytes of a file of answers
_WORDS = {"type": "array", "minItems": 1, "uniqueItems": True, "items": {"type": "string", "pattern": r"^[a-z0-9_]+\Z"}}
_SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "required": ["title", "source", "low", "high", "scales"],
    "properties": {
        "title": {"type": "string", "minLength": 1},
        "source": {"type": "string", "minLength": 1},
        "low": {"type": "number"},
        "high": {"type": "number"},
        "step": {"type": "number", "exclusiveMinimum": 0},
        "ends": {"type": "array", "minItems": 2, "maxItems": 2, "items": {"type": "string"}},
        "scales": {"type": "object", "minProperties": 1, "additionalProperties": _WORDS},
        "reversed": _WORDS,
        "wording": {"type": "object", "additionalProperties": {"type": "string", "minLength": 1}},
    },
}


@dataclass(frozen=True)
class Questionnaire:
    """One questionnaire."""

    name: str
    title: str
    source: str
    low: float
    high: float
    step: float
    """answers are low, low + step, ..., high"""
    ends: tuple[str, str]
    """meaning of low and high"""
    scales: Mapping[str, tuple[str, ...]]
    """items of each scale"""
    reversed: frozenset[str]
    wording: Mapping[str, str] = field(default_factory=dict)
    """sentences by item; an item without one is shown by its name"""

    def shown(self, item: str) -> str:
        """Text that participants read."""
        return self.wording.get(item) or item.replace("_", " ")

    @property
    def items(self) -> tuple[str, ...]:
        """All items, in the order of the file."""
        return tuple(item for items in self.scales.values() for item in items)

    def problem(self, answer: float) -> str:
        """Reason why this answer is invalid; empty if it is valid."""
        steps = (answer - self.low) / self.step if math.isfinite(answer) else math.nan
        if self.low <= answer <= self.high and abs(steps - round(steps)) < 1e-6:
            return ""
        return f"{self.low:g} to {self.high:g} in steps of {self.step:g} is expected, got {answer:g}"

    def scores(self, answers: Mapping[str, float]) -> dict[str, float]:
        """Score of each scale whose items are all answered: the mean, with reversed items turned over."""
        turned = {
            item: self.low + self.high - answer if item in self.reversed else answer for item, answer in answers.items()
        }
        return {
            scale: sum(turned[item] for item in items) / len(items)
            for scale, items in self.scales.items()
            if all(item in turned for item in items)
        }


@dataclass(frozen=True)
class AnswerRow:
    """One answer. The fields are the columns of questionnaires.csv."""

    participant: str
    block: int
    condition: str
    questionnaire: str
    item: str
    answer: float

    @property
    def place(self) -> tuple[str, int, str, str, str]:
        """Key of the answered item."""
        return self.participant, self.block, self.condition, self.questionnaire, self.item


def shipped() -> list[str]:
    """Names of the questionnaires of this package."""
    return sorted(file.stem for file in package_path("coglab_tools", "questionnaires").glob("*.yaml"))


def find(name: str, folder: Path) -> Questionnaire:
    """A shipped questionnaire by its name, or a YAML file, relative to ``folder``. CheckFailed names file and line."""
    if name in shipped():
        path = package_path("coglab_tools", "questionnaires", f"{name}.yaml")
    elif name.endswith((".yaml", ".yml")):
        path = folder / name
    else:
        raise CheckFailed(f"one of {', '.join(shipped())}, or a YAML file of your own, is expected, got '{name}'")
    try:
        document = read(path)
        document.check(_SCHEMA)
        value = document.value
        items = [item for scale in value["scales"].values() for item in scale]
        twice = next((item for item in items if items.count(item) > 1), "")
        if twice:
            raise YamlError(document.sentence(("scales",), f"the item '{twice}' appears twice"))
        for key in ("reversed", "wording"):
            if unknown := next((item for item in value.get(key, ()) if item not in items), ""):
                raise YamlError(document.sentence((key,), f"'{unknown}' is no item of the scales"))
        if not value["low"] < value["high"]:
            raise YamlError(document.sentence(("high",), "high must be above low"))
    except YamlError as error:
        raise CheckFailed(str(error)) from None
    ends = value.get("ends", ["", ""])
    return Questionnaire(
        Path(name).stem,
        value["title"],
        value["source"],
        float(value["low"]),
        float(value["high"]),
        float(value.get("step", 1)),
        (ends[0], ends[1]),
        {scale: tuple(items) for scale, items in value["scales"].items()},
        frozenset(value.get("reversed", [])),
        value.get("wording", {}),
    )


def answers_of(study: Study) -> list[AnswerRow]:
    """All answers of a study. An empty list if there are none. CheckFailed names file and line."""
    path = study.folder / ANSWERS
    return read_answers(path, study) if path.exists() else []


def open_items(study: Study, visits: Iterable[Visit]) -> dict[Visit, dict[str, list[str]]]:
    """The items that are not answered yet, by visit and questionnaire. {} of a visit: all are answered."""
    answered = {row.place for row in answers_of(study)}
    found: dict[Visit, dict[str, list[str]]] = {}
    for visit in visits:
        found[visit] = {}
        for each in study.questionnaires:
            if items := [item for item in each.items if (*visit, each.name, item) not in answered]:
                found[visit][each.name] = items
    return found


def add_answers(study: Study, rows: Iterable[AnswerRow]) -> tuple[int, int]:
    """Add answers to the study's file, or replace older answers to the same items. The file is written completely or
    not at all. Returns the numbers of new and of replaced answers."""
    new = {row.place: row for row in rows}
    with alone(study.folder):  # the console and `study ask` can write at the same time
        known = {row.place: row for row in answers_of(study)}
        replaced = len(known.keys() & new.keys())
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in sorted({**known, **new}.values(), key=lambda row: row.place):
            writer.writerow([*row.place, f"{row.answer:g}"])
        write_whole(study.folder / ANSWERS, text.getvalue().encode())
    return len(new) - replaced, replaced


def read_answers(path: Path, study: Study) -> list[AnswerRow]:
    """Answers from a CSV file, all of it or nothing. CheckFailed names file and line.

    Two forms: one row per answer, with the columns of COLUMNS (block may be left out); or one row per participant and
    condition, with the columns participant, condition, block (may be left out) and one column per item, as a form on
    the web exports it. An empty cell is no answer. Cells are separated by commas, semicolons (with a decimal comma, as
    a German Excel writes them) or tabs.
    """
    known = study.questionnaires
    header, lines = _table(path)
    missing = [name for name in ("participant", "condition") if name not in header]
    if missing:
        raise CheckFailed(f"{path}:1: the column {missing[0]} is expected, got {', '.join(header)[:200]}")
    if len(set(header)) != len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise CheckFailed(f"{path}:1: the column '{twice}' appears twice")
    long = "answer" in header
    owner = {item: each for each in known for item in each.items}
    by_name = {each.name: each for each in known}
    if long and not {"questionnaire", "item"} <= set(header):
        raise CheckFailed(f"{path}:1: with a column answer, the columns questionnaire and item are expected too")
    if not long:
        for name in header:
            if len(both := [each.name for each in known if name in each.items]) > 1:
                raise CheckFailed(
                    f"{path}:1: the column '{name}' is an item of {' and '.join(both)}: write one row per answer, with "
                    "the columns participant, condition, questionnaire, item, answer"
                )
            if name not in owner and name not in ("participant", "condition", "block"):
                raise CheckFailed(
                    f"{path}:1: the column '{name}' is no item of {', '.join(by_name) or 'any questionnaire'}"
                )
    found: dict[tuple[str, int, str, str, str], AnswerRow] = {}
    for number, cells in lines:
        row = dict(zip(header, cells, strict=True))
        head = _head(f"{path}:{number}", row, study)
        pairs: list[tuple[Questionnaire, str, str]]
        if long:
            each = by_name.get(row["questionnaire"])
            if each is None or row["item"] not in each.items:
                raise CheckFailed(
                    f"{path}:{number}: an item of {', '.join(by_name)} is expected, got "
                    f"'{row['questionnaire']}', '{row['item']}'"
                )
            pairs = [(each, row["item"], row["answer"])]
        else:
            pairs = [(owner[name], name, cell) for name, cell in row.items() if name in owner]
        for questionnaire, item, cell in pairs:
            if not cell:
                continue
            answer = AnswerRow(*head, questionnaire.name, item, _number(f"{path}:{number}: {item}", cell))
            if sentence := questionnaire.problem(answer.answer):
                raise CheckFailed(f"{path}:{number}: {item}: {sentence}")
            if answer.place in found:
                raise CheckFailed(f"{path}:{number}: {item}: answered twice for {head[0]}, {head[2]}")
            found[answer.place] = answer
    return list(found.values())


def _table(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Column names, and the rows that are not empty with their line numbers; cells without spaces around them."""
    text = _text(path)
    first = text.readline()
    text.seek(0)
    mark = max(",;\t", key=first.count)
    reader = csv.reader(text, delimiter=mark, strict=True)
    rows: list[tuple[int, list[str]]] = []
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                rows.append((reader.line_num, [cell.strip() for cell in cells]))
    except csv.Error as error:
        raise CheckFailed(f"{path}:{reader.line_num}: a row of a CSV table is expected: {error}") from None
    if not rows:
        raise CheckFailed(f"{path}:1: a line of column names is expected, got an empty file")
    (_, header), *lines = rows
    for number, cells in lines:
        if len(cells) != len(header):
            raise CheckFailed(f"{path}:{number}: {len(header)} cells are expected, got {len(cells)}")
    if mark == ";":
        lines = [(number, [re.sub(r"^(-?\d+),(\d+)\Z", r"\1.\2", cell) for cell in cells]) for number, cells in lines]
    return header, lines


def _head(where: str, row: Mapping[str, str], study: Study) -> tuple[str, int, str]:
    for name, known in (("participant", study.participants), ("condition", tuple(study.conditions))):
        if row[name] not in known:
            raise CheckFailed(f"{where}: {name}: one of {', '.join(known)} is expected, got '{row[name]}'")
    block = _number(f"{where}: block", row.get("block") or "1")
    if block not in range(1, study.blocks + 1):
        raise CheckFailed(f"{where}: block: a whole number 1 to {study.blocks} is expected, got {block:g}")
    return row["participant"], int(block), row["condition"]


def _number(where: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise CheckFailed(f"{where}: a number is expected, got '{cell[:40]}'") from None


def _text(path: Path) -> io.StringIO:
    """The file's text; CheckFailed if it cannot be read."""
    try:
        if path.stat().st_size > LARGEST:
            raise CheckFailed(f"{path}: at most {LARGEST} bytes are expected, got {path.stat().st_size}")
        return io.StringIO(path.read_text(encoding="utf-8-sig"), newline="")
    except OSError as error:
        raise CheckFailed(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise CheckFailed(f"{path}:{line}: text in UTF-8 is expected; save the table as CSV UTF-8") from None


def scores_of(rows: Sequence[AnswerRow], known: Sequence[Questionnaire]) -> list[dict[str, Any]]:
    """Scores, one dict per participant, block, condition and scale, with value."""
    groups: dict[tuple[str, int, str, str], dict[str, float]] = {}
    for row in rows:
        groups.setdefault(row.place[:4], {})[row.item] = row.answer
    by_name = {each.name: each for each in known}
    return [
        {
            "participant": participant,
            "block": block,
            "condition": condition,
            "questionnaire": name,
            "scale": scale,
            "value": value,
        }
        for (participant, block, condition, name), answers in groups.items()
        if name in by_name
        for scale, value in by_name[name].scores(answers).items()
    ]
