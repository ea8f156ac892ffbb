"""The person and an object that comes later: place_object with another name changes the plant, and whom it is for."""

import dataclasses
import importlib.util
import threading
from pathlib import Path

import numpy as np
import pytest
from coglab_msgs.msg import CellTruth
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene, WorldView, shipped
from coglab_sim.person.virtual_human import VirtualHuman
from geometry_msgs.msg import Pose, Quaternion

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "virtual_human.py"
STANDING = Pose(orientation=Quaternion(0, 0, 0, 1))


def person(name, knows_weight=True):
    """Who begins with that object; nobody misjudges a weight that was felt."""
    participant = dataclasses.replace(Participant.draw(3), weight_error=0.2)
    return VirtualHuman(participant, Scene.of(shipped(name)), knows_weight)


@pytest.mark.parametrize("knows_weight", [True, False])
def test_who_meets_another_object_is_as_who_began_with_it(knows_weight):
    human, fresh = person("mug"), person("bottle", knows_weight)
    human.step(0.0, WorldView())
    human.meets(Scene.of(shipped("bottle")), knows_weight)
    assert human.grip_force.expected == fresh.grip_force.expected == pytest.approx(0.53 * 9.81, rel=0.25)
    assert (human.grip_force.expected == pytest.approx(0.53 * 9.81)) == knows_weight
    assert human.grip_force.force == fresh.grip_force.force
    for field in dataclasses.fields(Scene):
        assert np.array_equal(getattr(human.scene, field.name), getattr(fresh.scene, field.name)), field.name


@pytest.fixture
def node(monkeypatch):
    """The node with a mug, without a master: parameters keep their defaults."""
    spec = importlib.util.spec_from_file_location("virtual_human_node", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module.parameters, "read", lambda name, kind, otherwise=None, *limits: otherwise)
    monkeypatch.setattr(module.rospy, "has_param", lambda name: False)
    monkeypatch.setattr(module.rospy, "logwarn", lambda text, *values: said.append(text % values))
    said = []
    made = object.__new__(module.VirtualHumanNode)
    made.human, made.object_id, made.lock, made.said = person("mug"), "mug", threading.Lock(), said
    return made


def truth(name, held_by="human"):
    return CellTruth(object_id=name, object=STANDING, robot_hand=STANDING, human_hand=STANDING, held_by=held_by)


def test_the_node_follows_the_name_in_the_truth(node):
    before = node.human.scene
    node.on_truth(truth("mug"))
    node.on_truth(truth(""))
    assert node.human.scene is before, "the same object, or none"
    node.on_truth(truth("bottle"))
    assert node.human.scene.object_mass == 0.53 and node.human.scene.object_friction == 0.5
    assert node.human.grip_force.expected == pytest.approx(0.53 * 9.81)
    met = node.human.scene
    node.on_truth(truth("bottle"))
    assert node.human.scene is met, "once"
    node.on_truth(truth("ball", held_by="board"))
    assert node.human.grip_force.expected == pytest.approx(0.13 * 9.81 * np.exp(0.2)), "a weight that was never felt"


def test_an_object_without_a_file_is_said_once_and_ends_nothing(node):
    node.on_truth(truth("elephant"))
    node.on_truth(truth("elephant"))
    assert node.human.scene.object_mass == 0.31
    assert len(node.said) == 1 and "elephant.yaml" in node.said[0]
