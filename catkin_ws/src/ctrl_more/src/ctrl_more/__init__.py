"""Feedback controllers for any robot (the Ctrl-MORE paper): the same C++ library that runs in the control cycle.

Every method has a Python name (`set_measured_data`) and its name in the paper (`setMeasuredData`). Arrays are
numpy arrays of float64, units are SI, quaternions are `x y z w`. A refused request raises `Refused`, a
`ValueError` with the expected and the received value and what to do; it has changed nothing. Records of the
C++ loggers go to `logging`, below the name `ctrl_more`.

    robot, control = RobotStates(), ControlStates(joints=7)
    manager = FeedbackControllersManager(robot, control)
    manager.load("feedback.yaml")
    manager.update(Cycle(now_ns=0, dt=0.005, number=1))
"""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a new process may find this folder before that of the compiled module

from ctrl_more import _core
from ctrl_more._core import (
    INTERFACE,
    Attribution,
    CentralModule,
    Change,
    ControllerStatus,
    ControlStates,
    ControlView,
    CorrectionLimit,
    Cycle,
    CycleRecord,
    Description,
    FeedbackController,
    FeedbackControllersManager,
    LoadReport,
    Logger,
    LogRecord,
    Manager,
    ModifiedControlStates,
    Refused,
    RobotStates,
    RobotView,
    Setup,
    Status,
    describe,
    logger,
    register_manager,
)
from ctrl_more._texts import add_texts
from ctrl_more.drain import to_logging

add_texts(_core)
to_logging(logger)

__all__ = [
    "INTERFACE",
    "Attribution",
    "CentralModule",
    "Change",
    "ControlStates",
    "ControlView",
    "ControllerStatus",
    "CorrectionLimit",
    "Cycle",
    "CycleRecord",
    "Description",
    "FeedbackController",
    "FeedbackControllersManager",
    "LoadReport",
    "LogRecord",
    "Logger",
    "Manager",
    "ModifiedControlStates",
    "Refused",
    "RobotStates",
    "RobotView",
    "Setup",
    "Status",
    "describe",
    "logger",
    "register_manager",
    "to_logging",
]
