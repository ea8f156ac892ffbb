"""`./coglab dmp VERB`: teach motions: record, import, learn, inspect and check primitives"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from coglab_tools.command import CHECK_FAILED, OK, CheckFailed, CommandResult, NotThere, UsageError, plural, progress

HELP = "teach motions: record, import, learn, inspect and check primitives"
MAPPINGS = ("none", "similarity", "upright")
LARGEST = 10.0  # m, number of a goal on the command line
FAULTS = ("short", "brief", "jump", "moving", "noisy")


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `dmp`."""
    parser = verbs.add_parser("record", help="records a demonstration: the hand-guided arm, or a tracked hand")
    parser.add_argument("name", help="name of the demonstration")
    parser.add_argument("--frame", default="", help="tf frame of a tracked hand; default: the hand-guided arm")
    parser.add_argument("--out", type=Path, default=Path("demonstrations"), help="folder of the demonstrations")
    parser.add_argument(
        "--button", default="", metavar="TOPIC", help="Bool or Joy topic of a button, held while recording"
    )
    parser.add_argument("--wait", type=int, default=3, metavar="S", help="count-down (3)")
    parser.add_argument("--limit", type=float, default=30.0, metavar="S", help="longest demonstration (30)")
    parser.add_argument("--stay", action="store_true", help="leave the arm in place, instead of bringing it home")
    parser.add_argument("--master", default="", help="ROS master of the robot, address or port")
    parser.set_defaults(run=record)

    parser = verbs.add_parser("import", help="reads and checks recordings and cuts their reaches into demonstrations")
    _reading(parser)
    parser.add_argument("--out", type=Path, default=Path("demonstrations"), help="folder of the demonstrations")
    parser.set_defaults(run=import_files)

    parser = verbs.add_parser("train", help="learns a primitive from recordings or demonstrations")
    _reading(parser)
    parser.add_argument("--id", required=True, help="name of the primitive")
    parser.add_argument("-o", "--library", type=Path, default=Path("primitives.xml"), help="library to extend")
    parser.add_argument("--replace", action="store_true", help="replace a primitive of this name")
    parser.add_argument("--mapping", choices=MAPPINGS, default="similarity", help="mapping of the shape to other goals")
    parser.add_argument("--basis", type=int, default=20, metavar="N", help="number of basis functions, 2..64")
    parser.add_argument("--description", default="", help="for people")
    parser.add_argument("--allow", action="append", default=[], choices=FAULTS, help="a fault that is accepted")
    parser.add_argument("--plot", type=Path, help="the picture (default: beside the library)")
    parser.set_defaults(run=train)

    parser = verbs.add_parser("inspect", help="shows one primitive: figures and a picture")
    _of_library(parser)
    parser.add_argument("--id", required=True)
    parser.add_argument("--goal", type=_metres, nargs=3, metavar=("X", "Y", "Z"), help="goal of the courses, m, base")
    parser.add_argument(
        "--with", dest="demonstrations", type=Path, nargs="+", default=[], help="demonstrations to show"
    )
    parser.add_argument("--plot", type=Path, help="the picture (default: ID_inspected.png here)")
    parser.set_defaults(run=inspect)

    parser = verbs.add_parser("list", help="lists the primitives of a library")
    _of_library(parser)
    parser.set_defaults(run=list_primitives)

    parser = verbs.add_parser("validate", help="runs primitives on the model of the arm; exit code 1 if one fails")
    _of_library(parser)
    parser.add_argument("--id", help="name of the only primitive to check")
    parser.add_argument("--needed", type=float, default=0.5, metavar="SHARE", help="needed share of goals (0.5)")
    parser.set_defaults(run=validate)

    parser = verbs.add_parser("export", help="writes the path of a primitive as CSV, npz or JSON")
    _of_library(parser)
    parser.add_argument("--id", required=True)
    parser.add_argument(
        "--goal", type=_metres, nargs=3, metavar=("X", "Y", "Z"), help="goal, m from start (default: taught)"
    )
    parser.add_argument("--ratio", type=float, default=1.0, help="dmp_ratio")
    parser.add_argument("-o", "--out", type=Path, required=True, help="a .csv, .npz or .json file")
    parser.set_defaults(run=export)


