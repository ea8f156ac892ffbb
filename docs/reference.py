"""Generates part of the reference from message files, tables in the code, launch files and --help.

One function per table. docs/build.py writes them as pages of the site.
"""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

COMMANDS = ("demo", "test", "bench", "launch", "film")  # commands of ./coglab with a --help


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table in Markdown."""
    head = list(head)
    lines = [head, ["---"] * len(head), *([str(cell).replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def code(value: object) -> str:
    """`value` as Markdown code; empty for an empty value."""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"`{text}`" if text else ""


def _part(lines: list[str]) -> tuple[str, list[list[str]]]:
    """Description and fields (type, name, comment) of one part of a message file."""
    about: list[str] = []
    fields: list[list[str]] = []
    for line in lines:
        text, _, comment = (piece.strip() for piece in line.partition("#"))
        if text:
            kind, _, name = text.partition(" ")
            fields.append([code(kind), code(re.sub(r"\s*=\s*", "=", name.strip())), comment])
        elif comment and fields and line.startswith(" "):
            fields[-1][2] += " " + comment  # continues the previous line
        elif comment and fields:
            fields.append(["", "", comment])  # describes the fields below
        elif comment:
            about.append(comment)
    return " ".join(about), fields


def message_page(file: Path, parts: tuple[str, ...]) -> str:
    """Page with the fields of a message, a service or an action."""
    page = [f"## {file.stem}", ""]
    texts = re.split(r"^---.*$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for name, text in zip(parts, texts, strict=False):
        about, fields = _part(text.splitlines())
        page += [about, ""] if about else []
        page += [f"{name}:", ""] if name else []
        page += [table(("type", "field", "meaning"), fields)] if fields else ["(no fields)", ""]
    return "\n".join(page)


def messages(top: Path) -> str:
    """Pages of coglab_msgs."""
    folder = top / "catkin_ws" / "src" / "coglab_msgs"
    kinds = {"msg": ("",), "srv": ("Request", "Answer"), "action": ("Goal", "Result", "Feedback")}
    page = [
        "# Messages, services and actions",
        "",
        "All of `coglab_msgs`, from its files. `rosmsg show` prints the same.",
    ]
    for ending, parts in kinds.items():
        for file in sorted(folder.glob(f"{ending}/*.{ending}")):
            if file.stem != "ReasonCode":
                page += ["", message_page(file, parts)]
    return "\n".join(page)


def reason_codes(top: Path) -> str:
    """Table of coglab_msgs/ReasonCode."""
    text = (top / "catkin_ws/src/coglab_msgs/msg/ReasonCode.msg").read_text(encoding="utf-8")
    rows = re.findall(r"^uint16 (\w+)=(\d+)\s*#?\s*(.*)$", text, re.MULTILINE)
    about = "The numbers of `coglab_msgs/ReasonCode`: what a refusal or a failure means, for programs."
    return f"# Reason codes\n\n{about}\n\n" + table(
        ("number", "name", "meaning"), ((n, code(k), m) for k, n, m in rows)
    )


def cell_parameters(_top: Path) -> str:
    """Parameters of the simulated cell, from its table."""
    from coglab_sim import _cell

    def span(row: dict) -> str:
        return f"{row['low']:g} .. {row['high']:g}" if row["low"] != row["high"] else ""

    rows = (
        (code(r["name"]), code(r["default"]), span(r), r["unit"], r["source"], r["text"]) for r in _cell.parameters()
    )
    about = (
        "Private parameters of the node `/coglab_sim/cell`, and names for `coglab_sim._cell.Cell`. Source: `published` "
        "(named in the headers), `ours` (no public document settles it), `set-up` (yours)."
    )
    return f"# Parameters of the simulated cell\n\n{about}\n\n" + table(
        ("name", "default", "range", "unit", "source", "meaning"), rows
    )


def machine_parameters(_top: Path) -> str:
    """Parameters of the state machines, from their table."""
    from coglab_smach import parameters

    about = "In `coglab_smach/config/machines.yaml`, which is read again whenever it changes."
    return f"# Parameters of the state machines\n\n{about}\n\n{parameters.markdown()}"


def wire_choices(_top: Path) -> str:
    """The open points of the hand's protocol that public documents leave."""
    from ih2_hand.wire_choices import as_markdown

    about = "One row per choice of `ih2_hand/wire_choices.py`, which driver and emulator share."
    return f"# Wire choices of the hand\n\n{about}\n\n{as_markdown()}"


