"""A live session of a study: one participant at the running system, real or simulated.

The robot is driven by coglab.connect(). A condition takes effect without a restart: the brain reads its machines.yaml
again and the object database its folder, so the system is launched with the copies of both in the study's folder
``live``. Everything is put back at the end of the session.
"""

from __future__ import annotations

import copy
import shlex
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

import yaml
from coglab_objects.database import ObjectError, parse_object
from coglab_py.packages import package_path
from coglab_smach.context.config import Config, ConfigError
from coglab_smach.parameters import BY_NAME

from coglab_tools.command import CheckFailed, NotThere, UsageError, plural
from coglab_tools.files import write_whole
from coglab_tools.study import settings as condition_settings
from coglab_tools.study.ask import ask
from coglab_tools.study.own_files import PRIMITIVES
from coglab_tools.study.plan import PlannedTrial, Study
from coglab_tools.study.questionnaires import open_items
from coglab_tools.study.recordings import RECORDINGS
from coglab_tools.study.rows import Rows, open_rows, undone, write_table
from coglab_tools.study.simulate import identity

LIVE = "live"
ANSWER = 5.0  # s, limit for an answer of a node
PARAMETERS, NOTES = "/coglab/trial", "/coglab/note"
BETWEEN = {"p": "put", "t": "take", "g": "give"}  # actions that belong to no trial, by key
HELP = """  Enter   starts this trial
  n TEXT  adds a note to the last trial, before the first trial to that one
  r       repeats the last trial
  s       skips this trial
  p, t    puts the object down, takes it
  g       gives the object back
  c       resets the robot
  q       ends the session"""


class System(Protocol):
    """Access of a session to the running system, besides the Robot."""

    def apply(self, condition: str) -> None:
        """Apply the settings of a condition. CheckFailed or NotThere if they cannot."""

    def announce(self, trial: PlannedTrial, session: str) -> None:
        """Announce the next trial to recorders."""

    def note(self, text: str) -> None:
        """Pass a note of the experimenter to recorders."""

    def restore(self) -> None:
        """Restore the state before the session."""


def run_live(study: Study, participant: str = "") -> dict[str, Any]:
    """Run the trials of one participant that are left, with prompts on the terminal. Returns numbers, as run_simulated.

    ``participant``: "": the first one with trials left. NotThere: no robot, or it was launched with other files.
    """
    from coglab.running import NoRobot, connect

    if participant:
        study.participant(participant)
    try:
        with connect() as robot:
            return session(study, robot, RunningSystem, participant)
    except (NoRobot, ImportError) as error:
        with open_rows(study, write=True):  # not below a session that runs
            prepare(study)
        raise NotThere(f"{error}; for this study: {launch_line(study)}") from None


def session(
    study: Study,
    robot: Any,
    system_of: Callable[[Study], System],
    participant: str = "",
    line: Callable[[str], str] = input,
) -> dict[str, Any]:
    """The session itself. ``system_of``: makes the System once no other session can run. ``line``: reads a line after
    a prompt."""
    with open_rows(study, write=True) as rows:
        left = [trial for trial in undone(study, rows) if participant in ("", trial.participant)]
        if not left:
            who = participant or "every participant"
            raise UsageError(f"{study.folder}: all trials of {who} are done; ./coglab study report {study.folder}")
        left = [trial for trial in left if trial.participant == left[0].participant]
        system = system_of(study)
        rows.begin(identity(), simulated=False)
        name = f"{study.name}_{left[0].participant}_{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
        before = len(rows.trials)
        print(f"{left[0].participant}: {plural(len(left), 'trial')}\n{HELP}")
        try:
            _Session(study, robot, system, rows, name, line).run(left)
        except EOFError:
            print()
        finally:
            system.restore()
        table = rows.table()
        return {
            "study": study.name,
            "session": name,
            "trials": len(rows.trials),
            "trials_now": len(rows.trials) - before,
            "handovers": len(table),
            "succeeded": sum(int(row["success"]) for row in table),
            "table": str(write_table(study, table)),
        }


