#!/usr/bin/python3
"""The node /coglab: runs coglab_master on ROS ports, receives triggers, publishes transitions and introspection.

Names are relative to the node's namespace.
Action: coglab/handover (coglab_msgs/Handover).
Services: coglab/start (coglab_msgs/Start), coglab/stop, coglab/why (std_srvs/Trigger).
Topics: coglab/transitions (coglab_msgs/Transition), coglab/handover_results (coglab_msgs/HandoverResult, one per
action, latched), coglab/results (std_msgs/String, the same as JSON, latched), coglab/holding (std_msgs/String, object
in the hand, latched), coglab/state (coglab_msgs/MasterState, latched, at least 5 Hz), say (coglab_msgs/Say, messages to
the person, latched).
Parameters: perception/frames (names of human_hand and board). Private: config_file, dmp_library (path of the
primitives), auto_trigger, result_file (JSON lines), state_file (object in the hand, survives a restart; default
coglab_holding.json in ROS_HOME), config_overrides (mapping of dotted names), introspection (default true).
"""

import json
import os
import sys
import threading

import coglab_controllers as cc
import rospkg
import rospy
import smach_ros
from coglab_msgs.msg import HandoverAction, HandoverResult, Say, Transition
from coglab_msgs.msg import MasterState as MasterStateMsg
from coglab_msgs.srv import Start, StartResponse
from coglab_py import parameters
from coglab_py.action_server import ActionServer
from coglab_py.node_start import init_node
from coglab_py.publish import publish
from coglab_py.steady import ClockWatch, Stamps, exit_status, utc_of, worker
from coglab_smach.clocks.clock import PacedClock
from coglab_smach.context.config import Config, ConfigError
from coglab_smach.context.context import Context
from coglab_smach.context.holding import HoldingMemory
from coglab_smach.context.journal import NOTHING_FAILED, ActionRecord, Journal, TransitionRecord
from coglab_smach.context.master_state import MasterState, StateWatch
from coglab_smach.context.requests import ask_for
from coglab_smach.kinematics.board_room import BoardRoom
from coglab_smach.kinematics.reachability import solve
from coglab_smach.machines import build_master
from coglab_smach.ros.arm import RosArm
from coglab_smach.ros.calls import PACE
from coglab_smach.ros.hand import RosHand
from coglab_smach.ros.handover_server import HandoverServer
from coglab_smach.ros.ports import RosContact, RosDatabase, RosPerception
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

STATE_PERIOD = 0.2  # s, period of coglab/state while nothing changes


def append(path: str, line: str) -> None:
    """Append a line to a file, or nothing: after half a line on a full disk, the next one would be a part of it."""
    left = f"{line}\n".encode()
    with open(path, "ab", buffering=0) as stream:
        length = stream.tell() if stream.seekable() else None
        try:
            while left:
                left = left[stream.write(left) :]
        except OSError:
            if length is not None:
                stream.truncate(length)
            raise


class Memory(HoldingMemory):
    """Publishes the noted object on a latched topic."""

    def __init__(self, path: str, warn) -> None:
        super().__init__(path, warn)
        self.publisher = rospy.Publisher("coglab/holding", String, queue_size=1, latch=True)

    def note(self, object_id: str) -> None:
        super().note(object_id)
        publish(self.publisher, String(object_id))


