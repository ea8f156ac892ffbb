"""Types of the compiled module. Shapes in brackets, units SI, quaternions x y z w, stamps in monotonic nanoseconds.

A request that is refused raises Refused and changes nothing. Methods with two names do the same: the second is
the name in the paper.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, overload

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
ArrayLike: TypeAlias = npt.ArrayLike
Path: TypeAlias = str | os.PathLike[str]
Size: TypeAlias = int | Sequence[int] | None

INTERFACE: int
"""Version of the interface between controllers and this library."""
logger: Logger
"""Logger of stores and managers that are made without one."""

class Refused(ValueError):
    """A request that was refused; the text says what was expected, what came and what to do."""

    cause: str
    """`invalid argument`, `unknown name`, `busy`, `bad file` or `fault`."""

class LogRecord:
    """One drained record."""

    @property
    def level(self) -> str:
        """`debug`, `info`, `warning` or `error`."""
    @property
    def source(self) -> str:
        """Controller or module."""
    @property
    def file(self) -> str: ...
    @property
    def line(self) -> int: ...
    @property
    def cycle(self) -> int:
        """Control cycle; 0 outside the cycle."""
    @property
    def time_ns(self) -> int: ...
    @property
    def message(self) -> str: ...

class Logger:
    """Bounded ring of records. The cycle writes into it; drain() gives the records to the sinks."""

    def __init__(self, capacity: int = 1024) -> None: ...
    def add_sink(self, sink: Callable[[LogRecord], object] | Path) -> None:
        """Give each drained record to a function, or append it to a file."""
    def set_level(self, level: str) -> None:
        """Drop records below `debug`, `info`, `warning` or `error`."""
    def log(self, level: str, source: str, text: str) -> None:
        """Add a record."""
    def drain(self) -> int:
        """Give all waiting records to the sinks; returns their number."""
    @property
    def dropped(self) -> int:
        """Records lost because the ring was full."""

class Status:
    """Outcome of an accepted request."""

    def __bool__(self) -> bool: ...
    @property
    def ok(self) -> bool: ...
    @property
    def message(self) -> str:
        """A note, such as controllers that were skipped; or empty."""
    @property
    def generation(self) -> int:
        """Number of the published plan, for wait_adopted(); 0: none."""

class Cycle:
    """Time of one control cycle."""

    def __init__(self, now_ns: int = 0, dt: float = 0.005, number: int = 0) -> None: ...
    @property
    def now_ns(self) -> int: ...
    @property
    def dt(self) -> float:
        """Time since the last cycle in s."""
    @property
    def number(self) -> int: ...

class RobotSignal:
    """A robot signal, for the host."""

    @property
    def size(self) -> int: ...
    @property
    def valid(self) -> bool: ...

class ControlSignal:
    """A control signal, for the host."""

    @property
    def size(self) -> int: ...
    @property
    def valid(self) -> bool: ...

class Read:
    """Reads a robot signal: robot.view(handle)."""

    @property
    def size(self) -> int: ...
    @property
    def valid(self) -> bool: ...

class Reference:
    """Reads a control signal: original.view(handle)."""

    @property
    def size(self) -> int: ...
    @property
    def valid(self) -> bool: ...

class Modify:
    """Permission to modify a control signal: modified[handle]."""

    @property
    def size(self) -> int: ...
    @property
    def valid(self) -> bool: ...

class SignalInfo:
    """Properties of one signal."""

    @property
    def key(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def frame(self) -> str: ...
    @property
    def size(self) -> int: ...

class RobotStates:
    """Measured and estimated data of the robot. `source` is `measuredData` or `estimatedData`."""

    def __init__(self, logger: Logger | None = None) -> None: ...
    def declare(self, source: str, key: str, size: int, unit: str = "", frame: str = "") -> Status:
        """Add a signal of `size` numbers."""
    def freeze(self) -> None:
        """Forbid new keys; views need it."""
    @property
    def frozen(self) -> bool: ...
    def find(self, source: str, key: str) -> RobotSignal:
        """Handle of a signal, for `size` and `valid`."""
    def view(self, source: str, key: str) -> Array:
        """The numbers of a signal on the memory of the store, read-only; after freeze()."""
    def signals(self, source: str) -> list[SignalInfo]:
        """Every signal of `measuredData` or `estimatedData`."""
    @property
    def newest_stamp(self) -> int: ...
    def set_measured_data(self, key: str, value: ArrayLike, stamp_ns: int) -> Status:
        """Write a measurement, (n,), SI units; `stamp_ns`: when it was taken, ns. A new key is added."""
    def setMeasuredData(self, key: str, value: ArrayLike, stamp_ns: int) -> Status: ...
    def set_estimated_data(self, key: str, value: ArrayLike, stamp_ns: int) -> Status:
        """Write an estimate; a new key is added."""
    def setEstimatedData(self, key: str, value: ArrayLike, stamp_ns: int) -> Status: ...
    def get_measured_data(self, key: str) -> Array:
        """A copy of a measurement."""
    def getMeasuredData(self, key: str) -> Array: ...
    def get_estimated_data(self, key: str) -> Array:
        """A copy of an estimate."""
    def getEstimatedData(self, key: str) -> Array: ...
    def get_measurement_time_stamp(self, key: str) -> int:
        """Its stamp; -1: never written."""
    def getMeasurementTimeStamp(self, key: str) -> int: ...
    def get_estimate_time_stamp(self, key: str) -> int:
        """Its stamp; -1: never written."""
    def getEstimateTimeStamp(self, key: str) -> int: ...
    def set_measurement_time_stamp(self, key: str, stamp_ns: int) -> Status:
        """Write its stamp."""
    def setMeasurementTimeStamp(self, key: str, stamp_ns: int) -> Status: ...
    def set_estimate_time_stamp(self, key: str, stamp_ns: int) -> Status:
        """Write its stamp."""
    def setEstimateTimeStamp(self, key: str, stamp_ns: int) -> Status: ...

class RobotView:
    """Robot states of this cycle: `robot` of update()."""

    def view(self, handle: Read) -> Array:
        """The numbers of a signal, read-only, without a copy."""
    def stamp(self, handle: Read) -> int:
        """When the signal was measured, ns."""

class ControlStates:
    """References. `container` is a name of the paper, such as `taskSpaceReferencePose`."""

    def __init__(self, joints: int = 0, period: float = 0.005, logger: Logger | None = None) -> None:
        """`joints`: size of every joint reference, 0: the first one decides. `period`: in s."""
    def declare(self, container: str, key: str, size: int, unit: str = "", frame: str = "") -> Status:
        """Add a reference without a value, for a controller that is loaded before it is written."""
    def freeze(self) -> None:
        """Forbid new keys; views need it."""
    @property
    def frozen(self) -> bool: ...
    def find(self, container: str, key: str) -> ControlSignal: ...
    def view(self, container: str, key: str) -> Array:
        """The numbers of a signal on the memory of the store, writable; after freeze()."""
    def signals(self, container: str) -> list[SignalInfo]:
        """Every reference of a container."""
    @property
    def joints(self) -> int: ...
    period: float
    """Control period in s."""
    def set_task_space_reference_pose(self, key: str, value: ArrayLike) -> Status:
        """[7] m and quaternion."""
    def setTaskSpaceReferencePose(self, key: str, value: ArrayLike) -> Status: ...
    def get_task_space_reference_pose(self, key: str) -> Array:
        """[7] m and quaternion."""
    def getTaskSpaceReferencePose(self, key: str) -> Array: ...
    def set_task_space_reference_vel(self, key: str, value: ArrayLike) -> Status:
        """[6] m/s, rad/s."""
    def setTaskSpaceReferenceVel(self, key: str, value: ArrayLike) -> Status: ...
    def get_task_space_reference_vel(self, key: str) -> Array:
        """[6] m/s, rad/s."""
    def getTaskSpaceReferenceVel(self, key: str) -> Array: ...
    def set_task_space_reference_acc(self, key: str, value: ArrayLike) -> Status:
        """[6] m/s^2, rad/s^2."""
    def setTaskSpaceReferenceAcc(self, key: str, value: ArrayLike) -> Status: ...
    def get_task_space_reference_acc(self, key: str) -> Array:
        """[6] m/s^2, rad/s^2."""
    def getTaskSpaceReferenceAcc(self, key: str) -> Array: ...
    def set_joint_space_reference(self, key: str, value: ArrayLike) -> Status:
        """One number per joint; key Position, Velocity or Torque."""
    def setJointSpaceReference(self, key: str, value: ArrayLike) -> Status: ...
    def get_joint_space_reference(self, key: str) -> Array:
        """One number per joint; key Position, Velocity or Torque."""
    def getJointSpaceReference(self, key: str) -> Array: ...
    def set_other_reference(self, key: str, value: ArrayLike) -> Status:
        """The first writer sets the size."""
    def setOtherReference(self, key: str, value: ArrayLike) -> Status: ...
    def get_other_reference(self, key: str) -> Array:
        """The first writer sets the size."""
    def getOtherReference(self, key: str) -> Array: ...
    def set_com(self, value: ArrayLike) -> Status:
        """[3] m."""
    def setCoM(self, value: ArrayLike) -> Status: ...
    def get_com(self) -> Array:
        """[3] m."""
    def getCoM(self) -> Array: ...
    def set_com_velocity(self, value: ArrayLike) -> Status:
        """[3] m/s."""
    def setCoMVelocity(self, value: ArrayLike) -> Status: ...
    def get_com_velocity(self) -> Array:
        """[3] m/s."""
    def getCoMVelocity(self) -> Array: ...
    def set_com_acceleration(self, value: ArrayLike) -> Status:
        """[3] m/s^2."""
    def setCoMAcceleration(self, value: ArrayLike) -> Status: ...
    def get_com_acceleration(self) -> Array:
        """[3] m/s^2."""
    def getCoMAcceleration(self) -> Array: ...
    def set_linear_momentum(self, value: ArrayLike) -> Status:
        """[3] kg m/s."""
    def setLinearMomentum(self, value: ArrayLike) -> Status: ...
    def get_linear_momentum(self) -> Array:
        """[3] kg m/s."""
    def getLinearMomentum(self) -> Array: ...
    def set_angular_momentum(self, value: ArrayLike) -> Status:
        """[3] kg m^2/s."""
    def setAngularMomentum(self, value: ArrayLike) -> Status: ...
    def get_angular_momentum(self) -> Array:
        """[3] kg m^2/s."""
    def getAngularMomentum(self) -> Array: ...
    def set_zmp(self, value: ArrayLike, key: str = "zmp") -> Status:
        """[3] m."""
    def setZMP(self, value: ArrayLike, key: str = "zmp") -> Status: ...
    def get_zmp(self, key: str = "zmp") -> Array:
        """[3] m."""
    def getZMP(self, key: str = "zmp") -> Array: ...
    @overload
    def set_pelvis_orientation(self, rotation: ArrayLike) -> Status: ...
    @overload
    def set_pelvis_orientation(self, roll: float, pitch: float, yaw: float) -> Status: ...
    @overload
    def setPelvisOrientation(self, rotation: ArrayLike) -> Status: ...
    @overload
    def setPelvisOrientation(self, roll: float, pitch: float, yaw: float) -> Status: ...
    def get_pelvis_orientation(self) -> Array:
        """Rotation matrix [3, 3]."""
    def getPelvisOrientation(self) -> Array: ...

class ControlView:
    """References before any feedback controller of the stage: `original` of update()."""

    def view(self, handle: Reference | Modify) -> Array:
        """The numbers of a signal, read-only, without a copy; only during update()."""

class ModifiedControlStates:
    """References after the controllers before this one: `modified` of update()."""

    def view(self, handle: Reference | Modify) -> Array:
        """The numbers of a signal, read-only, without a copy."""
    def __getitem__(self, handle: Modify) -> Array:
        """The numbers of a signal, writable until update() returns."""
    def __setitem__(self, handle: Modify, value: ArrayLike) -> None: ...
    def set(self, handle: Modify, value: ArrayLike) -> None:
        """Replace the numbers of a signal, as `modified[handle] = value` does."""

class RobotSignalUse:
    """A robot signal that a controller reads."""

    @property
    def role(self) -> str: ...
    @property
    def key_from(self) -> str: ...
    @property
    def sizes(self) -> list[int]: ...
    @property
    def unit(self) -> str: ...
    @property
    def frame(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def if_asked(self) -> bool: ...
    @property
    def source(self) -> str: ...
    @property
    def max_age(self) -> float: ...

class CorrectionLimit:
    """Bounds of a correction: size [unit], rate [unit/s], angle [rad], angle_rate [rad/s]; infinite: none."""

    def __init__(
        self,
        size: float = ...,
        rate: float = ...,
        angle: float = ...,
        angle_rate: float = ...,
    ) -> None: ...
    @property
    def size(self) -> float: ...
    @property
    def rate(self) -> float: ...
    @property
    def angle(self) -> float: ...
    @property
    def angle_rate(self) -> float: ...

class ControlSignalUse:
    """A control signal that a controller reads or modifies."""

    @property
    def role(self) -> str: ...
    @property
    def key_from(self) -> str: ...
    @property
    def sizes(self) -> list[int]: ...
    @property
    def unit(self) -> str: ...
    @property
    def frame(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def if_asked(self) -> bool: ...
    @property
    def container(self) -> str: ...
    @property
    def modifies(self) -> bool: ...
    @property
    def exclusive(self) -> bool: ...
    @property
    def limit(self) -> CorrectionLimit: ...
    @property
    def when_paused(self) -> str: ...

class GainSpec:
    """A gain."""

    @property
    def name(self) -> str: ...
    @property
    def size(self) -> int: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...
    @property
    def initial(self) -> list[float]: ...
    @property
    def unit(self) -> str: ...
    @property
    def text(self) -> str: ...

class SettingSpec:
    """A setting."""

    @property
    def name(self) -> str: ...
    @property
    def initial_text(self) -> str: ...
    @property
    def initial(self) -> list[float]: ...
    @property
    def choices(self) -> list[str]: ...
    @property
    def unit(self) -> str: ...
    @property
    def text(self) -> str: ...

class StateSpec:
    """A number that state() returns."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def text(self) -> str: ...

