"""`./coglab people VERB`: makes recordings of people playable, and learns from them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from coglab_tools.command import CheckFailed, CommandResult, NotThere, UsageError, progress

HELP = "recordings of people: made playable, and learnt from"
KINDS = ("kth", "dexycb")


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `people`."""
    parser = verbs.add_parser("import", help="makes recordings of handovers playable by recording:=")
    _recordings(parser)
    parser.add_argument("--out", type=Path, default=Path("people"), help="folder of the files")
    parser.add_argument("--role", choices=("giver", "taker"), default="giver", help="whose hand is the person's")
    parser.add_argument("--object", default="", metavar="ID", help="also write the object, as frame object_ID")
    parser.add_argument("--turn", type=float, default=0.0, metavar="DEG", help="additional rotation about the vertical")
    parser.set_defaults(run=import_recordings)

    parser = verbs.add_parser("learn", help="learns the robot's primitives and the reaching patterns from handovers")
    _recordings(parser)
    parser.add_argument("--primitives", type=Path, help="library to write, with the shipped ones of other names")
    parser.add_argument("--patterns", type=Path, help="pattern file to write")
    parser.add_argument("--basis", type=int, default=20, metavar="N", help="number of basis functions, 2..64")
    parser.set_defaults(run=learn)


def _recordings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recordings", type=Path, nargs="+", help="KTH: a folder; DexYCB, HandoverSim: an npz file")
    parser.add_argument("--format", choices=KINDS, help="default: judged")
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of DexYCB (30; the cache: 1000)")


def handovers(paths: Sequence[Path], kind: str | None, rate: float | None) -> list[Any]:
    """Read recordings of either kind."""
    from coglab_tools.people.dexycb import read_dexycb
    from coglab_tools.people.kth import is_kth, read_kth

    if rate is not None and not 1.0 <= rate <= 10_000.0:
        raise UsageError(f"--rate: expected 1 to 10000 Hz, got {rate:g}")
    found = []
    for path in progress(paths, len(paths), "reading"):
        if not path.is_dir() and path.suffix != ".npz":
            what = "expected a folder of the KTH dataset or of DexYCB, or an npz file"
            raise (UsageError if path.exists() else NotThere)(f"{path}: {what}")
        kth = kind == "kth" or (kind is None and (is_kth(path) or not (path / "pose.npz").exists() and path.is_dir()))
        found.append(read_kth(path) if kth else read_dexycb(path, rate))
    return found


def import_recordings(options: argparse.Namespace) -> CommandResult:
    """`people import`."""
    import re

    from coglab_tools.dmp.demonstration import for_shell
    from coglab_tools.people.handover import write_recording

    if options.object and not re.fullmatch(r"[a-z0-9_]{1,64}", options.object):
        raise UsageError(f"--object: expected the id of an object such as mug, got '{options.object}'")
    lines, rows, paths = [], [], []
    frame = f"object_{options.object}" if options.object else ""
    for h in handovers(options.recordings, options.format, options.rate):
        path = options.out / f"{h.name}_{options.role}.csv"
        if path in paths:
            raise UsageError(f"two recordings would become {path}; import them into two folders with --out")
        reach, tracks = h.reach(options.role), h.recording(options.role, frame, options.turn)
        replaced = "; an earlier file was there and was replaced" if path.exists() else ""
        write_recording(path, tracks)
        paths.append(path)
        lines.append(
            f"{path}: {tracks['human_hand'].duration:.1f} s; the reach takes {reach.duration:.2f} s over "
            f"{reach.way:.3f} m, at {float(reach.speed.max()):.2f} m/s at most; {'; '.join(h.notes)}{replaced}"
        )
        rows.append({"file": str(path), "frames": list(tracks), "reach_s": reach.duration, "reach_m": reach.way,
                     "peak_speed_m_s": float(reach.speed.max()), "touch_s": h.touch, "source": h.source,
                     "notes": list(h.notes)})  # fmt: skip
    held = "" if options.object else " recorded_object:=in_hand"
    return CommandResult(
        "\n".join(lines), {"recordings": rows}, f"./coglab launch recording:={for_shell(paths[0])}{held}"
    )


def learn(options: argparse.Namespace) -> CommandResult:
    """`people learn`."""
    from coglab_tools.dmp.demonstration import for_shell
    from coglab_tools.files import write_whole
    from coglab_tools.people.learn import PRIMITIVES, base_library, learn_patterns, learn_primitives, learnable

    if options.primitives is None and options.patterns is None:
        raise UsageError("nothing to write: name --primitives FILE.xml or --patterns FILE.json, or both")
    found = handovers(options.recordings, options.format, options.rate)
    lines = [f"read {len(found)} handovers"]
    data: dict[str, Any] = {"handovers": [h.name for h in found]}
    follow = []
    if options.primitives is not None:
        try:
            library = learn_primitives(found, base_library(), options.basis)
        except ValueError as error:
            raise CheckFailed(str(error)) from None
        write_whole(options.primitives, library.format())
        names = learnable(found)
        lines += [f"  {name}: {library[name].description}" for name in names]
        if left := [name for name in PRIMITIVES if name not in names]:
            lines.append(f"  {', '.join(left)}: not learnt: there is no recording of this role; the shipped ones stay")
        lines.append(f"wrote {options.primitives}: {', '.join(library.ids())}")
        data["primitives"] = {name: library[name].duration for name in names}
        follow.append(f"primitives:={for_shell(options.primitives)}")
    if options.patterns is not None:
        counts = learn_patterns(found, options.patterns)
        lines.append(f"wrote {options.patterns}: {', '.join(f'{name} ({n})' for name, n in counts.items())}")
        data["patterns"] = counts
        follow.append(f"patterns:={for_shell(options.patterns)}")
    return CommandResult("\n".join(lines), data, f"./coglab launch {' '.join(follow)}")