class _Session:
    def __init__(
        self, study: Study, robot: Any, system: System, rows: Rows, name: str, line: Callable[[str], str]
    ) -> None:
        self.study, self.robot, self.system, self.rows, self.name, self.line = study, robot, system, rows, name, line
        self._condition = ""
        self._notes: list[str] = []
        """before the first trial of the session"""
        self._last: tuple[int, list[dict[str, Any]]] | None = None
        """number and rows of the last trial"""
        self._attempts: dict[int, int] = {}

    def run(self, left: list[PlannedTrial]) -> None:
        place = 0
        own = [trial for trial in self.study.trials() if trial.participant == left[0].participant]
        for trial in {trial.visit: trial for trial in own}.values():
            self._questions(trial, left)  # those that an earlier session has left open
        while place <= len(left):
            over = place == len(left)
            trial = left[min(place, len(left) - 1)]
            if over:
                print(f"\n{trial.participant}: every trial is done. Enter ends the session; n TEXT and r as before")
            else:
                print(
                    f"\n{trial.participant}, trial {place + 1} of {len(left)}: {trial.condition}"
                    f" ({trial.repetition} of {self.study.repetitions}): {', '.join(self.study.actions)}"
                )
            word, _, text = self.line("> ").strip().partition(" ")
            if word == "q" or (over and word == ""):
                return
            if word == "n":
                self._note(text.strip())
            elif word == "c":
                self._reset()
            elif word in BETWEEN:
                self._between(BETWEEN[word], trial)
            elif word == "r" and place > 0:
                place -= 1
            elif word == "s" and not over:
                if trial.number not in self.rows.trials:  # after r, what was done before stays
                    self.rows.add(trial.number, [])
                place += 1
                self._questions(trial, left[place:])
            elif word == "":
                if self._run(trial):
                    place += 1
                    self._questions(trial, left[place:])
            else:
                print(HELP)

    def _run(self, trial: PlannedTrial) -> bool:
        """Run a trial and write its rows. False if it did not begin."""
        import coglab

        try:
            if trial.condition != self._condition:
                self.system.apply(trial.condition)
                self._condition = trial.condition
            self.system.announce(trial, self.name)
        except (CheckFailed, NotThere) as error:
            print(f"  {error}")
            return False
        rows: list[dict[str, Any]] = []
        object_id = self.study.object_of(trial.condition)
        attempt = self._attempts.get(trial.number, 0) + 1
        for place, action in enumerate(self.study.actions):
            row = {
                "trial": trial.number,
                "participant": trial.participant,
                "block": trial.block,
                "condition": trial.condition,
                "repetition": trial.repetition,
                "handover": place + 1,
                "action": action,
                "object": object_id,
                "session": self.name,
                "attempt": attempt,
                "started_utc": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z",
            }
            print(f"  {action} ...", flush=True)
            try:
                named = object_id if action in ("receive", "take") else None
                result = getattr(self.robot, action)(named, limit=self.study.limit)
            except coglab.Refused as error:
                print(f"  refused: {error}; between trials p puts the object down, t takes it, g gives it back")
                if not rows:
                    return False
                rows.append(row | {"success": 0, "outcome": "refused", "reason_code": error.name, "reason": str(error)})
                break
            except KeyboardInterrupt:
                self.robot.stop("the experimenter pressed Ctrl-C")
                print("  stopped. c resets the robot")
                rows.append(
                    row | {"success": 0, "outcome": "aborted", "reason_code": "", "reason": "by the experimenter"}
                )
                break
            except TimeoutError as error:
                print(f"  {error}")
                rows.append(row | {"success": 0, "outcome": "no_result", "reason_code": "", "reason": str(error)})
                break
            print(f"  {result}")
            rows.append(row | result_fields(result))
            if not result.ok:
                break
        rows = [row | {"notes": "; ".join(self._notes)} for row in rows]
        self.rows.add(trial.number, rows)
        self._notes, self._attempts[trial.number], self._last = [], attempt, (trial.number, rows)
        return True

    def _note(self, text: str) -> None:
        if not text:
            print("  n TEXT: the text is missing")
            return
        self.system.note(text)
        if self._last is None:
            self._notes.append(text)
            return
        number, rows = self._last
        rows = [row | {"notes": "; ".join(filter(None, [row["notes"], text]))} for row in rows]
        self.rows.add(number, rows)  # the newer line of a trial counts
        self._last = number, rows

    def _between(self, action: str, trial: PlannedTrial) -> None:
        """Move the object, so that the next trial can begin. It counts for no trial."""
        try:
            named = self.study.object_of(trial.condition) if action == "take" else None
            print(f"  {action} ...", flush=True)
            print(f"  {getattr(self.robot, action)(named, limit=self.study.limit)}")
        except KeyboardInterrupt:
            self.robot.stop("the experimenter pressed Ctrl-C")
            print("  stopped. c resets the robot")
        except (RuntimeError, TimeoutError) as error:
            print(f"  {error}")

    def _reset(self) -> None:
        try:
            print(f"  {self.robot.reset()}")
        except (RuntimeError, TimeoutError) as error:
            print(f"  {error}")

    def _questions(self, trial: PlannedTrial, left: list[PlannedTrial]) -> None:
        """After the last trial under a condition: its questionnaires, if a trial was done and an item is open."""
        own = [each for each in self.study.trials() if each.visit == trial.visit]
        done = any(self.rows.trials.get(each.number) for each in own)  # a skipped trial has no rows
        if any(each in left for each in own) or not done or not any(open_items(self.study, [trial.visit]).values()):
            return
        self.system.announce(trial, self.name)  # the console shows the questionnaires of this trial
        how = "asks for them here, or after they were filled in at the console; l: later > "
        how = f"questionnaires, {trial.condition}: Enter {how}"
        word = self.line(how).strip()
        while word.partition(" ")[0] == "n":
            self._note(word.partition(" ")[2].strip())
            word = self.line(how).strip()
        if word == "":
            ask(self.study, trial.participant, trial.condition, trial.block, self.line)