class Description:
    """Declaration of a controller: checks, page and configuration file come from it."""

    type: str
    summary: str
    use: str
    when: str
    limitations: str
    law: str
    source: str
    information: str
    safety: bool
    stage: str

    def __init__(
        self,
        summary: str = "",
        *,
        use: str = "",
        when: str = "",
        limitations: str = "",
        law: str = "",
        source: str = "",
        information: str = "",
        stage: str = "task",
        safety: bool = False,
        on_switch: str = "reset",
        type: str = "",
    ) -> None:
        """`stage`: task or joint. `on_switch`: reset or hold. `type`: empty for the name of the class."""
    def measured(
        self,
        role: str,
        *,
        size: Size = None,
        unit: str = "",
        frame: str = "",
        text: str = "",
        max_age: float = ...,
        key_from: str = "",
        if_asked: bool = False,
    ) -> None:
        """Declare a signal of `measuredData` that the controller reads; `max_age` in s."""
    def estimated(
        self,
        role: str,
        *,
        size: Size = None,
        unit: str = "",
        frame: str = "",
        text: str = "",
        max_age: float = ...,
        key_from: str = "",
        if_asked: bool = False,
    ) -> None:
        """Declare a signal of `estimatedData` that it reads."""
    def reads(
        self,
        container: str,
        role: str,
        *,
        size: Size = None,
        unit: str = "",
        frame: str = "",
        text: str = "",
        key_from: str = "",
        if_asked: bool = False,
    ) -> None:
        """Declare a control signal that it only reads."""
    def modifies(
        self,
        container: str,
        role: str,
        *,
        size: Size = None,
        unit: str = "",
        frame: str = "",
        text: str = "",
        limit: CorrectionLimit = ...,
        exclusive: bool = False,
        when_paused: str = "by kind",
        key_from: str = "",
        if_asked: bool = False,
    ) -> None:
        """Declare a control signal that it modifies. `when_paused`: by kind, hold, fade or zero."""
    def gain(
        self,
        name: str,
        initial: float | ArrayLike,
        *,
        low: float = ...,
        high: float = ...,
        unit: str = "",
        text: str = "",
    ) -> None:
        """Declare a gain; a list makes it a vector."""
    def setting(
        self,
        name: str,
        initial: str | float | ArrayLike,
        *,
        choices: Sequence[str] = (),
        low: float = ...,
        high: float = ...,
        any_size: bool = False,
        unit: str = "",
        text: str = "",
    ) -> None:
        """Declare a setting: a text, or numbers."""
    def state(self, name: str, *, unit: str = "", text: str = "") -> None:
        """Declare a number that state() returns."""
    @property
    def robot_signals(self) -> list[RobotSignalUse]: ...
    @property
    def control_signals(self) -> list[ControlSignalUse]: ...
    @property
    def gains(self) -> list[GainSpec]: ...
    @property
    def settings(self) -> list[SettingSpec]: ...
    @property
    def states(self) -> list[StateSpec]: ...
    def faults(self) -> list[str]:
        """Errors that prevent a safe run."""
    def empty_fields(self) -> list[str]:
        """Fields that a reader would miss."""
    def page(self) -> str:
        """Documentation page in Markdown."""
    def config(self) -> str:
        """Configuration file with all gains and settings at their initial values."""

