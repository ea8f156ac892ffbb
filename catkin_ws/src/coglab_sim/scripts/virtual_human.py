#!/usr/bin/python3
"""The node /coglab_sim/virtual_human: a seeded person who gives and takes.

Subscribes truth/cell (what a person sees and feels), human_command (std_msgs/String: give <id>, receive <id>, rest) and
coglab/transitions of the namespace above this one (reacts by itself unless ~react is false). Publishes human_hand
(coglab_msgs/HumanHand, 100 Hz) and human_state (std_msgs/String). Names are relative to the node's namespace.
Parameters (private): transitions (topic, where it is another one), seed, behaviour, participant (mapping, overrides),
holds_object, react, rest, handover_object, object_in_hand (three numbers each, m), object_mass (kg; by default that
of the cell's object in the folder cell/objects).
"""

import sys
import threading
import time
from pathlib import Path

import numpy as np
import rospy
from coglab_msgs.msg import CellTruth, HumanHand, Transition
from coglab_objects.database import objects_folder, read_object
from coglab_py import parameters
from coglab_py.messages import pose_message, pose_of
from coglab_sim.participant import Participant
from coglab_sim.scene import Scene, WorldView
from coglab_sim.virtual_human import VirtualHuman
from geometry_msgs.msg import Vector3
from std_msgs.msg import String

LARGEST = 1e4  # m, N: no number of a cell is larger
GIVE, RECEIVE = "exchange_human_to_robot", "exchange_robot_to_human"


def object_in_cell() -> dict:
    """The object that the cell begins with, from its file."""
    folder = Path(parameters.read("cell/objects", str, str(objects_folder())))
    return read_object(folder / f"{parameters.read('cell/object/id', str, 'mug')}.yaml")[0]


class VirtualHumanNode:
    """Thin node over VirtualHuman."""

    def __init__(self) -> None:
        fields = parameters.read("~participant", dict, {})
        fields.setdefault("seed", parameters.read("~seed", int, parameters.read("seed", int, 7)))
        fields.setdefault("behaviour", parameters.read("~behaviour", str, "normal"))
        scene = Scene()
        for name in ("rest", "handover_object", "object_in_hand"):
            if rospy.has_param(f"~{name}"):
                setattr(scene, name, np.array(parameters.numbers(f"~{name}", length=3)))
        scene.object_mass = parameters.read("~object_mass", float, object_in_cell()["mass"], 0.0, 100.0)
        self.human = VirtualHuman(Participant.from_mapping(fields), scene, parameters.read("~holds_object", bool, True))
        self.lock = threading.Lock()
        self.view = WorldView()
        self.palm_history: list[tuple[float, np.ndarray]] = []
        self.hand = rospy.Publisher("human_hand", HumanHand, queue_size=1, tcp_nodelay=True)
        self.state = rospy.Publisher("human_state", String, queue_size=10, latch=True)
        self.last_phase = ""
        rospy.Subscriber("truth/cell", CellTruth, self.on_truth, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("human_command", String, self.on_command, queue_size=10)
        if parameters.read("~react", bool, True):
            above = rospy.get_namespace().rstrip("/").rpartition("/")[0]
            topic = parameters.read("~transitions", str, f"{above}/coglab/transitions")
            rospy.Subscriber(topic, Transition, self.on_transition, queue_size=100)

    def on_truth(self, message: CellTruth) -> None:
        """What the person sees and feels now; the robot's speed is judged over 0.1 s."""
        now = time.monotonic()
        robot, held = pose_of(message.robot_hand), pose_of(message.object)
        force = message.palm_force
        numbers = [
            *robot.position,
            *robot.orientation,
            *held.position,
            *held.orientation,
            force.x,
            force.y,
            force.z,
            message.robot_load_share,
            message.human_load_share,
        ]
        if not np.all(np.abs(numbers) < LARGEST):  # not finite either
            rospy.logwarn_throttle(
                5.0, f"virtual human: truth/cell ignored: a number is not finite, or beyond {LARGEST:g}"
            )
            return
        with self.lock:
            self.palm_history.append((now, robot.position))
            while self.palm_history[0][0] < now - 0.1:
                self.palm_history.pop(0)
            then, place = self.palm_history[0]
            speed = float(np.linalg.norm(robot.position - place)) / (now - then) if now - then > 0.03 else 1.0
            self.view = WorldView(
                robot,
                speed,
                held,
                float(np.linalg.norm([force.x, force.y, force.z])),
                message.robot_load_share,
                message.human_load_share,
                message.held_by,
            )

    def on_command(self, message: String) -> None:
        """What the person is asked to do."""
        try:
            with self.lock:
                self.human.command(message.data)
        except ValueError as error:
            rospy.logwarn("virtual human: %s", error)

    def on_transition(self, message: Transition) -> None:
        """The person sees what the robot is about to do."""
        if message.path != "/coglab_master":
            return
        with self.lock:
            if message.to_state == GIVE:
                self.human.command("give")
            elif message.to_state == RECEIVE:
                self.human.command("receive")
            elif message.from_state in (GIVE, RECEIVE) and message.outcome != "succeeded":
                self.human.command("rest")

    def run(self) -> None:
        """100 Hz on the steady clock."""
        period = 0.01
        due = time.monotonic()
        while not rospy.is_shutdown():
            with self.lock:
                sample = self.human.step(time.monotonic(), self.view)
            self.publish(sample)
            due = max(due + period, time.monotonic() - period)
            time.sleep(max(0.0, due - time.monotonic()))

    def publish(self, sample) -> None:
        """Hand for the cell, phase for whoever watches."""
        message = HumanHand(grip=sample.grip, grip_force=sample.grip_force)
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = "world"
        message.pose = pose_message(sample.frame)
        message.velocity.linear = Vector3(*sample.velocity)
        self.hand.publish(message)
        if sample.phase != self.last_phase:
            self.last_phase = sample.phase
            self.state.publish(String(sample.phase))
            rospy.loginfo("virtual human: %s", sample.phase)


def main() -> int:
    """Entry point."""
    rospy.init_node("virtual_human")
    try:
        node = VirtualHumanNode()
    except (ValueError, TypeError) as error:
        rospy.logfatal("virtual human: %s", error)
        return 1
    node.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
