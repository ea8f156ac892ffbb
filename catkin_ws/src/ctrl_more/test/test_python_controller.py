"""Feedback controllers in Python load, act, fault and blend like those in C++."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from pathlib import Path

import ctrl_more
import numpy as np
import pytest
from ctrl_more import (
    ControlStates,
    CorrectionLimit,
    Cycle,
    Description,
    FeedbackControllersManager,
    Refused,
    RobotStates,
)

DT = 0.005  # s
POSE = [0.5, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]


class Lift(ctrl_more.FeedbackController):
    """Lifts the hand by a gain; `then` is called at the end of each update()."""

    def __init__(self, then: object = None) -> None:
        super().__init__()
        self.then = then
        self.resets = 0

    def describe(self) -> Description:
        d = Description("Lifts the hand.")
        d.modifies("taskSpaceReferencePose", "ee", unit="m", frame="base", limit=CorrectionLimit(size=0.1))
        d.gain("height", 0.01, low=0.0, high=1.0, unit="m")
        d.state("lifted", unit="m")
        return d

    def initialize(self, setup: ctrl_more.Setup) -> None:
        self.ee = setup.modify("ee")
        self.height = setup.gain("height")

    def update(self, cycle, robot, original, modified) -> None:  # type: ignore[no-untyped-def]
        modified[self.ee][2] += self.scalar(self.height)
        if self.then:
            self.then(self, modified)  # type: ignore[operator]

    def reset(self) -> None:
        self.resets += 1

    def state(self) -> list[float]:
        return [self.scalar(self.height)]


class Cell:
    """A manager with the stores that it runs on."""

    def __init__(self, blend_s: float = 0.0) -> None:
        self.robot, self.control = RobotStates(), ControlStates()
        self.control.set_task_space_reference_pose("ee", POSE)
        self.manager = FeedbackControllersManager(self.robot, self.control, blend_s=blend_s)
        self.number = 0

    def run(self, cycles: int = 1) -> float:
        """Height of the hand after some cycles, each on the same reference."""
        for _ in range(cycles):
            self.number += 1
            self.control.set_task_space_reference_pose("ee", POSE)
            self.manager.update(Cycle(int(self.number * DT * 1e9), DT, self.number))
        return float(self.control.get_task_space_reference_pose("ee")[2])


def add(cell: Cell, controller: ctrl_more.FeedbackController, name: str = "lift") -> None:
    cell.manager.add_controller(controller, name, enabled=True)


def test_acts_is_attributed_and_reports_its_state() -> None:
    cell, lift = Cell(), Lift()
    add(cell, lift)
    assert cell.run() == pytest.approx(0.31)
    record = cell.manager.last_cycle()
    assert [(c.controller, c.signal) for c in record.changes] == [("lift", "taskSpaceReferencePose/ee")]
    assert record.changes[0].size == pytest.approx(0.01) and record.states == {"lift": [0.01]}
    assert lift.resets == 1 and lift.isEnabled() and lift.getName() == "lift"


def test_blends_in_and_out() -> None:
    cell = Cell(blend_s=10 * DT)
    add(cell, Lift())
    assert cell.run() == pytest.approx(0.301) and cell.run(9) == pytest.approx(0.31)
    cell.manager.disable("lift")
    assert cell.run() == pytest.approx(0.309) and cell.run(9) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("wrong", "kind", "words"),
    [
        (lambda c, m: 1 / 0, "exception", "test_python_controller.py:"),
        (lambda c, m: m[c.ee].__setitem__(0, np.nan), "number that is not finite", ""),
        (lambda c, m: m[c.ee].__setitem__(0, 2.0), "correction larger than declared", ""),
        (lambda c, m: m.set(c.ee, [1.0, 2.0]), "exception", "7"),
        (lambda c, m: m.set(c.ee, ["a"] * 7), "exception", "expected real numbers"),
        (lambda c, m: m.set(c.ee, np.zeros((7, 1))), "exception", "one dimension"),
    ],
)
def test_fault_is_rolled_back_and_named(wrong: object, kind: str, words: str) -> None:
    cell = Cell()
    add(cell, Lift(wrong))
    add(cell, Lift(), "next")
    assert cell.run() == pytest.approx(0.31)
    status = cell.manager.status("lift")
    assert status.fault == kind and words in status.fault_text and status.paused
    assert status.reasons[0].startswith("fault") and cell.manager.status("next").activity == "running"


def test_arrays_are_live_and_closed_after_update() -> None:
    cell = Cell()
    kept = {}

    def keep(controller: Lift, modified: ctrl_more.ModifiedControlStates) -> None:
        kept.update(array=modified[controller.ee], view=modified.view(controller.ee), modified=modified)

    lift = Lift(keep)
    add(cell, lift)
    cell.run()
    assert np.shares_memory(kept["array"], cell.control.view("taskSpaceReferencePose", "ee"))
    assert not kept["view"].flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        kept["array"][0] = 1.0
    with pytest.raises(Refused, match="update"):
        kept["modified"][lift.ee]


def test_foreign_permission_is_refused() -> None:
    cell = Cell()
    first = Lift()
    add(cell, first, "first")
    add(cell, Lift(lambda c, m: m[first.ee]), "thief")
    cell.run()
    assert "PermissionError" in cell.manager.status("thief").fault_text


def test_store_lives_as_long_as_its_arrays() -> None:
    control = ControlStates()
    control.set_task_space_reference_pose("ee", POSE)
    with pytest.raises(Refused, match="freeze"):
        control.view("taskSpaceReferencePose", "ee")
    control.freeze()
    view = control.view("taskSpaceReferencePose", "ee")
    view[0] = 0.7
    assert control.get_task_space_reference_pose("ee")[0] == 0.7
    del control
    gc.collect()
    assert view[0] == 0.7


def test_gains_out_of_range_change_nothing() -> None:
    cell = Cell()
    add(cell, Lift())
    with pytest.raises(Refused, match="height"):
        cell.manager.set_gains("lift", {"height": 2.0})
    cell.manager.set_gains("lift", {"height": 0.02})
    assert cell.manager.get_gains("lift") == {"height": [0.02]} and cell.run() == pytest.approx(0.32)


def test_instance_is_loaded_once_at_a_time() -> None:
    cell, lift = Cell(), Lift()
    add(cell, lift)
    with pytest.raises(Refused, match="another instance"):
        add(Cell(), lift)
    cell.manager.disable("lift")
    cell.run(2)
    cell.manager.unload("lift")
    cell.run()
    cell.manager.enable()  # a request frees what the cycle has left
    add(cell, lift, "again")
    assert cell.run() == pytest.approx(0.31)


def test_manager_may_be_run_in_another_thread() -> None:
    cell = Cell()
    add(cell, Lift())
    thread = threading.Thread(target=cell.run, args=(100,))
    thread.start()
    for _ in range(20):
        cell.manager.set_gains("lift", {"height": 0.03})
    thread.join(60)
    assert cell.run() == pytest.approx(0.33)


MODULE = """
import ctrl_more
from helper_beside import RAISE