class Gain:
    """Handle of a gain."""

    @property
    def size(self) -> int: ...

class Setup:
    """Argument of initialize(): handles of declared signals, gains and settings."""

    def read(self, role: str, size: int = 0) -> Read:
        """Handle of a robot signal that describe() declares; `robot.view(handle)` reads it in update()."""
    def reference(self, role: str, size: int = 0) -> Reference:
        """Handle of a reference that is read alone."""
    def modify(self, role: str, size: int = 0) -> Modify:
        """Handle of a reference that is corrected: `modified[handle][:3] += shift`."""
    def gain(self, name: str) -> Gain:
        """Handle of a gain; `self.scalar(handle)` reads it in update()."""
    def text(self, name: str) -> str:
        """Text of a setting."""
    def numbers(self, name: str) -> Array:
        """Numbers of a setting."""
    @property
    def joints(self) -> int: ...
    @property
    def period(self) -> float: ...

class ResolvedRobotUse:
    """A declared robot signal with its key."""

    @property
    def use(self) -> RobotSignalUse: ...
    @property
    def key(self) -> str: ...
    @property
    def name(self) -> str: ...

class ResolvedControlUse:
    """A declared control signal with its key."""

    @property
    def use(self) -> ControlSignalUse: ...
    @property
    def key(self) -> str: ...
    @property
    def name(self) -> str: ...