class MasterNode:
    """Connects the machines to ROS. It contains no logic."""

    def __init__(self) -> None:
        frames = parameters.read("perception/frames", dict, {})
        overrides = {f"perception.{role}": frames[role] for role in ("human_hand", "board") if role in frames}
        overrides.update(parameters.read("~config_overrides", dict, {}))
        if rospy.has_param("~dmp_library"):
            overrides["dmp_library"] = parameters.read("~dmp_library", str)
        if rospy.has_param("~auto_trigger"):
            overrides["auto_trigger"] = parameters.read("~auto_trigger", bool)
        config = Config.load(parameters.read("~config_file", str), overrides, rospy.logwarn)
        clock = PacedClock(PACE.follow())
        self.journal = Journal(clock.now)
        self.stamps = Stamps()
        self.transitions = rospy.Publisher("coglab/transitions", Transition, queue_size=200)
        self.results = rospy.Publisher("coglab/results", String, queue_size=20, latch=True)
        self.typed_results = rospy.Publisher("coglab/handover_results", HandoverResult, queue_size=20, latch=True)
        self.spoken = rospy.Publisher(
            "say", Say, queue_size=20, latch=True
        )  # latched: a late listener receives the last message too
        self.result_file = parameters.read("~result_file", str, "")
        self.journal.listen(self.on_transition)
        self.journal.listen_results(self.on_result)
        self.ctx = Context(
            clock=clock,
            arm=RosArm(),
            hand=RosHand(),
            perception=RosPerception(),
            database=RosDatabase(),
            contact=RosContact(),
            config=config,
            journal=self.journal,
            memory=Memory(self.state_file(), rospy.logwarn),
            say=self.say,
            **self.geometry(config),
        )
        self.handovers = HandoverServer(self.ctx, self.stop, self.stamp, self.utc, self.spawn)
        self.master = build_master(self.ctx)
        self.thread = worker(self.master.execute, "coglab_master")
        self.states = rospy.Publisher("coglab/state", MasterStateMsg, queue_size=20, latch=True)
        self.watch = StateWatch(self.ctx, self.on_state)
        self.server = None
        if parameters.read("~introspection", bool, True):
            self.server = smach_ros.IntrospectionServer("coglab", self.master, "/coglab_master")
            self.server.start()
        rospy.Service("coglab/start", Start, self.on_start)
        rospy.Service("coglab/stop", Trigger, self.on_stop)
        rospy.Service("coglab/why", Trigger, self.on_why)
        self.actions = ActionServer(
            rospy.resolve_name("coglab/handover"),
            HandoverAction,
            self.handovers.on_goal,
            self.handovers.on_cancel,
            auto_start=False,
        )
        self.actions.start()

    @staticmethod
    def spawn(function) -> None:
        """Run a function in a thread that does not keep the node from ending."""
        threading.Thread(target=function, name="handover", daemon=True).start()

    def stamp(self, when: float) -> rospy.Time:
        """Returns the ROS time of a time (s) of the brain's clock."""
        return self.stamps.stamp(PACE.steady(when))

    @staticmethod
    def utc(when: float) -> str:
        """Returns the date and time of a time (s) of the brain's clock."""
        return utc_of(PACE.steady(when))

    @staticmethod
    def geometry(config):
        """Returns the checks of reach and of the clearance above the board, from the robot description. Without one,
        nothing is checked."""
        urdf = parameters.found_above("robot_description", str)
        if urdf is None:
            return {}
        arm, room = cc.Chain(urdf), BoardRoom(urdf, config.get("postures.board"))
        return {"reachable": lambda pose: solve(arm, pose) is not None, "raised": room.raised}

    @staticmethod
    def state_file() -> str:
        """Returns the path of the file for the held object: one file per namespace."""
        name = "coglab_holding" + rospy.get_namespace().rstrip("/").replace("/", "_") + ".json"
        return parameters.read("~state_file", str, "") or os.path.join(rospkg.get_ros_home(), name)

    def say(self, code: int, text: str) -> None:
        """Publish a message to the person, for a speech synthesiser or the simulated person."""
        message = Say(code=code, text=text)
        message.header.stamp = rospy.Time.now()
        publish(self.spoken, message)

    def on_start(self, request):
        """Pass a trigger to the open hub."""
        answer = ask_for(self.ctx, request.action, request.object_id)
        rospy.loginfo("start %s %s: %s", request.action, request.object_id, answer.message)
        return StartResponse(answer.ok, answer.code, answer.message)

    def on_stop(self, _request):
        """STOP: the arm brakes and latches, the machine ends the action, the hand keeps its object."""
        return self.stop("the operator pressed STOP")

    def stop(self, reason: str):
        """STOP with a reason. Returns the answer of the service."""
        self.ctx.stop.press(reason)
        pending = self.ctx.arm.hold(reason)
        end = self.ctx.clock.now() + 2.0
        while not pending.done() and self.ctx.clock.now() < end:
            self.ctx.clock.sleep(0.005)
        try:
            if not pending.done():
                return TriggerResponse(
                    False,
                    "STOP is latched in the machine, but the LWR interface did not answer "
                    "within 2 s: use the emergency stop of the robot",
                )
            return TriggerResponse(True, f"STOP: {pending.result()}")
        except Exception as error:
            return TriggerResponse(False, f"STOP is latched in the machine, but: {error}")

    def on_why(self, _request):
        """Return the reason of the last stop in one sentence."""
        return TriggerResponse(True, self.watch.now().why or NOTHING_FAILED)

    def on_state(self, state: MasterState) -> None:
        """Publish the state on a latched topic."""
        message = MasterStateMsg(
            state=state.state,
            in_hub=state.in_hub,
            actions=list(state.actions),
            object_id=state.object_id,
            why=state.why,
            reason_code=state.reason_code,
            waits_for=state.waits_for,
            waits_code=state.waits_code,
        )
        message.header.stamp = rospy.Time.now()
        if state.deadline:  # on the brain's steady clock
            # The state may be published again shortly after its deadline, before it ends.
            left = max(0.001, (state.deadline - self.ctx.clock.now()) / PACE.factor)
            message.deadline = message.header.stamp + rospy.Duration.from_sec(left)
        publish(self.states, message)

    def on_transition(self, record: TransitionRecord) -> None:
        """Publish and log a transition."""
        message = Transition(
            path=record.path,
            from_state=record.from_state,
            outcome=record.outcome,
            to_state=record.to_state,
            reason_code=record.code,
            reason=record.reason,
            causes=list(record.causes),
        )
        message.header.stamp = rospy.Time.now()
        publish(self.transitions, message)
        (rospy.logwarn if record.outcome in ("failed", "fault", "stopped") else rospy.loginfo)(record.sentence())

    def on_result(self, record: ActionRecord) -> None:
        """Publish a result, typed and as JSON, and append it to the result file, one JSON object per action."""
        publish(self.typed_results, self.handovers.result_of(record))
        row = record.to_dict()
        for name, when in (("started", record.started), ("ended", record.ended)):
            row[f"{name}_ros"], row[f"{name}_utc"] = self.ros_seconds(when), self.utc(when)
        row["marks_ros"] = {name: self.ros_seconds(when) for name, when in record.marks.items()}
        line = json.dumps(row)
        publish(self.results, String(line))
        if self.result_file:
            try:
                append(self.result_file, line)
            except OSError as error:
                rospy.logerr("result file %s cannot be written: %s", self.result_file, error)

    def ros_seconds(self, when: float) -> float:
        """Returns the ROS time of a time of the brain's clock, s to the ms."""
        return round(self.stamp(when).to_sec(), 3)

    def run(self) -> None:
        """Execute the machine until shut-down."""
        # rospy calls this before its own shut-down: the machine can still reach the arm and end its motion.
        rospy.on_shutdown(self.end)
        self.thread.start()
        clock = ClockWatch()
        while not rospy.is_shutdown() and self.thread.is_alive():
            self.thread.join(STATE_PERIOD)
            self.watch.tell_again()
            clock.look()
        self.end()  # if the shut-down began before on_shutdown() was called
        if self.server is not None:
            self.server.stop()

    def end(self) -> None:
        """Preempt the machine and wait for its end, at most 4 s."""
        self.master.request_preempt()
        if self.thread.is_alive() and threading.current_thread() is not self.thread:
            self.thread.join(4.0)


def main() -> int:
    """Entry point. Exit status 1: unusable configuration."""
    init_node("coglab")
    try:
        node = MasterNode()
    except (ConfigError, parameters.ParameterError) as error:
        rospy.logfatal("coglab cannot start: %s", error)
        return 1
    node.run()
    return exit_status()


if __name__ == "__main__":
    sys.exit(main())
