#!/usr/bin/python3
"""The node /object_database: serves the object files of a folder and reloads them when they change.

Private services: get_object, list_objects, reload (returns error messages and one code).
Parameters: ~folder; ih2_hand/dialect (legacy), dialect of the hand. Copies valid entries to ~objects/<id>, read-only.
"""

import sys

import rospy
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import GetObject, GetObjectResponse, ListObjects, ListObjectsResponse, Reload, ReloadResponse
from coglab_objects.database import ObjectDatabase, ObjectError
from coglab_py import parameters, steady
from coglab_py.node_start import init_node

MIRROR = "~objects"


class ObjectDatabaseNode:
    """ROS interface of ObjectDatabase."""

    def __init__(self) -> None:
        self.database = ObjectDatabase(
            parameters.read("~folder", str), parameters.read("ih2_hand/dialect", str, "legacy")
        )
        self.reported: list[str] = []
        self.mirrored: dict[str, str] | None = None  # text by id; None: entries of an earlier run are not removed yet
        self.behind = False  # True while the copy on the parameter server is not up to date
        self.reload(only_changed=False)
        rospy.Service("~get_object", GetObject, self.on_get)
        rospy.Service("~list_objects", ListObjects, self.on_list)
        rospy.Service("~reload", Reload, self.on_reload)
        steady.SteadyTimer(1.0, self.on_timer, "reload")

    def reload(self, only_changed: bool) -> list[str]:
        """Read the files, log each new error, copy the entries to the parameter server."""
        problems = self.database.reload(only_changed)
        for problem in problems:
            if problem not in self.reported:
                rospy.logwarn("object database: %s", problem)
        self.reported = list(problems)
        self.mirror()
        return problems

    def mirror(self) -> None:
        """Update ~objects. If the master refuses or does not answer, it is tried again each second."""
        try:
            if self.mirrored is None:
                if rospy.has_param(MIRROR):
                    rospy.delete_param(MIRROR)
                self.mirrored = {}
            wanted = {object_id: self.database.text(object_id) for object_id in self.database.ids()}
            for gone in set(self.mirrored) - set(wanted):
                rospy.delete_param(f"{MIRROR}/{gone}")
                del self.mirrored[gone]
            for object_id, text in wanted.items():
                if self.mirrored.get(object_id) != text:
                    rospy.set_param(f"{MIRROR}/{object_id}", self.database.get(object_id))
                    self.mirrored[object_id] = text
            self.behind = False
        except Exception as error:  # the master does not answer or refuses a value: the services continue
            if not self.behind:
                rospy.logwarn("object database: %s is not up to date: %s", rospy.resolve_name(MIRROR), error)
            self.behind = True

    def on_timer(self) -> None:
        """Reload changed files. No file may end the node."""
        try:
            if self.database.changed():
                self.reload(only_changed=True)
            elif self.behind:
                self.mirror()
        except Exception as error:
            rospy.logerr_throttle(10.0, f"object database: not read again ({type(error).__name__}: {error})")

    def on_list(self, _request):
        """The ids, and the errors of invalid files."""
        problems = list(self.database.problems)
        return ListObjectsResponse(self.database.ids(), problems, [ReasonCode.BAD_FILE] * len(problems))

    def on_get(self, request):
        """One entry as YAML text."""
        try:
            return GetObjectResponse(success=True, yaml=self.database.text(request.object_id))
        except ObjectError as error:
            return GetObjectResponse(False, ReasonCode.OBJECT_UNKNOWN, str(error), "")

    def on_reload(self, _request):
        """Read all files now."""
        problems = self.reload(only_changed=False)
        code = ReasonCode.BAD_FILE if problems else ReasonCode.NONE
        return ReloadResponse(not problems, code, "; ".join(problems) or f"{len(self.database.ids())} objects")


def main() -> int:
    """Entry point."""
    init_node("object_database")
    try:
        ObjectDatabaseNode()
    except parameters.ParameterError as error:
        rospy.logfatal("object_database: %s; ~folder is the folder with one YAML file per object", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