def _reading(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", type=Path, nargs="+", help=".csv, .npz or .bag files")
    parser.add_argument("--frame", default="", help="tf frame, or the hand's name in the file (human_hand)")
    parser.add_argument("--world", default="world", help="parent frame of the transforms in a bag")
    parser.add_argument("--topic", default="", help="topic in a bag")
    parser.add_argument("--length", default="", help="unit m, cm, mm, in or ft (default: guessed)")
    parser.add_argument("--time", default="", help="unit s, ms, us or ns (default: guessed)")
    parser.add_argument("--angle", default="", help="unit rad or deg (default: guessed)")
    parser.add_argument("--back", action="store_true", help="use motions back as reaches too")


def _metres(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= LARGEST:
        raise argparse.ArgumentTypeError(f"expected a number of metres up to {LARGEST:g}, got '{text}'")
    return value


def _of_library(parser: argparse.ArgumentParser) -> None:
    from coglab_py.packages import package_path

    shipped = package_path("coglab_controllers", "config", "primitives.xml")
    parser.add_argument(
        "library", type=Path, nargs="?", default=shipped, help="library (.xml); default: the shipped one"
    )


# --- the verbs ---


def demonstrations(options: argparse.Namespace) -> list[Any]:
    """The reaches in all files, in order."""
    from coglab_tools.dmp.cut import reaches
    from coglab_tools.dmp.read import Source, read

    o = options
    source = Source(o.frame, o.topic, o.world, o.length, o.time, o.angle)
    found = []
    for path in progress(o.files, len(o.files), "reading"):
        recording = read(path, source)
        try:
            found += reaches(recording, o.back, "moving" in getattr(o, "allow", ()))
        except CheckFailed as error:
            raise CheckFailed(f"{path}: {str(error).removeprefix(f'{recording.name}: ')}") from None
    return found


def record(options: argparse.Namespace) -> CommandResult:
    """`dmp record`."""
    import re
    import signal
    import tempfile
    import threading

    from coglab_tools.files import write_whole

    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", options.name):
        raise UsageError(f"the name '{options.name}': expected 1 to 64 letters, digits, '_', '-' or '.'")
    if not 0 <= options.wait <= 60 or not 1.0 <= options.limit <= 600.0:
        raise UsageError("--wait: expected 0 to 60 s; --limit: expected 1 to 600 s")
    path = _free(options.out, options.name)
    try:
        import coglab
        from coglab.running import NoRobot
    except ImportError as error:
        raise NotThere(f"ROS is not there ({error}); start in ./coglab shell, after ./coglab build") from None
    from coglab_tools.dmp import record as recorder
    from coglab_tools.dmp.cut import reaches

    terminal = recorder.Terminal()
    write_whole(path, bytes(1_000_000))  # detect an unwritable folder or disk before the arm moves
    path.unlink()
    if threading.current_thread() is threading.main_thread():  # other threads cannot set handlers
        for number in (signal.SIGHUP, signal.SIGTERM):  # like Ctrl-C: hand guiding must end
            signal.signal(number, signal.default_int_handler)
    try:
        with coglab.connect(options.master or _running_master()) as robot:
            if not options.frame:
                recorder.check_free(robot)
            button = recorder.Button(options.button) if options.button else None
            if not options.frame:
                terminal.say("hand guiding: take the robot's hand. The arm yields after the countdown")
            if button is not None:
                terminal.say(f"hold the button {options.button} while you demonstrate")
                recorder.await_button(button, robot)
            else:
                terminal.count_down(options.wait, robot.pause)
                terminal.begin()
            with terminal.keys() as pressed:
                recorded = recorder.record(
                    robot,
                    path.stem,
                    options.frame,
                    limit=options.limit,
                    ends=lambda: pressed() or (button is not None and not button.held),
                    show=terminal.show,
                )
            try:
                state = "" if options.frame else recorder.settle(robot, terminal, options.stay)
            except KeyboardInterrupt:  # the demonstration is valid
                state = "ended by Ctrl-C before the arm was home; go on with: ./coglab start reset"
    except KeyboardInterrupt:
        raise KeyboardInterrupt("ended by Ctrl-C; nothing was recorded") from None
    except NoRobot as error:
        raise NotThere(str(error)) from None
    except (coglab.Refused, TimeoutError) as error:
        raise CheckFailed(str(error)) from None
    try:
        recorded.save(path)
    except CheckFailed as error:
        kept = recorded.save(Path(tempfile.mkdtemp(prefix="coglab-")) / path.name)
        raise CheckFailed(f"{error}. What was recorded is in {kept}") from None
    try:
        found = reaches(recorded)
    except CheckFailed as error:
        kept = path.rename(path.with_name(f"{path.name}.failed"))
        raise CheckFailed(f"{error}. What was recorded is in {kept}") from None
    lines = [f"wrote {path}: {recorded.duration:.1f} s, {len(recorded.times)} samples", *_table(found)]
    return CommandResult(
        "\n".join([*lines, *([state] if state else [])]),
        {"file": str(path), "demonstrations": [_facts(d, path) for d in found], "state": state},
        f"./coglab dmp train {options.out}/*.csv --id NAME, or the same command again for one more demonstration",
    )


def _running_master() -> str:
    """Address of the running system; empty: that of ROS_MASTER_URI."""
    import os

    from coglab_py.running_systems import NoSystem, find_master

    top = os.environ.get("COGLAB_TOP", "")
    if not top:
        return ""
    own = os.environ.get("COGLAB_USER_MASTER", "")
    try:
        return find_master(Path(top), 0, own)
    except NoSystem as error:
        if not own:
            raise NotThere(str(error)) from None
        return own


def _free(folder: Path, name: str) -> Path:
    """A path that does not exist yet: name.csv, name_2.csv, ..."""
    path, number = folder / f"{name}.csv", 1
    while path.exists() or path.with_name(f"{path.name}.failed").exists():
        number += 1
        path = folder / f"{name}_{number}.csv"
    return path


def import_files(options: argparse.Namespace) -> CommandResult:
    """`dmp import`."""
    found = demonstrations(options)
    names = Counter(d.name for d in found)
    double = [name for name, count in names.items() if count > 1]
    if double:
        raise UsageError(f"two files give demonstrations of the name {double[0]}; import them into two folders")
    paths: list[Path] = []
    replaced = sum((options.out / f"{d.name}.csv").exists() for d in found)
    for d in found:
        paths.append(options.out / f"{d.name}.csv")
        try:
            d.save(paths[-1])
        except CheckFailed as error:
            raise CheckFailed(f"{error}; {len(paths) - 1} of {len(found)} demonstrations were written") from None
    wrote = f"wrote {len(paths)} demonstrations to {options.out}"
    wrote += f"; {replaced} replaced earlier files" if replaced else ""
    text = [_of_files(options.files, found), *_table(found), wrote]
    return CommandResult(
        "\n".join(text),
        {"demonstrations": [_facts(d, path) for d, path in zip(found, paths, strict=True)]},
        f"./coglab dmp train {options.out}/*.csv --id NAME",
    )


def train(options: argparse.Namespace) -> CommandResult:
    """`dmp train`."""
    from coglab_tools.dmp import check, plot
    from coglab_tools.dmp.train import add_to_library, fingers_in_words
    from coglab_tools.dmp.train import train as learn

    found = demonstrations(options)
    taught = learn(options.id, found, options.basis, options.mapping, options.description, options.allow)
    count = add_to_library(taught, options.library, options.replace)
    primitive, middle = taught.primitive, check.run(taught.primitive, check.region_middle())
    path = options.plot or options.library.with_name(f"{options.id}.png")
    try:
        plot.draw(path, primitive, found, taught.rmse, taught.turn, taught.closing)
    except CheckFailed as error:
        raise CheckFailed(f"{error}. The primitive is in {options.library}: ./coglab dmp inspect draws it") from None
    errors = 1000.0 * taught.rmse
    lines = [
        _of_files(options.files, found),
        *_notes(found),
        f"learnt {options.id}: {options.basis} basis functions, {primitive.duration:.2f} s, RMSE median "
        f"{float(sorted(errors)[len(errors) // 2]):.2f} mm, worst {float(errors.max()):.2f} mm",
        f"on the arm, from home to the middle of the handover region: {middle.verdict}, joints at "
        f"{100 * middle.peak:.0f} % of their speed at most ({middle.fastest})",
    ]
    if taught.turn is not None:
        lines.append(
            f"turn: kept beside the library; the robot turns along its own curve, which differs by "
            f"{57.2958 * taught.turn_error:.1f} deg at most"
        )
    if taught.closing is not None:
        lines.append(f"fingers: {fingers_in_words(taught.closing, primitive.duration)}; kept beside the library")
    if taught.strange:
        lines.append(f"far from the others: {', '.join(taught.strange)}; check the picture, and leave out wrong ones")
    lines.append(f"wrote {options.library} ({plural(count, 'primitive')}) and {path}")
    data = {
        "id": options.id,
        "duration_s": primitive.duration,
        "rmse_mm": [float(e) for e in errors],
        "joint_speed_share": middle.peak,
        "verdict": middle.verdict,
        "strange": list(taught.strange),
        "library": str(options.library),
        "plot": str(path),
        "demonstrations": [_facts(d, None) for d in found],
    }
    return CommandResult("\n".join(lines), data, f"./coglab dmp validate {options.library} --id {options.id}")


def inspect(options: argparse.Namespace) -> CommandResult:
    """`dmp inspect`."""
    import numpy as np

    from coglab_tools.dmp import check, plot
    from coglab_tools.dmp.cut import reaches
    from coglab_tools.dmp.demonstration import for_shell
    from coglab_tools.dmp.read import read
    from coglab_tools.dmp.train import load_beside

    primitive = _primitive(options.library, options.id)
    entry = load_beside(options.library).get(options.id, {})
    found = [d for path in options.demonstrations for d in reaches(read(path))]
    goal = np.array(options.goal) if options.goal else check.region_middle()
    turn, closing = (np.array(entry[name]) if name in entry else None for name in ("turn_rad", "closing"))
    rmse = np.array(entry.get("rmse_mm", [])) / 1000.0
    path = options.plot or Path(f"{options.id}_inspected.png")
    plot.draw(path, primitive, found, rmse, turn, closing, goal)
    courses = [check.run(primitive, goal, ratio) for ratio in plot.RATIOS]
    lines = [
        f"{options.id}: {primitive.description or 'no description'}",
        f"{primitive.duration:.2f} s, {len(primitive.centres)} basis functions, mapping {primitive.mapping}, "
        f"{float(np.linalg.norm(np.asarray(primitive.goal) - primitive.start)):.3f} m",
        f"learnt from {', '.join(entry['from'])}" if entry.get("from") else "its source is not recorded",
        *(
            f"dmp_ratio {ratio:g} to {np.round(goal, 3).tolist()} m: {c.verdict}, joints at {100 * c.peak:.0f} % of "
            f"their speed ({c.fastest})"
            for ratio, c in zip(plot.RATIOS, courses, strict=True)
        ),
        *([entry["fingers"]] if "fingers" in entry else []),
        f"picture: {path}",
    ]
    data = {
        "id": options.id,
        "duration_s": primitive.duration,
        "mapping": primitive.mapping,
        "learnt": {name: entry[name] for name in ("from", "rmse_mm", "fingers") if name in entry},
        "courses": [
            {"ratio": r, "verdict": c.verdict, "joint_speed_share": c.peak, "error_mm": 1000 * c.error}
            for r, c in zip(plot.RATIOS, courses, strict=True)
        ],
        "plot": str(path),
    }
    return CommandResult("\n".join(lines), data, f"./coglab launch primitives:={for_shell(options.library)}")


def list_primitives(options: argparse.Namespace) -> CommandResult:
    """`dmp list`."""
    import numpy as np

    from coglab_tools.dmp.train import load_beside, load_library

    library, entries = load_library(options.library), load_beside(options.library)
    rows = []
    for name in library.ids():
        p = library[name]
        rows.append(
            {
                "id": name,
                "duration_s": p.duration,
                "way_m": float(np.linalg.norm(np.asarray(p.goal) - p.start)),
                "mapping": p.mapping,
                "basis": len(p.centres),
                "description": p.description,
                "learnt_from": entries.get(name, {}).get("from", []),
            }
        )
    lines = [f"{'primitive':22} {'s':>5} {'m':>6} {'mapping':11} N   description"]
    lines += [
        f"{r['id']:22} {r['duration_s']:5.2f} {r['way_m']:6.3f} {r['mapping']:11} {r['basis']:<3} {r['description']}"
        for r in rows
    ]
    first = rows[0]["id"] if rows else "NAME"
    return CommandResult("\n".join(lines), {"primitives": rows}, f"./coglab dmp inspect {options.library} --id {first}")


def validate(options: argparse.Namespace) -> CommandResult:
    """`dmp validate`."""
    from coglab_tools.dmp import check
    from coglab_tools.dmp.demonstration import for_shell
    from coglab_tools.dmp.train import load_library

    library = load_library(options.library)
    names = [_primitive(options.library, options.id).id] if options.id else library.ids()
    lines, rows, failed = [], [], []
    for name in progress(names, len(names), "validating"):
        courses = check.over_region(library[name])
        middle = check.run(library[name], check.region_middle())
        share = sum(c.reached for c in courses) / len(courses)
        slowed = sum(c.verdict == "slowed" for c in courses)
        why = Counter(c.stopped_by or "ends off the goal" for c in courses if not c.reached)
        good = share >= options.needed and middle.reached
        failed += [] if good else [name]
        missed = ", ".join(f"{count}: {what}" for what, count in why.most_common())
        lines.append(
            f"{'ok ' if good else 'bad'} {name}: {100 * share:.0f} % of {len(courses)} goals reached, {slowed} slowed "
            f"by a joint's speed{f'; missed: {missed}' if missed else ''}; middle of the region: {middle.verdict}, "
            f"joints at {100 * middle.peak:.0f} % ({middle.fastest})"
        )
        rows.append({"id": name, "ok": good, "share_reached": share, "slowed": slowed, "missed": dict(why),
                     "joint_speed_share": middle.peak, "verdict": middle.verdict})  # fmt: skip
    if failed:
        lines.append(
            f"{', '.join(failed)}: fewer than {100 * options.needed:.0f} % of the goals, or not the middle. A longer "
            "dmp_ratio helps a slowed arm; a joint at its stop needs another path or mapping"
        )
    return CommandResult(
        "\n".join(lines),
        {"primitives": rows},
        f"./coglab launch primitives:={for_shell(options.library)}",
        CHECK_FAILED if failed else OK,
    )


def export(options: argparse.Namespace) -> CommandResult:
    """`dmp export`."""
    import io
    import json

    import numpy as np

    from coglab_tools.dmp.demonstration import Demonstration
    from coglab_tools.dmp.train import course
    from coglab_tools.files import write_whole

    kind = options.out.suffix.lower()
    if kind not in (".csv", ".npz", ".json"):
        raise UsageError(f"--out: expected a .csv, .npz or .json file, got {options.out}")
    if not 0.05 <= options.ratio <= 100.0:
        raise UsageError(f"--ratio: expected 0.05 to 100, got {options.ratio:g}")
    p = _primitive(options.library, options.id)
    line = np.asarray(p.goal) - p.start if options.goal is None else np.array(options.goal)
    times = np.linspace(0.0, options.ratio * p.duration, int(200 * options.ratio * p.duration) + 1)
    path = course(p, np.zeros(3), line, options.ratio, times)
    if kind == ".csv":
        Demonstration(options.id, times, path).save(options.out)
    elif kind == ".npz":
        content = io.BytesIO()
        np.savez(content, t=times, position=path, centres=p.centres, widths=p.widths, weights=p.weights)
        write_whole(options.out, content.getvalue())
    else:
        values = {name: getattr(p, name) for name in ("id", "description", "duration", "alpha", "stiffness", "damping",
                                                      "mapping")}  # fmt: skip
        arrays = {name: np.asarray(getattr(p, name)).tolist() for name in ("start", "goal", "start_velocity", "centres",
                                                                           "widths", "weights")}  # fmt: skip
        whole = {**values, **arrays, "t": times.tolist(), "position": path.tolist()}
        write_whole(options.out, json.dumps(whole, indent=1) + "\n")
    return CommandResult(
        f"wrote {options.out}: {len(times)} samples, {times[-1]:.2f} s, from 0 to {np.round(line, 3).tolist()} m",
        {"file": str(options.out), "samples": len(times), "duration_s": float(times[-1])},
    )


# --- words ---


def _primitive(library: Path, name: str) -> Any:
    from coglab_tools.dmp.train import load_library

    primitives = load_library(library)
    if name not in primitives:
        raise CheckFailed(f"{library} has no primitive '{name}'; it has {', '.join(primitives.ids()) or 'none'}")
    return primitives[name]


def _of_files(files: Sequence[Path], found: Sequence[Any]) -> str:
    rates = [(len(d.times) - 1) / d.duration for d in found]
    durations = [d.duration for d in found]
    return (
        f"read {len(found)} demonstrations from {len(files)} files: {min(durations):.2f} to {max(durations):.2f} s, "
        f"{min(rates):.0f} to {max(rates):.0f} samples per second"
    )


def _notes(found: Sequence[Any]) -> list[str]:
    """The notes, each sentence once with its number of demonstrations."""
    counts = Counter(note for d in found for note in d.notes if not note.startswith("reach from"))
    return [f"  {note}{f' (in {count} of {len(found)})' if len(found) > 1 else ''}" for note, count in counts.items()]


def _table(found: Sequence[Any]) -> list[str]:
    rows = [f"{'demonstration':28} {'s':>5} {'m':>6} {'m/s':>5} {'noise mm':>8}  notes"]
    for d in found:
        rows.append(
            f"{d.name:28} {d.duration:5.2f} {d.way:6.3f} {float(d.speed.max()):5.2f} {1000 * d.noise:8.2f}  "
            f"{'; '.join(d.notes)}"
        )
    return rows


def _facts(d: Any, path: Path | None) -> dict[str, Any]:
    return {
        "name": d.name,
        "duration_s": d.duration,
        "way_m": d.way,
        "peak_speed_m_s": float(d.speed.max()),
        "noise_mm": 1000 * d.noise,
        "notes": list(d.notes),
        **({} if path is None else {"file": str(path)}),
    }