def result_fields(result: Any) -> dict[str, Any]:
    """Outcome, reason and times of a handover, for its row."""
    from coglab_tools.study.measures import times_of

    return {
        "success": int(result.ok),
        "outcome": result.outcome,
        "reason_code": "" if result.ok else result.reason,
        "reason": result.sentence,
        **times_of(result),
    }


# --- files of the launched system -------------------------------------------------------------------


def machines_file(study: Study) -> Path:
    """The brain's configuration during a session."""
    return (study.folder / LIVE / "machines.yaml").resolve()


def objects_copy(study: Study) -> Path:
    """The object database during a session."""
    return (study.folder / LIVE / "objects").resolve()


def primitives_copy(study: Study) -> Path:
    """The library of primitives during a session, if the study has own primitives."""
    return (study.folder / LIVE / PRIMITIVES).resolve()


def recordings_folder(study: Study) -> Path:
    """Folder of the recorded handovers of this study."""
    return (study.folder / RECORDINGS).resolve()


def launch_line(study: Study) -> str:
    """The command that starts the system for this study."""
    own = [f"primitives:={primitives_copy(study)}"] if study.own.primitives else []
    return "./coglab launch " + shlex.join(
        [
            f"machines:={machines_file(study)}",
            f"objects:={objects_copy(study)}",
            *own,
            f"record:={recordings_folder(study)}",
        ]
    )


def prepare(study: Study) -> None:
    """Write these files without a condition: from the study's own machines.yaml, primitives.xml and objects/, and the
    shipped ones. CheckFailed: they cannot be written."""
    write_machines(study, {})
    write_objects(study, "", {})
    if study.own.primitives:
        _write(primitives_copy(study), study.own.library())


