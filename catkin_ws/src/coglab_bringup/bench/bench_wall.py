#!/usr/bin/python3
"""Wall times a newcomer meets: the first demo and the whole test run as recorded, a later demo as run here."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path


def row(figure: str, value: float | None, limit: float) -> dict:
    """A row whose goal is an upper limit in s; a figure that was never recorded is not ok."""
    fine = value is not None and value <= limit
    return dict(
        bench="wall", figure=figure, value=value, unit="s", goal=f"<= {limit:.0f}", peer=None, peer_value=None, ok=fine
    )


def main() -> None:
    top = Path(os.environ["COGLAB_TOP"])
    with tempfile.TemporaryDirectory() as out:
        start = time.monotonic()
        subprocess.run([top / "coglab", "demo", "--headless", "--out", out], stdout=subprocess.DEVNULL, check=True)
        later = round(time.monotonic() - start, 1)
    recorded = top / ".coglab" / "times.json"
    times = json.loads(recorded.read_text()) if recorded.is_file() else {}
    setup = times.get("setup", {"install_s": 0.0, "build_s": 0.0})
    first = setup["install_s"] + setup["build_s"] + later
    rows = [
        row("demo with the longest installation and build recorded in this checkout", round(first, 1), 600),
        row("demo again", later, 60),
        row("./coglab test, as last run", times.get("last_test", {}).get("total_s"), 900),
    ]
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
