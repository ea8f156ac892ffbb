"""The primitives of the package equal those from the script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
EXAMPLES = PACKAGE / "examples"
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
PRIMITIVES = PACKAGE / "config" / "primitives.xml"
CYCLE = 0.005
UNIT = [0.0, 0.0, 0.0, 1.0]


def loaded() -> cc.Library:
    library = cc.Library()
    library.load(str(PRIMITIVES))
    return library


def test_the_packages_primitives_are_those_that_are_made(tmp_path: Path) -> None:
    """With and without a file name the output equals the package's file; each primitive is reported."""
    script = str(EXAMPLES / "make_primitives.py")
    for arguments, file in (([], "primitives.xml"), (["mine.xml"], "mine.xml")):
        command = [sys.executable, script, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=tmp_path)
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
