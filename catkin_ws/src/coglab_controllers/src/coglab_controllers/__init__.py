"""The cores of the low-level controller for Python: the same C++ code that runs in the robot's control cycle.

Units are SI, quaternions are ``x y z w``, joints are in wire order (lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5
lwr_a6). Arrays are numpy arrays of float64. Wrong input raises ``ValueError`` (or ``LibraryError``, a
``ValueError``) with the expected and the received value.
"""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a new process may find this folder before that of the compiled module

from coglab_controllers._core import (
    MAX_BASIS,
    ArmDynamics,
    CartesianMotion,
    CartesianReference,
    Chain,
    Dmp,
    DynamicTerms,
    GoalFilter,
    GoalLimits,
    GoalWeight,
    Guard,
    GuardResult,
    IkResult,
    Interpolator,
    JointLimits,
    Library,
    LibraryError,
    OrientationCurve,
    PhaseGovernor,
    PostureTask,
    Primitive,
    PtpTrajectory,
    TwoTaskIk,
    Workspace,
    WorkspaceParameters,
    exp_rotation,
    learn,
    load_joint_limits,
    reproduce,
    rotation_between,
)

__all__ = [
    "MAX_BASIS",
    "ArmDynamics",
    "CartesianMotion",
    "CartesianReference",
    "Chain",
    "Dmp",
    "DynamicTerms",
    "GoalFilter",
    "GoalLimits",
    "GoalWeight",
    "Guard",
    "GuardResult",
    "IkResult",
    "Interpolator",
    "JointLimits",
    "Library",
    "LibraryError",
    "OrientationCurve",
    "PhaseGovernor",
    "PostureTask",
    "Primitive",
    "PtpTrajectory",
    "TwoTaskIk",
    "Workspace",
    "WorkspaceParameters",
    "exp_rotation",
    "learn",
    "load_joint_limits",
    "reproduce",
    "rotation_between",
]