def console_commands(_top: Path) -> str:
    """Commands of the experimenter's page, for programs."""
    from coglab_console.desk import commands as console

    about = '`POST /api/command` takes `{"name": ..., "arguments": {...}}`; fields in brackets may be left out.'
    return f"# Commands of the console\n\n{about}\n\n" + "\n".join(console.table())


CONFIGURATION = (
    ("coglab_smach/config/machines.yaml", "state machines; read again when the file changes"),
    ("coglab_controllers/config/controllers.yaml", "controller manager, below `/controller_manager`"),
    ("lwr_fri_bridge/config/lwr.yaml", "arm's interface, below `/lwr`"),
    ("lwr_description/config/joint_limits.yaml", "the one table of joint limits"),
    ("ctrl_more/config/feedback.yaml", "list of feedback controllers"),
    ("coglab_perception/config/frames.yaml", "frame names"),
    ("coglab_perception/config/belief.yaml", "belief in an offer or a request"),
    ("coglab_sim/config/perception.yaml", "simulated tracker"),
    ("coglab_sim/config/virtual_human.yaml", "where the simulated person stands"),
    ("ih2_hand/config/grasps.yaml", "preshapes and grasps"),
)


def configuration(top: Path) -> str:
    """The configuration files as shipped, with their comments."""
    page = ["# Configuration files", "", "As shipped: each value is the default, the comment has unit and meaning."]
    for name, about in CONFIGURATION:
        file = top / "catkin_ws" / "src" / name
        page += [
            "",
            f"## {file.name}",
            "",
            f"`{name}`: {about}.",
            "",
            "```yaml",
            file.read_text(encoding="utf-8"),
            "```",
        ]
    return "\n".join(page)


def launch_arguments(top: Path) -> str:
    """Arguments of every launch file."""
    page = ["# Launch arguments", "", "`./coglab launch NAME:=VALUE` takes those of `coglab.launch`."]
    files = sorted((top / "catkin_ws" / "src").glob("*/launch/*.launch"), key=lambda f: (f.stem != "coglab", f.stem))
    for file in files:
        rows = [
            (code(arg.get("name")), code(arg.get("default", "(needed)")), arg.get("doc", ""))
            for arg in ET.parse(file).getroot().findall("arg")
            if arg.get("value") is None
        ]
        page += ["", f"## {file.name}", "", f"`roslaunch {file.parts[-3]} {file.name}`", ""]
        page += [table(("argument", "default", "meaning"), rows) if rows else "No arguments."]
    return "\n".join(page)


def commands(top: Path) -> str:
    """Help texts of ./coglab."""
    page = ["# Commands of ./coglab"]
    for words in (["help"], *([name, "--help"] for name in COMMANDS)):
        done = subprocess.run([top / "coglab", *words], capture_output=True, text=True, check=True)
        page += ["", f"## ./coglab {' '.join(words)}", "", "```text", done.stdout.rstrip(), "```"]
    return "\n".join(page)


PAGES = {
    "commands": commands,
    "launch_arguments": launch_arguments,
    "messages": messages,
    "reason_codes": reason_codes,
    "configuration": configuration,
    "cell_parameters": cell_parameters,
    "machine_parameters": machine_parameters,
    "wire_choices": wire_choices,
    "console_commands": console_commands,
}


def write(top: Path, folder: Path) -> None:
    """Write all pages."""
    folder.mkdir()
    for name, page in PAGES.items():
        (folder / f"{name}.md").write_text(page(top) + "\n", encoding="utf-8")