class FeedbackController:
    """Base class of a feedback controller in Python: override describe(), initialize() and update().

    An exception in update() is a fault of this controller alone: its writes are undone and it is paused.
    """

    interface: int
    def __init__(self) -> None: ...
    def describe(self) -> Description:
        """Declare the controller; must not depend on the instance."""
    def initialize(self, setup: Setup) -> None:
        """Fetch handles. An exception refuses the controller."""
    def update(self, cycle: Cycle, robot: RobotView, original: ControlView, modified: ModifiedControlStates) -> None:
        """Run once per control cycle."""
    def reset(self) -> None:
        """Forget internal state."""
    def gains_changed(self) -> None:
        """Called in the cycle after gains changed."""
    def judge_gains(self, gains: dict[str, list[float]]) -> str | None:
        """Return one sentence if these gains do not fit each other."""
    def state(self) -> Sequence[float] | Array:
        """Return the numbers that the description declares as states."""
    def gain(self, handle: Gain) -> Array:
        """Current numbers of a gain."""
    def scalar(self, handle: Gain) -> float:
        """Current first number of a gain."""
    def log(self, level: str, text: str) -> None:
        """Log from the cycle, without waiting."""
    def enable(self) -> Status: ...
    def disable(self) -> Status: ...
    def pause(self) -> Status: ...
    def resume(self) -> Status: ...
    def declaration(self) -> Description:
        """What describe() returned, with the settings of its file."""
    def plot(self) -> str:
        """Text with description, state, gains and signals."""
    def is_enabled(self) -> bool:
        """True if enabled."""
    def isEnabled(self) -> bool: ...
    def is_paused(self) -> bool:
        """True if paused for any reason."""
    def isPaused(self) -> bool: ...
    def get_name(self) -> str:
        """Name of the instance."""
    def getName(self) -> str: ...
    def set_name(self, name: str) -> Status:
        """Set the name, before it is loaded."""
    def setName(self, name: str) -> Status: ...
    def get_information(self) -> str:
        """Additional information."""
    def getInformation(self) -> str: ...
    def get_gains(self) -> dict[str, list[float]]:
        """Gains by name."""
    def getGains(self) -> dict[str, list[float]]: ...
    def set_gains(self, gains: Mapping[str, float | ArrayLike]) -> Status:
        """Set gains, all or none."""
    def setGains(self, gains: Mapping[str, float | ArrayLike]) -> Status: ...
    def load_gains(self, file: str) -> Status:
        """Read gains from a file."""
    def loadGains(self, file: str) -> Status: ...
    def get_used_robot_states(self) -> list[ResolvedRobotUse]:
        """Declared robot signals."""
    def getUsedRobotStates(self) -> list[ResolvedRobotUse]: ...
    def get_used_control_state(self) -> list[ResolvedControlUse]:
        """Declared control signals."""
    def getUsedControlState(self) -> list[ResolvedControlUse]: ...
    def get_used_control_states(self) -> list[ResolvedControlUse]:
        """Declared control signals."""
    def getUsedControlStates(self) -> list[ResolvedControlUse]: ...
    def add_used_robot_state(self, name: str) -> Status:
        """Declare a robot signal, before initialize()."""
    def addUsedRobotState(self, name: str) -> Status: ...
    def add_used_control_state(self, name: str) -> Status:
        """Declare a control signal, before initialize()."""
    def addUsedControlState(self, name: str) -> Status: ...
    def is_using_robot_state(self, name: str) -> bool:
        """True if it is declared."""
    def isUsingRobotState(self, name: str) -> bool: ...
    def is_using_control_state(self, name: str) -> bool:
        """True if it is declared."""
    def isUsingControlState(self, name: str) -> bool: ...

