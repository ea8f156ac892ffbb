"""The contracts of the ports on their doubles."""

import pytest
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_sim.virtual_world import DT, World
from coglab_smach.simulated.cell import SimulatedCell
from coglab_smach.simulated.ports import (
    SimulatedArm,
    SimulatedContact,
    SimulatedDatabase,
    SimulatedHand,
    SimulatedPerception,
)
from coglab_smach.simulated.world_ports import VirtualArm
from port_contracts import SUITES, Place
from virtual_trial import LIBRARY


class ManualClock:
    """Stands still but for sleep()."""

    def __init__(self):
        self.t = 100.0

    def now(self):
        return self.t

    def sleep(self, duration):
        self.t += duration


def double_of(name):
    clock = ManualClock()
    cell = SimulatedCell(clock)
    cell.partner.touch_after = cell.partner.take_after = cell.partner.let_go_after = None
    cell.faults.empty_grasp = True
    database = ObjectDatabase(objects_folder())
    assert database.reload() == []
    ports = {
        "arm": SimulatedArm,
        "hand": SimulatedHand,
        "perception": SimulatedPerception,
        "contact": SimulatedContact,
        "database": lambda at: SimulatedDatabase(at, database),
    }
    return Place(
        ports[name](cell),
        clock.now,
        clock.sleep,
        lambda: cell.faults.dead.add(name),
        lambda: cell.faults.dead.discard(name),
    )


@pytest.mark.parametrize(
    "name, test", [(name, test) for name, suite in SUITES.items() for test in vars(suite) if test.startswith("test_")]
)
def test_double(name, test):
    contract = SUITES[name](double_of(name))
    contract.begin()
    getattr(contract, test)()


RIG_LACKS = ("test_given_up_while_its_node_is_frozen_it_never_acts", "test_a_hold_ends_the_motion_and_latches")
"""there is no node to freeze, and the report tells in words alone what blocks"""


def test_the_arm_of_whole_trials():
    """The arm of the trials in virtual time, which has the real controllers behind it."""
    rig = World(1)

    def sleep(duration):
        for _ in range(max(1, round(duration / DT))):
            rig.step()

    sleep(1.0)
    suite = SUITES["arm"](Place(VirtualArm(rig), lambda: rig.t, sleep, None, None, LIBRARY))
    for test in [name for name in vars(SUITES["arm"]) if name.startswith("test_") and name not in RIG_LACKS]:
        suite.begin()
        getattr(suite, test)()
