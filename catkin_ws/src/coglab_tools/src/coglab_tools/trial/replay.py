"""Publishes the bag of a trial again, on its own ROS master, with its own time (`/clock`)."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from coglab_tools.command import CheckFailed, NotThere, UsageError

END_LIMIT = 20.0  # s for roslaunch to end its nodes


def replay(bag: Path, rate: float, rviz: bool) -> float:
    """Play a bag until its end or Ctrl-C. Returns how long that took (s). UsageError: `rate` is no speed. NotThere:
    roslaunch or a screen for rviz is missing. CheckFailed: it ended with an error."""
    if not (math.isfinite(rate) and 0.01 <= rate <= 100.0):
        raise UsageError(f"--rate is {rate:g}: 0.01 to 100 times real time are expected")
    if rviz and not os.environ.get("DISPLAY"):
        raise NotThere("--rviz needs a screen, and DISPLAY is empty; without it: rosrun rviz rviz on another computer")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    environment.pop("ROS_HOSTNAME", None)
    command = ["roslaunch", "-p", str(port), "coglab_tools", "replay.launch", f"bag:={bag.absolute()}"]
    command += [f"rate:={rate}", f"rviz:={'true' if rviz else 'false'}"]
    print(f"in another terminal: export ROS_MASTER_URI=http://127.0.0.1:{port}; rostopic list", flush=True)
    begun = time.monotonic()
    try:
        errors = tempfile.TemporaryFile()  # roslaunch calls the end of the bag a death
        process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
    except FileNotFoundError:
        raise NotThere(
            "roslaunch is not there: . catkin_ws/devel/setup.bash, or sudo apt install python3-roslaunch"
        ) from None
    try:
        status = process.wait()
    except KeyboardInterrupt:
        process.send_signal(signal.SIGINT)
        status = 0
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(END_LIMIT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    if status:
        errors.seek(0)
        last = (errors.read().decode(errors="replace").strip().splitlines() or ["it printed no message"])[-1]
        raise CheckFailed(f"roslaunch ended with status {status} while it played {bag}: {last}")
    return time.monotonic() - begun