def write_machines(study: Study, settings: Mapping[str, Any]) -> None:
    """Write the brain's configuration with these settings. The brain reads it again within a state."""
    base = study.folder / "machines.yaml"
    if not base.is_file():
        base = Path(package_path("coglab_smach", "config", "machines.yaml"))
    try:
        Config.load(str(base))
        values = yaml.safe_load(base.read_text(encoding="utf-8"))
        text = yaml.safe_dump(with_settings(values, condition_settings.machines_settings(settings)), sort_keys=False)
        part = machines_file(study).with_name(".machines.check.yaml")
        write_whole(part, text.encode())
        Config.load(str(part))
        part.unlink()
    except ConfigError as error:
        raise CheckFailed(str(error)) from None
    _write(machines_file(study), text.encode())


def with_settings(values: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a copy of a machines.yaml's values with these parameters. A timing wins over the file, so parameters of
    timings are set in the active one."""
    changed: dict[str, Any] = copy.deepcopy(dict(values))
    if "timing" in settings:
        changed["timing"] = settings["timing"]
    active = changed.get("timing", "")
    for name, value in settings.items():
        if active and BY_NAME[name].timed:
            changed["timings"][active][name] = value
        elif name != "timing":
            node = changed
            *above, last = name.split(".")
            for part in above:
                node = node.setdefault(part, {})
            node[last] = value
    return changed


def write_objects(study: Study, object_id: str, settings: Mapping[str, Any]) -> None:
    """Write the objects, one of them with the primitive and delivery of a condition."""
    for name, text in study.own.object_texts.items():
        file = objects_copy(study) / f"{name}.yaml"
        if name == object_id and ("primitive" in settings or "delivery" in settings):
            try:
                text = yaml.safe_dump(condition_settings.object_with(study.own.object(name), settings), sort_keys=False)
                parse_object(text, str(file))
            except ObjectError as error:
                raise CheckFailed(str(error)) from None
        _write(file, text.encode())


def _write(file: Path, content: bytes) -> None:
    if not file.exists() or file.read_bytes() != content:
        write_whole(file, content)


# --- the running system -------------------------------------------------------------------------------------------


class RunningSystem:
    """The System over ROS. NotThere: it was launched with other files than the study's."""

    def __init__(self, study: Study) -> None:
        import rospy
        from std_msgs.msg import String

        self.study = study
        changes = [set(settings) for settings in study.conditions.values()]
        self._names = set().union(*changes)
        prepare(study)
        wrong = [
            f"{parameter} is {rospy.get_param(parameter, 'not set')}"
            for parameter, wanted in (
                ("/coglab/config_file", machines_file(study)),
                ("/object_database/folder", objects_copy(study)),
                *([("/coglab/dmp_library", primitives_copy(study))] if study.own.primitives else []),
            )
            if Path(str(rospy.get_param(parameter, ""))).resolve() != wanted
        ]
        if wrong:
            raise NotThere(
                f"the system was launched with other files ({'; '.join(wrong)}), so conditions cannot take effect; end "
                f"it and start it by {launch_line(study)}"
            )
        above = set(rospy.get_param("/coglab/config_overrides", {})) & set(self._parameters())
        if above:
            raise NotThere(
                f"the parameter /coglab/config_overrides sets {', '.join(sorted(above))}, which conditions of this "
                "study set too, and it would win: launch the system without it"
            )
        if Path(str(rospy.get_param("/trial_recorder/folder", ""))).resolve() != recordings_folder(study):
            print("  no recorder writes into this study: its report will have no fluency and no forces. To record:")
            print(f"  {launch_line(study)}")
        self._publisher = rospy.Publisher(NOTES, String, queue_size=20)
        self._speed = float(rospy.get_param("/controller_manager/speed_scale", 1.0))
        self._feedback = self._standing_feedback() if "feedback" in self._names else []

    def _parameters(self) -> set[str]:
        return {name for s in self.study.conditions.values() for name in condition_settings.machines_settings(s)}

    def apply(self, condition: str) -> None:
        """See System."""
        settings = self.study.conditions[condition]
        write_machines(self.study, settings)
        self._set_objects(self.study.object_of(condition), settings)
        if "speed" in self._names:
            self._set_speed(float(settings.get("speed", self._speed)))
        if "feedback" in self._names:
            self._set_feedback(settings.get("feedback", self._feedback))

    def announce(self, trial: PlannedTrial, session: str) -> None:
        """See System: sets the parameters below /coglab/trial: study, participant, condition and session for recorders,
        study_folder and block for the console's questionnaires."""
        import rospy

        values = {
            "study": self.study.name,
            "participant": trial.participant,
            "condition": trial.condition,
            "session": session,
            "study_folder": str(self.study.folder.resolve()),
            "block": trial.block,
        }
        rospy.set_param(PARAMETERS, values)

    def note(self, text: str) -> None:
        """See System: publishes it on /coglab/note, for recorder and console."""
        from std_msgs.msg import String

        self._publisher.publish(String(text))

    def restore(self) -> None:
        """See System."""
        import rospy

        write_machines(self.study, {})
        try:
            self._set_objects("", {})
            if "speed" in self._names:
                self._set_speed(self._speed)
            if "feedback" in self._names:
                self._set_feedback(self._feedback)
            if rospy.has_param(PARAMETERS):
                rospy.delete_param(PARAMETERS)
        except (NotThere, CheckFailed, OSError) as error:
            print(f"  the system was not put back: {error}; launch it again")

    def _set_objects(self, object_id: str, settings: Mapping[str, Any]) -> None:
        from coglab_msgs.srv import Reload

        write_objects(self.study, object_id, settings)
        self._call("object_database/reload", Reload)

    def _set_speed(self, speed: float) -> None:
        from coglab_msgs.srv import SetSpeedScale

        self._call("controller_manager/speed_scale", SetSpeedScale, speed_scale=speed)

    def _set_feedback(self, names: list[str]) -> None:
        from coglab_msgs.srv import FeedbackSelect, SetExecutionOrder

        status = self._status()
        others = [each.name for each in status if each.name not in names]
        self._call("controller_manager/feedback/set_execution_order", SetExecutionOrder, names=[*names, *others])
        enabled = {each.name for each in status if each.enabled}
        for verb, chosen in (("disable", enabled - set(names)), ("enable", set(names) - enabled)):
            if chosen:
                self._call(f"controller_manager/feedback/{verb}", FeedbackSelect, names=sorted(chosen), reason="")

    def _standing_feedback(self) -> list[str]:
        return [each.name for each in self._status() if each.enabled]

    @staticmethod
    def _status() -> list[Any]:
        from coglab_msgs.msg import FeedbackStatus
        from coglab_py.steady import wait_for
        from coglab_smach.ros.calls import Newest

        status = Newest("controller_manager/feedback/status", FeedbackStatus)
        try:
            if not wait_for(lambda: status.message, ANSWER):
                raise NotThere(
                    f"controller_manager/feedback/status has not been published for {ANSWER:g} s; ./coglab status"
                )
            return list(status.message.controllers)
        finally:
            status.close()

    @staticmethod
    def _call(name: str, kind: Any, **fields: Any) -> Any:
        from coglab_smach.ports.pending import PortError
        from coglab_smach.ros.calls import call

        pending = call(name, kind, wait=ANSWER, **fields)
        end = time.monotonic() + 2 * ANSWER
        while not pending.done():
            if time.monotonic() > end:
                pending.cancel()
                raise NotThere(f"the service {name} does not answer; ./coglab status")
            time.sleep(0.01)
        try:
            return pending.result()
        except PortError as error:
            raise CheckFailed(error.sentence) from None
