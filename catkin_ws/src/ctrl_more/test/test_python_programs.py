"""Programs in Python: central module, managers, logging, the command and the paper's example."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import ctrl_more
import numpy as np
import pytest
from ctrl_more import CentralModule, Logger, Refused

PACKAGE = Path(__file__).resolve().parent.parent


class Walk:
    """A manager that moves the centre of mass."""

    def __init__(self, name, block, robot, control) -> None:  # type: ignore[no-untyped-def]
        self.step = block["step"]

    def update_stage(self, stage, robot, control) -> None:  # type: ignore[no-untyped-def]
        if stage == "task":
            control.set_com(control.get_com() + [self.step, 0, 0])
            if control.get_com()[0] > 0.35:
                raise OverflowError("too far")


ctrl_more.register_manager("Walk", Walk)


def test_manager_in_python_runs_and_its_failure_is_raised(tmp_path: Path) -> None:
    file = tmp_path / "central.yaml"
    file.write_text("managers: [walk]\nwalk: {type: Walk, step: 0.1}\n")
    central = CentralModule(file)
    for _ in range(3):
        central.update()
    assert central.control_states().get_com()[0] == pytest.approx(0.3)
    assert isinstance(central.manager("walk"), Walk)
    with pytest.raises(RuntimeError, match="OverflowError: too far"):
        central.update()


def test_wrong_central_file_is_refused_with_its_place(tmp_path: Path) -> None:
    file = tmp_path / "central.yaml"
    file.write_text("managers: [walk]\nwalk: {type: Wlk}\n")
    with pytest.raises(Refused, match=r"central.yaml:2.*Walk"):
        CentralModule(file)


def test_records_go_to_logging(caplog: pytest.LogCaptureFixture) -> None:
    logger = Logger()
    ctrl_more.to_logging(logger, "mine", period=60.0)
    with caplog.at_level(logging.WARNING, "mine"):
        logger.log("warning", "arm", "it is warm")
        logger.drain()
    assert ("mine.arm", logging.WARNING, "it is warm") in caplog.record_tuples


def call(*arguments: str | Path, cwd: Path | None = None) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, *map(str, arguments)], capture_output=True, text=True, timeout=600, check=False, cwd=cwd
    )
    return done.returncode, done.stdout + done.stderr


def test_the_papers_user_code() -> None:
    code, said = call(PACKAGE / "examples" / "python" / "attitude.py")
    assert code == 0, said
    numbers = np.array([float(n) for n in said.replace("[", " ").replace("]", " ").split()]).reshape(3, 3)
    assert np.allclose(numbers @ numbers.T, np.eye(3), atol=1e-6) and not np.allclose(numbers, np.eye(3))


def test_command_runs_a_list_file(tmp_path: Path) -> None:
    file = PACKAGE / "examples" / "controllers.yaml"
    imu = "measuredData/imu=0.1,0,0,0,0,0,0,0,9.81"
    code, said = call("-m", "ctrl_more", "run", file, "--enable-all", "--signal", imu, "--cycles", "100")
    assert code == 0 and "100 of 100" in said and "pelvisOrientation/pelvis" in said
    code, said = call("-m", "ctrl_more", "check", file.name, cwd=file.parent)  # its own files lie beside it
    assert code == 0, said
    code, said = call("-m", "ctrl_more", "page", file)
    assert code == 0 and said.startswith("# Attitude")
    code, said = call("-m", "ctrl_more", "list", tmp_path / "missing.yaml")
    assert code == 1 and "missing.yaml" in said and "Traceback" not in said
    assert call("-m", "ctrl_more", "walk")[0] == 2


def test_command_runs_a_controller_of_a_python_file(tmp_path: Path) -> None:
    file = tmp_path / "rises.py"
    file.write_text(
        "import ctrl_more\n"
        "class Rises(ctrl_more.FeedbackController):\n"
        "    def describe(self):\n"
        "        d = ctrl_more.Description('rises')\n"
        "        d.modifies('zmp', 'zmp')\n"
        "        return d\n"
        "    def initialize(self, setup): self.zmp = setup.modify('zmp')\n"
        "    def update(self, cycle, robot, original, modified): modified[self.zmp][2] += 0.1\n"
    )
    code, said = call("-m", "ctrl_more", "run", file, "--cycles", "50")
    assert code == 0 and "50 of 50" in said and "0.1" in said, said
    code, said = call("-m", "ctrl_more", "run", file, "--signal", "measuredData/wrench=0,5,0,0,0,0")
    assert code == 1 and "measuredData/wrench: " in said and "zmp/zmp" in said
    code, said = call("-m", "ctrl_more", "run", f"{file}:Falls")
    assert code == 1 and "['Rises']" in said
