"""The whole cell in one process and in virtual time: KRC stand-in and bridge byte for byte in lockstep, the controller
cores, the hand emulator behind its driver, virtual human, tracker, contact detector. One call of step() is
one FRI period.
"""
from pathlib import Path
from types import SimpleNamespace

import coglab_controllers as cc
import lwr_fri_bridge
import numpy as np
from coglab_sim import _cell
from coglab_sim.participant import Participant
from coglab_sim.perception_stand_in import PerceptionSettings, Tracker
from coglab_sim.rigid import Frame, quat_from_rotvec, quat_multiply
from coglab_sim.virtual_human import Scene, VirtualHuman, WorldView
from coglab_smach.contact_detector import ContactDetector, DetectorSettings
from ih2_hand.clock import VirtualClock as HandClock
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.virtual_link import VirtualLink
from ih2_hand.progress import shown_empty, shown_holding

SOURCES = Path(__file__).resolve().parents[2]
URDF = SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = str(SOURCES / "lwr_description" / "config" / "joint_limits.yaml")
HOME = np.array([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
BOARD = Frame(np.array([0.45, -0.55, 0.05]), quat_from_rotvec([0, 0, -np.pi / 2]))
DT = 0.005

GOAL_TIME_CONSTANT = 0.12
"""s, of the goal estimator; as in coglab_smach.launch."""
GOAL_MAX_AGE, GOAL_LOST, GOAL_FINISH = 0.2, 1.0, 0.12
"""s, s, m: design.md section 4."""


class Arm:
    """Controller cores on bridge and cell: what the controller manager's cycle does, at 200 Hz."""

    def __init__(self, cell, bridge):
        self.cell, self.bridge = cell, bridge
        self.limits = cc.load_joint_limits(LIMITS)
        text = URDF.read_text()
        self.chain = cc.Chain(text)
        self.ik = cc.TwoTaskIk(velocity_limit=self.limits.velocity)
        self.guard = cc.Guard(self.chain, self.limits)
        self.workspace = cc.Workspace(cc.WorkspaceParameters(box_min=[-1.2, -1.2, 0.0], box_max=[1.2, 1.2, 1.6]))
        self.library = cc.Library()
        self.active = ""
        self.motion = None
        self.ptp = None
        self.aborted = ""
        self.governor = cc.PhaseGovernor()
        self.sample = None
        self.peak_share = 0.0
        self.goal_of = None
        self.goal_age = 0.0
        self.last_goal = None

    def start_dmp(self, primitive, goal_of, ratio):
        """Begin a DMP; ``goal_of()`` gives (position, orientation, age s) of the palm's goal as received."""
        self.motion = cc.CartesianMotion(GOAL_TIME_CONSTANT)
        self.aborted = ""
        self.goal_of = goal_of
        position, orientation, _ = goal_of()
        q = self.sample["commanded_position"]
        p, o = self.chain.fk(q)
        self.last_goal = (self.workspace.project(position), orientation)
        self.motion.start(self.library[primitive], p, o, self.last_goal[0], orientation, ratio=ratio)
        self.governor.reset()
        self.guard.reset()

    def start_ptp(self, target, speed=0.3, acceleration=0.2):
        """Begin a point-to-point motion from the commanded state."""
        s = self.sample
        self.ptp = (cc.PtpTrajectory(s["commanded_position"], s["commanded_velocity"], target,
                                     speed * self.limits.velocity, acceleration * self.limits.acceleration), [0.0])

    def ptp_done(self):
        """Whether the trajectory has passed and the arm is there."""
        if self.ptp is None:
            return True
        trajectory, t = self.ptp
        return t[0] > trajectory.duration and np.max(np.abs(self.sample["position"] - trajectory.target)) < 0.01

    def cycle(self, now_ns):
        """One control cycle; sends a velocity."""
        s = self.sample = self.bridge.snapshot()
        if not s["motion_allowed"]:
            if self.motion is not None and not self.aborted:
                self.aborted = s["reason"]
            self.motion_off()
            return
        q = np.asarray(s["position"])
        velocity = np.zeros(7)
        if self.active == "dmp" and self.motion is not None and not self.aborted:
            velocity = self._dmp_velocity(q)
        elif self.active == "ptp" and self.ptp is not None:
            trajectory, t = self.ptp
            t[0] += DT
            position, velocity, _ = trajectory.at(t[0])
            velocity = velocity + 5.0 * (position - np.asarray(s["commanded_position"]))
        result = self.guard.limit(self.chain, q, velocity)
        self.peak_share = max(self.peak_share, float(np.max(np.abs(result.velocity) / self.limits.velocity)))
        self.bridge.send_velocity(result.velocity, now_ns)

    def motion_off(self):
        """Nothing moves any more."""
        self.ptp = None

    def _dmp_velocity(self, q):
        position, orientation, age = self.goal_of()
        if age <= GOAL_MAX_AGE:
            self.last_goal = (self.workspace.project(position), orientation)
        elif age > GOAL_LOST and self.motion.phase == "running" and self.motion.remaining_distance > GOAL_FINISH:
            self.aborted = f"goal lost for {GOAL_LOST} s"
            return np.zeros(7)
        reference = self.motion.step(DT, *self.last_goal, rate=self.governor.rate)
        solved = self.ik.solve(self.chain, q, reference)
        self.governor.update(DT, 1.0, solved.scale)
        return solved.velocity


class Hand:
    """Driver on the emulator over a line without a pty; one task at a time, polled at 30 Hz while it runs."""

    def __init__(self):
        self.clock = HandClock()
        self.emulator = EmulatedHand(self.clock)
        self.driver = HandSerialDriver(transport=VirtualLink(self.emulator, self.clock), clock=self.clock)
        self.calibrated = False
        self.holding = False
        self.message = ""
        self.task = None
        self.begun = 0.0
        self.verdict = None
        self.positions = (0, 0, 0, 0, 0)
        self._next_poll = 0.0

    def begin(self, task):
        """Start a task of ih2_hand.progress."""
        self.task, self.begun, self.verdict = task, self.clock.monotonic(), None
        task.begin(self.driver)

    def step(self, t, contact):
        """Follow the time; ``contact()`` gives where the fingers meet the object."""
        self.clock.now = max(self.clock.now, t)
        self.emulator.advance()
        if t < self._next_poll:
            return
        self._next_poll = t + (1 / 30 if self.task is not None else 0.2)
        positions, stiffness = contact()
        self.emulator.set_contacts(positions, stiffness)
        if not self.calibrated:
            return
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

    def __init__(self, seed=1, behaviour="normal", perfect=False, object_on="human_hand", perception=None):
        parameters = {"seed": int(seed), "krc/period": DT, "contact/board_center": [0.45, -0.55, 0.05],
                      "object/start": object_on, "object/position": [-0.08, 0.0, -0.05]}
        if object_on == "world":
            place = BOARD.apply([0.0, 0.0, 0.002])
            parameters["object/position"] = [float(v) for v in place]
            parameters["object/rotation"] = [float(v) for v in BOARD.orientation]
        self.cell = _cell.Cell(str(URDF), parameters)
        self.bridge = lwr_fri_bridge.Bridge(LIMITS, "default")
        self.arm = Arm(self.cell, self.bridge)
        self.hand = Hand()
        self.scene = Scene()
        self.human = VirtualHuman(Participant.draw(seed, behaviour), self.scene, object_on == "human_hand")
        settings = perception or PerceptionSettings(perfect=perfect)
        self.trackers = {name: Tracker(name, settings, seed) for name in ("object_mug", "human_hand")}
        self.detector = ContactDetector(DetectorSettings(), lambda q: self.arm.chain.jacobian(q)[:3])
        self.event = None
        self.t = 0.0
        self.now_ns = 0
        self.measurement = None
        self.ticks = 0
        self.truth = None
        self.palm_history = []
        self.watched_while_moving = 0
        self.limit_violations = 0

    def newest(self, name):
        """Newest sight of a frame and its age; the board is known."""
        if name == "board":
            return BOARD, 0.0
        sight = self.trackers[name].newest
        if sight is None:
            return None, 1e9
        return sight.frame, self.t - sight.captured

    def goal_of(self, frame, offset, orientation):
        """The palm's goal from a tracked frame, as the plug-in forms it."""
        kept = [None]

        def goal():
            seen, age = self.newest(frame)
            if seen is None:
                return kept[0][0], kept[0][1], age
            target = quat_multiply(seen.orientation, orientation)
            kept[0] = (seen.apply(offset), target / np.linalg.norm(target))
            return (*kept[0], age)

        return goal

    def step(self):
        """One FRI period."""
        answer = None
        if self.measurement is not None:
            answer = self.bridge.answer(self.measurement, self.now_ns)
        else:
            self.bridge.idle(self.now_ns)
        self.arm.cycle(self.now_ns)
        if self.ticks % 2 == 0:
            self._human()
        self.hand.step(self.t, self.cell.finger_contact)
        self.cell.set_fingers([min(254, int(m.position)) for m in self.hand.emulator.motors])
        self._sense()
        self.measurement = self.cell.step(answer)
        self.ticks += 1
        self.t = self.ticks * DT
        self.now_ns = round(self.t * 1e9)

    def _human(self):
        self.truth = truth = self.cell.truth()
        palm = _frame(truth["robot_hand"])
        self.palm_history.append(palm.position)
        del self.palm_history[:-10]
        way = float(np.linalg.norm(palm.position - self.palm_history[0]))
        speed = way / 0.09 if len(self.palm_history) > 9 else 1.0
        view = WorldView(palm, speed, _frame(truth["object"]), float(np.linalg.norm(truth["palm_force"])),
                         truth["robot_load_share"], truth["human_load_share"], truth["held_by"])
        hand = self.human.step(self.t, view)
        self.cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, np.zeros(3), hand.grip,
                            hand.grip_force)
        for name, frame in (("object_mug", view.object), ("human_hand", hand.frame)):
            self.trackers[name].step(self.t, frame, palm)

    def _sense(self):
        sample = self.arm.sample
        if sample["cycle_time"] <= 0.0:
            return
        q, v = np.asarray(sample["position"]), np.asarray(sample["velocity"])
        event = self.detector.feed(self.t, sample["external_torque"], q, v)
        if event is not None and self.event is None:
            self.event = event
        if self.detector.state() == "watching" and np.max(np.abs(v)) > 0.05:
            self.watched_while_moving += 1
        if np.any(q < self.arm.limits.lower_position) or np.any(q > self.arm.limits.upper_position):
            self.limit_violations += 1


def _frame(pose):
    return Frame(np.asarray(pose["position"]), np.asarray(pose["rotation"]))
