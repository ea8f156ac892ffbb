"""Doxygen runs over ctrl_more without a warning."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent


@pytest.mark.skipif(shutil.which("doxygen") is None, reason="doxygen is not installed")
def test_doxygen_has_no_warnings(tmp_path: Path) -> None:
    result = subprocess.run(
        ["doxygen", "doc/Doxyfile"],
        cwd=PACKAGE,
        env=dict(os.environ, CTRL_MORE_DOC_OUT=str(tmp_path)),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0
    warnings = [line for line in result.stderr.splitlines() if "warning" in line]
    assert not warnings, "\n".join(warnings[:20])
    assert (tmp_path / "html" / "index.html").is_file()
