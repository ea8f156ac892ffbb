"""What docs/console.md prints is run: a program with a key."""

import asyncio
import re
import shutil
from pathlib import Path

import pytest
from console_double import running

PACKAGE = Path(__file__).resolve().parents[1]
PAGE = (PACKAGE.parents[2] / "docs" / "console.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", PAGE, re.S)


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed: apt install curl")
def test_the_printed_program_notes_and_stops(tmp_path):
    (program,) = [text for _, text in BLOCKS if "curl" in text]

    async def test():
        async with running(tmp_path) as console:
            script = re.sub(r"^link=.*$", f"link='{console.link()}'", program, flags=re.M)
            bash = await asyncio.create_subprocess_exec("bash", "-euc", script, stdout=asyncio.subprocess.PIPE)
            out, _ = await asyncio.wait_for(bash.communicate(), 120)
            assert out.count(b'"success": true') + out.count(b'"success":true') == 2, out
            assert console.robot.stops == ["program 1"] and console.robot.published == [("note", "by a program")]

    asyncio.run(test())
