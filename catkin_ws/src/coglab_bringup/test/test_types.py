"""The Python that ships is typed, as coglab_bringup/type_check.py says; pre-commit runs the same."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from coglab_bringup import type_check

TOP = Path(__file__).resolve().parents[4]


@pytest.mark.skipif(shutil.which("mypy") is None, reason="mypy is not installed: ./coglab install test")
def test_the_python_that_ships_is_typed(capfd):
    files, strict = type_check.shipped_files()
    assert len(files) > 100 and len(strict) > 70
    names = {str(path.relative_to(type_check.SOURCES)) for path in files}
    ships = [*type_check.SOURCES.glob("*/scripts/*.py"), *type_check.SOURCES.glob("*/src/*/__init__.py")]
    missing = {str(path.relative_to(type_check.SOURCES)) for path in ships} - names
    assert not missing, f"they ship and are not checked: {missing}"
    assert {"new_controller", "object_tool", "train_patterns", "check_person"} <= set(strict)
    status = type_check.main()
    said = capfd.readouterr()
    assert status == 0, said.out[-6000:] + said.err
