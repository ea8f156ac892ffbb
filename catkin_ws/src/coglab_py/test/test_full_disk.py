"""A node continues if its log cannot be written, as on a full disk."""

from __future__ import annotations

import subprocess
import sys

NODE = """
import logging, sys
import rosgraph.roslogging
rosgraph.roslogging.configure_logging("full_disk")
from coglab_py import node_start
getattr(node_start, "log_without_raising", lambda: None)()
for _ in range(2000):
    logging.getLogger("rosout").info("a line of some length that soon fills the buffer of the stream")
sys.stderr.write("went on\\n")
"""


def test_a_log_that_cannot_be_written_does_not_end_the_caller(tmp_path):
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-c", NODE],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=600,
            check=False,
            env={"PYTHONPATH": ":".join(sys.path), "PATH": "/usr/bin:/bin", "ROS_LOG_DIR": str(tmp_path)},
        )
    assert "went on" in ended.stderr, ended.stderr
    assert ended.stderr.count("\n") < 10, ended.stderr  # no traceback for each line
