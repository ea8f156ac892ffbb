"""One simulated trial of a study, and the version of the code that makes it. Runs in this process or in a worker."""

from __future__ import annotations

import hashlib
import io
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from coglab_objects.database import objects_in
from coglab_py.packages import package_path

from coglab_tools.study import settings as condition_settings
from coglab_tools.study.own_files import OBJECTS, PRIMITIVES, OwnFiles
from coglab_tools.study.plan import PlannedTrial, Study

PACKAGES = (
    "coglab", "coglab_controllers", "coglab_objects", "coglab_perception", "coglab_py", "coglab_sim", "coglab_smach",
    "coglab_trials", "ctrl_more", "ih2_hand", "lwr_description", "lwr_fri_bridge",
)  # fmt: skip
"""packages whose Python, configuration and C++ influence a trial"""
OWN = tuple(
    f"coglab_tools.{name}"
    for name in ("study.simulate", "study.settings", "study.own_files", "study.measures", "report.metrics")
)
"""modules of this package that do too"""
KINDS = {".py", ".pyi", ".yaml", ".xml", ".json", ".cpp", ".hpp", ".urdf"}


class OtherVersion(RuntimeError):
    """This worker has another version of the code than the sender of the job."""


@dataclass(frozen=True)
class Job:
    """Data of one trial for a worker."""

    study: str
    trial: PlannedTrial
    actions: tuple[str, ...]
    object_id: str
    settings: Mapping[str, Any]
    simulated: Mapping[str, Any]
    limit: float
    record: bool
    own: OwnFiles
    identity: Mapping[str, Any]


def job_of(study: Study, trial: PlannedTrial) -> Job:
    """The job for one trial of a study."""
    return Job(
        study.name,
        trial,
        study.actions,
        study.object_of(trial.condition),
        study.conditions[trial.condition],
        study.simulated,
        study.limit,
        study.record,
        study.own,
        identity(),
    )


@lru_cache(maxsize=1)
def identity() -> Mapping[str, Any]:
    """Versions that influence the rows: the code of the packages (a hash), Python and numpy."""
    import numpy as np

    digest = hashlib.sha256()
    for package in PACKAGES:
        top = package_path(package, "package.xml").parent
        found = find_spec(package)
        installed = [] if (top / "src").is_dir() else list(found.submodule_search_locations or ()) if found else []
        for folder in (top, *map(Path, installed)):
            for file in sorted(folder.rglob("*")):
                inside = file.relative_to(folder)
                if file.suffix in KINDS and "test" not in inside.parts and file.is_file():
                    digest.update(f"{package}/{inside}\n".encode())
                    digest.update(file.read_bytes())
    for module in OWN:
        digest.update(Path(str(import_module(module).__file__)).read_bytes())
    return {
        "code": digest.hexdigest()[:12],
        "python": ".".join(map(str, sys.version_info[:2])),
        "numpy": np.__version__,
    }


def run(job: Job) -> tuple[list[dict[str, Any]], bytes]:
    """Run one trial in virtual time. Returns a row per handover, and the recording (a zip of its folder; empty if it is
    not kept). OtherVersion: this process has other code than the one that made the job."""
    from coglab_tools.study.rows import difference

    if change := difference(job.identity, identity()):
        raise OtherVersion(change)
    if not job.own:
        return _run(job, {})
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        job.own.write(folder)
        with objects_in(folder / OBJECTS):
            return _run(job, {"dmp_library": str(folder / PRIMITIVES)})


def _run(job: Job, files: Mapping[str, Any]) -> tuple[list[dict[str, Any]], bytes]:
    import coglab
    from coglab_sim.tracker.tracker import PerceptionSettings

    trial = job.trial
    world = coglab.World(
        trial.seed,
        conditions=coglab.Conditions(
            job.simulated.get("behaviour", "normal"),
            person=_person(job),
            perception=PerceptionSettings(perfect=job.simulated.get("perfect_perception", False)),
            object_id=job.object_id,
        ),
        settings={**condition_settings.machines_settings(job.settings), **files},
        object_on="board" if job.actions[0] == "take" else "person",
    )
    failure = ""
    with world:
        condition_settings.apply(world, job.settings)
        with world.record() as recording:
            for action in job.actions:
                try:
                    named = job.object_id if action in ("receive", "take") else None
                    result = getattr(world.robot, action)(named, limit=job.limit)
                except (TimeoutError, coglab.Refused) as error:
                    failure = f"{type(error).__name__}: {error}"
                    break
                _rest(world)
                if not result.ok:
                    break
        record = recording.trial
    if not job.record:
        return rows_of(trial, job, record, failure), b""
    labels = {"participant": trial.participant, "condition": trial.condition, "study": job.study, "notes": failure}
    return rows_of(trial, job, record, failure), _packed(replace(record, labels=labels))


def _person(job: Job) -> dict[str, Any]:
    """Fields of the virtual person: drawn by the participant's seed; variations by the trial's seed."""
    from coglab_sim.person.participant import Participant

    given = job.simulated.get("person", "drawn")
    own = {} if isinstance(given, str) else dict(given)
    profile = given if isinstance(given, str) else own.pop("profile", "drawn")
    drawn = Participant.draw(job.trial.person_seed, job.simulated.get("behaviour", "normal"), profile)
    own = {name: tuple(value) if isinstance(value, list) else value for name, value in own.items()}
    return {**asdict(drawn), **own, "seed": job.trial.seed}


def _rest(world: Any, limit: float = 20.0) -> None:
    """Let time pass until the person's hand is back, at most ``limit`` s."""
    end = world.time + limit
    while world.person.phase != "idle" and world.time < end:
        world.step(0.05)


def rows_of(trial: PlannedTrial, job: Job, record: Any, failure: str = "") -> list[dict[str, Any]]:
    """A row per handover that was begun. ``failure``: reason of a last handover without a result."""
    from coglab_tools.study.measures import measures_of

    rows = []
    for place, result in enumerate(record.results):
        row = _head(trial, job, place)
        row |= {
            "success": int(result.ok),
            "outcome": result.outcome,
            "reason_code": "" if result.ok else result.reason,
            "reason": result.sentence,
        }
        rows.append(row | measures_of(record, result))
    if failure:
        row = _head(trial, job, len(rows))
        rows.append(row | {"success": 0, "outcome": "no_result", "reason_code": "", "reason": failure})
    return rows


def _head(trial: PlannedTrial, job: Job, place: int) -> dict[str, Any]:
    return {
        "trial": trial.number,
        "participant": trial.participant,
        "block": trial.block,
        "condition": trial.condition,
        "repetition": trial.repetition,
        "handover": place + 1,
        "action": job.actions[min(place, len(job.actions) - 1)],
        "object": job.object_id,
        "seed": trial.seed,
    }


def _packed(record: Any) -> bytes:
    """The recording's folder as a zip file."""
    with tempfile.TemporaryDirectory() as place:
        folder = record.save(Path(place) / "trial")
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for file in sorted(folder.iterdir()):
                archive.write(file, file.name)
        return packed.getvalue()


def unpack(recording: bytes, folder: Path) -> None:
    """Write a recording into a new folder, completely or not at all; an older one is replaced."""
    import shutil

    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".part-") as place:
        part = Path(place) / "trial"
        with zipfile.ZipFile(io.BytesIO(recording)) as archive:
            for name in ("trial.npz", "trial.yaml"):
                archive.extract(name, part)
        shutil.rmtree(folder, ignore_errors=True)
        part.rename(folder)
