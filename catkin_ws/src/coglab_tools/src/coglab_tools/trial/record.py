"""The record of one handover: a folder with `trial.yaml` and `trial.bag`. The file `trial.yaml` is written last."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from coglab_tools.command import CheckFailed

VERSION = 1  # of trial.yaml
FILE, BAG = "trial.yaml", "trial.bag"
LEFT_OUT = ("robot_description", "roslaunch", "run_id", "rosdistro", "rosversion")
"""ROS parameters that are no setting of ours; the model of the robot is part of the versions, by its hash"""


@dataclass
class TrialRecord:
    """What `trial.yaml` says. Times of marks in s since the start of the action."""

    id: str
    """name of the folder"""
    started: str
    """UTC, ISO 8601"""
    started_ros: float
    """s of ROS time, as the stamps in the bag"""
    duration_s: float
    action: str
    """name of the action, such as exchange_human_to_robot"""
    object: str
    success: bool
    outcome: str
    code: int
    """coglab_msgs/ReasonCode; 0 after success"""
    reason: str
    """name of the code"""
    text: str
    """the reason in a sentence; empty after success"""
    causes: list[str] = field(default_factory=list)
    marks: list[dict[str, Any]] = field(default_factory=list)
    """name and time_s, in the order of their times"""
    simulated: bool = False
    seed: int | None = None
    participant: str = ""
    condition: str = ""
    session: str = ""
    study: str = ""
    notes: str = ""
    configuration: dict[str, Any] = field(default_factory=dict)
    """ROS parameters at the start"""
    configuration_hash: str = ""
    """SHA-256 of the configuration, first 16 digits: trials with the same one had the same settings"""
    versions: dict[str, str] = field(default_factory=dict)

    def save(self, folder: Path) -> None:
        """Write `trial.yaml` into the folder, completely or not at all."""
        part = folder / f".{FILE}"
        part.write_text(yaml.safe_dump({"version": VERSION, **asdict(self)}, sort_keys=False), encoding="utf-8")
        part.replace(folder / FILE)

    @staticmethod
    def load(folder: Path) -> TrialRecord:
        """Read a folder's `trial.yaml`. CheckFailed names the file and what is wrong with it."""
        file = folder / FILE
        if not file.is_file():
            raise CheckFailed(f"{folder} is no recorded trial: it has no {FILE}; ./coglab trial list shows the trials")
        try:
            data = yaml.safe_load(file.read_text(encoding="utf-8"))
            version = data.pop("version")
            if version != VERSION or "started_ros" not in data:
                raise CheckFailed(f"{file}: expected a record of version {VERSION}, got another file of that name")
            known = {each.name for each in fields(TrialRecord)}
            return TrialRecord(**{key: value for key, value in data.items() if key in known})
        except CheckFailed:
            raise
        except (OSError, yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
            raise CheckFailed(f"{file} cannot be read: {error}") from None


def default_folder() -> Path:
    """Where records go and are looked for: out/trials of the checkout, else ~/.ros/coglab_trials."""
    top = os.environ.get("COGLAB_TOP", "")
    return Path(top) / "out" / "trials" if top else Path.home() / ".ros" / "coglab_trials"


def trials_in(folder: Path) -> Iterator[Path]:
    """Folders with a complete record, oldest first."""
    yield from sorted(file.parent for file in folder.glob(f"*/{FILE}") if not file.parent.name.startswith("."))


def find_trial(name: str) -> Path:
    """The folder of a trial: a path, the name or the end of a name in the default folder, or "last"."""
    path = Path(name)
    if (path / FILE).is_file():
        return path
    known = list(trials_in(default_folder()))
    if name == "last" and known:
        return known[-1]
    found = [each for each in known if each.name == name or each.name.startswith(name)]
    if len(found) == 1:
        return found[0]
    what = f"{len(found)} trials begin with" if found else "there is no trial"
    raise CheckFailed(f"{what} '{name}'; give a folder, a name that ./coglab trial list shows, or last")


def hash_of(configuration: dict[str, Any]) -> str:
    """Hash of settings, the same for the same values in any order."""
    return hashlib.sha256(yaml.safe_dump(configuration, sort_keys=True).encode()).hexdigest()[:16]


def versions() -> dict[str, str]:
    """Versions of CogLab, Python and the distribution."""
    from coglab_py.packages import package_path

    release = Path("/etc/debian_version")
    manifest = package_path("coglab_tools", "package.xml").read_text(encoding="utf-8")
    return {
        "coglab": manifest.partition("<version>")[2].partition("</version>")[0],
        "python": platform.python_version(),
        "debian": release.read_text(encoding="utf-8").strip() if release.is_file() else "",
    }