class Lift(ctrl_more.FeedbackController):
    def describe(self):
        d = ctrl_more.Description("Lifts the hand.")
        d.modifies("taskSpaceReferencePose", "ee", unit="m", frame="base")
        return d
    def initialize(self, setup):
        self.ee = setup.modify("ee")
    def update(self, cycle, robot, original, modified):
        modified[self.ee][2] = original.view(self.ee)[2] + RAISE

class Short(Lift):
    def update(self, cycle): pass

class NoUpdate(ctrl_more.FeedbackController):
    def describe(self): return ctrl_more.Description("Nothing.")
    def initialize(self, setup): pass

class Old(Lift):
    interface = 1

class NoDescription(Lift):
    def describe(self): return 3

number = 3
"""


def write_list(folder: Path, kind: str, more: str = "") -> Path:
    (folder / "lifting.py").write_text(MODULE)
    (folder / "helper_beside.py").write_text("RAISE = 0.02\n")
    (folder / "broken.py").write_text("import no_such_module\n")
    path = folder / "list.yaml"
    path.write_text(f"loadControllers: [lift]\nlift: {{type: '{kind}', enabled: true{more}}}\n")
    return path


def test_list_file_names_a_class_beside_it(tmp_path: Path) -> None:
    cell = Cell()
    cell.manager.load(write_list(tmp_path, "lifting:Lift"))
    assert cell.run() == pytest.approx(0.32)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("lifting:Missing", "has no class Missing"),
        ("lifting:Short", "expected update"),
        ("lifting:NoUpdate", "no method update"),
        ("lifting:Old", "interface 1"),
        ("lifting:NoDescription", "returned int"),
        ("lifting:number", "not a class"),
        ("broken:Lift", "no_such_module"),
        ("nowhere_at_all:Lift", "nowhere_at_all"),
        ("a b:c", "my_module:MyController"),
    ],
)
def test_what_is_no_controller_is_refused_in_words(tmp_path: Path, kind: str, words: str) -> None:
    cell = Cell()
    with pytest.raises(Refused, match=words):
        cell.manager.load(write_list(tmp_path, kind))
    assert cell.manager.get_controllers_names() == []


@pytest.mark.parametrize("value", [[1.0] * 6, [np.nan] * 7, ["x"] * 7, [1j] * 7, [[0.0] * 7], None])
def test_store_refuses_wrong_values(value: object) -> None:
    control = ControlStates()
    control.setTaskSpaceReferencePose("ee", POSE)
    with pytest.raises(Refused):
        control.setTaskSpaceReferencePose("ee", value)
    assert control.getTaskSpaceReferencePose("ee").tolist() == POSE


INTERRUPTED = """
from test_python_controller import Cell, Lift, add
def interrupt(*_):
    raise KeyboardInterrupt
cell = Cell()
add(cell, Lift(interrupt))
try:
    cell.run()
except KeyboardInterrupt:
    print(cell.manager.status("lift").fault)
"""


def test_ctrl_c_in_update_reaches_the_program() -> None:
    # In a program of its own, as only the main thread hears signals: under xdist it may be another one.
    heard = ["env", "--default-signal=INT", sys.executable, "-c", INTERRUPTED]
    ended = subprocess.run(heard, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=600, check=True)
    assert ended.stdout.strip() == "exception", ended.stderr


def test_help_of_compiled_methods_has_their_text() -> None:
    text = ctrl_more.RobotStates.set_measured_data.__doc__ or ""
    assert text.startswith("set_measured_data(") and "Write" in text and "ns" in text


def test_bare_numbers_of_numpy_are_gains_and_signals() -> None:
    cell, robot = Cell(), RobotStates()
    add(cell, Lift())
    cell.manager.set_gains("lift", {"height": np.float32(0.5)})
    robot.set_measured_data("height", np.float64(0.2), 1)
    assert robot.get_measured_data("height").tolist() == [0.2]


def test_a_library_that_is_none_is_refused() -> None:
    with pytest.raises(Refused, match="nowhere.so"):
        ctrl_more.describe(Path("/nowhere.so"))
