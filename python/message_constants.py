"""Writes a Python module with the constants of messages, for installations without ROS.

message_constants.py MODULE.py MESSAGE.msg ...
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

CONSTANT = re.compile(r"^u?int\d+\s+([A-Z][A-Z0-9_]*)\s*=\s*(-?\d+)")


def module(messages: list[Path]) -> str:
    """Returns the source of a module: one class per message, with its integer constants."""
    lines = ['"""Constants of coglab_msgs, without the messages: those need ROS."""']
    for message in messages:
        found = [match.groups() for line in message.read_text().splitlines() if (match := CONSTANT.match(line))]
        if not found:
            raise SystemExit(f"{message}: expected integer constants, found none")
        lines += ["", "", f"class {message.stem}:", f'    """The constants of {message.stem}.msg."""', ""]
        lines += [f"    {name} = {value}" for name, value in found]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(module([Path(name) for name in sys.argv[2:]]))
