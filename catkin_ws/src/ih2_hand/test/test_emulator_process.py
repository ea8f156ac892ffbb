"""The emulator in its own process, without ROS."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from ih2_hand.errors import HandConnectionLost
from patience import opened, until

SCRIPT = str(Path(__file__).resolve().parents[1] / "scripts" / "hand_emulator.py")


@pytest.fixture
def start(tmp_path):
    processes = []

    def run(*arguments: str, errors: int | None = None) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, SCRIPT, "--link", str(tmp_path / "hand"), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.terminate()
        assert process.wait(60.0) == 0
    assert not (tmp_path / "hand").exists(), "the link goes with the process"


def test_port_link_commands_and_trace(start, tmp_path):
    trace = tmp_path / "trace.txt"
    process = start(
        "--calibration-scale",
        "0",
        "--commands",
        "--trace",
        str(trace),
        "--contact",
        "255",
        "100",
        "100",
        "100",
        "100",
        "--stiffness",
        "20",
    )
    port = process.stdout.readline().split()
    assert port[0] == "port"
    with opened(str(tmp_path / "hand")) as driver:
        driver.calibration("fast")
        driver.set_finger_current(2, 100)
        until(lambda: driver.get_finger_position(2) == 105)
        process.stdin.write("unplug 0.2\n")
        process.stdin.flush()
        assert process.stdout.readline() == "port none (unplugged)\n"
        with pytest.raises(HandConnectionLost):
            for _ in range(100):
                driver.get_finger_status(1)
                time.sleep(0.01)
    lines = [process.stdout.readline() for _ in range(2)]
    assert "unplugged\n" in lines and any(line.startswith("port /") for line in lines)
    process.stdin.write("nonsense\n")
    process.stdin.flush()
    assert "fault" in process.stdout.readline()
    text = trace.read_text()
    assert "resynchronisation" in text
    assert "FastCalibration" in text
    assert "LLMC command 61 motor 2 data 00 64" in text
    assert "position 105" in text


@pytest.mark.parametrize(
    "arguments",
    [("--contact", "255", "100", "100", "100", "300"), ("--calibration-scale", "-1"), ("--fault", "explode")],
)
def test_bad_arguments(tmp_path, arguments):
    done = subprocess.run(
        [sys.executable, SCRIPT, *arguments], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 2
    assert "hand_emulator:" in done.stderr


def test_a_trace_on_a_full_disk_is_reported_once_and_the_hand_goes_on(start, tmp_path):
    process = start("--calibration-scale", "0", "--trace", "/dev/full", errors=subprocess.PIPE)
    assert process.stdout.readline().startswith("port")
    with opened(str(tmp_path / "hand")) as driver:
        driver.calibration("fast")
        for _ in range(20):
            driver.get_finger_position(2)
    assert process.poll() is None
    process.terminate()
    text = process.stderr.read()
    assert text.count("/dev/full") == 1 and "No space left" in text and "Traceback" not in text, text