def describe(library: Path, type: str = "") -> Description:
    """Description of a controller in a library, or of `module:Class` in the folder `library`."""

class ControllerStatus:
    """State of one controller."""

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def stage(self) -> str: ...
    @property
    def enabled(self) -> bool: ...
    @property
    def paused(self) -> bool: ...
    @property
    def safety(self) -> bool: ...
    @property
    def reasons(self) -> list[str]: ...
    @property
    def activity(self) -> str: ...
    @property
    def fault(self) -> str: ...
    @property
    def fault_text(self) -> str: ...
    @property
    def fault_cycle(self) -> int: ...
    @property
    def faults(self) -> int: ...
    @property
    def overruns(self) -> int: ...
    @property
    def last_us(self) -> float: ...
    @property
    def waiting_for(self) -> str: ...

class Attribution:
    """Change of a reference by one controller in one cycle."""

    @property
    def controller(self) -> str: ...
    @property
    def signal(self) -> str: ...
    @property
    def cycle(self) -> int: ...
    @property
    def before(self) -> list[float]: ...
    @property
    def after(self) -> list[float]: ...
    @property
    def size(self) -> float: ...
    @property
    def angle(self) -> float: ...

class CycleRecord:
    """What each controller did in one cycle."""

    @property
    def cycle(self) -> int: ...
    @property
    def changes(self) -> list[Attribution]: ...
    @property
    def states(self) -> dict[str, list[float]]: ...

