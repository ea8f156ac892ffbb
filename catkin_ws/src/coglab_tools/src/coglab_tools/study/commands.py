"""`./coglab study VERB`: studies: plan, run, resume, report"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from coglab_tools.command import CheckFailed, CommandResult, UsageError, plural

HELP = "studies: plan, run, resume, report"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `study`."""
    init = verbs.add_parser("init", help="makes a folder with a commented study.yaml")
    init.add_argument("name", type=Path, metavar="NAME", help="the new folder; its last part is the study's name")
    init.set_defaults(run=_init)
    for verb, text in (
        ("run", "runs a study from its beginning"),
        ("resume", "runs the remaining trials of an interrupted study"),
    ):
        parser = verbs.add_parser(verb, help=text)
        _folder(parser)
        parser.add_argument(
            "--workers", type=_workers, default=0, metavar="N", help="processes on this computer; default: one per core"
        )
        parser.add_argument(
            "--scheduler", default="", metavar="ADDRESS", help="Dask scheduler, such as tcp://127.0.0.1:8786"
        )
        parser.add_argument("--live", action="store_true", help="with participants, at the running system")
        parser.add_argument("--participant", default="", metavar="P03", help="of a live session; default: the next one")
        parser.set_defaults(run=_run, fresh=verb == "run")
    status = verbs.add_parser("status", help="shows finished trials and the next step")
    _folder(status)
    status.set_defaults(run=_status)
    ask = verbs.add_parser("ask", help="fills in the questionnaires of a participant on the terminal")
    ask.add_argument("participant", metavar="P03")
    _folder(ask)
    ask.add_argument("--condition", default="", help="default: each condition that is not answered yet")
    ask.set_defaults(run=_ask)
    load = verbs.add_parser("import", help="reads answers to questionnaires from a CSV file")
    load.add_argument("file", type=Path, metavar="FILE")
    _folder(load)
    load.set_defaults(run=_import)
    report = verbs.add_parser("report", help="writes report.html and trials.csv")
    _folder(report)
    report.add_argument("--pdf", action="store_true", help="report.pdf too")
    report.set_defaults(run=_report)


def _folder(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path(), metavar="FOLDER", help="of the study; default: here"
    )


def _workers(text: str) -> int:
    from coglab_tools.study.cluster import MOST_WORKERS

    if not text.isdecimal() or not 1 <= int(text) <= MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"1 to {MOST_WORKERS} processes are expected, got {text}")
    return int(text)


