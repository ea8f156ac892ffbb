"""What docs/console.md prints is run: the tables of sessions, the reader in Python, a program with a key."""

import asyncio
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from coglab_console.desk.experiment import Experiment
from coglab_console.desk.session_file import COLUMNS, session_files
from coglab_console.web import server
from console_double import running

PACKAGE = Path(__file__).resolve().parents[1]
PAGE = (PACKAGE.parents[2] / "docs" / "console.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", PAGE, re.S)
TOOL = "./coglab shell rosrun coglab_console console_session.py"


@pytest.fixture
def sessions(tmp_path):
    """A folder console_sessions with one session of one trial."""
    folder = tmp_path / "console_sessions"
    session = Experiment(folder, lambda: 1_700_000_000.0, lambda text: None)
    session.begin("P07", ["receive"], 2, "as_listed", 0)
    session.trial_begin()
    session.result({"kind": "take", "outcome": "succeeded", "duration_s": 1.0, "started": 1.0, "ended": 2.0})
    session.trial_end("done")
    return folder


def lines_that_begin_with(word):
    return [line.split("  #")[0].strip() for _, text in BLOCKS for line in text.splitlines() if line.startswith(word)]


@pytest.mark.parametrize("line", lines_that_begin_with(TOOL))
def test_the_printed_commands_make_tables(line, sessions):
    (file,) = session_files(sessions)
    words = shlex.split(line.removeprefix(TOOL).replace("FILE", str(file)).replace("FOLDER", str(sessions)))
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path), "ROS_HOME": str(sessions.parent)}
    command = [sys.executable, str(PACKAGE / "scripts" / "console_session.py"), *words]
    ended = subprocess.run(
        command, capture_output=True, text=True, timeout=60, cwd=sessions.parent, env=environment, check=False
    )
    assert ended.returncode == 0, ended.stderr
    shown = (sessions.parent / "all.csv").read_text() if "--csv" in words else ended.stdout
    assert "P07" in shown and "take" in shown


def test_the_printed_reader_runs(sessions):
    (program,) = [text for language, text in BLOCKS if language == "python"]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path)}
    command = [sys.executable, "-c", program]
    ended = subprocess.run(
        command, capture_output=True, text=True, timeout=60, cwd=sessions.parent, env=environment, check=False
    )
    assert ended.stdout == "1 receive done ['succeeded']\n", ended.stderr


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed: apt install curl")
def test_the_printed_program_notes_and_stops(tmp_path):
    (program,) = [text for _, text in BLOCKS if "curl" in text]

    async def test():
        async with running(tmp_path) as console:
            script = re.sub(r"^link=.*$", f"link='{console.link()}'", program, flags=re.M)
            bash = await asyncio.create_subprocess_exec("bash", "-euc", script, stdout=asyncio.subprocess.PIPE)
            out, _ = await asyncio.wait_for(bash.communicate(), 30)
            assert out.count(b'"success": true') + out.count(b'"success":true') == 2, out
            assert console.robot.stops == ["program 1"] and console.robot.told == [("note", "by a program")]

    asyncio.run(test())


def test_every_column_and_every_type_of_line_is_described():
    for table, columns in COLUMNS.items():
        (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{table}`")]
        common = {"session", "participant", "trial", "attempt", "condition"}
        assert [name for name in columns if name not in common and f"`{name}`" not in row] == []


def test_the_limits_are_those_that_are_served():
    assert f"more than {server.MAX_MESSAGE // 1024} KiB" in PAGE and f"nothing for {server.SEND_LIMIT:.0f} s" in PAGE
    assert f"after {server.MAX_BAD_FRAMES} of them" in PAGE and server.MAX_SOCKETS == 4
