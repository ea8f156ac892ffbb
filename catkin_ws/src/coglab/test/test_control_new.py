"""`./coglab controller new --python` makes a file that passes its own test."""

import subprocess
import sys

import pytest
from coglab.control import ControlError, Motion, MotionCycle, Reference, simulate
from coglab.control.new import make


@pytest.mark.parametrize("motion", [True, False], ids=["motion", "feedback"])
def test_new_file_passes_its_test_and_plots(tmp_path, motion):
    file = make("WristSway", tmp_path, motion)
    for command in (["-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)], [str(file)]):
        done = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "wrist_sway.png").is_file()
    with pytest.raises(FileExistsError, match="exists already"):
        make("WristSway", tmp_path, motion)
    with pytest.raises(ValueError, match="CamelCase"):
        make("../away", tmp_path)


def test_motion_without_end_is_refused():
    class Endless(Motion):
        def start(self, start):
            pass

        def reference(self, cycle: MotionCycle) -> Reference:
            return Reference()

        def done(self) -> bool:
            return False

    with pytest.raises(ControlError, match=r"1\.0 s"):
        simulate(Endless(), longest=1.0)