class LoadReport:
    """Result of loading a list file; false if something was refused."""

    @property
    def loaded(self) -> list[str]: ...
    @property
    def errors(self) -> list[str]: ...
    def __bool__(self) -> bool: ...

class Change:
    """Steps that the cycle adopts together, or none of them."""

    def __init__(self) -> None: ...
    def enable(self, name: str) -> Change:
        """Enable a controller; it blends in."""
    def disable(self, name: str, force: bool = False) -> Change:
        """Disable a controller; its correction fades. `force`: a safety controller too."""
    def pause(self, name: str, reason: str = "user", force: bool = False) -> Change:
        """Pause a controller for a reason; reasons do not cancel each other."""
    def resume(self, name: str, reason: str = "user") -> Change:
        """Withdraw one reason of a pause."""
    def order(self, names: Sequence[str]) -> Change:
        """Order of execution: every loaded controller once."""
    def gains(self, name: str, gains: Mapping[str, float | ArrayLike]) -> Change:
        """Set gains, all or none."""
    def gain_file(self, name: str, file: str) -> Change:
        """Read gains from a file."""
    def profile(self, name: str) -> Change:
        """Enable exactly the controllers of a profile."""
    def motion_switched(self) -> Change:
        """Say that another motion begins: controllers with `reset` begin anew."""

class Manager:
    """A manager of a central module."""

    @property
    def name(self) -> str: ...

