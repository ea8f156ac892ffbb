"""The contracts of the ports on their doubles."""

from dataclasses import replace

import pytest
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_perception.belief import Belief
from coglab_perception.recogniser import Estimate
from coglab_trials.scripted.arm import SimulatedArm
from coglab_trials.scripted.cell import SimulatedCell
from coglab_trials.scripted.contact import SimulatedContact
from coglab_trials.scripted.ports import SimulatedDatabase, SimulatedHand, SimulatedPerception
from coglab_trials.trial import LIBRARY
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.world import DT, World
from coglab_trials.world_ports import VirtualContact, VirtualDatabase, VirtualHand, VirtualPerception
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
        LIBRARY,
        cell.push,
        arm=SimulatedArm(cell),
        believe=lambda offer: believe_in_cell(cell, offer),
        show_hand=lambda seen: (cell.faults.not_seen.discard if seen else cell.faults.not_seen.add)("human_hand"),
        slow=lambda scale: setattr(cell.arm, "speed_scale", scale),
    )


def believe_in_cell(cell, offer):
    """The partner of the kinematic cell offers, and moves as for that."""
    cell.partner.offer = offer
    cell.partner.pattern, cell.partner.pattern_at = ("mug", 0.0) if offer else ("unknown", 0.0)
    cell.arm.motion_started = cell.clock.now()


@pytest.mark.parametrize(
    "name, test", [(name, test) for name, suite in SUITES.items() for test in vars(suite) if test.startswith("test_")]
)
def test_double(name, test):
    contract = SUITES[name](double_of(name))
    contract.begin()
    getattr(contract, test)()


class ToldBelief:
    """In the place of the BeliefFilter of VirtualPerception: believes what it is told."""

    def __init__(self):
        self.belief = Belief(0.0)

    def see_object(self, *sight):
        """Without an influence."""

    def see_hand(self, captured, *sight):
        """Likewise."""
        self.belief = replace(self.belief, stamp=captured)
        return self.belief


class ToldRecogniser:
    """In the place of its recogniser: recognises what it is told."""

    estimate = Estimate("mug", 0.9, True, 0.5, {"mug": 0.9, "unknown": 0.1})

    def update(self, *sight):
        """Without an influence."""

    def pattern_end(self):
        """Of no influence."""
        return None


def virtual_double_of(name):
    """A port of the trials in virtual time, which has the real controllers, driver and detector behind it."""
    rig, told = World(1), ToldBelief()

    def believe(offer):
        told.belief = Belief(rig.t, offer=offer, object_id="mug" if offer else "")

    def show_hand(seen):
        (rig.blind.discard if seen else rig.blind.add)("human_hand")

    def sleep(duration):
        for _ in range(max(1, round(duration / DT))):
            rig.step()

    sleep(1.0)
    database = ObjectDatabase(objects_folder())
    assert database.reload() == []
    ports = {
        "arm": VirtualArm,
        "hand": VirtualHand,
        "perception": lambda rig: VirtualPerception(rig, ToldRecogniser(), told),
        "contact": VirtualContact,
        "database": lambda rig: VirtualDatabase(database),
    }

    def slow(scale):
        rig.robot.virtual.speed_scale(scale)
        rig.speed_scale = scale

    port = ports[name](rig)
    push = lambda force: rig.cell.set_push([0.0, 0.0, force])  # noqa: E731
    return Place(
        port,
        lambda: rig.t,
        sleep,
        port.freeze,
        port.thaw,
        LIBRARY,
        push,
        arm=VirtualArm(rig),
        believe=believe,
        show_hand=show_hand,
        slow=slow,
    )


@pytest.mark.parametrize("name", SUITES)
def test_port_of_whole_trials(name):
    suite = SUITES[name](virtual_double_of(name))
    for test in [test for test in vars(SUITES[name]) if test.startswith("test_")]:
        suite.begin()
        getattr(suite, test)()
