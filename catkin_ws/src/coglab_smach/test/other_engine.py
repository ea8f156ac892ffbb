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


OF_STATE = (
    "execute get_registered_input_keys get_registered_outcomes get_registered_output_keys preempt_requested "
    "recall_preempt register_input_keys register_io_keys register_outcomes register_output_keys request_preempt "
    "service_preempt"
)
OF_CONTAINER = OF_STATE + (
    " assert_opened call_start_cbs call_termination_cbs call_transition_cbs check_consistency close get_active_states "
    "get_children get_initial_states get_internal_edges is_opened open opened register_start_cb "
    "register_termination_cb register_transition_cb set_initial_state"
)
ATTRIBUTES = {
    "State": OF_STATE,
    "CBState": OF_STATE,
    "Container": OF_CONTAINER,
    "StateMachine": OF_CONTAINER + " add add_auto check_state_spec is_running",
    "Sequence": OF_CONTAINER + " add add_auto check_state_spec is_running",
    "Concurrence": OF_CONTAINER + " add",
    "Iterator": OF_CONTAINER + " set_contained_state set_iteritems",
}
"""Public attributes of the states and containers of smach 2.5."""
OF_INSTANCES = "userdata _preempt_requested"
"""What instances have besides: the data of a container, and the one private name that states of other people's use."""
NONE = object()


class Hidden:
    """A name of our engine that smach 2.5 lacks: there for the engine alone."""

    def __init__(self, name, own):
        self.name, self.own = name, own

    def __get__(self, instance, owner=None):
        if sys._getframe(1).f_globals.get("__name__", "").partition(".")[0] != "smach":
            raise AttributeError(f"smach 2.5 has no {owner.__name__}.{self.name}")
        if hasattr(self.own, "__set__"):
            return self.own.__get__(instance, owner)
        if instance is not None and self.name in vars(instance):
            return vars(instance)[self.name]
        if self.own is NONE:
            raise AttributeError(self.name)
        return self.own.__get__(instance, owner) if hasattr(self.own, "__get__") else self.own

    def __set__(self, instance, value):
        if hasattr(self.own, "__set__"):
            self.own.__set__(instance, value)
        else:
            vars(instance)[self.name] = value


def only_ours(engine_class, samples):
    """Attributes of a class of our engine that smach 2.5 lacks: of the class, and what its instances are given."""
    names = set(dir(engine_class)) | set(vars(samples[engine_class.__name__]))
    theirs = {*ATTRIBUTES[engine_class.__name__].split(), *OF_INSTANCES.split()}
    return {name for name in names if not name.startswith("__")} - theirs


def own_of(engine_class, name):
    """What the class holds under this name; NONE if instances alone have it."""
    return next((vars(one)[name] for one in engine_class.__mro__ if name in vars(one)), NONE)


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

    instead = {cls.__name__: cls for cls in (State, StateMachine, Concurrence)}
    for name in ATTRIBUTES:
        instead.setdefault(name, type(name, (getattr(smach, name),), {}))
    samples = {
        "State": smach.State(["ok"]),
        "CBState": smach.CBState(lambda ud: "ok", outcomes=["ok"]),
        "Container": smach.Container(["ok"]),
        "StateMachine": smach.StateMachine(["ok"]),
        "Sequence": smach.Sequence(["ok"], "ok"),
        "Concurrence": smach.Concurrence(["ok"], "ok"),
        "Iterator": smach.Iterator(["ok"], [], [], [1], "it"),
    }
    for name, cls in instead.items():
        for hidden in only_ours(getattr(smach, name), samples):
            setattr(cls, hidden, Hidden(hidden, own_of(getattr(smach, name), hidden)))
    return instead


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
    from coglab_trials.trial import VirtualTrial

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
