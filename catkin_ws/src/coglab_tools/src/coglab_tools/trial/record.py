"""The description of a recorded trial: `trial.yaml` in the trial's folder.

A trial is a folder `<UTC stamp>_<action>[_<object>]` with `trial.yaml` and `trial.bag` (recorded by ROS) or `trial.npz`
(virtual time, `coglab.Trial.save()`). `trial.yaml` is written last: a folder that has it is complete.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from coglab_tools.command import CheckFailed, UsageError

FILE, BAG, ARRAYS = "trial.yaml", "trial.bag", "trial.npz"
VERSION = 1  # of trial.yaml


@dataclass(frozen=True)
class Outcome:
    """How the action of a trial ended."""

    success: bool
    code: int = 0
    """coglab_msgs/ReasonCode; 0 after success"""
    reason: str = "NONE"
    """name of the code"""
    text: str = ""
    """reason of the failure; empty after success"""


@dataclass(frozen=True)
class TrialRecord:
    """Contents of `trial.yaml`. Missing texts are empty."""

    id: str
    """name of the folder"""
    started: str
    """start of the action, UTC, ISO 8601; empty for virtual time"""
    duration_s: float
    action: str
    """"exchange_human_to_robot", "exchange_robot_to_human", "take" or "put"; several in virtual time: with "+" """
    outcome: Outcome
    object: str = ""
    condition: str = ""
    participant: str = ""
    session: str = ""
    study: str = ""
    seed: int | None = None
    """of the simulated person and noise; None: real, or unknown"""
    simulated: bool = False
    configuration: Mapping[str, Any] = field(default_factory=dict)
    """parameters by their names, and "hash" of all of them"""
    versions: Mapping[str, str] = field(default_factory=dict)
    """of coglab, python and debian"""
    marks: tuple[Mapping[str, Any], ...] = ()
    """events: {"name": "contact", "time_s": s since the start of the action}"""
    notes: str = ""
    version: int = VERSION

    def save(self, folder: Path) -> Path:
        """Write `trial.yaml` into `folder`, completely or not at all. Returns its path. OSError on failure."""
        file = folder / FILE
        part = file.with_name(f".{FILE}.part")
        try:
            with part.open("w", encoding="utf-8") as stream:
                yaml.safe_dump(_plain(asdict(self)), stream, sort_keys=False, allow_unicode=True)
                stream.flush()
                os.fsync(stream.fileno())
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)
        return file

    @staticmethod
    def load(folder: str | os.PathLike[str]) -> TrialRecord:
        """Read the record of a trial's folder, of either kind. UsageError: it is no trial. CheckFailed names the file
        and the error."""
        file = Path(folder) / FILE
        data = _read(file)
        try:
            if "outcome" not in data and "results" in data:
                return _virtual(file.parent, data)
            if data.get("version") != VERSION:
                raise ValueError(f"its version is {data.get('version')!r}, this program reads version {VERSION}")
            known = {each.name for each in fields(TrialRecord)}
            values = {name: value for name, value in data.items() if name in known}
            values["outcome"] = Outcome(**data["outcome"])
            values["duration_s"] = float(data["duration_s"])
            values["marks"] = tuple({"name": str(m["name"]), "time_s": float(m["time_s"])} for m in data["marks"])
            values["started"] = str(data["started"])
            if not math.isfinite(values["duration_s"]):
                raise ValueError("duration_s is not a number")
            return TrialRecord(**values)
        except KeyError as error:
            raise CheckFailed(f"{file}: the key {error} is missing; it was not written by the recorder") from None
        except (TypeError, ValueError, AttributeError) as error:
            raise CheckFailed(f"{file} is no record of a trial: {error}") from None


def _read(file: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        folder = file.parent
        kind = "is not there" if not folder.exists() else f"has no {FILE}: it is no trial, or its recording never ended"
        raise UsageError(f"{folder} {kind}; ./coglab trial list shows the trials") from None
    except NotADirectoryError:
        raise UsageError(f"{file.parent} is a file: give the folder of the trial") from None
    except (OSError, UnicodeDecodeError) as error:
        raise CheckFailed(f"{file} cannot be read: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{file}:{mark.line + 1}" if mark else str(file)
        why = getattr(error, "problem", None) or str(error)
        raise CheckFailed(f"{where} is no YAML: {' '.join(why.split())}; take the file from a copy") from None
    if not isinstance(data, dict):
        raise CheckFailed(f"{file} holds a {type(data).__name__}; a mapping with version, id, started, ... is expected")
    return data


def _virtual(folder: Path, data: Mapping[str, Any]) -> TrialRecord:
    """The record of a trial that coglab.Trial.save() wrote."""
    from coglab.results import ACTIONS, reason_name

    results, labels = data["results"], data.get("labels") or {}
    bad = next((row for row in results if not row["ok"]), None)
    outcome = Outcome(bad is None and bool(results))
    if bad is not None:
        outcome = Outcome(False, int(bad["code"]), reason_name(bad["code"]), str(bad["sentence"]))
    start = float(results[0]["started"]) if results else float(data["start"])
    end = float(results[-1]["ended"]) if results else float(data["end"])
    return TrialRecord(
        id=folder.resolve().name,
        started="",
        duration_s=round(end - start, 3),
        action="+".join(ACTIONS.get(row["what"], row["what"]) for row in results),
        outcome=outcome,
        object=str(results[0]["object_id"]) if results else "",
        participant=str(labels.get("participant", "")),
        condition=str(labels.get("condition", "")),
        study=str(labels.get("study", "")),
        session=str(labels.get("session", "")),
        notes=str(labels.get("notes", "")),
        seed=int(data["seed"]),
        simulated=True,
        configuration=dict(data["conditions"]),
        marks=tuple(
            {"name": str(name), "time_s": round(float(when) - start, 3)}
            for row in results
            for name, when in row["marks"].items()
        ),
    )


def trials_folder() -> Path:
    """Default folder of recorded handovers, without the launch argument `record`: out/trials of the workspace for
    systems that ./coglab launch starts, otherwise trials in ROS_HOME (~/.ros)."""
    given = os.environ.get("ROS_HOME", "")
    home = Path(given) if given else Path.home() / ".ros"
    top = os.environ.get("COGLAB_TOP", "") if not given else ""
    if home.parent.name == ".coglab":  # home_1, home_2, ... of ./coglab launch
        top = str(home.parent.parent)
    return Path(top) / "out" / "trials" if top else home / "trials"


def find_trials(folder: str | os.PathLike[str]) -> list[Path]:
    """Folders of the complete trials below `folder`, by name, or `folder` itself. UsageError: no such folder."""
    place = Path(folder)
    if (place / FILE).is_file():
        return [place]
    if not place.is_dir():
        raise UsageError(f"{place} is not there: give a folder of trials")
    found = []
    for here, below, files in os.walk(place):
        below[:] = sorted(name for name in below if not name.startswith("."))
        if FILE in files:
            below.clear()
            found.append(Path(here))
    return found


def _plain(value: Any) -> Any:
    """The value converted to YAML's safe types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)
