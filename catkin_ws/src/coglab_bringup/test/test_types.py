"""The shipped Python passes mypy with mypy.ini; pre-commit runs the same."""

import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]


@pytest.mark.skipif(shutil.which("mypy") is None, reason="mypy is not installed: ./coglab install test")
@pytest.mark.skipif("bookworm" not in Path("/etc/os-release").read_text(), reason="numpy's types differ by release")
def test_the_shipped_python_is_typed():
    done = subprocess.run(["mypy"], cwd=TOP, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr
