"""The bench presses STOP in the phases of the machine itself."""

import sys
from pathlib import Path

import pytest
from test_words import the_master

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

from console_phases import on_the_way, phases_of


def structure_of(machine, path, found):
    """As introspection publishes it: children by the path of their container."""
    found[path] = list(machine.get_children())
    for label, state in machine.get_children().items():
        if hasattr(state, "get_children"):
            structure_of(state, f"{path}/{label}", found)
    return found


@pytest.mark.parametrize(
    "action, known",
    [
        ("exchange_human_to_robot", {"set_dmp_goal", "execute_dmp", "wait_stop", "hand_close", "coglab_home_robot"}),
        ("exchange_robot_to_human", {"set_dmp_goal", "execute_dmp", "wait_stop", "hand_open", "coglab_home_robot"}),
    ],
)
def test_the_phases_are_those_of_the_machine(action, known):
    structure = structure_of(the_master(), "/coglab_master", {})
    phases, aside = phases_of(structure, action)
    labels = [path.rsplit("/", 1)[1] for path in phases]
    assert known <= set(labels) and len(phases) == len(set(phases)) > len(known)
    assert all(f"/{action}/" in path and "/recover/" not in path for path in phases)
    # Those of the recovery are aside, and none is lost.
    assert aside and all(f"/{action}/" in path and "/recover" in path for path in aside)
    leaves = [f"{path}/{label}" for path, labels in structure.items() for label in labels]
    leaves = [path for path in leaves if path not in structure and f"/{action}/" in path]
    assert sorted(phases + aside) == sorted(leaves)
    # A state that is added to the machine is a phase without a word to the bench.
    container = phases[0].rsplit("/", 1)[0]
    structure[container].append("new_state")
    assert f"{container}/new_state" in phases_of(structure, action)[0]


def test_an_action_that_is_not_there_is_named():
    with pytest.raises(KeyError, match="give"):
        phases_of({"/m": ["a"]}, "give")


def test_what_was_passed_is_on_the_way():
    assert on_the_way(["/m/a", "/m/b", "/m/c"], ["/m/c", "/m/a", "/m/x", "/m/a"]) == (["/m/a", "/m/c"], ["/m/b"])
