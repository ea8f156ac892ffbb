"""Requests one handover from a running system and waits for its end. Used by the demo and the tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rosgraph
import rospy
import yaml
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import GetObject, Start
from coglab_py.node_start import answer
from coglab_py.pace import Pace
from coglab_py.packages import package_path
from coglab_py.steady import call_service, utc_of
from coglab_py.yaml_file import read
from coglab_smach.context.requests import HUBS

from coglab_bringup.ask import LONGEST_START
from coglab_bringup.trial_recorder import TrialRecorder, summarise

READY_LIMIT = 90.0  # s without progress until the system waits in its hub
HANDOVER_LIMIT = 60.0  # s of simulated time for one handover
MASTER = "/coglab_master"


class NotTaken(RuntimeError):
    """The master machine did not accept an action. `code` is the ReasonCode of its last refusal."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


def services() -> int:
    """Number of services that the nodes of this system have registered."""
    try:
        state = answer(rosgraph.get_master_uri(), "getSystemState")
    except TimeoutError:
        return 0
    return len(state[2]) if state else 0


def ask_for(action: str, object_id: str, alive: Callable[[], bool], limit: float) -> None:
    """Call /coglab/start until the master machine accepts the action. Raises NotTaken with its last refusal.

    `limit`: s without progress, that is, no new service and the same refusal. On a busy computer nodes start late.
    """
    refusal, code = "the service /coglab/start never appeared", ReasonCode.NODE_SILENT
    begun = moved = time.monotonic()
    before: tuple = ()
    while time.monotonic() - moved < limit and time.monotonic() - begun < max(limit, LONGEST_START) and alive():
        if (progress := (services(), refusal)) != before:
            before, moved = progress, time.monotonic()
        try:
            response = call_service("/coglab/start", Start, action, object_id, wait=1.0)
        except rospy.ROSException:
            continue
        except rospy.ServiceException as error:
            refusal, code = str(error), ReasonCode.NODE_SILENT
        else:
            if response.success:
                return
            refusal, code = response.message, response.reason_code
        time.sleep(0.2)
    raise NotTaken(f"{action} was not taken within {time.monotonic() - begun:.0f} s: {refusal}", code)


def entry_of(object_id: str) -> Mapping[str, Any] | None:
    """Entry of an object in the database of the running system; None if the database does not return it."""
    try:
        response = call_service("/object_database/get_object", GetObject, object_id, wait=2.0)
    except (rospy.ROSException, rospy.ServiceException):
        return None
    return yaml.safe_load(response.yaml) if response.success else None


def run_handover(
    kind: str, object_id: str, recorder: TrialRecorder, alive: Callable[[], bool] = lambda: True
) -> tuple[dict, float, float]:
    """Request one handover and wait until the system is in the hub again, while `recorder` records.

    Returns its result row, its start and its end (s of the steady clock).
    """
    table = package_path("lwr_description", "config", "joint_limits.yaml")
    limits = np.array(read(table).value["default"]["velocity"])
    ask_for(kind, object_id, alive, READY_LIMIT)
    pace = Pace().follow()
    deadline = pace.now() + HANDOVER_LIMIT
    start = time.monotonic()
    entry = entry_of(object_id)

    def ended() -> list[tuple]:
        rows = list(recorder.trial.transitions)
        return [row for row in rows if row[0] >= start and row[1] == MASTER and row[2] == kind and row[4] in HUBS]

    while pace.now() < deadline and not rospy.is_shutdown():
        if recorder.wait_for(lambda: bool(ended()) or not alive(), 1.0):
            break
    end = time.monotonic()
    if ended():
        _, _, _, outcome, _, reason, code = ended()[0]
        outcome = "success" if outcome == "succeeded" else f"{outcome}: {reason}"
    elif alive():
        outcome, code = f"no end within {HANDOVER_LIMIT:.0f} s", ReasonCode.TIME_LIMIT
    else:
        outcome, code = "the system ended", ReasonCode.NODE_SILENT
    row = summarise(recorder.trial, kind, outcome, start, end, limits, entry)
    return {**row, "reason_code": int(code), "started_utc": utc_of(start)}, start, end
