"""A handover, both directions, on an engine that is not ours. A program: ``other_engine.py FOLDER | names [FILE]``.

FOLDER holds a package ``smach``. ``names``: our engine behind modules that have the names and signatures of the ROS
distributions' smach and nothing else. Prints one JSON object. With FILE: runs the tests of that file instead.
"""

import importlib
import json
import pickle
import sys
import threading
import types

import pytest

MODULES = {
    "smach": "State CBState Container StateMachine Sequence Concurrence Iterator UserData Remapper CBInterface "
    "cb_interface has_smach_interface InvalidTransitionError InvalidStateError InvalidConstructionError "
    "InvalidUserCodeError set_loggers loginfo logwarn logerr logdebug set_shutdown_check is_shutdown",
    "smach.state": "State CBState",
    "smach.user_data": "UserData Remapper",
    "smach.container": "Container",
    "smach.state_machine": "StateMachine",
    "smach.sequence": "Sequence",
    "smach.concurrence": "Concurrence",
    "smach.iterator": "Iterator",
    "smach.util": "CBInterface cb_interface has_smach_interface",
    "smach.log": "set_loggers loginfo logwarn logerr logdebug",
    "smach.exceptions": "SmachError InvalidTransitionError InvalidStateError InvalidConstructionError "
    "InvalidUserCodeError",
}
"""Public names of each module of smach 2.5."""

ROS_NAMES = (
    "IntrospectionServer IntrospectionClient SimpleActionState ServiceState MonitorState ConditionState "
    "ActionServerWrapper set_preempt_handler"
)
"""Public names of smach_ros 2.5 that are not those of its modules."""


ONLY_OURS = {
    "StateMachine": ("register_end_cb", "unregister_cb"),
    "Concurrence": ("is_running", "register_end_cb", "unregister_cb"),
}
"""Public methods of our containers that smach 2.5 lacks."""


class Hidden:
    """A method that is not there."""

    def __init__(self, name):
        self.name = name

    def __get__(self, instance, owner):
        raise AttributeError(f"smach 2.5 has no {owner.__name__}.{self.name}")


def narrow(smach):
    """Classes with upstream's signatures in place of ours, which take more."""

    class State(smach.State):
        def __init__(self, outcomes=[], input_keys=[], output_keys=[], io_keys=[]):  # noqa: B006
            assert all(type(keys) is list for keys in (outcomes, input_keys, output_keys, io_keys)), "lists alone"
            super().__init__(outcomes, input_keys, output_keys, io_keys)

    class StateMachine(smach.StateMachine):
        def __init__(self, outcomes, input_keys=[], output_keys=[]):  # noqa: B006
            super().__init__(outcomes, input_keys, output_keys)

        @staticmethod
        def add(label, state, transitions=None, remapping=None):
            return smach.StateMachine.add(label, state, transitions, remapping)

        def execute(self, parent_ud=None):
            return super().execute(parent_ud)

    class Concurrence(smach.Concurrence):
        def __init__(
            self,
            outcomes,
            default_outcome,
            input_keys=[],  # noqa: B006
            output_keys=[],  # noqa: B006
            outcome_map={},  # noqa: B006
            outcome_cb=None,
            child_termination_cb=None,
        ):
            super().__init__(
                outcomes, default_outcome, input_keys, output_keys, outcome_map, outcome_cb, child_termination_cb
            )

        @staticmethod
        def add(label, state, remapping={}):  # noqa: B006
            return smach.Concurrence.add(label, state, remapping)

        def execute(self, parent_ud=None):
            return super().execute(parent_ud)

    for cls in (StateMachine, Concurrence):
        for name in ONLY_OURS[cls.__name__]:
            setattr(cls, name, Hidden(name))
    return {cls.__name__: cls for cls in (State, StateMachine, Concurrence)}


def hide_names():
    """Put modules with upstream's names alone in place of our engine."""
    smach = importlib.import_module("smach")
    instead = narrow(smach)
    real = {name: importlib.import_module(name) for name in MODULES}
    for name in [name for name in sys.modules if name.partition(".")[0] == "smach"]:
        sys.modules[name] = None  # importing it now raises ImportError
    for name, public in MODULES.items():
        shown = types.ModuleType(name)
        shown.__dict__.update({n: instead.get(n) or getattr(real[name], n) for n in public.split()})
        sys.modules[name] = shown
        if name != "smach":
            setattr(sys.modules["smach"], name.partition(".")[2], shown)
    # The engine's module itself: a clock puts its threads there, in this engine as in the others.
    sys.modules["smach.concurrence"] = sys.modules["smach"].concurrence = real["smach.concurrence"]


def use_engine(folder):
    """Take smach from ``folder``."""
    sys.path.insert(0, folder)
    if not hasattr(threading.Thread, "isAlive"):
        threading.Thread.isAlive = threading.Thread.is_alive  # older releases of smach use the name of Python 2


def watch_user_data(container, seen):
    """Note what a viewer is sent at each transition: the introspection of other engines pickles it."""
    container.register_transition_cb(lambda *_: seen.append(pickle.dumps(container.userdata._data, 2)))
    for child in container.get_children().values():
        if hasattr(child, "get_children"):
            watch_user_data(child, seen)


def main(where, *files):
    """One trial, or the tests of a file; returns the exit status."""
    if where == "names":
        hide_names()
    else:
        use_engine(where)
    import smach

    smach.set_loggers(*[lambda *a: None] * 4)
    if files:
        print(smach.__file__)
        return pytest.main(["-q", "-p", "no:cacheprovider", *files])
    from virtual_trial import VirtualTrial

    trial, seen = VirtualTrial(seed=0, profile="accustomed", perfect=True), []
    watch_user_data(trial.master, seen)
    results = trial.run("exchange_human_to_robot", "exchange_robot_to_human")
    truth = trial.rig.cell.truth()
    print(
        json.dumps(
            {
                "engine": getattr(smach, "__file__", "names"),
                "outcomes": [[r.kind, r.outcome, r.reason] for r in results],
                "held_by": truth["held_by"],
                "dropped": truth["dropped"],
                "last_hub": trial.last_hub,
                "limit_violations": trial.rig.robot.limit_violations,
                "pickled": len(seen),
            }
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
