"""The files of coglab_tools as the page shows them: recorded handovers, and the questionnaires of a live study.

Reads what `./coglab trial` and `./coglab study` read. It waits for the disk, so it runs in a thread of its own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rospy

from ..desk.words import button

SHOWN = 20  # newest recordings
LABELS = "coglab/trial"  # parameters of the trial that is under way; `./coglab study run --live` adds its folder


class Recordings:
    """The newest recorded handovers."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[int, dict[str, Any]]] = {}

    def document(self) -> dict[str, Any]:
        """The folder, whether a recorder writes into it, and a row per recording, newest first."""
        from coglab_tools.command import CommandError
        from coglab_tools.trial.record import FILE, TrialRecord, find_trials, trials_folder

        given = rospy.get_param("trial_recorder/folder", None)
        folder = Path(str(given)).expanduser() if given else trials_folder()
        found = sorted(find_trials(folder), key=lambda place: place.name)[-SHOWN:] if folder.is_dir() else []
        known: dict[Path, tuple[int, dict[str, Any]]] = {}
        for place in reversed(found):
            try:
                stamp = (place / FILE).stat().st_mtime_ns
                before = self._known.get(place)
                known[place] = (
                    before if before and before[0] == stamp else (stamp, _row(place.name, TrialRecord.load(place)))
                )
            except (CommandError, OSError) as error:
                known[place] = (0, {"name": place.name, "outcome": f"cannot be read: {error}"})
        self._known = known
        return {"folder": str(folder), "recording": given is not None, "rows": [row for _, row in known.values()]}


def _row(name: str, record: Any) -> dict[str, Any]:
    outcome = record.outcome
    return {
        "name": name,
        "started": record.started,
        "action": button(record.action),
        "object": record.object,
        "participant": record.participant,
        "condition": record.condition,
        "study": record.study,
        "outcome": "succeeded" if outcome.success else f"{outcome.reason}: {outcome.text}"[:200],
        "duration_s": round(record.duration_s, 1),
        "notes": record.notes[:300],
    }


class LiveStudy:
    """The study that `./coglab study run --live` runs at this system."""

    def __init__(self) -> None:
        self.name = ""
        """Name of the study; empty: no study was live at the last document()."""
        self._study: Any = None
        self._read = (Path(), 0)

    def document(self) -> dict[str, Any] | None:
        """The study, its participant and condition, and the items that are not answered yet; None: no study is live."""
        from coglab_tools.command import CommandError

        named = self._named()
        self.name = str(named.get("study", "")) if named.get("study_folder") else ""
        if not self.name:
            return None
        head: dict[str, Any] = {name: str(named.get(name, "")) for name in ("study", "participant", "condition")}
        head["of"] = list(map(str, self._head(named)))
        try:
            return {**head, "problem": "", "questionnaires": self._open(named)}
        except CommandError as error:
            return {**head, "problem": str(error), "questionnaires": []}

    def answer(self, questionnaire: str, answers: dict[str, float], of: list[str] | None = None) -> str:
        """Writes answers of the participant under this condition, all or none. `of`: participant, block and condition
        of the form; None: the current ones. Returns a sentence. CommandError if they cannot be written."""
        from coglab_tools.command import CheckFailed
        from coglab_tools.study.questionnaires import AnswerRow, add_answers

        if not answers:
            raise CheckFailed("nothing is filled in: type a number at one item or more")
        named = self._named()
        if not named.get("study_folder"):
            raise CheckFailed("no study is live: ./coglab study run FOLDER --live")
        study = self._load(named)
        one = next((each for each in study.questionnaires if each.name == questionnaire), None)
        if one is None:
            raise CheckFailed(f"{study.name} has no questionnaire '{questionnaire}'")
        for item, value in answers.items():
            sentence = one.problem(float(value)) if item in one.items else f"it is not an item of {one.title}"
            if sentence:
                raise CheckFailed(f"{item}: {sentence}")
        head = self._head(named)
        if of is not None and of != list(map(str, head)):
            raise CheckFailed(
                f"the study went on to {head[0]}, {head[2]}, and nothing was written: ./coglab study ask {of[0]} asks "
                f"for {of[2]} later"
            )
        add_answers(study, [AnswerRow(*head, questionnaire, item, float(value)) for item, value in answers.items()])
        return f"{len(answers)} answers of {head[0]} under {head[2]} written"

    def _open(self, named: dict[str, Any]) -> list[dict[str, Any]]:
        from coglab_tools.study.questionnaires import open_items

        study = self._load(named)
        head = self._head(named)
        missing = open_items(study, [head])[head]
        found = []
        for one in study.questionnaires:
            if items := missing.get(one.name):
                found.append(
                    {
                        "name": one.name,
                        "title": one.title,
                        "low": one.low,
                        "high": one.high,
                        "step": one.step,
                        "ends": one.ends,
                        "items": [[item, one.shown(item)] for item in items],
                    }
                )
        return found

    @staticmethod
    def _named() -> dict[str, Any]:
        named = rospy.get_param(LABELS, {})
        return named if isinstance(named, dict) else {}

    @staticmethod
    def _head(named: dict[str, Any]) -> tuple[str, int, str]:
        return str(named.get("participant", "")), int(named.get("block", 1)), str(named.get("condition", ""))

    def _load(self, named: dict[str, Any]) -> Any:
        """The study. Reads it again if its file changed."""
        from coglab_tools.study.plan import FILE, load

        file = Path(str(named["study_folder"])) / FILE
        stamp = (file, file.stat().st_mtime_ns if file.is_file() else 0)
        if self._study is None or stamp != self._read:
            self._study, self._read = load(file.parent), stamp
        return self._study
