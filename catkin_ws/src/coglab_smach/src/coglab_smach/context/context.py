"""Objects that every state receives: ports, clock, configuration, journal, triggers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from coglab_py.pose import Pose

from coglab_smach.clocks.clock import Clock
from coglab_smach.context.config import Config
from coglab_smach.context.holding import HoldingMemory
from coglab_smach.context.journal import Journal
from coglab_smach.context.parts import Parts
from coglab_smach.context.requests import Requests
from coglab_smach.ports.interfaces import ArmPort, ContactPort, DatabasePort, HandPort, PerceptionPort


class StopSwitch:
    """STOP for the machines: set by the operator, cleared only by an explicit reset."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.reason = ""

    def press(self, reason: str) -> None:
        """Latch STOP with a reason, a sentence."""
        self.reason = reason
        self._event.set()

    def reset(self) -> None:
        """Unlatch."""
        self._event.clear()
        self.reason = ""

    def pressed(self) -> bool:
        """True while STOP is latched."""
        return self._event.is_set()


@dataclass
class Context:
    """Passed to each state. ``clock`` is steady on the robot and virtual in tests and benches."""

    clock: Clock
    arm: ArmPort
    hand: HandPort
    perception: PerceptionPort
    database: DatabasePort
    contact: ContactPort
    config: Config
    journal: Journal
    requests: Requests = None  # type: ignore[assignment]  # made in __post_init__, to report its changes to the journal
    parts: Parts = None  # type: ignore[assignment]  # made in __post_init__, from the configuration
    """actions, states and deliveries of a user's package"""
    stop: StopSwitch = field(default_factory=StopSwitch)
    memory: HoldingMemory = field(default_factory=HoldingMemory)
    reachable: Callable[[Pose], bool] = lambda pose: True
    """returns whether the arm can bring the palm to a pose in the base frame"""
    raised: Callable[[Pose, Pose, float, float], tuple[float, Pose | None]] = lambda _board, palm, *_: (0.0, palm)
    """(board, palm, room, most) -> (m by which the palm must rise to keep ``room`` m above the board, raised palm). The
    palm is None if it must rise by more than ``most`` m (BoardRoom.raised)."""
    say: Callable[[int, str], None] = lambda code, text: None
    """gives a message to the person: code of coglab_msgs/Say and a sentence"""
    _holding: str = ""

    def __post_init__(self) -> None:
        self.requests = self.requests or Requests(self.journal.changed)
        self.parts = self.parts or Parts.load(self.config)

    @property
    def holding(self) -> str:
        """Id of the object in the robot's hand, empty if the hand is empty."""
        return self._holding

    @holding.setter
    def holding(self, object_id: str) -> None:
        if object_id != self._holding:
            self.memory.note(object_id)
        self._holding = object_id
        self.journal.changed()
