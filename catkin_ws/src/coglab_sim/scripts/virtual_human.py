#!/usr/bin/python3
"""The node /coglab_sim/virtual_human: a seeded person who gives and takes, or whose hand follows a recording.

Subscribes truth/cell (the person perceives it with delay and noise), human_command (std_msgs/String: give <id>,
receive <id>, rest) and, in the parent namespace, say (coglab_msgs/Say: the robot's speech; the person reacts unless
~react is false). Publishes human_hand (coglab_msgs/HumanHand, 100 Hz) and human_state (std_msgs/String). Names are
relative to the node's namespace.
Parameters (private): say (topic name, if different), seed, behaviour, profile (drawn, patient, accustomed),
participant (mapping, overrides), holds_object, react, rest, handover_object, object_in_hand (three numbers each, m),
object_mass (kg; default: that of the cell's object in the folder cell/objects), recording (mapping, see
recorded_person; without a file nothing is played). object_in_hand and object_mass apply to the first object of the
cell. For a later one (place_object) the person uses the values of its file.
"""

import sys
import threading
import time
from pathlib import Path

import numpy as np
import rospy
from coglab_msgs.msg import CellTruth, HumanHand, Say
from coglab_msgs.srv import PlaceObject, PlaceObjectRequest
from coglab_objects.database import ObjectError, objects_folder, read_object
from coglab_py import parameters
from coglab_py.messages import pose_message, pose_of
from coglab_py.node_start import init_node
from coglab_py.pace import Pace
from coglab_py.pose import Pose
from coglab_py.steady import call_service
from coglab_sim.person.participant import Participant
from coglab_sim.person.recorded_person import RecordedPerson, open_recorded_hand
from coglab_sim.person.scene import Scene, WorldView
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_sim.plausible import IMPLAUSIBLE, plausible
from geometry_msgs.msg import Vector3
from std_msgs.msg import String

OLDEST_WORDS = 30.0  # s; the person ignores older speech of the robot
PERIOD = 0.01  # s, between two messages
LONGEST_STEP = 0.1  # s; for so long the cell moves the hand on without a message
CELL_LIMIT = 30.0  # s, longest wait for the cell's service that puts a recorded object into the hand


def object_of(object_id: str) -> dict:
    """Reads the entry of an object of the cell from its file."""
    folder = Path(parameters.read("cell/objects", str, str(objects_folder())))
    return read_object(folder / f"{object_id}.yaml")[0]


def scene_with(entry: dict, *fields: str) -> Scene:
    """Returns the scene with an object; private parameters override the given fields."""
    scene = Scene.of(entry)
    for name in fields:
        if rospy.has_param(f"~{name}"):
            setattr(scene, name, np.array(parameters.numbers(f"~{name}", length=3)))
    return scene


