"""The emulated hand as a node, without a master: contacts, physics, faults, fingers, and a quiet end."""

from __future__ import annotations

import contextlib
import threading
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import FingerContact, FingerPositions, MotorCommands, MotorStates
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.ros import emulator_node, shutdown
from std_msgs.msg import String


class Topic:
    """A topic that keeps what is published on it."""

    every: dict[str, Topic] = {}

    def __init__(self, name: str, kind: type, **_: object) -> None:
        self.kind, self.told = kind, []
        Topic.every[name] = self

    def publish(self, message: object) -> None:
        assert isinstance(message, self.kind)
        self.told.append(message)


class Cell:
    """A node with its hand; `heard` are the topics it listens to, `logged` what it has said."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, physical: bool) -> None:
        self.heard: dict[str, object] = {}
        self.logged: list[str] = []
        self.on_shutdown: list[object] = []
        Topic.every.clear()
        rospy.rostime.set_rostime_initialized(True)
        rospy.rostime.switch_to_wallclock()
        monkeypatch.setattr(rospy, "Publisher", Topic)
        monkeypatch.setattr(rospy, "Subscriber", lambda name, _, call, **__: self.heard.update({name: call}))
        monkeypatch.setattr(emulator_node, "SteadyTimer", self._timer)
        monkeypatch.setattr(rospy, "on_shutdown", self.on_shutdown.append)
        monkeypatch.setattr(rospy, "loginfo", lambda text, *values: self.logged.append(text % values))
        monkeypatch.setattr(rospy, "logwarn", lambda text, *values: self.logged.append(text % values))
        monkeypatch.setattr(rospy, "logwarn_throttle", lambda _, text, *values: self.logged.append(text % values))
        self.clock = SteppedClock()
        self.hand = EmulatedHand(self.clock, greeting=True, physical=physical)
        self.server = SimpleNamespace(
            hand=self.hand,
            lock=contextlib.nullcontext(),
            fault=Faults(self.hand).command,
            request_shutdown=lambda: None,
        )
        self.node = emulator_node.EmulatorNode(self.server)

    def _timer(self, period: float, call: object, _name: str) -> SimpleNamespace:
        self.period, self.tick, self.ended = period, call, []
        return SimpleNamespace(shutdown=lambda: self.ended.append("shut down"))


@pytest.fixture
def cell(monkeypatch) -> Cell:
    return Cell(monkeypatch, physical=False)


@pytest.fixture
def physical_cell(monkeypatch) -> Cell:
    return Cell(monkeypatch, physical=True)


def test_fingers_are_told_fifty_times_a_second_as_they_move(cell):
    assert cell.period == pytest.approx(0.02)
    cell.hand.set_contacts([255, 255, 100, 255, 255], [20] * 5)
    cell.hand.receive(bytes.fromhex("C8 80 CD FF"))
    cell.clock.sleep(3.0)
    cell.tick()
    (fingers,) = Topic.every["finger_positions"].told
    assert isinstance(fingers, FingerPositions) and fingers.header.stamp != rospy.Time()
    pressed = 1000.0 * 128 / 511
    assert list(fingers.position) == [0, 0, 113, 254, 0]
    assert list(fingers.current) == [0, 0, int(pressed), 0, 0]
    assert list(fingers.effort) == pytest.approx([0.0, 0.0, pressed, 0.0, 0.0], abs=0.1)
    cell.hand.motors[1].current = 5000.0
    cell.tick()
    assert Topic.every["finger_positions"].told[-1].current[1] == 1023


def test_without_a_cell_a_contact_stands_in_for_an_object(cell):
    assert set(cell.heard) == {"finger_contact", "hand_fault"} and "motor_commands" not in Topic.every
    cell.hand.receive(bytes.fromhex("C9 FF"))
    cell.clock.sleep(0.5)
    cell.heard["finger_contact"](FingerContact(contact_position=[250] * 5, stiffness=[20.0] * 5))
    assert cell.hand.motors[2].contact.position == 250 and cell.hand.motors[2].contact.stiffness == 20.0
    assert cell.hand.motors[2].position == pytest.approx(127.5, abs=1.0), "up to here it was free"
    cell.heard["finger_contact"](FingerContact(contact_position=[1, 2], stiffness=[1.0]))
    assert len(cell.logged) == 1 and "finger_contact refused" in cell.logged[0]


def test_in_the_cell_each_state_of_the_motors_is_answered_with_commands(physical_cell):
    cell = physical_cell
    assert set(cell.heard) == {"motor_states", "hand_fault"}
    cell.hand.receive(bytes.fromhex("44 02 66"))
    states = MotorStates(
        position=[0.0, 0.25, 0.5, 0.75, 1.0],
        current=[0.0, 1.0, 2.0, 3.0, 4.0],
        effort=[5.0, 6.0, 7.0, 8.0, 9.0],
        moving=[False, False, True, False, False],
        locked=[False] * 5,
    )
    cell.clock.sleep(0.01)
    cell.heard["motor_states"](states)
    (commands,) = Topic.every["motor_commands"].told
    assert isinstance(commands, MotorCommands) and commands.header.stamp != rospy.Time()
    assert list(commands.speed) == [0.0, 0.0, 1.0, 0.0, 0.0]
    assert list(commands.target) == pytest.approx([0.0, 0.25, 0.4, 0.75, 1.0])
    assert list(commands.current) == [0.0, 0.0, 640.0, 0.0, 0.0]
    assert cell.hand.motors[2].current == 2.0 and [motor.effort for motor in cell.hand.motors] == [5, 6, 7, 8, 9]
    states.current = [1.0]
    cell.heard["motor_states"](states)
    assert len(Topic.every["motor_commands"].told) == 1 and "motor_states refused" in cell.logged[-1]


def test_a_fault_is_carried_out_or_refused_with_words(cell):
    cell.heard["hand_fault"](String("stuck 3"))
    assert cell.hand.motors[3].stuck and cell.logged == ["hand emulator: motor 3 is stuck"]
    cell.heard["hand_fault"](String("explode"))
    assert "no such fault" in cell.logged[-1]


def test_the_end_of_ros_ends_the_port_and_the_end_of_the_port_the_timer(cell):
    assert cell.on_shutdown == [cell.server.request_shutdown]
    cell.node.stop()
    assert cell.ended == ["shut down"]


def test_the_port_is_told_as_a_parameter_while_there_is_one(monkeypatch):
    held: dict[str, str] = {}
    monkeypatch.setattr(rospy, "set_param", held.__setitem__)
    monkeypatch.setattr(rospy, "has_param", held.__contains__)
    monkeypatch.setattr(rospy, "delete_param", held.__delitem__)
    announce = emulator_node.EmulatorNode.announce
    announce("/dev/pts/7")
    assert held == {"hand_port": "/dev/pts/7"}
    announce("")
    announce("")
    assert held == {}


def test_without_a_master_the_hand_lives_on(monkeypatch):
    said: list[str] = []

    def gone(*_: object) -> None:
        raise OSError("nobody there")

    monkeypatch.setattr(rospy, "set_param", gone)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: said.append(text % values))
    emulator_node.EmulatorNode.announce("/dev/pts/7")
    assert len(said) == 1 and "nobody there" in said[0]


@pytest.mark.parametrize(
    ("requested", "closed", "error", "is_quiet"),
    [
        (True, False, rospy.ROSException("closed"), True),
        (False, True, rospy.ROSException("closed"), True),
        (False, False, rospy.ROSException("closed"), False),
        (True, True, rospy.ROSSerializationException("closed"), True),
        (True, True, ValueError("a slip"), False),
        (True, True, Exception("whatever"), False),
    ],
)
def test_only_topics_that_close_at_the_end_are_passed_over(monkeypatch, requested, closed, error, is_quiet):
    told: list[type] = []
    monkeypatch.setattr(threading, "excepthook", lambda arguments: told.append(arguments.exc_type))
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: requested)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: closed)
    assert shutdown.ending() == (requested or closed)
    shutdown.end_quietly()
    threading.excepthook(SimpleNamespace(exc_type=type(error)))
    assert told == ([] if is_quiet else [type(error)])
