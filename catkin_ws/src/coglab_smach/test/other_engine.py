"""Runs a handover in both directions on another smach. A program: ``other_engine.py FOLDER [FILE]``.

FOLDER contains a package ``smach``. Prints one JSON object. With FILE, runs the tests of that file instead.
"""

import json
import pickle
import sys
import threading

import pytest


def use_engine(folder):
    """Take smach from ``folder``."""
    sys.path.insert(0, folder)
    if not hasattr(threading.Thread, "isAlive"):
        threading.Thread.isAlive = lambda thread: thread.is_alive()  # older releases of smach use the name of Python 2


def watch_user_data(container, seen):
    """Collect the user data that a viewer receives at each transition. Other engines pickle it."""

    def collect(*_):
        data = container.userdata
        seen.append(pickle.dumps({key: data[key] for key in list(data.keys())}, 2))

    container.register_transition_cb(collect)
    for child in container.get_children().values():
        if hasattr(child, "get_children"):
            watch_user_data(child, seen)


def main(where, *files):
    """One trial, or the tests of a file; returns the exit status."""
    use_engine(where)
    import smach

    smach.set_loggers(*[lambda *a: None] * 4)
    if files:
        print(smach.__file__)
        return pytest.main(["-q", "-p", "no:cacheprovider", *files])
    from coglab_trials import VirtualTrial
    from coglab_trials.conditions import CONSIDERATE

    trial, seen = VirtualTrial(0, CONSIDERATE), []
    watch_user_data(trial.master, seen)
    results = trial.run("exchange_human_to_robot", "exchange_robot_to_human")
    truth = trial.world.cell.truth()
    print(
        json.dumps(
            {
                "engine": smach.__file__,
                "outcomes": [[r.action, r.outcome, r.reason] for r in results],
                "held_by": truth["held_by"],
                "dropped": truth["dropped"],
                "last_hub": trial.last_hub,
                "limit_violations": trial.world.robot.limit_violations,
                "pickled": len(seen),
            }
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