def _init(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.plan import load, new

    file = new(options.name)
    study = load(file.parent)
    text = (
        f"wrote {file}: {plural(len(study.participants), 'participant')}, "
        f"{plural(len(study.conditions), 'condition')}, {plural(len(study.trials()), 'trial')}; edit it as you like"
    )
    return CommandResult(text, {"file": str(file), "trials": len(study.trials())}, f"./coglab study run {file.parent}")


def _run(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.plan import load
    from coglab_tools.study.rows import open_rows

    study = load(options.folder)
    total = len(study.trials())
    with open_rows(study) as rows:
        done, live = len(rows.trials), bool(rows.header) and not rows.simulated
    live = live or options.live
    if options.fresh and done and not live:
        if done == total:
            return CommandResult(
                f"{study.name}: {total} of {plural(total, 'trial')} done",
                {"trials": total},
                f"./coglab study report {study.folder}",
            )
        raise UsageError(
            f"{done} of {plural(total, 'trial')} done already: ./coglab study resume {study.folder} runs the others"
        )
    if not options.fresh and not done and not live:
        raise UsageError(f"nothing was interrupted, no trial is done: ./coglab study run {study.folder}")
    if live and (options.workers or options.scheduler):
        raise UsageError("--workers and --scheduler are for simulated studies, and this one is live")
    if not live and options.participant:
        raise UsageError("--participant is for live sessions: add --live")
    if options.workers and options.scheduler:
        raise UsageError("give --workers or --scheduler, not both: a scheduler has its own workers")
    try:
        if live:
            from coglab_tools.study.live import run_live

            data = run_live(study, options.participant)
        else:
            from coglab_tools.study.run import run_simulated

            data = run_simulated(study, options.workers, options.scheduler)
    except KeyboardInterrupt:
        with open_rows(study) as rows:
            done = len(rows.trials)
        verb = "resume" if done or live else "run"
        raise KeyboardInterrupt(
            f"ended by Ctrl-C; {done} of {plural(total, 'trial')} done and kept. To go on: ./coglab study {verb} "
            f"{study.folder}{' --live' if live else ''}"
        ) from None
    text = (
        f"{study.name}: {data['trials']} of {plural(total, 'trial')} done, {data['trials_now']} of them now; "
        f"{data['succeeded']} of {plural(data['handovers'], 'handover')} succeeded; {data['table']}"
    )
    if not live and (study.folder / "machines.yaml").exists():
        text += f"; {study.folder / 'machines.yaml'} is for live sessions, simulated trials have the shipped one"
    following = "report" if data["trials"] == total else "status"
    return CommandResult(text, data, f"./coglab study {following} {study.folder}")


def _status(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.plan import load
    from coglab_tools.study.questionnaires import open_items
    from coglab_tools.study.rows import open_rows

    study = load(options.folder)
    trials = study.trials()
    with open_rows(study) as rows:
        done, started, simulated = set(rows.trials), rows.header is not None, rows.simulated
        table = rows.table()
    kind = ("simulated" if simulated else "live") if started else "not started"
    missing = open_items(study, [trial.visit for trial in trials])
    lines = [f"{study.name}, {kind}: {len(done)} of {plural(len(trials), 'trial')} done"]
    people = []
    for name in study.participants:
        own = [trial for trial in trials if trial.participant == name]
        order = list(dict.fromkeys(trial.visit for trial in own))
        finished = sum(trial.number in done for trial in own)
        failed = sum(row["participant"] == name and not int(row["success"]) for row in table)
        asked = sum(not missing[visit] for visit in order) if study.questionnaires else 0
        people.append({"participant": name, "done": finished, "trials": len(own), "failed": failed, "answered": asked})
        questions = (
            f", all questionnaires of {asked} of {plural(len(order), 'condition')}" if study.questionnaires else ""
        )
        lines.append(
            f"  {name}  {finished:3d} of {plural(len(own), 'trial')}, {plural(failed, 'failed handover')}{questions}; "
            f"order {', '.join(condition for *_, condition in order)}"
        )
    if len(lines) > 42:
        lines[41:] = [f"  ... {len(study.participants) - 40} more; --json has all"]
    following = next((trial for trial in trials if trial.number not in done), None)
    asked_next = next((t.participant for t in trials if missing[t.visit]), "") if started and not simulated else ""
    if following is None and asked_next:
        then = f"./coglab study ask {asked_next} {study.folder}"
    elif following is None:
        then = f"./coglab study report {study.folder}"
    else:
        live = " --live" if started and not simulated else ""
        then = f"./coglab study {'resume' if done else 'run'} {study.folder}{live}"
    data = {"study": study.name, "kind": kind, "done": len(done), "trials": len(trials), "participants": people}
    return CommandResult("\n".join(lines), data, then)


def _ask(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.ask import ask
    from coglab_tools.study.plan import load

    study = load(options.folder)
    count = ask(study, study.participant(options.participant), options.condition)
    text = f"{plural(count, 'answer')} of {options.participant} written"
    return CommandResult(text, {"answers": count}, f"./coglab study status {study.folder}")


def _import(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.plan import load
    from coglab_tools.study.questionnaires import add_answers, read_answers

    study = load(options.folder)
    if not study.questionnaires:
        raise CheckFailed(
            f"{study.folder}/study.yaml names no questionnaires: add a line such as questionnaires: [nasa_tlx]"
        )
    rows = read_answers(options.file, study)
    new, replaced = add_answers(study, rows)
    text = f"{plural(new, 'new answer')}, {replaced} replaced, from {options.file}"
    return CommandResult(text, {"new": new, "replaced": replaced}, f"./coglab study report {study.folder}")


def _report(options: argparse.Namespace) -> CommandResult:
    from coglab_tools.study.plan import load
    from coglab_tools.study.report import write_report

    study = load(options.folder)
    data = write_report(study, options.pdf)
    text = "\n".join([data["verdict"], *data["problems"], *(f"wrote {file}" for file in data["files"])])
    return CommandResult(text, data, f"./coglab study status {study.folder}" if data["left"] else "")
