#!/usr/bin/python3
"""Objects on the command line: list them, check them (schema, consistency, reachability), start a new one.

Usage: ./coglab object [--folder DIR] [--dialect D] list | check [ID ...] | new ID. Exit status: 0 well, 1 a check
failed, 2 usage.
"""

import argparse
import sys
from pathlib import Path

from coglab_objects.database import ObjectDatabase, ObjectError, new_object_text, objects_folder, read_object
from coglab_smach.kinematics.reachability import reachability_report


def cmd_list(database: ObjectDatabase) -> int:
    """Print one line per object."""
    for object_id in database.ids():
        entry = database.get(object_id)
        print(f"{object_id:12} {entry['mass']:5.2f} kg  grasps: {', '.join(entry['grasps'])}  {entry['name']}")
    for problem in database.problems:
        print(problem, file=sys.stderr)
    print("next: ./coglab object check")
    return 1 if database.problems else 0


def cmd_check(folder: Path, ids: list[str], dialect: str) -> int:
    """Check schema, consistency and reachability of each object."""
    failed = 0
    files = [folder / f"{i}.yaml" for i in ids] or sorted(folder.glob("*.yaml"))
    for path in files:
        try:
            entry, _ = read_object(path, dialect)
        except ObjectError as error:
            print(error)
            failed += 1
            continue
        print(f"{path.name}: schema and references ok")
        for line, ok in reachability_report(entry):
            print(f"  {line}")
            failed += 0 if ok else 1
    print("all fine" if not failed else f"{failed} problems; edit the files, then again: ./coglab object check")
    return 1 if failed else 0


def cmd_new(folder: Path, object_id: str) -> int:
    """Write a commented example to start from. An existing file is not overwritten."""
    path = folder / f"{object_id}.yaml"
    if path.exists():
        print(f"{path} exists already; edit it or choose another id", file=sys.stderr)
        return 1
    try:
        text = new_object_text(object_id)
    except ObjectError as error:
        print(error, file=sys.stderr)
        return 2
    path.write_text(text, encoding="utf-8")
    print(f"wrote {path}; edit it, then: ./coglab object check {object_id}")
    return 0


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="./coglab object", description=__doc__)
    parser.add_argument("--folder", type=Path, default=None, help="folder of the object files")
    parser.add_argument("--dialect", choices=("legacy", "v17"), default="legacy", help="firmware dialect of the hand")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("list", description=cmd_list.__doc__)
    check = verbs.add_parser("check", description=cmd_check.__doc__)
    check.add_argument("ids", nargs="*", metavar="ID", help="default: all objects of the folder")
    new = verbs.add_parser("new", description=cmd_new.__doc__)
    new.add_argument("id", metavar="ID", help="name of the object and of its file, e.g. cup")
    arguments = parser.parse_args()
    folder = arguments.folder or objects_folder()
    if arguments.verb == "check":
        return cmd_check(folder, arguments.ids, arguments.dialect)
    if arguments.verb == "new":
        return cmd_new(folder, arguments.id)
    database = ObjectDatabase(str(folder), arguments.dialect)
    database.reload()
    return cmd_list(database)


if __name__ == "__main__":
    sys.exit(main())
