"""One self-contained HTML page for one or several handovers: outcome, plot, figures with their definitions."""

from __future__ import annotations

import base64
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from coglab.series import Series

from coglab_tools.command import NotThere
from coglab_tools.report.metrics import DEFINITIONS, metrics_of
from coglab_tools.trial.explain import explain
from coglab_tools.trial.record import TrialRecord

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-top: 1px solid #d0d4d9; padding-top: 1rem }
pre { background: #eef0f2; padding: .8rem; overflow-x: auto; } img { max-width: 100%; }
table { border-collapse: collapse; } td, th { text-align: left; padding: .25rem .8rem .25rem 0; vertical-align: top; }
td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
.small { color: #55606b; font-size: .9rem; } details { margin: .5rem 0; }
</style></head><body>
<h1>{{ title }}</h1>
<p class="small">{{ about }}</p>
{% for part in parts %}
<h2>{{ part.record.action | replace("_", " ") }}{% if part.record.object %}, {{ part.record.object }}{% endif %}:
{{ "succeeded" if part.record.success else part.record.outcome }}</h2>
<pre>{{ part.lines | join("\n") }}</pre>
{% if part.picture %}<img alt="Phases, paths, speeds, torques, fingers and force over time"
 src="data:image/png;base64,{{ part.picture }}">{% endif %}
<table>{% for name, value in part.figures.items() %}
<tr><td>{{ name }}</td><td class="number">{{ "%.3g" | format(value) }}</td>
<td class="small">{{ definitions[name] }}</td></tr>
{% endfor %}</table>
<details><summary>Record</summary><table>
{% for name, value in part.facts.items() %}<tr><td>{{ name }}</td><td>{{ value }}</td></tr>{% endfor %}
</table></details>
{% endfor %}
</body></html>
"""
MARGIN = 0.5  # s before and after the action in the plot
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")


class Part(NamedTuple):
    """One handover of a page. Empty series: nothing is drawn."""

    record: TrialRecord
    series: Series


def write_page(path: Path, title: str, about: str, parts: Sequence[Part]) -> Path:
    """Write the page, completely or not at all, and return its path."""
    import jinja2

    environment = jinja2.Environment(autoescape=True)
    shown = []
    for record, series in parts:
        start, end = record.started_ros, record.started_ros + record.duration_s
        marks = {str(mark["name"]): float(mark["time_s"]) for mark in record.marks}
        facts = {
            "id": record.id,
            "started": record.started,
            "participant": record.participant,
            "condition": record.condition,
            "session": record.session,
            "study": record.study,
            "seed": record.seed,
            "simulated": record.simulated,
            "configuration": record.configuration_hash,
            "versions": ", ".join(f"{name} {value}" for name, value in record.versions.items()),
            "notes": record.notes,
        }
        shown.append(
            {
                "record": record,
                "lines": explain(record),
                "picture": _picture(series, start - MARGIN, end + MARGIN),
                "figures": metrics_of(series, start, end, marks),
                "facts": {name: value for name, value in facts.items() if value not in ("", None)},
            }
        )
    text = environment.from_string(PAGE).render(title=title, about=about, parts=shown, definitions=DEFINITIONS)
    part = path.with_name(f".{path.name}")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path


def _picture(series: Series, start: float, end: float) -> str:
    from coglab.plot import figure_of

    if not series.joints and not series.transitions:
        return ""
    stream = io.BytesIO()
    figure_of(series, "", start, end).savefig(stream, dpi=130)
    return base64.b64encode(stream.getvalue()).decode()


def to_pdf(page: Path) -> Path:
    """Write a page as PDF beside it, and return its path. NotThere: no browser is installed."""
    browser = next((found for name in CHROMIUM if (found := shutil.which(name))), None)
    if browser is None:
        raise NotThere("a PDF is printed by Chromium, which is not installed; ./coglab install browser gets it")
    target = page.with_suffix(".pdf")
    with tempfile.TemporaryDirectory() as profile:
        command = [browser, "--headless", "--disable-gpu", "--no-pdf-header-footer", f"--user-data-dir={profile}"]
        command += ["--disable-background-networking", "--no-first-run", f"--print-to-pdf={target}"]
        if os.geteuid() == 0:
            command.append("--no-sandbox")  # Chromium refuses its sandbox to root; the page is our own file
        done = subprocess.run([*command, page.absolute().as_uri()], capture_output=True, text=True, timeout=120)
    if done.returncode or not target.is_file():
        raise NotThere(f"Chromium printed no PDF: {(done.stderr.strip().splitlines() or ['no reason'])[-1]}")
    return target
