"""One self-contained page for a trial: outcome, events, figures with their definitions, plots, configuration."""

from __future__ import annotations

import base64
import io
import os
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coglab_tools.command import CheckFailed, NotThere
from coglab_tools.files import write_by, write_whole
from coglab_tools.report.metrics import METRICS, activities, metrics_of
from coglab_tools.trial.explain import explain, headline
from coglab_tools.trial.read import Measured

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 1500  # of a series in a plot
PDF_LIMIT = 60.0  # s for chromium
BLUE, ORANGE, DARK = "#0072B2", "#E69F00", "#1B1F24"


def figure_of_trial(trial: Measured) -> Figure:
    """Phases, paths, speeds, torques, fingers and force of a trial on one time axis."""
    from coglab.plot import figure_of

    start, end = trial.start, max(trial.end, trial.start + 0.1)

    def thin(rows: list[Any]) -> list[Any]:
        inside = [row for row in rows if start <= row[0] <= end]
        return inside[:: 1 + len(inside) // MOST_ROWS]

    series = trial.series
    series = replace(series, truth=thin(series.truth), external_torques=thin(series.external_torques))
    return figure_of(series, trial.record.id.replace("_", " "), start, end)


def figure_of_activity(trial: Measured) -> Figure:
    """Intervals in which person and robot are active, with the marks of the trial."""
    from matplotlib.figure import Figure

    person, robot = activities(trial)
    figure = Figure(figsize=(7.2, 1.9))
    figure.subplots_adjust(0.09, 0.24, 0.97, 0.72)
    axis = figure.subplots()
    for lane, (intervals, colour, hatch) in enumerate(((person, ORANGE, "//"), (robot, BLUE, ""))):
        bars = [(start - trial.start, end - start) for start, end in intervals]
        axis.broken_barh(bars, (lane - 0.35, 0.7), facecolors=colour, edgecolor=DARK, hatch=hatch, linewidth=0.5)
    last = -1.0
    for mark in sorted(trial.record.marks, key=lambda each: each["time_s"]):
        axis.axvline(mark["time_s"], color=DARK, lw=0.6, ls=":")
        if mark["time_s"] - last > 0.028 * (trial.end - trial.start):  # s, so that names do not overlap
            name = mark["name"].replace("_", " ")
            axis.text(mark["time_s"], -0.6, name, rotation=40, fontsize=6, ha="left", va="bottom")
            last = mark["time_s"]
    axis.set_yticks([0, 1], ["person", "robot"])
    axis.set_ylim(1.6, -0.6)
    axis.set_xlim(0.0, max(trial.end - trial.start, 0.1))
    axis.set_xlabel("time, s", fontsize=8)
    axis.tick_params(labelsize=7)
    return figure


def _png(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=130, pil_kwargs={"compress_level": 1})
    return base64.b64encode(stream.getvalue()).decode("ascii")


def page_of(trial: Measured) -> str:
    """The page of a trial as HTML, with everything inside."""
    from coglab_py.packages import package_path
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    record = trial.record
    parts = trial.parts()
    titles = [f"{k}. {part.record.action}".replace("_", " ") for k, part in enumerate(parts, 1)]
    names = Environment(
        loader=FileSystemLoader(str(package_path("coglab_tools", "templates"))),
        autoescape=True, undefined=StrictUndefined, trim_blocks=True,
    )  # fmt: skip
    facts: list[tuple[str, Any]] = [
        ("id", record.id),
        ("started (UTC)", record.started or "virtual time"),
        ("robot", "simulated" if record.simulated else "real"),
        ("seed", record.seed),
        *((name, getattr(record, name)) for name in ("condition", "participant", "session", "study", "notes")),
        *record.versions.items(),
        ("configuration hash", record.configuration.get("hash", "")),
    ]
    return names.get_template("trial.html").render(
        record=record,
        verdicts=[(part.record.outcome.success, headline(part)) for part in parts],
        metrics=METRICS,
        columns=[(name, metrics_of(part)) for name, part in zip(titles, parts, strict=True)],
        sources=trial.sources or {"hands": "unknown", "force": "unknown"},
        parts=[
            {
                "name": name,
                "lines": explain(part)[1:],
                "activity": _png(figure_of_activity(part)),
                "plot": _png(figure_of_trial(part)),
            }
            for name, part in zip(titles, parts, strict=True)
        ],
        facts=[(name, value) for name, value in facts if value not in ("", None)],
        configuration=[(name, value) for name, value in record.configuration.items() if name != "hash"],
    )


def write_report(trial: Measured, file: Path) -> Path:
    """Write the page of a trial, completely or not at all. Returns its path. CheckFailed: it cannot be written."""
    text = page_of(trial)
    return write_whole(file, text)


def write_pdf(page: Path, file: Path) -> Path:
    """Print a page into a PDF with chromium. NotThere: chromium is not installed. CheckFailed: it failed, and how."""
    browser: str | None = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise NotThere(f"--pdf needs chromium: sudo apt install chromium; or print {page} from any browser")

    def write(part: Path) -> None:
        command: list[str] = [
            str(browser),
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--print-to-pdf={part}",
        ]
        if os.geteuid() == 0:
            command.append("--no-sandbox")  # chromium refuses to run as root with it
        with tempfile.TemporaryDirectory(prefix="coglab-pdf-") as profile:
            command += [f"--user-data-dir={profile}", page.absolute().as_uri()]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=PDF_LIMIT)
            except subprocess.TimeoutExpired:
                raise CheckFailed(f"{browser} did not print {page} within {PDF_LIMIT:g} s") from None
        if not part.is_file():
            last = (done.stderr.strip().splitlines() or ["it printed no message"])[-1]
            raise CheckFailed(f"{browser} did not print {page}: {last}; print it from a browser")

    return write_by(file, write)