class FeedbackControllersManager(Manager):
    """Loads, orders, runs, pauses and guards feedback controllers."""

    def __init__(
        self,
        robot: RobotStates,
        control: ControlStates,
        *,
        blend_s: float = 0.2,
        timed: bool = False,
        lockstep: bool = False,
        overruns_to_pause: int = 5,
        check_undeclared: bool = False,
        logger: Logger | None = None,
    ) -> None: ...
    def load(self, file: Path, strict: bool = True) -> LoadReport:
        """Load a list file. Strict: all of it or nothing, else what can be loaded."""
    def load_text(self, text: str, folder: Path = ".", strict: bool = True) -> LoadReport:
        """The same from YAML text; `folder` is for relative paths."""
    def unload(self, name: str) -> Status:
        """Remove a controller that is disabled and whose correction has faded."""
    def apply(self, change: Change) -> Status:
        """Let the next cycle adopt all steps of a change, or none."""
    def prepare(self, change: Change) -> Status:
        """Check a change and hold it ready, without adopting it."""
    def withdraw(self, generation: int) -> Status:
        """Withdraw a change that the cycle has not adopted."""
    def enable(self, name: str = "") -> Status:
        """Enable one, or all."""
    def disable(self, name: str = "", force: bool = False) -> Status:
        """Disable one, or all; corrections fade. `force`: safety controllers too."""
    def pause(self, name: str = "", force: bool = False) -> Status:
        """Pause one, or all, with the reason `user`."""
    def resume(self, name: str = "", reason: str = "user") -> Status:
        """Withdraw one reason of a pause; `fault` clears a fault."""
    def __contains__(self, name: str) -> bool: ...
    def describe(self, name: str) -> Description:
        """What the controller declares: signals, gains, texts."""
    def status(self, name: str) -> ControllerStatus:
        """State of one controller: enabled, paused and why, fault."""
    def attribution(self) -> list[Attribution]:
        """Who changed which reference in the last cycle."""
    def plot(self, name: str = "") -> str:
        """Text about one controller, or all."""
    def freeze(self) -> None:
        """Fix the layout of both stores; the first cycle does it otherwise."""
    @overload
    def update(self, cycle: Cycle, robot: RobotStates | None = None, control: ControlStates | None = None) -> None:
        """Run a whole cycle."""
    @overload
    def update(self, robot: RobotStates | None = None, control: ControlStates | None = None) -> None:
        """Run a cycle as in the paper: the time is the newest stamp."""
    def add_controller(
        self,
        controller: FeedbackController,
        name: str,
        enabled: bool = False,
        config_file: Path | None = None,
        overrun_us: float = 0.0,
        blend_s: float = -1.0,
        on_fault: str = "fade",
    ) -> Status:
        """Add a controller that the program made."""
    def addController(
        self,
        controller: FeedbackController,
        name: str,
        enabled: bool = False,
        config_file: Path | None = None,
        overrun_us: float = 0.0,
        blend_s: float = -1.0,
        on_fault: str = "fade",
    ) -> Status: ...
    def load_controller(
        self,
        name: str,
        type: str = "",
        library: str = "",
        enabled: bool = False,
        config_file: Path | None = None,
        overrun_us: float = 0.0,
        blend_s: float = -1.0,
        on_fault: str = "fade",
    ) -> Status:
        """Load one from a library, or as `module:Class`."""
    def loadController(
        self,
        name: str,
        type: str = "",
        library: str = "",
        enabled: bool = False,
        config_file: Path | None = None,
        overrun_us: float = 0.0,
        blend_s: float = -1.0,
        on_fault: str = "fade",
    ) -> Status: ...
    def set_profile(self, profile: str, controllers: Sequence[str]) -> Status:
        """Set a profile."""
    def setProfile(self, profile: str, controllers: Sequence[str]) -> Status: ...
    def apply_profile(self, profile: str, motion_switched: bool = True) -> Status:
        """Enable exactly its controllers."""
    def applyProfile(self, profile: str, motion_switched: bool = True) -> Status: ...
    def wait_adopted(self, generation: int, timeout: float) -> bool:
        """Wait until the cycle has adopted a plan; `timeout` in s."""
    def waitAdopted(self, generation: int, timeout: float) -> bool: ...
    def set_execution_order(self, names: Sequence[str]) -> Status:
        """Every loaded controller once."""
    def setExecutionOrder(self, names: Sequence[str]) -> Status: ...
    def load_gains(self, name: str, file: Path) -> Status:
        """Read gains from a file."""
    def loadGains(self, name: str, file: Path) -> Status: ...
    def reload_gains(self, name: str) -> Status:
        """Read them from its own file."""
    def reloadGains(self, name: str) -> Status: ...
    def set_gains(self, name: str, gains: Mapping[str, float | ArrayLike]) -> Status:
        """Set gains, all or none."""
    def setGains(self, name: str, gains: Mapping[str, float | ArrayLike]) -> Status: ...
    def get_gains(self, name: str) -> dict[str, list[float]]:
        """Gains as last requested."""
    def getGains(self, name: str) -> dict[str, list[float]]: ...
    def is_enabled(self, name: str) -> bool:
        """As last requested."""
    def isEnabled(self, name: str) -> bool: ...
    def is_paused(self, name: str) -> bool:
        """For any reason."""
    def isPaused(self, name: str) -> bool: ...
    def get_controllers_names(self) -> list[str]:
        """In load order."""
    def getControllersNames(self) -> list[str]: ...
    def get_execution_order(self) -> list[str]:
        """In execution order."""
    def getExecutionOrder(self) -> list[str]: ...
    def get_profiles(self) -> list[str]:
        """Names of profiles."""
    def getProfiles(self) -> list[str]: ...
    def has_profile(self, profile: str) -> bool:
        """True if it exists."""
    def hasProfile(self, profile: str) -> bool: ...
    def get_used_robot_states(self, enabled_only: bool = False) -> list[str]:
        """`map/key` of all."""
    def getUsedRobotStates(self, enabled_only: bool = False) -> list[str]: ...
    def get_used_control_states(self, enabled_only: bool = False) -> list[str]:
        """`container/key` of all."""
    def getUsedControlStates(self, enabled_only: bool = False) -> list[str]: ...
    def status_all(self) -> list[ControllerStatus]:
        """In execution order."""
    def statusAll(self) -> list[ControllerStatus]: ...
    def plot_all(self) -> str:
        """Text about all."""
    def plotAll(self) -> str: ...
    def last_cycle(self) -> CycleRecord:
        """Record of the last cycle."""
    def lastCycle(self) -> CycleRecord: ...
    def begin_cycle(self, cycle: Cycle) -> None:
        """Begin a cycle."""
    def beginCycle(self, cycle: Cycle) -> None: ...
    def update_stage(self, stage: str, robot: RobotStates | None = None, control: ControlStates | None = None) -> None:
        """Run the controllers of `task` or `joint`."""
    def updateStage(
        self, stage: str, robot: RobotStates | None = None, control: ControlStates | None = None
    ) -> None: ...
    def end_cycle(self) -> None:
        """End a cycle."""
    def endCycle(self) -> None: ...
    def pause_all_using_robot_state(self, signal: str, force: bool = False) -> Status:
        """Pause all users of a signal."""
    def pauseAllUsingRobotState(self, signal: str, force: bool = False) -> Status: ...
    def pause_all_using_control_state(self, signal: str, force: bool = False) -> Status:
        """Pause all users of a signal."""
    def pauseAllUsingControlState(self, signal: str, force: bool = False) -> Status: ...
    def disable_all_using_robot_state(self, signal: str, force: bool = False) -> Status:
        """Disable all users of a signal."""
    def disableAllUsingRobotState(self, signal: str, force: bool = False) -> Status: ...
    def disable_all_using_control_state(self, signal: str, force: bool = False) -> Status:
        """Disable all users of a signal."""
    def disableAllUsingControlState(self, signal: str, force: bool = False) -> Status: ...
    def resume_all_using_robot_state(self, name: str) -> Status:
        """Withdraw the reason of this signal."""
    def resumeAllUsingRobotState(self, name: str) -> Status: ...
    def resume_all_using_control_state(self, name: str) -> Status:
        """Withdraw the reason of this signal."""
    def resumeAllUsingControlState(self, name: str) -> Status: ...

