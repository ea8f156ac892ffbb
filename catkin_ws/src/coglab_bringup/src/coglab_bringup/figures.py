"""docs/figures.md: what ./coglab bench has measured of these sources, each figure with its definition, goal and peer.

A run of a bench leaves its rows in .coglab/figures/NAME.json, with machine, date and commit. `./coglab bench --report`
writes the page from those files, and keeps them in docs/figures.json for whoever has not measured. A bench without rows
of its sources as they are now was not measured: it is shown as missed, whatever older rows say. The lines of README.md
between the two marks are taken from that page: what `is_quoted` says of the benches QUOTED, and below them in one line
what is missed besides.

What the sources of a bench are sources.py says. Below the rows of `mutants` the page lists the survivors of
docs/mutants.json, which the report keeps, too.
"""

from __future__ import annotations

import ast
import json
import os
import platform
import re
import shlex
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from coglab_bringup import mutants_kept
from coglab_bringup.arguments import find_benches
from coglab_bringup.mutant import ALONE
from coglab_bringup.sources import MUTANTS, sources_of

NOT_MEASURED = "not measured on these sources"
ALL_ROWS = "all of its rows"
MET, MISSED, UNJUDGED, SAMPLE = "met", "**missed**", "-", "sample"
NO_GOAL = (None, "", "told", "reported")
"""what stands for the goal of a row that is shown and not judged"""
GOAL = re.compile(r"[<>]=? ?(?:-?[\d.]|peer)|-?[\d.]")
"""how a goal begins that a value can meet: a comparison with a number or the peer, or a number"""
BEGIN, END = "<!-- quoted from docs/figures.md -->", "<!-- end of the quotation -->"
KEPT = "docs/figures.json"
QUOTED = ("wall", "fri", "trials")
"""the benches of which README.md shows rows; of the others it says how many are missed"""
TRIALS = "COGLAB_TRIALS"
SETTINGS = (TRIALS, "COGLAB_BENCH_QUADS", "CONSOLE_BENCH_PARTS")
"""what a bench reads from the environment, beside what --long sets: which rows there are, of how many, and from which
file of trials"""
HEAD = """# Figures

Written by `./coglab bench --report`, from what `./coglab bench NAME ...` has measured on these sources; edit nothing
here. A row that misses its goal stays and says so; one without a goal has met none and says "-"; one of fewer trials
than were asked for has met none either and says "sample". A bench that was not run on its sources as they are (its
package and those that it uses, tests and documents apart) counts as missed.
Definitions, goals and peers are fixed before anything is measured: they stand in the bench itself.
"""
TABLE = "| figure | value | goal | | peer | its value |\n| --- | --- | --- | --- | --- | --- |"


def machine() -> str:
    """Processor, cores and kernel."""
    models = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    model = models[0].partition(":")[2].strip() if models else platform.machine()
    return f"{os.cpu_count()} cores of {model}, Linux {platform.release()}"


def settings_here() -> dict[str, str]:
    """Those of SETTINGS that are made, as they are told: a file lies elsewhere for whoever types the command."""
    made = {name: os.environ[name] for name in SETTINGS if os.environ.get(name)}
    return made | {name: "FILE" for name in made if name == TRIALS}


def record(top: Path, name: str, rows: list[dict], long: bool, before: dict[str, str]) -> bool:
    """Keeps the rows of one bench as just measured; the load tells how far the machine was alone.

    `before`: what sources_of() said before the run. False, and nothing is kept, where the sources are others now:
    nobody could say which of them were measured.
    """
    if sources_of(top, name)["sources"] != before["sources"]:
        return False
    folder = top / ".coglab" / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    run = {
        "rows": rows,
        "machine": machine(),
        "load": round(os.getloadavg()[1], 1),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "long": long,
        "settings": {} if name == MUTANTS else settings_here(),
    }
    new = folder / f"{name}.new"
    new.write_text(json.dumps(run | before, indent=1) + "\n")
    new.replace(folder / f"{name}.json")
    return True


def kept(top: Path) -> dict[str, Any]:
    """The runs that the last report kept, by bench."""
    try:
        runs = json.loads((top / KEPT).read_text())
        return runs if isinstance(runs, dict) else {}
    except (OSError, ValueError):
        return {}


def measured(top: Path, name: str) -> dict | None:
    """The last run of a bench, here or as kept by the last report, if it was one of its sources as they are now."""
    now = sources_of(top, name)["sources"]
    try:
        here = json.loads((top / ".coglab" / "figures" / f"{name}.json").read_text())
    except (OSError, ValueError):
        here = None
    for run in (here, kept(top).get(name)):
        if isinstance(run, dict) and now and run.get("sources") == now and isinstance(run.get("rows"), list):
            return run
    return None


def definition(paths: list[Path]) -> str:
    """What a bench measures, over how many and what is left out: the text at the head of its files."""
    texts = [ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "" for path in paths]
    return "\n\n".join(texts)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value in (None, "") else str(value).replace("|", "\\|").replace("\n", " ")


def sampled(row: dict) -> str:
    """Words for a row with fewer trials than asked for, by its fields `done` and `asked`; empty for any other."""
    done, asked = row.get("done"), row.get("asked")
    return f" [sample of {done} of {asked} asked]" if asked is not None and (done or 0) < asked else ""


