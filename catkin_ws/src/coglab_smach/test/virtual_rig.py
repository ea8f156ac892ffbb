"""The whole cell in one process and in virtual time: the robot (KRC stand-in, bridge and controller manager, byte for
byte in lockstep), the hand emulator behind its driver, virtual human, tracker, contact detector. One step() is one FRI
period.
"""
from pathlib import Path
from types import SimpleNamespace

import coglab_controllers as cc
import numpy as np
import yaml
from coglab_sim import _cell  # noqa: F401  (knows the type of VirtualRobot.cell)
from coglab_sim._virtual import VirtualRobot
from coglab_sim.participant import Participant
from coglab_sim.perception_stand_in import PerceptionSettings, Tracker
from coglab_sim.rigid import Frame, quat_from_rotvec, quat_multiply
from coglab_sim.scene import Scene, WorldView
from coglab_sim.virtual_human import VirtualHuman
from coglab_smach.contact_detector import ContactDetector, DetectorSettings
from coglab_smach.manager_limits import read_limits
from ih2_hand.clock import VirtualClock as HandClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.physical_motor import MotorState
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.progress import shown_empty, shown_holding

SOURCES = Path(__file__).resolve().parents[2]
URDF = SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = str(SOURCES / "lwr_description" / "config" / "joint_limits.yaml")
MANAGER = SOURCES / "coglab_controllers" / "config" / "controllers.yaml"
BOARD = Frame(np.array([0.45, -0.55, 0.05]), quat_from_rotvec([0, 0, -np.pi / 2]))
DT = 0.005
FLOAT32 = 5e-4
"""rad/s, what rounding to float32 on the wire adds to a velocity between two answers"""


def manager_parameters() -> str:
    """The parameters of /controller_manager as the launch file loads them, in YAML."""
    parameters = yaml.safe_load(MANAGER.read_text(encoding="utf-8"))
    package, _, path = parameters["feedback_file"].removeprefix("package://").partition("/")
    parameters["feedback_file"] = str(SOURCES / package / path)
    return yaml.safe_dump(parameters)


class Robot:
    """VirtualRobot with what the detector and the figures need of each period."""

    def __init__(self, seed, limits=LIMITS, **cell):
        parameters = {"seed": int(seed), "krc/period": DT, "contact/board_center": [0.45, -0.55, 0.05],
                      **{name.replace("__", "/"): value for name, value in cell.items()}}
        self.virtual = VirtualRobot(str(URDF), limits, parameters, manager_parameters())
        self.cell = self.virtual.cell
        self.limits = cc.load_joint_limits(limits)
        self.motion_limits = read_limits({**yaml.safe_load(manager_parameters()), "joint_limits_file": limits})
        self.chain = cc.Chain(URDF.read_text())
        self.report = self.virtual.report()
        self.progress = {"motion": "idle", "reason": "", "primitive": "", "phase": 0.0, "remaining_distance": 0.0}
        self.ended: dict[int, dict] = {}
        self.loaded: dict[str, str] = {}
        self.peak_share = 0.0
        self.limit_violations = 0
        self.debug = None
        self._commanded = None

    def step(self):
        """One FRI period; the limits are looked at in what was measured and in what was answered."""
        self.virtual.tick()
        self.report = report = self.virtual.report()
        if report["fri_period"] <= 0.0:
            return
        if "ptp" in self.loaded:
            self.ended.update((end["ptp_id"], end) for end in self.virtual.ptp_ends())
        q, commanded = np.asarray(report["position"]), np.asarray(report["commanded_position"])
        outside = any(np.any(v < self.limits.lower_position) or np.any(v > self.limits.upper_position)
                      for v in (q, commanded))
        if self._commanded is not None and report["motion_allowed"]:
            speed = np.abs(commanded - self._commanded) / DT
            self.peak_share = max(self.peak_share, float(np.max(speed / self.limits.velocity)))
            outside = outside or bool(np.any(speed > self.limits.velocity + FLOAT32))
        self._commanded = commanded if report["motion_allowed"] else None
        self.limit_violations += outside

    def look_at_motion(self):
        """Progress of the DMP and, while it moves, the newest set-point and goal."""
        self.progress = self.virtual.dmp_progress()
        records = self.virtual.ik_debug()
        if records:
            self.debug = records[-1]
        return records


