"""Generates part of the reference from message files, tables in the code, launch files and --help.

One function per table. docs/build.py writes them as pages of the site.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

COMMANDS = (  # commands of ./coglab whose --help says more than ./coglab help
    "demo", "test", "bench", "launch", "start", "status", "hold", "stop", "film", "controller new",
    "controller new --python", "controller run", "object new", "object check", "object list", "hand trace",
)  # fmt: skip


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


def contact_parameters(top: Path) -> str:
    """Parameters of the contact detector, from the fields of its settings and their docstrings."""
    text = (top / "catkin_ws/src/coglab_contact/src/coglab_contact/detector.py").read_text(encoding="utf-8")
    rows = re.findall(r'^    (\w+): .+? = (.+)\n    """(.+)"""$', text, re.MULTILINE)
    about = "Private parameters of the node `/contact_detector`, besides the files and topics on the page *Reference*."
    return f"# Parameters of the contact detector\n\n{about}\n\n" + table(
        ("name", "default", "meaning"), ((code(name), code(default), meaning) for name, default, meaning in rows)
    )


def belief_parameters(_top: Path) -> str:
    """Parameters of the belief, from the fields of its settings and their docstrings."""
    from coglab_perception.belief import BeliefSettings
    from coglab_perception.carried import CarriedSettings
    from coglab_perception.reach_bank import ReachSettings

    rows = [
        (code(above + name), code(getattr(settings, name)), meaning)
        for above, settings in (("", BeliefSettings()), ("reach/", ReachSettings()), ("carried/", CarriedSettings()))
        for name, meaning in _fields(type(settings)).items()
        if name not in ("reach", "carried") or above
    ]
    about = "Private parameters of the node `/motion_recogniser`, below `belief`. Lengths in m, times in s."
    return f"# Parameters of the belief\n\n{about}\n\n" + table(("name", "default", "meaning"), rows)


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


def _spread(values: list) -> str:
    """Median of `values` with the range of 90 % of them; the share of true ones."""
    if isinstance(values[0], tuple):
        return "; ".join(_spread(list(axis)) for axis in zip(*values, strict=True))
    if isinstance(values[0], bool):
        return f"{100 * sum(values) / len(values):.0f} % true"
    ordered = sorted(values)
    low, middle, high = (ordered[round(share * (len(ordered) - 1))] for share in (0.05, 0.5, 0.95))
    return f"{middle:.2g}" if low == high else f"{middle:.2g} ({low:.2g} .. {high:.2g})"


def _fields(kind: type) -> dict[str, str]:
    """The fields of a dataclass with their docstrings; empty where there is none."""
    body = ast.parse(inspect.getsource(kind)).body[0].body
    return {
        field.target.id: " ".join(text.value.value.split()) if isinstance(text, ast.Expr) else ""
        for field, text in zip(body, [*body[1:], None], strict=True)
        if isinstance(field, ast.AnnAssign)
    }


def person_parameters(_top: Path) -> str:
    """Parameters of the simulated person: meanings from the class, values from 1000 drawn people."""
    from coglab_sim.person.participant import Participant

    people = [Participant.draw(seed) for seed in range(1000)]
    meanings = _fields(Participant)
    rows = [
        (code(name), _spread([getattr(person, name) for person in people]), meanings.get(name, ""))
        for name in vars(people[0])
        if name not in ("seed", "behaviour")
    ]
    about = (
        "Fields of a person in `coglab_sim/person/participant.py`. Value: median of 1000 people of the profile "
        "`drawn`, and the range of 90 % of them. Times in s, lengths in m, forces in N, angles in deg."
    )
    return f"# Parameters of the simulated person\n\n{about}\n\n" + table(("name", "value", "meaning"), rows)


PYTHON_CLASSES = (  # heading, modules; after a colon: only these names of the module
    ("The robot, running or in virtual time", "coglab.robot", "coglab.world: World", "coglab.running: connect"),
    ("Results, trials and studies", "coglab.results", "coglab.trial", "coglab.fluency", "coglab.study"),
    ("Own motions and feedback controllers", "coglab.control"),
    ("Environments", "coglab.envs.handover", "coglab.envs.people"),
    ("The virtual world", "coglab_trials.world: World, Robot, Hand", "coglab_trials.conditions"),
    ("Virtual trials", "coglab_trials.trial: VirtualTrial, TrialResult"),
    ("Virtual time", "coglab_trials.virtual_clock: VirtualClock, using"),
    ("Motion", "coglab_controllers"),
    ("Hand", "ih2_hand.driver"),
    ("Feedback controllers on any robot", "ctrl_more"),
    ("State machines", "coglab_smach.states.base", "coglab_smach.ports.interfaces"),
    ("Perception, objects", "coglab_perception.belief", "coglab_objects.database"),
    ("The simulated cell", "coglab_sim._cell", "coglab_sim._virtual", "coglab_sim.person.participant"),
)


def python_classes(_top: Path) -> str:
    """Python classes and functions, from their docstrings. Sphinx reads the modules."""
    page = ["# Python", "", "What can be imported in a shell of the workspace (`./coglab shell`), from the docstrings."]
    for heading, *modules in PYTHON_CLASSES:
        page += ["", f"## {heading}", "", "```{eval-rst}"]
        for entry in modules:
            module, _, names = entry.partition(": ")
            page += [f".. automodule:: {module}", f"   :members: {names}".rstrip()]
            page += [] if "." in module else ["   :imported-members:"]  # a package imports its names from its modules
        page += ["```"]
    return "\n".join(page)


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
    ("coglab_objects/config/object_schema.json", "fields of an object file"),
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


def _nodes(element: ET.Element, when: tuple[str, ...] = ()) -> Iterable[tuple[str, str, str]]:
    """Name, program and condition of each node of a launch file, without those of included files."""
    for child in element:
        conditions = (*when, *(f"{key} {child.get(key)}" for key in ("if", "unless") if child.get(key)))
        if child.tag == "node":
            yield code(child.get("name")), code(f"{child.get('pkg')} {child.get('type')}"), code(", ".join(conditions))
        elif child.tag == "group":
            yield from _nodes(child, conditions)


def launch_files(top: Path) -> str:
    """Arguments and nodes of every launch file."""
    about = "`./coglab launch NAME:=VALUE` takes the arguments of `coglab.launch`, which includes other files."
    page = ["# Launch files", "", about]
    files = sorted((top / "catkin_ws" / "src").glob("*/launch/*.launch"), key=lambda f: (f.stem != "coglab", f.stem))
    for file in files:
        root = ET.parse(file).getroot()
        rows = [
            (code(arg.get("name")), code(arg.get("default", "(needed)")), arg.get("doc", ""))
            for arg in root.findall("arg")
            if arg.get("value") is None
        ]
        nodes = list(_nodes(root))
        page += ["", f"## {file.name}", "", f"`roslaunch {file.parts[-3]} {file.name}`", ""]
        page += [table(("argument", "default", "meaning"), rows) if rows else "No arguments."]
        page += ["", table(("node", "package and program", "condition"), nodes)] if nodes else []
    return "\n".join(page)


def packages(top: Path) -> str:
    """The packages, with the description of each package.xml."""
    roots = [ET.parse(file).getroot() for file in (top / "catkin_ws" / "src").glob("**/package.xml")]
    rows = sorted((root.findtext("name", ""), " ".join(root.findtext("description", "").split())) for root in roots)
    return "# Packages\n\n" + table(("package", "what it is"), ((code(name), about) for name, about in rows))


def commands(top: Path) -> str:
    """Help texts of ./coglab."""
    from coglab_tools.__main__ import NOUNS, make_parser

    texts = {}
    for words in ("help", *(f"{name} --help" for name in COMMANDS)):
        done = subprocess.run([top / "coglab", *words.split()], capture_output=True, text=True, check=True)
        texts[words] = done.stdout
    nouns = _verbs(make_parser())
    for noun in NOUNS:
        for verb, parser in _verbs(nouns[noun]).items():
            texts[f"{noun} {verb} --help"] = parser.format_help()
    page = ["# Commands of ./coglab"]
    for name, text in texts.items():
        page += ["", f"## ./coglab {name}", "", "```text", text.rstrip(), "```"]
    return "\n".join(page)


def _verbs(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parsers below `parser`, by name."""
    return next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))


PAGES = {
    "packages": packages,
    "commands": commands,
    "launch_files": launch_files,
    "messages": messages,
    "reason_codes": reason_codes,
    "configuration": configuration,
    "cell_parameters": cell_parameters,
    "machine_parameters": machine_parameters,
    "contact_parameters": contact_parameters,
    "belief_parameters": belief_parameters,
    "wire_choices": wire_choices,
    "person_parameters": person_parameters,
    "console_commands": console_commands,
    "python_classes": python_classes,
}


def write(top: Path, folder: Path) -> None:
    """Write all pages."""
    folder.mkdir()
    for name, page in PAGES.items():
        (folder / f"{name}.md").write_text(page(top) + "\n", encoding="utf-8")
