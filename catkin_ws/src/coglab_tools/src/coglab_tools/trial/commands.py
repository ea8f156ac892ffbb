"""`./coglab trial VERB`: recorded handovers: list, show, plot, replay, explain, report."""

from __future__ import annotations

import argparse
import os
import subprocess
from dataclasses import asdict
from pathlib import Path
from typing import Any

from coglab_tools.command import Answer, CheckFailed, NotThere
from coglab_tools.trial.record import BAG, TrialRecord, default_folder, find_trial, trials_in

HELP = "recorded handovers: list, show, explain, plot, report, replay"
TRIAL = "a folder, the beginning of a name that `trial list` shows, or last"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `trial`."""
    parser = verbs.add_parser("list", help="the recorded trials of a folder")
    parser.add_argument("folder", nargs="?", type=Path, help=f"default: {default_folder()}")
    parser.set_defaults(run=list_trials)
    for name, run, words in (
        ("show", show, "everything that trial.yaml says"),
        ("explain", explain_trial, "what happened, in ten lines with times"),
        ("plot", plot, "phases, paths, speeds, torques, fingers and force over time, as PNG and PDF"),
        ("report", report, "one HTML page with outcome, plot and figures"),
        ("replay", replay, "publishes the bag again, on the ROS master of this shell"),
    ):
        parser = verbs.add_parser(name, help=words, description=words)
        parser.add_argument("trial", help=TRIAL)
        parser.set_defaults(run=run)
        if name in ("plot", "report"):
            parser.add_argument("--out", type=Path, help="file (default: in the trial's folder)")
        if name == "report":
            parser.add_argument("--pdf", action="store_true", help="a PDF beside it, printed by Chromium")
        if name == "replay":
            parser.add_argument("--rate", type=float, default=1.0, help="times real time (default 1)")


def list_trials(options: argparse.Namespace) -> Answer:
    """`trial list`: a table of a folder. What is no record is named, and the others are shown."""
    folder: Path = options.folder or default_folder()
    if not folder.is_dir():
        raise CheckFailed(f"{folder} is not there: no handover was recorded yet; ./coglab launch records each one")
    records, problems = [], []
    for place in trials_in(folder):
        try:
            records.append(TrialRecord.load(place))
        except CheckFailed as error:
            problems.append(str(error))
    rows = []
    for one in records:
        ended = "success" if one.success else one.reason.lower()
        rows.append(f"{one.id:52} {ended:20} {one.duration_s:6.1f} s  {one.condition} {one.participant}".rstrip())
    text = "\n".join([*rows, *problems, f"{len(records)} trials in {folder}"])
    following = f"./coglab trial explain {records[-1].id}" if records else "./coglab launch, then ./coglab start"
    return Answer(text, {"trials": [asdict(r) for r in records], "problems": problems}, following)


def show(options: argparse.Namespace) -> Answer:
    """`trial show`"""
    import yaml

    folder = find_trial(options.trial)
    data = asdict(TrialRecord.load(folder))
    return Answer(f"{folder}\n{yaml.safe_dump(data, sort_keys=False)}", data, f"./coglab trial report {folder.name}")


def explain_trial(options: argparse.Namespace) -> Answer:
    """`trial explain`"""
    from coglab_tools.trial.explain import explain

    folder = find_trial(options.trial)
    lines = explain(TrialRecord.load(folder))
    return Answer("\n".join(lines), {"lines": lines}, f"./coglab trial report {folder.name}")


def plot(options: argparse.Namespace) -> Answer:
    """`trial plot`"""
    from coglab.plot import draw_trial

    from coglab_tools.trial.bag import series_of

    folder = find_trial(options.trial)
    record, series = TrialRecord.load(folder), series_of(folder / BAG)
    out: Path = options.out or folder / "trial.png"
    title = f"{record.action.replace('_', ' ')} {record.object}: {record.outcome}"
    draw_trial(series, title, record.started_ros - 0.5, record.started_ros + record.duration_s + 0.5, out)
    return Answer(f"wrote {out}", {"file": str(out)}, f"./coglab trial report {folder.name}")


def report(options: argparse.Namespace) -> Answer:
    """`trial report`"""
    from coglab_tools.report.page import Part, to_pdf, write_page
    from coglab_tools.trial.bag import series_of

    folder = find_trial(options.trial)
    record = TrialRecord.load(folder)
    out: Path = options.out or folder / "report.html"
    title = f"{record.action.replace('_', ' ').capitalize()} {record.object}".strip()
    write_page(
        out,
        title,
        f"{record.started}, {'simulated' if record.simulated else 'real'}",
        [Part(record, series_of(folder / BAG))],
    )
    files = [out, to_pdf(out)] if options.pdf else [out]
    return Answer("wrote " + " and ".join(map(str, files)), {"files": list(map(str, files))}, f"xdg-open {out}")


def replay(options: argparse.Namespace) -> Answer:
    """`trial replay`: plays the bag with its time as /clock. Ends with the bag or with Ctrl-C."""
    import rosgraph

    folder = find_trial(options.trial)
    if not 0.0 < options.rate <= 100.0:
        raise CheckFailed(f"--rate: expected a number from 0 to 100, got {options.rate:g}")
    if not rosgraph.is_master_online():
        raise NotThere(
            f"no ROS master answers at {os.environ.get('ROS_MASTER_URI', 'its address')}; in another shell: "
            "./coglab shell roscore, then: rosparam set use_sim_time true, and rviz beside it"
        )
    bag = folder / BAG
    code = subprocess.call(["rosbag", "play", "--clock", "--rate", f"{options.rate:g}", str(bag)])
    if code:
        raise CheckFailed(f"{bag} was not played to its end (status {code})")
    return Answer(f"played {bag}", {"file": str(bag)}, f"./coglab trial explain {folder.name}")
