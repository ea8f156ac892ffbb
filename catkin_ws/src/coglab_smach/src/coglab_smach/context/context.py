"""What every state is given: ports, clock, configuration, journal, triggers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from coglab_py.pose import Pose

from coglab_smach.clocks.clock import Clock
from coglab_smach.context.config import Config
from coglab_smach.context.hand_track import HandTrack
from coglab_smach.context.holding import HoldingMemory
from coglab_smach.context.journal import Journal
from coglab_smach.context.requests import Requests
from coglab_smach.ports.interfaces import ArmPort, ContactPort, DatabasePort, HandPort, PerceptionPort
from coglab_smach.ports.pending import Pending


class StopSwitch:
    """STOP as the machines see it: set by the operator, cleared only by an explicit reset."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.reason = ""

    def press(self, reason: str) -> None:
        """Latch with a reason in words."""
        self.reason = reason
        self._event.set()

    def reset(self) -> None:
        """Unlatch."""
        self._event.clear()
        self.reason = ""

    def pressed(self) -> bool:
        """Whether STOP is latched."""
        return self._event.is_set()


@dataclass
class Context:
    """Injected into each state. ``clock`` is steady for the robot, virtual for tests and benches."""

    clock: Clock
    arm: ArmPort
    hand: HandPort
    perception: PerceptionPort
    database: DatabasePort
    contact: ContactPort
    config: Config
    journal: Journal
    requests: Requests = None  # type: ignore[assignment]  # made below, so that its changes are told
    stop: StopSwitch = field(default_factory=StopSwitch)
    memory: HoldingMemory = field(default_factory=HoldingMemory)
    reachable: Callable[[Pose], bool] = lambda pose: True
    """whether the arm can bring the palm to a pose in the base frame"""
    raised: Callable[[Pose, Pose, float, float], tuple[float, Pose | None]] = lambda _board, palm, *_: (0.0, palm)
    """(board, palm, room, most): m by which the palm has to rise to leave so much room above the board, and that palm;
    None where that is more than most (BoardRoom.raised)"""
    say: Callable[[int, str], None] = lambda code, text: None
    """tell the person something: code of coglab_msgs/Say and a sentence"""
    shared: bool = False
    """the person may hold the object that is in the robot's fingers: from the closing on an object that is offered
    until its weight is felt, and from the person's taking of the load until the hand is open"""
    firm: int = 0
    """wire speed, and with it the force, with which the fingers are to close on what they hold gently as long as a
    person's fingers may be between them; 0: they hold it as its grasp says"""
    preshaped: bool = False
    """the fingers have taken the preshape of this reach's grasp"""
    closing: Pending | None = None
    """of the fingers, begun on the last of a reach's way"""
    tightening: Pending | None = None
    """of the fingers around what the person has let go of, firmly"""
    closing_on: str = ""
    """id of the object that they close on there"""
    closing_firm: int = 0
    """``firm`` of that object"""
    shared_mass: float = 0.0
    """kg, of what the robot and the person may both hold"""
    hand_track: HandTrack | None = None
    """the hand of the person who gives an object, or takes it, as long as they may hold it, too"""
    _holding: str = ""

    def __post_init__(self) -> None:
        self.requests = self.requests or Requests(self.journal.changed)

    @property
    def holding(self) -> str:
        """Id of the object in the robot's hand, empty if the hand is empty."""
        return self._holding

    @holding.setter
    def holding(self, object_id: str) -> None:
        if object_id != self._holding:
            self.memory.note(object_id)
        if not object_id:
            self.firm = 0
        self._holding = object_id
        self.journal.changed()
