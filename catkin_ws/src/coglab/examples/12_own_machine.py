#!/usr/bin/python3
"""A state of one's own in the state machine: the robot announces what it will do, then takes the object."""

import coglab
from coglab_msgs.msg import Say
from coglab_smach.context.context import Context
from coglab_smach.machines.exchange_human_to_robot import build_exchange_human_to_robot
from coglab_smach.machines.exchange_robot_to_human import build_exchange_robot_to_human
from coglab_smach.machines.init import build_init_system
from coglab_smach.machines.recovery import build_recovery
from coglab_smach.states.base import CoglabMachine, CoglabState
from coglab_smach.states.hub import Fault, Hub, Stopped
from example import parser, save

TAKE, GIVE = "exchange_human_to_robot", "exchange_robot_to_human"
ENDED = {"failed_empty": "wait_without_object", "failed_holding": "wait_with_object", "stopped": "stopped"}
ENDED |= {"fault": "fault", "preempted": "preempted"}
STOPS = {"stopped": "stopped", "failed": "fault", "preempted": "preempted"}


class Announce(CoglabState):
    """Say what comes, and leave the person a second to understand it."""

    def run(self, ud) -> str:
        self.ctx.say(Say.NOTHING, f"I will take the {ud.object_id}.")
        self.pause(1.0)
        self.reason = "announced"
        return "succeeded"


def build_my_master(ctx: Context) -> CoglabMachine:
    """The shipped parts, put together anew, with Announce before the exchange."""
    master = CoglabMachine(ctx, "coglab_master", ["preempted"])
    master.userdata.object_id = master.userdata.grasp_name = ""
    master.userdata.object_entry, master.userdata.grasp = {}, {}
    recovered = {"empty": "wait_without_object", "holding": "wait_with_object", "stopped": "stopped", "fault": "fault"}
    with master:
        after = {"succeeded": "wait_without_object", "failed": "fault", "preempted": "preempted"}
        master.add_state("coglab_init_system", build_init_system(ctx), after)
        master.add_state("wait_without_object", Hub(ctx, (TAKE,), with_object=False), {TAKE: "announce"} | STOPS)
        announced = {"succeeded": TAKE, "failed": "stopped", "preempted": "preempted"}
        master.add_state("announce", Announce(ctx, input_keys=["object_id"]), announced)
        master.add_state(TAKE, build_exchange_human_to_robot(ctx), ENDED | {"succeeded": "wait_with_object"})
        master.add_state("wait_with_object", Hub(ctx, (GIVE,), with_object=True), {GIVE: GIVE} | STOPS)
        master.add_state(GIVE, build_exchange_robot_to_human(ctx), ENDED | {"succeeded": "wait_without_object"})
        again = {"succeeded": "recover", "failed": "fault", "preempted": "preempted"}
        master.add_state("stopped", Stopped(ctx), again)
        anew = {"succeeded": "coglab_init_system", "failed": "fault", "preempted": "preempted"}
        master.add_state("fault", Fault(ctx), anew)
        recover = build_recovery(ctx, operator=True)
        master.add_state("recover", recover, recovered | {"preempted": "preempted"})
    return master


options = parser(__doc__).parse_args()
with coglab.World(seed=3, person="accustomed", machine=build_my_master) as world:
    trial = world.trial("receive", "give")
for phase in trial.phases:
    if phase.path == "/coglab_master":
        print(f"{phase.start:6.2f} .. {phase.end:6.2f} s  {phase.state}")
print(*trial.results, sep="\n")
save(trial.plot("A machine with an announcement"), __file__, options.out)