class Hand:
    """Driver on the emulator over a line without a pty; one task at a time, polled at 30 Hz while it runs."""

    def __init__(self, cell):
        self.cell = cell
        self.clock = HandClock()
        self.emulator = EmulatedHand(self.clock, physical=True)
        self.driver = HandSerialDriver(transport=VirtualLink(self.emulator, self.clock), clock=self.clock)
        self.calibrated = False
        self.holding = False
        self.message = ""
        self.task = None
        self.begun = 0.0
        self.verdict = None
        self.positions = (0, 0, 0, 0, 0)
        self.dead = False
        self._next_poll = 0.0

    def begin(self, task):
        """Start a task of ih2_hand.progress."""
        self.task, self.begun, self.verdict = task, self.clock.monotonic(), None
        task.begin(self.driver)

    def step(self, t):
        """Follow the time and the motors that the physics turns; tell these what to do."""
        self.clock.now = max(self.clock.now, t)
        self.emulator.follow([MotorState(*(motor[name] for name in ("position", "current", "effort", "moving", "locked")))
                              for motor in self.cell.motors()])
        self.emulator.advance()
        self._poll(t)
        self.cell.set_motors(*map(list, zip(*self.emulator.orders(), strict=True)))

    def _poll(self, t):
        if t < self._next_poll or self.dead or not self.calibrated:
            return
        self._next_poll = t + (1 / 30 if self.task is not None else 0.2)
        readings = [SimpleNamespace(**r) for r in self.driver.read_motors()]
        self.positions = tuple(r.position for r in readings)
        if self.holding and shown_empty(readings):
            self.holding = False
        elif not self.holding and shown_holding(readings):
            self.holding = True
        if self.task is None:
            return
        elapsed = self.clock.monotonic() - self.begun
        verdict = self.task.judge(readings, elapsed)
        if verdict.done or elapsed > self.task.limit:
            self.verdict, self.task = verdict, None
            if verdict.holding is not None:
                self.holding = verdict.holding
            if verdict.stop:
                self.driver.stop_all()
            self.message = verdict.text


class Rig:
    """Everything together. ``seed`` makes person, noise and tracker; ``behaviour`` is the person's."""

    def __init__(self, seed=1, behaviour="normal", perfect=False, object_on="human_hand", perception=None, turned=0.0,
                 limits=LIMITS):
        where = {"object__start": object_on, "object__position": [-0.08, 0.0, -0.05],
                 "object__rotation": [float(v) for v in quat_from_rotvec([0, 0, turned])]}
        if object_on == "world":
            where["object__position"] = [float(v) for v in BOARD.apply([0.0, 0.0, 0.002])]
            where["object__rotation"] = [float(v) for v in BOARD.orientation]
        self.robot = Robot(seed, limits, **where)
        self.cell = self.robot.cell
        self.hand = Hand(self.cell)
        self.scene = Scene()
        self.human = VirtualHuman(Participant.draw(seed, behaviour), self.scene, object_on == "human_hand")
        settings = perception or PerceptionSettings(perfect=perfect)
        self.trackers = {name: Tracker(name, settings, seed) for name in ("object_mug", "human_hand")}
        self.detector = ContactDetector(DetectorSettings(), lambda q: self.robot.chain.jacobian(q)[:3])
        self.event = None
        self.speed_scale = 1.0
        self.t = self.robot.virtual.now
        self.ticks = 0
        self.truth = self.cell.truth()
        self.watched_while_moving = 0
        self.sights = {}
        self.blind = set()
        self._palms = []

    def newest(self, name):
        """Newest sight of a frame and its age; the board is known."""
        if name == "board":
            return BOARD, 0.0
        sight = self.sights.get(name)
        if sight is None:
            return None, 1e9
        return sight.frame, self.t - sight.captured

    def step(self):
        """One FRI period."""
        if self.ticks % 2 == 0:
            self._human()
        self.hand.step(self.t)
        self.robot.virtual.set_frame("board", BOARD.position, BOARD.orientation)
        self.robot.step()
        self.ticks += 1
        self.t = self.robot.virtual.now
        self._sense()

    def _human(self):
        self.truth = truth = self.cell.truth()
        palm = frame_of(truth["robot_hand"])
        self._palms.append(palm.position)
        del self._palms[:-10]
        speed = float(np.linalg.norm(palm.position - self._palms[0])) / 0.09 if len(self._palms) > 9 else 1.0
        view = WorldView(palm, speed, frame_of(truth["object"]), float(np.linalg.norm(truth["palm_force"])),
                         truth["robot_load_share"], truth["human_load_share"], truth["held_by"])
        hand = self.human.step(self.t, view)
        self.cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, np.zeros(3), hand.grip,
                            hand.grip_force)
        for name, frame in (("object_mug", view.object), ("human_hand", hand.frame)):
            for sight in self.trackers[name].step(self.t, frame, palm):
                if name not in self.blind:
                    self.sights[name] = sight
                    self.robot.virtual.set_frame(name, sight.frame.position, sight.frame.orientation,
                                                 self.t - sight.captured)

    def _sense(self):
        report = self.robot.report
        if report["fri_period"] <= 0.0:
            return
        velocity = np.asarray(report["measured_velocity"])
        event = self.detector.feed(self.t, report["external_torque"], report["position"], velocity)
        if event is not None and self.event is None:
            self.event = event
        if self.detector.state() == "watching" and np.max(np.abs(velocity)) > 0.05:
            self.watched_while_moving += 1


def frame_of(pose):
    """A pose of the truth as a Frame."""
    return Frame(np.asarray(pose["position"]), np.asarray(pose["rotation"]))


def palm_goal(frame, offset, orientation):
    """The palm's goal from the frame it is given in: (position, unit quaternion)."""
    target = quat_multiply(frame.orientation, orientation)
    return frame.apply(offset), target / np.linalg.norm(target)


def distance(a, b):
    """(m, rad) between two poses (position, quaternion)."""
    d = min(1.0, abs(float(np.dot(a[1], b[1]))))
    return float(np.linalg.norm(np.asarray(a[0]) - np.asarray(b[0]))), 2.0 * float(np.arccos(d))
