"""What an experimenter reads: no name of a state, an action, a command or a service; every phase has words."""

import re

import pytest
from coglab_console.desk import words
from coglab_console.desk.commands import COMMANDS
from coglab_console.desk.gates import MotionGuard, Standing, reasons
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_py.packages import package_path
from coglab_smach.context.config import Config
from coglab_smach.machines import build_master
from coglab_trials.scripted import scripted_context
from coglab_trials.virtual_clock import VirtualClock, using

LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))
HELD = {"object_id": "mug", "actions": ("exchange_robot_to_human", "put")}
NAMES = re.compile(r"[a-z]+_[a-z_]+|/[a-z_]+|rosservice|coglab")


def labels_of(machine, found):
    """Labels of all states of a machine and of those within."""
    for label, state in machine.get_children().items():
        found.add(label)
        if hasattr(state, "get_children"):
            labels_of(state, found)
    return found


def the_master():
    """The whole hierarchy of the brain, on simulated ports."""
    clock, database = VirtualClock(), ObjectDatabase(objects_folder())
    config = Config.load(str(package_path("coglab_smach", "config", "machines.yaml")), {"dmp_library": LIBRARY})
    context, _ = scripted_context(clock, database, config)
    with using(clock):
        return build_master(context)


def test_every_state_of_the_machine_has_words():
    labels = labels_of(the_master(), set())
    assert len(labels) > 30
    assert sorted(label for label in labels if label not in words.PHASES) == []


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_is_told_in_words(name):
    arguments = {"start": {"action": "exchange_human_to_robot"}, "calibrate": {"mode": "complete", "force": True}}
    assert not NAMES.search(words.command(name, arguments.get(name, {})))


@pytest.mark.parametrize(
    "change",
    [
        {},
        HELD,
        {"master_alive": False, "arm_alive": False, "hand_alive": False, "manager_alive": False},
        {"in_hub": False, "state": "/coglab_master/exchange_human_to_robot/approach/arm_motion/wait_stop"},
        {"in_hub": False, "state": "/coglab_master/recover/coglab_home_robot"},
        {"state": "/coglab_master/stopped", "actions": ("reset",)},
        {"state": "/coglab_master/fault", "actions": ("initialise",)},
        {"calibrated": True, "holding": True},
    ],
)
def test_reasons_are_sentences(change):
    standing = Standing(
        **{"master_alive": True, "in_hub": True, "state": "/coglab_master/wait_without_object", **change}
    )
    for name, reason in reasons(standing, MotionGuard()).items():
        assert not NAMES.search(reason), (name, reason)


@pytest.mark.parametrize(
    "told, read",
    [
        (
            "the arm is blocked: hold is latched: rosservice call /lwr/command reset; when its cause is away, "
            "type: ./coglab start reset",
            "the arm is blocked: hold is latched; when its cause is away, press Go on",
        ),
        ("hold is latched; send reset: rosservice call /lwr/command reset", "hold is latched"),
        ("hold is latched; send reset", "hold is latched"),
        (
            "'take' refused: wait_with_object takes exchange_robot_to_human, put; "
            "type: ./coglab start exchange_robot_to_human or ./coglab start put",
            "'take' refused: 'ready, holds an object' takes Give, put; press Give or Put",
        ),
    ],
)
def test_a_sentence_of_the_brain_says_what_to_press(told, read):
    assert words.plain(told) == read


def test_a_transition_is_a_sentence():
    """Its reason stands first. What the phase that is shown beside it says already is left out."""
    path = "/coglab_master/exchange_human_to_robot"
    assert words.transition(path, "set_dmp_goal", "succeeded", "approach") == "now: reaches"
    assert words.transition("/coglab_master", "wait_with_object", "put", "put") == (
        "ready, holds an object: Put; now: puts on the board"
    )
    assert words.transition(path, "recover", "empty", "failed_empty") == "recovers: empty"
    assert words.transition(path, "switch_to_dmp", "succeeded", "switch_to_dmp") == "prepares the reach: done"
    assert words.transition(path, "monitor_dmp", "switched", "monitor_dmp", "pattern 'high'") == (
        "pattern 'high' (watches where the person reaches: switched)"
    )
    assert words.transition(path, "approach", "failed", "recover", "the arm is blocked") == (
        "the arm is blocked (reaches: failed; now: recovers)"
    )
