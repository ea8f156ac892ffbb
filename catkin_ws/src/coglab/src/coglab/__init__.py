"""The Python interface of CogLab: one Robot, running or in virtual time; own controllers; learning environments.

- ``connect()``: the running robot, over ROS.
- ``World(seed=..., person=..., object=...)``: the whole cell in virtual time, without a ROS master.
- ``trials(n)``: many trials on several processors.
- ``coglab.control``: own motions and feedback controllers. ``coglab.envs``: Gymnasium environments.

The names are loaded when they are used first: ``import coglab.control`` needs neither ROS nor the simulation.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coglab_py.pose import Pose
    from coglab_trials import Conditions

    from coglab.fluency import Fluency, fluency_of
    from coglab.results import ACTIONS, Event, Exchange, MotionResult, Refused, Result, RobotState, reason_name
    from coglab.robot import Arm, Hand, Motion, Robot
    from coglab.running import connect
    from coglab.study import trials
    from coglab.trial import Phase, Trial
    from coglab.world import World

_WHERE = {
    "ACTIONS": "results",
    "Arm": "robot",
    "Conditions": "world",
    "Event": "results",
    "Exchange": "results",
    "Fluency": "fluency",
    "Hand": "robot",
    "Motion": "robot",
    "MotionResult": "results",
    "Phase": "trial",
    "Pose": "results",
    "Refused": "results",
    "Result": "results",
    "Robot": "robot",
    "RobotState": "results",
    "Trial": "trial",
    "World": "world",
    "connect": "running",
    "fluency_of": "fluency",
    "reason_name": "results",
    "trials": "study",
}

__all__ = [
    "ACTIONS",
    "Arm",
    "Conditions",
    "Event",
    "Exchange",
    "Fluency",
    "Hand",
    "Motion",
    "MotionResult",
    "Phase",
    "Pose",
    "Refused",
    "Result",
    "Robot",
    "RobotState",
    "Trial",
    "World",
    "connect",
    "fluency_of",
    "reason_name",
    "trials",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'coglab' has no attribute '{name}'; it has {', '.join(__all__)}")
    return getattr(import_module(f"coglab.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