class VirtualHumanNode:
    """ROS interface of VirtualHuman."""

    def __init__(self) -> None:
        self.object_id = parameters.read("cell/object/id", str, "mug")
        self.human = self.person(object_of(self.object_id))
        self.lock = threading.Lock()
        self.pace = Pace().follow("real_time_factor")  # of the cell, in the same namespace
        self.time = self.stepped_at = self.pace.now()  # s, of the person, and of the last step
        self.view = WorldView()
        self.hand = rospy.Publisher("human_hand", HumanHand, queue_size=1, tcp_nodelay=True)
        self.state = rospy.Publisher("human_state", String, queue_size=10, latch=True)
        self.last_phase = ""
        rospy.Subscriber("truth/cell", CellTruth, self.on_truth, queue_size=1, tcp_nodelay=True)
        above = rospy.get_namespace().rstrip("/").rpartition("/")[0]
        rospy.Subscriber("human_command", String, self.on_command, queue_size=10)
        if parameters.read("~react", bool, True):
            rospy.Subscriber(parameters.read("~say", str, f"{above}/say"), Say, self.on_say, queue_size=10)

    @staticmethod
    def person(entry: dict) -> VirtualHuman:
        """Creates the person that the parameters describe."""
        fields = parameters.read("~participant", dict, {})
        fields.setdefault("seed", parameters.read("~seed", int, parameters.read("seed", int, 7)))
        fields.setdefault("behaviour", parameters.read("~behaviour", str, "normal"))
        fields.setdefault("profile", parameters.read("~profile", str, "drawn"))
        scene = scene_with(entry, "rest", "handover_object", "object_in_hand")
        scene.object_mass = parameters.read("~object_mass", float, scene.object_mass, 0.0, 100.0)
        recording = parameters.read("~recording", dict, {})
        if not recording.get("file"):
            holds = parameters.read("~holds_object", bool, True)
            return VirtualHuman(Participant.from_mapping(fields), scene, holds)
        hand, way = open_recorded_hand(recording, f"object_{entry['id']}")
        rospy.loginfo("the person's hand goes as recorded in %s (%s), %.1f s", recording["file"], way, hand.end)
        return RecordedPerson(Participant.from_mapping(fields), scene, hand, way)

    def put_into_hand(self) -> None:
        """Puts the object into the hand at its recorded pose. ROSException if the cell does not answer."""
        scene = self.human.scene
        place = PlaceObjectRequest(where="human_hand", pose=pose_message(Pose(scene.object_in_hand, scene.object_turn)))
        answer = call_service("cell/place_object", PlaceObject, place, wait=CELL_LIMIT)
        if not answer.success:
            raise ValueError(f"the cell refuses the object in the recorded hand: {answer.message}")

    def on_truth(self, message: CellTruth) -> None:
        """Takes the true state of the cell as the person's view."""
        robot, held = pose_of(message.robot_hand), pose_of(message.object)
        force = message.human_force
        load = np.array([force.x, force.y, force.z])
        if not plausible([robot, *([held] if message.object_id else [])], [*load, message.hand_closure]):
            rospy.logwarn_throttle(5.0, f"virtual human: truth/cell ignored: {IMPLAUSIBLE}")
            return
        if message.object_id not in ("", self.object_id):
            self.meet(message)
        with self.lock:
            self.view = WorldView(robot, message.hand_closure, held, load)

    def meet(self, message: CellTruth) -> None:
        """The cell has another object: the person uses its data from now on."""
        self.object_id = message.object_id
        try:
            scene = scene_with(object_of(message.object_id), "rest", "handover_object")
        except ObjectError as error:
            rospy.logwarn("virtual human: goes on as with the object before: %s", error)
            return
        with self.lock:
            self.human.meets(scene, message.held_by in ("human", "both"))

    def on_command(self, message: String) -> None:
        """Passes a command to the person."""
        try:
            with self.lock:
                self.human.command(message.data)
        except ValueError as error:
            rospy.logwarn("virtual human: %s", error)

    def on_say(self, message: Say) -> None:
        """Passes the robot's speech to the person, except old latched messages."""
        if message.header.stamp and (rospy.Time.now() - message.header.stamp).to_sec() > OLDEST_WORDS:
            return
        with self.lock:
            self.human.hear(self.time, message.code)

    def run(self) -> None:
        """Steps the person at 100 Hz in the time of the cell."""
        due = self.pace.now()
        while not rospy.is_shutdown():
            self.step(self.pace.now())
            due = max(due + PERIOD, self.pace.now() - PERIOD)
            time.sleep(max(0.0, due - self.pace.now()) / self.pace.factor)

    def step(self, now: float) -> None:
        """Steps the person and publishes the hand. ``now``: time of the cell (s). If a busy computer stopped this
        node, the hand goes on from where it stopped: it does not jump to where it would be."""
        with self.lock:
            self.time += min(max(0.0, now - self.stepped_at), LONGEST_STEP)
            self.stepped_at = now
            sample = self.human.step(self.time, self.view)
        self.publish(sample)

    def publish(self, sample) -> None:
        """Publishes the hand, and the phase when it changes."""
        message = HumanHand(grip=sample.grip, grip_force=sample.grip_force)
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = "world"
        message.pose = pose_message(sample.frame)
        message.velocity.linear = Vector3(*sample.velocity)
        message.velocity.angular = Vector3(*sample.spin)
        self.hand.publish(message)
        if sample.phase != self.last_phase:
            self.last_phase = sample.phase
            self.state.publish(String(sample.phase))
            rospy.loginfo("virtual human: %s", sample.phase)


def main() -> int:
    """Entry point."""
    init_node("virtual_human")
    try:
        node = VirtualHumanNode()
        if isinstance(node.human, RecordedPerson) and node.human.recorded.object_in_hand is not None:
            node.put_into_hand()
    except (ValueError, TypeError, OSError, rospy.ROSException, rospy.ServiceException) as error:
        rospy.logfatal("virtual human: %s", error)
        return 1
    node.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
