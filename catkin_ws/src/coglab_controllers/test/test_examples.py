"""The numbered examples run and draw; the primitives of the package are those that the script makes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
EXAMPLES = PACKAGE / "examples"
NUMBERED = sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
PRIMITIVES = PACKAGE / "config" / "primitives.xml"
CYCLE = 0.005
UNIT = [0.0, 0.0, 0.0, 1.0]

# Runs an example as its user does, and then tells what its figure holds.
DRIVER = """
import json, runpy, sys
example, folder = sys.argv[1:]
sys.argv = [example, folder]
sys.path.insert(0, example.rpartition("/")[0])
runpy.run_path(example, run_name="__main__")
from matplotlib import pyplot

def line(one):
    data = one.get_data_3d() if hasattr(one, "get_data_3d") else one.get_data()
    return [list(map(float, axis)) for axis in data]

print(json.dumps([[line(each) for each in axes.lines] for axes in pyplot.gcf().axes]))
"""


@pytest.mark.parametrize("example", NUMBERED, ids=lambda path: path.stem)
def test_an_example_runs_and_draws_its_plot(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, str(example), str(tmp_path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / f"{example.stem}.png").stat().st_size > 5000
    curves = [line for axes in json.loads(done.stdout.splitlines()[-1]) for line in axes]
    assert curves and all(np.isfinite(line).all() and np.size(line) > 10 for line in curves)


def loaded() -> cc.Library:
    library = cc.Library()
    library.load(str(PRIMITIVES))
    return library


def test_a_plot_lies_beside_its_script_unless_a_folder_is_given(tmp_path: Path) -> None:
    call = f"import sys; sys.path.insert(0, {str(EXAMPLES)!r}); import example_files as e; e.pyplot.plot([0, 1]); "
    call += f"e.save_plot({str(tmp_path / 'mine.py')!r})"
    (tmp_path / "there").mkdir()
    for arguments, place in (([], tmp_path), ([str(tmp_path / "there")], tmp_path / "there")):
        done = subprocess.run([sys.executable, "-c", call, *arguments], capture_output=True, text=True, timeout=60)
        assert done.stdout == f"plot: {place / 'mine.png'}\n", done.stderr[-2000:]
        assert (place / "mine.png").is_file()


def test_the_packages_primitives_are_those_that_are_made(tmp_path: Path) -> None:
    """With a file and without: the same, as the package has it; and what is said of each."""
    script = str(EXAMPLES / "make_primitives.py")
    for arguments, file in (([], "primitives.xml"), (["mine.xml"], "mine.xml")):
        command = [sys.executable, script, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)
        assert done.returncode == 0, done.stderr[-2000:]
        made = cc.Library()
        made.load(str(tmp_path / file))
    there = loaded()
    assert made.ids() == there.ids() and sorted(p.name for p in tmp_path.iterdir()) == ["mine.xml", "primitives.xml"]
    for name in there.ids():
        one, other = made[name], there[name]
        assert (one.description, one.mapping, one.duration) == (other.description, other.mapping, other.duration)
        for field in ("centres", "widths", "weights", "start", "goal", "start_velocity", "alpha", "stiffness"):
            np.testing.assert_allclose(getattr(one, field), getattr(other, field), rtol=1e-7, atol=1e-7, err_msg=name)
    said = [line.split(": ") for line in done.stdout.splitlines()]
    names = ["reach_human", "reach_human_high", "give_human", "take_board", "put_board"]
    assert [line[0] for line in said] == names
    for name, words in said:
        seconds, rest = words.split(" s, worst deviation ")
        assert float(seconds) == pytest.approx(there[name].duration, abs=0.05)
        assert 0.0 < float(rest.removesuffix(" mm")) < 5.0
