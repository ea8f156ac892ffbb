"""Names, modules, signatures, and what importing smach_ros does. No roscore."""

import inspect
import itertools
import random
import subprocess
import sys
from types import SimpleNamespace

import pytest
import smach
import smach_ros
from smach_ros import introspection
from smach_ros.introspection import WELCOME_DELAY, ContainerProxy, IntrospectionServer, _Beat, _Viewers

SIGNATURES = {
    smach.State: "outcomes input_keys output_keys io_keys",
    smach.CBState: "cb cb_args cb_kwargs outcomes input_keys output_keys io_keys",
    smach.CBInterface: "cb outcomes input_keys output_keys io_keys",
    smach.Container: "outcomes input_keys output_keys",
    smach.StateMachine: "outcomes input_keys output_keys",
    smach.Sequence: "outcomes connector_outcome input_keys output_keys",
    smach.Concurrence: "outcomes default_outcome input_keys output_keys outcome_map outcome_cb child_termination_cb",
    smach.Iterator: "outcomes input_keys output_keys it it_label exhausted_outcome",
    smach.Remapper: "ud input_keys output_keys remapping",
    smach.StateMachine.add: "label state transitions remapping constants",
    smach.StateMachine.add_auto: "label state connector_outcomes transitions remapping constants",
    smach.Sequence.add: "label state transitions remapping",
    smach.Concurrence.add: "label state remapping",
    smach.Iterator.set_contained_state: "label state loop_outcomes break_outcomes final_outcome_map",
    smach.Iterator.set_iteritems: "it it_label",
    smach.UserData.extract: "self keys remapping",
    smach.UserData.merge: "self ud keys remapping",
    smach.set_loggers: "info warn debug error",
    smach_ros.ServiceState: "service_name service_spec request request_cb request_cb_args "
    "request_cb_kwargs request_key request_slots response_cb response_cb_args response_cb_kwargs "
    "response_key response_slots input_keys output_keys outcomes",
    smach_ros.SimpleActionState: "action_name action_spec goal goal_key goal_slots goal_cb "
    "goal_cb_args goal_cb_kwargs result_key result_slots result_cb result_cb_args result_cb_kwargs "
    "input_keys output_keys outcomes exec_timeout preempt_timeout server_wait_timeout",
    smach_ros.MonitorState: "topic msg_type cond_cb max_checks input_keys output_keys",
    smach_ros.ConditionState: "cond_cb input_keys poll_rate timeout max_checks",
    smach_ros.ActionServerWrapper: "server_name action_spec wrapped_container succeeded_outcomes "
    "aborted_outcomes preempted_outcomes goal_key feedback_key result_key goal_slots_map "
    "feedback_slots_map result_slots_map expand_goal_slots pack_result_slots",
    smach_ros.IntrospectionServer: "server_name state path",
    ContainerProxy: "server_name container path update_rate",
    smach_ros.IntrospectionClient.set_initial_state: "self server path initial_states initial_userdata timeout",
    smach_ros.set_preempt_handler: "container",
}


@pytest.mark.parametrize("function, names", SIGNATURES.items(), ids=lambda v: getattr(v, "__qualname__", ""))
def test_signatures(function, names):
    assert list(inspect.signature(function).parameters) == names.split()


def test_importing_smach_ros_redirects_log_and_shutdown_check():
    code = (
        "import rospy, smach, smach_ros;"
        "assert (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr) =="
        " (rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr);"
        "assert smach.is_shutdown is rospy.is_shutdown"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_core_does_not_import_ros():
    code = "import sys, smach; assert not {'rospy', 'genpy', 'roslib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


class Topic:
    """Stands for a publisher; connections are names, and what each was sent is kept with its time."""

    def __init__(self):
        self.impl, self.connections, self.now, self.sent = self, [], 0.0, {}
        self.acquire = self.release = lambda: None

    def get_num_connections(self):
        return len(self.connections)

    def publish(self, _message, connection):
        self.sent.setdefault(connection, []).append(self.now)


@pytest.mark.parametrize("seed", range(20))
def test_no_viewer_gets_a_beat_before_its_window_exists_and_all_get_theirs(seed, monkeypatch):
    draw = random.Random(seed)
    comes = sorted(draw.uniform(0.0, 30.0) for _ in range(draw.choice((2, 3, 40))))
    topic, server = Topic(), IntrospectionServer("/server", smach.StateMachine(["end"]), "/SM_ROOT")
    monkeypatch.setattr(introspection.time, "monotonic", lambda: topic.now)
    server._watched, server._beat = [SimpleNamespace(path="/SM_ROOT", structure=lambda: None)], _Beat(0.0, 2.0)
    server._structure_pub, server._viewers = topic, [_Viewers(topic)]
    for step in range(4000):
        topic.now = 0.01 * step
        for i, when in enumerate(comes):
            if i not in topic.connections and when <= topic.now < when + 20.0:
                topic.connections.append(i)
                server._welcome()
            if i in topic.connections and topic.now >= when + 20.0:
                topic.connections.remove(i)
        if server._is_due(topic.now):
            server._publish_heartbeats(topic.now)
    for i, when in enumerate(comes):
        sent = topic.sent.get(i, [])
        assert WELCOME_DELAY <= sent[0] - when <= WELCOME_DELAY + 0.02, "its first beat"
        end = min(when + 20.0, 40.0)
        gaps = [after - before for before, after in itertools.pairwise([*sent, end])]
        assert max(gaps) <= 2.02, "a beat was left out"
        assert sent[-1] < end