class CentralModule:
    """Runs managers in the order of its file."""

    def __init__(self, file: Path, logger: Logger | None = None) -> None: ...
    def manager(self, name: str) -> Any:
        """A manager by its name."""
    def managers(self) -> list[str]:
        """Names of the managers, in their order."""
    @overload
    def update(self) -> None: ...
    @overload
    def update(self, cycle: Cycle) -> None: ...
    @overload
    def update(self, robot: RobotStates, control: ControlStates) -> Status: ...
    def plot(self) -> str:
        """Text about all managers."""
    @staticmethod
    def register_manager(
        type: str, maker: Callable[[str, dict[str, Any], RobotStates, ControlStates], object]
    ) -> bool: ...
    @staticmethod
    def registerManager(
        type: str, maker: Callable[[str, dict[str, Any], RobotStates, ControlStates], object]
    ) -> bool: ...
    def robot_states(self) -> RobotStates:
        """The shared robot states."""
    def robotStates(self) -> RobotStates: ...
    def control_states(self) -> ControlStates:
        """The shared references."""
    def controlStates(self) -> ControlStates: ...
    def feedback_controllers(self) -> FeedbackControllersManager:
        """The feedback manager."""
    def feedbackControllers(self) -> FeedbackControllersManager: ...
    def load_errors(self) -> list[str]:
        """One sentence each."""
    def loadErrors(self) -> list[str]: ...

def register_manager(type: str, maker: Callable[[str, dict[str, Any], RobotStates, ControlStates], object]) -> bool:
    """Register a class of managers: maker(name, block, robot, control) has update_stage(stage, robot, control)."""
