"""The contracts of the ports on their doubles."""
import pytest
from coglab_smach.object_database import ObjectDatabase
from coglab_smach.simulated_cell import SimulatedCell
from coglab_smach.simulated_ports import (
    SimulatedArm,
    SimulatedContact,
    SimulatedDatabase,
    SimulatedHand,
    SimulatedPerception,
)
from conftest import SHARE
from port_contracts import SUITES, Place


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
    database = ObjectDatabase(str(SHARE / "objects"))
    assert database.reload() == []
    ports = {"arm": SimulatedArm, "hand": SimulatedHand, "perception": SimulatedPerception, "contact": SimulatedContact,
             "database": lambda at: SimulatedDatabase(at, database)}
    return Place(ports[name](cell), clock.now, clock.sleep, lambda: cell.faults.dead.add(name),
                 lambda: cell.faults.dead.discard(name))


@pytest.mark.parametrize("name, test", [(name, test) for name, suite in SUITES.items() for test in vars(suite)
                                        if test.startswith("test_")])
def test_double(name, test):
    contract = SUITES[name](double_of(name))
    contract.begin()
    getattr(contract, test)()
