#!/usr/bin/python3
"""The node /object_database: serves the object files of a folder and reads them again when they change.

Services (private): get_object, list_objects, reload (std_srvs/Trigger: problems in words).
Parameter (private): folder. Mirrors the good entries read-only to ~objects/<id>.
"""
import sys

import rospy
from coglab_msgs.srv import GetObject, GetObjectResponse, ListObjects, ListObjectsResponse
from coglab_smach.object_database import ObjectDatabase, ObjectError
from std_srvs.srv import Trigger, TriggerResponse


class ObjectDatabaseNode:
    """Thin node over ObjectDatabase."""

    def __init__(self) -> None:
        self.database = ObjectDatabase(rospy.get_param("~folder"))
        self.reload(only_changed=False)
        rospy.Service("~get_object", GetObject, self.on_get)
        rospy.Service("~list_objects", ListObjects, lambda _request: ListObjectsResponse(self.database.ids()))
        rospy.Service("~reload", Trigger, self.on_reload)
        rospy.Timer(rospy.Duration(1.0), self.on_timer)
        self.reported: list[str] = []

    def reload(self, only_changed: bool) -> list[str]:
        """Read, warn about each problem, mirror to the parameter server."""
        problems = self.database.reload(only_changed)
        for problem in problems:
            rospy.logwarn("object database: %s", problem)
        for object_id in self.database.ids():
            rospy.set_param(f"~objects/{object_id}", self.database.get(object_id))
        return problems

    def on_timer(self, _event) -> None:
        """Hot reload; a file that stays bad is reported once."""
        if not self.database.changed():
            return
        problems = self.database.reload(only_changed=True)
        for problem in problems:
            if problem not in self.reported:
                rospy.logwarn("object database: %s", problem)
        self.reported = problems
        for object_id in self.database.ids():
            rospy.set_param(f"~objects/{object_id}", self.database.get(object_id))

    def on_get(self, request):
        """One entry as YAML text."""
        try:
            return GetObjectResponse(True, "", self.database.text(request.object_id))
        except ObjectError as error:
            return GetObjectResponse(False, str(error), "")

    def on_reload(self, _request):
        """Read everything again now."""
        problems = self.reload(only_changed=False)
        return TriggerResponse(not problems, "; ".join(problems) or f"{len(self.database.ids())} objects")


def main() -> int:
    """Entry point."""
    rospy.init_node("object_database")
    try:
        ObjectDatabaseNode()
    except KeyError:
        rospy.logfatal("object_database: parameter ~folder is missing: the folder with one YAML file per object")
        return 1
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
