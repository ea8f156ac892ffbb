"""The experimenter reads no names of states, actions, commands or services; every phase has words."""

import pytest
from coglab_console.desk import words
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_py.packages import package_path
from coglab_smach.context.config import Config
from coglab_smach.machines import build_master
from coglab_trials.scripted import scripted_context
from coglab_trials.virtual_clock import VirtualClock, using

LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))


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


@pytest.mark.parametrize(
    "told, read",
    [
        ("'take' refused: wait_with_object takes put", "Take refused: 'ready, holds an object' takes put"),
        ("'reset' refused: the arm did not take it", "Go on refused: the arm did not take it"),
        ("the person did not take it", "the person did not take it"),
    ],
)
def test_a_sentence_of_the_brain_has_the_words_of_the_page(told, read):
    assert words.plain(told) == read