def verdict(row: dict) -> str:
    """Whether a row has met its goal; what has none cannot meet it, but what its bench says is wrong is missed, and
    so is a goal that says no limit. A sample can miss a goal and not meet it."""
    if not row["ok"]:
        return MISSED
    if row["goal"] in NO_GOAL:
        return UNJUDGED
    if row["value"] is None or not GOAL.match(str(row["goal"])):
        return MISSED
    return SAMPLE if sampled(row) else MET


def line_of(bench: str, row: dict) -> str:
    """One row of a table; a value that is missing is a missed one, where there is a goal."""
    judged = verdict(row)
    absent = "-" if judged == UNJUDGED else NOT_MEASURED
    value = absent if row["value"] is None else f"{_cell(row['value'])} {row['unit'] or ''}".strip()
    figure, peer, peer_value = _cell(row["figure"] + sampled(row)), _cell(row["peer"]), _cell(row["peer_value"])
    return f"| {bench}: {figure} | {value} | {_cell(row['goal'])} | {judged} | {peer} | {peer_value} |"


def command_of(name: str, run: dict[str, Any]) -> str:
    """What prints the rows of a run, whoever types it."""
    settings = [f"{key}={shlex.quote(value)}" for key, value in run.get("settings", {}).items()]
    own = name == MUTANTS and any(ALONE in row["figure"] for row in run["rows"])
    return " ".join([*settings, "./coglab bench", *["--long"] * run["long"], name, *["--own"] * own])


def printed_by(name: str, run: dict[str, Any]) -> str:
    """The line above the table of a run."""
    return (
        f"Printed by `{command_of(name, run)}`, on {run['date']}, commit {run['commit']}, "
        f"on {run['machine']}, five-minute load {run['load']}."
    )


def lines_of(top: Path, name: str) -> list[str]:
    """The rows of a bench; a single one where it was not measured."""
    run = measured(top, name)
    if run is None:
        return [f"| {name}: {ALL_ROWS} | {NOT_MEASURED} | as in the bench | {MISSED} | - | - |"]
    return [line_of(name, row) for row in run["rows"]]


def page(top: Path) -> str:
    """The whole text of docs/figures.md."""
    parts = [HEAD]
    benches = find_benches(top / "catkin_ws" / "src")
    benches[MUTANTS] = [Path(__file__).with_name("mutants.py")]
    for name, paths in sorted(benches.items()):
        run = measured(top, name)
        parts.append(f"## {name}\n\n{definition(paths)}\n")
        if run is not None:
            parts.append(printed_by(name, run) + "\n")
        parts.append("\n".join([TABLE, *lines_of(top, name)]) + "\n")
        if name == MUTANTS and (survivors := mutants_kept.survivors(top)):
            parts.append(survivors + "\n")
    return "\n".join(parts)


def cells_of(line: str) -> list[str]:
    """The six cells of a row of this page; none for any other line."""
    cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    return cells if len(cells) == 6 and cells[3] in (MET, MISSED, UNJUDGED, SAMPLE) else []


def is_quoted(line: str) -> bool:
    """README.md shows of the benches QUOTED each row that is missed, and the latency over FRI wherever it is judged."""
    cells = cells_of(line)
    if not cells or cells[0].partition(": ")[0] not in QUOTED:
        return False
    return cells[3] == MISSED or (cells[0].startswith("fri: answer latency") and cells[2] not in ("-", *NO_GOAL))


def missed_besides(text: str) -> str:
    """One sentence that counts the missed rows of the page that README.md does not show; empty if there are none."""
    not_measured: list[str] = []
    missed: Counter[str] = Counter()
    for line in text.splitlines():
        cells = cells_of(line)
        if cells and cells[3] == MISSED and not is_quoted(line):
            bench = cells[0].partition(": ")[0]
            if cells[0] == f"{bench}: {ALL_ROWS}":
                not_measured.append(bench)
            else:
                missed[bench] += 1
    counts = [f"`{bench}` {count}" for bench, count in sorted(missed.items())]
    parts = ["rows of " + ", ".join(counts)] if counts else []
    parts += [f"{NOT_MEASURED}: " + ", ".join(f"`{bench}`" for bench in not_measured)] if not_measured else []
    return f"**Missed besides:** {'; '.join(parts)}. Every row: [docs/figures.md](docs/figures.md)." if parts else ""


def quotation(text: str) -> str:
    """What README.md says of a page of figures, between its two marks."""
    table = "\n".join([TABLE, *(line for line in text.splitlines() if is_quoted(line))])
    return "\n\n".join(part for part in (table, missed_besides(text)) if part)


def with_quotation(readme: str, quoted: str) -> str:
    """A page whose part between the marks is `quoted`; without the marks as it was."""
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    return f"{before}{begin}\n{quoted}\n{end}{after}" if begin and end else readme


def write_report(top: Path) -> Path:
    """Writes docs/figures.md and what README.md quotes of it, and keeps what both are made of."""
    mutants_kept.keep(top, machine())
    target, readme = top / "docs" / "figures.md", top / "README.md"
    text = page(top)
    target.write_text(text, encoding="utf-8")
    runs = {name: run for name in [*find_benches(top / "catkin_ws" / "src"), MUTANTS] if (run := measured(top, name))}
    (top / KEPT).write_text(json.dumps(runs, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    readme.write_text(with_quotation(readme.read_text(encoding="utf-8"), quotation(text)), encoding="utf-8")
    return target
