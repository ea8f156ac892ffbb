"""`./coglab trial VERB`: recorded handovers: list, show, plot, explain, report, video, replay"""

from __future__ import annotations

import argparse
import glob
from dataclasses import asdict
from pathlib import Path
from typing import Any

from coglab_tools.command import OK, CheckFailed, CommandError, CommandResult, UsageError, plural
from coglab_tools.trial.record import BAG, FILE, TrialRecord, find_trials, trials_folder

HELP = "recorded handovers: list, show, plot, explain, report, video, replay"
HIDDEN = ".part-"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `trial`."""
    parser = verbs.add_parser("list", help="the trials of a folder as a table")
    parser.add_argument("folder", type=Path, nargs="?", help="default: where ./coglab launch records")
    parser.set_defaults(run=list_trials)
    for name, run, words in (
        ("show", show, "outcome, marks, metrics and configuration of a trial"),
        ("explain", explain_trial, "the events, in at most ten lines with times"),
        ("plot", plot, "phases, paths, torques, fingers and forces as a picture"),
        ("report", report, "one HTML page with outcome, plots and figures"),
        ("video", video, "a moving picture, drawn from the recording without a screen"),
        ("replay", replay, "publishes the bag again, on its own ROS master"),
    ):
        parser = verbs.add_parser(name, help=words)
        given = parser.add_argument(
            "trial", nargs="?", default="", help='folder of a trial, or the start of its name; "" or "last": the newest'
        )
        given.completer = _names  # of argcomplete
        if name in ("plot", "report", "video"):
            parser.add_argument("-o", "--out", type=Path, help="file to write; default: in the folder of the trial")
        if name == "report":
            parser.add_argument("--pdf", action="store_true", help="also write a PDF beside the page")
        if name == "replay":
            parser.add_argument("--rate", type=float, default=1.0, help="playback speed, times real time")
            parser.add_argument("--rviz", action="store_true", help="open rviz")
        parser.set_defaults(run=run)


def _names(prefix: str, **_: Any) -> list[str]:
    """Names of recordings that begin like this, for the Tab key."""
    return ["last", *(each.parent.name for each in sorted(trials_folder().glob(f"{prefix}*/trial.yaml")))]


def _place(options: argparse.Namespace) -> Path:
    """Folder of the requested trial: a path, the start of a name in the default folder, or the newest."""
    given = options.trial
    if given in ("", "last"):
        found = find_trials(trials_folder()) if trials_folder().is_dir() else []
        if not found:
            raise UsageError(
                f"{trials_folder()} has no trial yet: name the folder of one, or ./coglab launch and start"
            )
        return max(found, key=lambda folder: folder.name)
    place = Path(given)
    if place.exists() or len(place.parts) != 1:
        return place
    found = sorted(trials_folder().glob(f"{glob.escape(given)}*/{FILE}"))
    if len(found) > 1 and (trials_folder() / given / FILE) not in found:
        names = ", ".join(file.parent.name for file in found[:5])
        raise UsageError(f"{len(found)} trials in {trials_folder()} begin with {given}: {names}; type more of the name")
    return found[0].parent if found else trials_folder() / given


def _measured(options: argparse.Namespace) -> tuple[Path, Any]:
    from coglab_tools.trial.read import read_trial

    place = _place(options)
    return place, read_trial(place)


def list_trials(options: argparse.Namespace) -> CommandResult:
    """A row per trial; those that cannot be read are named, with the reason."""
    folder = options.folder or trials_folder()
    rows: list[dict[str, Any]] = []
    bad: list[str] = []
    for place in find_trials(folder):
        try:
            record = TrialRecord.load(place)
        except CommandError as error:
            bad.append(str(error))
            continue
        row = {
            name: getattr(record, name) for name in ("id", "started", "action", "object", "participant", "condition")
        }
        outcome = "succeeded" if record.outcome.success else record.outcome.reason.replace("NONE", "no result")
        rows.append({**row, "outcome": outcome, "duration_s": round(record.duration_s, 2), "folder": str(place)})
    parts = sorted(str(each) for each in Path(folder).glob(f"{HIDDEN}*")) if Path(folder).is_dir() else []
    columns = ("id", "object", "participant", "condition", "outcome", "duration_s")
    table = [columns, *(tuple(str(row[c]) for c in columns) for row in rows)]
    widths = [max(len(line[k]) for line in table) for k in range(len(columns))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in table]
    good = sum(row["outcome"] == "succeeded" for row in rows)
    lines.append(f"{plural(len(rows), 'trial')} in {folder}, {good} succeeded")
    lines += [f"cannot be read: {sentence}" for sentence in bad]
    lines += [f"being recorded, or cut off: {part}; rosbag reindex {part}/{BAG} saves the rest" for part in parts]
    data = {"trials": rows, "unreadable": bad, "unfinished": parts}
    following = f"./coglab trial report {rows[-1]['folder']}" if rows else "./coglab launch, then ./coglab start"
    return CommandResult("\n".join(lines), data, following, OK)


def show(options: argparse.Namespace) -> CommandResult:
    """The record and the metrics of a trial."""
    import yaml

    from coglab_tools.report.metrics import METRICS, metrics_of
    from coglab_tools.trial.explain import events, headline

    place, trial = _measured(options)
    data = asdict(trial.record)
    values, lines = [], []
    for part in trial.parts():
        values.append(metrics_of(part))
        lines.append(headline(part))
        lines += [f"{t:+7.2f} s  {text}" for t, text, _ in events(part)]
        lines += [
            f"{metric.label:28} {'-' if values[-1][name] is None else f'{values[-1][name]:.3g} {metric.unit}'}"
            for name, metric in METRICS.items()
        ]
    rest = {k: v for k, v in data.items() if k not in ("marks", "outcome") and v not in ("", None, {})}
    lines.append(yaml.safe_dump(rest, sort_keys=False, allow_unicode=True, default_flow_style=None).rstrip())
    return CommandResult(
        "\n".join(lines),
        {**data, "metrics": values[0] if len(values) == 1 else values},
        f"./coglab trial report {place}",
    )


def explain_trial(options: argparse.Namespace) -> CommandResult:
    """The events, in at most ten lines."""
    from coglab_tools.trial.explain import explain

    place, trial = _measured(options)
    lines = explain(trial)
    return CommandResult("\n".join(lines), {"lines": lines}, f"./coglab trial plot {place}")


def plot(options: argparse.Namespace) -> CommandResult:
    """The picture of a trial, as PNG, PDF or SVG by the name of the file."""
    from coglab_tools.files import write_by
    from coglab_tools.report.page import figure_of_trial

    place, trial = _measured(options)
    file = options.out or place / "trial.png"
    if file.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise UsageError(f"{file} ends with {file.suffix or 'nothing'}: .png, .pdf or .svg is expected")
    figure = figure_of_trial(trial)
    write_by(file, lambda part: figure.savefig(part, dpi=160))
    return CommandResult(f"{file}", {"file": str(file)}, f"./coglab trial report {place}")


def report(options: argparse.Namespace) -> CommandResult:
    """The page of a trial."""
    from coglab_tools.report.page import write_pdf, write_report

    place, trial = _measured(options)
    file = write_report(trial, options.out or place / "report.html")
    data = {"file": str(file), "pdf": ""}
    text = f"{file}"
    if options.pdf:
        data["pdf"] = str(write_pdf(file, file.with_suffix(".pdf")))
        text += f"\n{data['pdf']}"
    return CommandResult(text, data, f"./coglab trial video {place}")


def video(options: argparse.Namespace) -> CommandResult:
    """The moving picture of a trial, as GIF or MP4 by the name of the file."""
    from coglab_tools.trial.video import KINDS, write_video

    place, trial = _measured(options)
    file: Path = options.out or place / "trial.gif"
    if file.suffix.lower() not in KINDS:
        raise UsageError(f"{file} ends with {file.suffix or 'nothing'}: {' or '.join(KINDS)} is expected")
    data = write_video(trial, file)
    text = f"{file}: {data['frames']} pictures, {data['seconds']:.0f} s, {file.stat().st_size / 1e6:.1f} MB"
    return CommandResult(text, {"file": str(file), **data}, f"./coglab trial report {place}")


def replay(options: argparse.Namespace) -> CommandResult:
    """Publish the bag of a trial again, until it ends or Ctrl-C."""
    from coglab_tools.trial.replay import replay as run

    place = _place(options)
    TrialRecord.load(place)
    if not (place / BAG).is_file():
        raise CheckFailed(f"{place} has no {BAG}: a trial of virtual time is not replayed; ./coglab trial plot {place}")
    seconds = run(place / BAG, options.rate, options.rviz)
    return CommandResult(
        f"{place / BAG}: replayed in {seconds:.0f} s", {"seconds": seconds}, f"./coglab trial explain {place}"
    )
