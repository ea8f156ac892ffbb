"""Data of files and services that change seldom (objects, configuration of the machines, primitives, recordings and
questionnaires), and the path of the next motion.

Both have their own thread, because they may wait for the ROS master.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import rospy
import yaml
from coglab_msgs.srv import GetObject, ListObjects, PredictDmp, PredictDmpRequest, PredictDmpResponse
from coglab_py import parameters
from coglab_py.steady import call_service, wait_for_service
from geometry_msgs.msg import Point, Quaternion

from ..scene import path_ahead
from ..scene.primitives import LibraryError, load_library
from ..scene.primitives import document as library_document
from .recordings import Recordings
from .view import RosView

PERIOD = 5.0  # s between two reads of the files and the object database
PATH_PERIOD = 0.5  # s between two predictions of the next motion's path
PREDICT = "controller_manager/dmp/predict_dmp"
MAX_OBJECTS = 100
MAX_FILE = 1_000_000  # bytes of a configuration


def lookup(values: Mapping[str, Any], name: str) -> Any:
    """Value of `a.b.c` in nested mappings; None if it is missing."""
    node: Any = values
    for part in name.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return None
        node = node[part]
    return node


class Knowledge:
    """Sets the documents of these data. `selected()` returns the object of the next action."""

    def __init__(
        self,
        view: RosView,
        put: Callable[[str, Any], None],
        say: Callable[[str, str], None],
        selected: Callable[[], str],
    ) -> None:
        self._view, self._put, self._say, self._selected = view, put, say, selected
        self._texts: dict[str, str] = {}
        self._entries: dict[str, dict] = {}
        self._config: dict = {}
        self._stamps: dict[str, int] = {}
        self._reported: dict[str, str] = {}
        self._now = threading.Event()
        self._own_frames = view.named
        self._asked = False
        self._recordings = Recordings()
        view.entry = self._entry
        view.objects = lambda: tuple(sorted(self._entries)) if self._asked else None
        view.config = lambda: self._config
        view.files_changed = self.read_again
        threading.Thread(target=self._look, name="knowledge", daemon=True).start()
        threading.Thread(target=self._paths, name="path_ahead", daemon=True).start()

    def _entry(self) -> dict:
        """Entry of the held object, of the next action's object, or of the machine's default object."""
        name = self._view.machine.object_id or self._selected() or str(self._config.get("default_object", ""))
        return self._entries.get(name, {})

    def read_again(self) -> None:
        """Call this after the object database read its files, or after a questionnaire was filled in."""
        self._now.set()

    def _look(self) -> None:
        while not rospy.is_shutdown():
            for name, work in (
                ("objects", self._objects),
                ("machines", self._machines),
                ("primitives", self._primitives),
                ("recordings", lambda: self._put("recordings", self._recordings.document())),
                ("study", lambda: self._put("study", self._view.study.document())),
            ):
                try:
                    work()
                    self._reported.pop(name, None)
                except Exception as error:  # a service or file is missing now: keep the old content
                    if self._reported.get(name) != str(error):
                        self._reported[name] = str(error)
                        self._say(f"{name}: {error}", "warning")
            self._now.wait(PERIOD)
            self._now.clear()

    def _objects(self) -> None:
        try:
            wait_for_service("object_database/list_objects", 1.0)
        except rospy.ROSException:
            self._show_objects(None)
            return
        listed = call_service("object_database/list_objects", ListObjects, wait=1.0)
        ids = listed.object_ids[:MAX_OBJECTS]
        for name in ids:
            answer = call_service("object_database/get_object", GetObject, name, wait=1.0)
            if answer.success and answer.yaml != self._texts.get(name):
                entry = yaml.safe_load(answer.yaml)
                if isinstance(entry, dict):
                    self._texts[name], self._entries[name] = answer.yaml, entry
        for gone in set(self._texts) - set(ids):
            del self._texts[gone], self._entries[gone]
        self._view.named = self._own_frames | {str(entry.get("frame", "")) for entry in self._entries.values()}
        self._show_objects([problem[:400] for problem in listed.problems[:MAX_OBJECTS]])

    def _show_objects(self, problems: list[str] | None) -> None:
        """Sets the document. `problems`: texts of the database; None: the database does not run."""
        self._asked = problems is not None
        rows = [
            {
                "id": name,
                "name": str(self._entries[name].get("name", name)),
                "mass": self._entries[name].get("mass"),
                "shape": self._entries[name].get("shape"),
                "size": self._entries[name].get("size"),
                "deliveries": list(self._entries[name].get("deliveries") or ()),
                "text": text[:8000],
            }
            for name, text in sorted(self._texts.items())
        ]
        self._put("objects", {"rows": rows, "asked": problems is not None, "problems": problems or []})

    def _changed(self, path: Path) -> bool:
        stamp = path.stat().st_mtime_ns
        if self._stamps.get(str(path)) == stamp:
            return False
        self._stamps[str(path)] = stamp
        return True

    def _machines(self) -> None:
        path = Path(parameters.read("coglab/config_file", str, ""))
        if path.is_file() and path.stat().st_size < MAX_FILE and self._changed(path):
            values = yaml.safe_load(path.read_text(encoding="utf-8"))
            if isinstance(values, dict):
                self._config = values

    def _primitives(self) -> None:
        path = Path(parameters.read("coglab/dmp_library", str, ""))
        if not path.is_file() or not self._changed(path):
            return
        try:
            library = load_library(path)
        except LibraryError as error:
            self._put("primitives", {"file": str(path), "problem": str(error), "rows": []})
            raise
        self._put("primitives", {"file": str(path), "problem": "", "rows": library_document(library)})

    # --- the path ahead ---------------------------------------------------------------------------------------

    def _paths(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(PATH_PERIOD)
            try:
                found = None if self._view.path_runs() else self._path()
                if not self._view.path_runs():  # a motion may have begun meanwhile
                    self._put("path", found)
            except Exception as error:  # nothing that comes from outside ends this thread
                if self._reported.get("path") != str(error):
                    self._reported["path"] = str(error)
                    self._say(f"the path ahead cannot be drawn: {type(error).__name__}: {error}", "warning")

    def _path(self) -> dict | None:
        """Document of the next motion's path. The view sets that of a running motion."""
        view = self._view
        actions = [
            action
            for action in view.machine.actions
            if action in ("exchange_human_to_robot", "exchange_robot_to_human")
        ]
        leaf_parent = view.machine.state.split("/")[-2:-1]
        if not actions and leaf_parent and leaf_parent[0] in path_ahead.ROLES:
            actions = leaf_parent  # the action has begun, the reach has not
        if view.preview:
            actions = [*actions, "exchange_human_to_robot"]  # if no action is possible now: the reach for the object
        wanted = path_ahead.aim(actions[0], view.entry(), view.hand_frame) if actions else None
        if wanted is None:
            return None
        if view.preview:
            wanted["primitive_id"] = view.preview
        wanted["dmp_ratio"] *= self._pace()
        answer = self._predict(wanted)
        if answer is None:
            return None
        return view.shown("ahead", answer.path) if answer.success else path_ahead.refused(answer.message)

    def _predict(self, fields: dict) -> PredictDmpResponse | None:
        """Requests the predicted path; None if the controller does not answer."""
        request = PredictDmpRequest(**fields)
        request.goal_offset = Point(*fields["goal_offset"])
        request.target_orientation = Quaternion(*fields["target_orientation"])
        try:
            return call_service(PREDICT, PredictDmp, request, wait=1.0)
        except (rospy.ServiceException, rospy.ROSException):
            return None

    def _pace(self) -> float:
        """Factor by which the machines lengthen the primitives of an exchange."""
        ratio = lookup(self._config, "handover.reach_ratio")
        return float(ratio) if isinstance(ratio, (int, float)) and ratio > 0 else 1.0
