"""Names of grasp modes and force levels, and the preshapes. Every package that names a grasp uses this table."""

from __future__ import annotations

import re
from pathlib import Path

from ih2_hand.errors import RefusedError
from ih2_hand.reasons import Reason
from ih2_hand.wire_choices import WIRE

LONGEST_QUOTE = 40  # characters of a text from outside that a message repeats


def quoted(text: str) -> str:
    """A text from outside, quoted for a message and shortened to LONGEST_QUOTE."""
    return repr(text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "...")


MODES = ("cylindrical", "lateral", "tridigit", "bidigit", "tridigit2", "bidigit2")
LEVELS = ("low", "medium", "high")  # force levels

CLOSING_MOTORS = {
    "cylindrical": (1, 2, 3, 4),
    "lateral": (1,),
    "tridigit": (1, 2, 3),
    "bidigit": (1, 2),
    "tridigit2": (1, 2, 3),
    "bidigit2": (1, 2),
}
"""Motors that close in each mode (EH1 guide 4.3, for the IH2's five motors)."""


def levels_of(mode: str, dialect: str) -> tuple[str, ...]:
    """Force levels of a mode in `dialect` (W22: the one-byte commands lack some)."""
    if dialect == "v17":
        return LEVELS
    return tuple(level for level in LEVELS if (mode, level) in WIRE.legacy_grasps)


def check_grasp(mode: str, level: str, dialect: str) -> None:
    """Raise RefusedError unless the dialect has this mode at this force level. The message lists those that exist."""
    if mode not in MODES:
        raise RefusedError(f"grasp mode must be one of {', '.join(MODES)}; got {quoted(mode)}", Reason.UNKNOWN_NAME)
    existing = levels_of(mode, dialect)
    if level not in existing:
        raise RefusedError(
            f"grasp mode {mode} has force level {', '.join(existing)} in the {dialect} dialect; got {quoted(level)}",
            Reason.NOT_SUPPORTED if level in LEVELS else Reason.UNKNOWN_NAME,
        )


def grasps_file() -> Path:
    """Path of grasps.yaml: in the source tree, otherwise in the share folder of the install space."""
    here = Path(__file__).resolve()
    candidates = [here.parents[2] / "config" / "grasps.yaml"]
    candidates += [parent / "share" / "ih2_hand" / "config" / "grasps.yaml" for parent in here.parents]
    for path in candidates:
        if path.is_file():
            return path
    raise FileNotFoundError(
        f"grasps.yaml not found beside {here} nor in a share/ih2_hand/config "
        "above it; install the package again or pass the file's path"
    )


def load_preshapes(path: str | Path | None = None) -> dict[str, tuple[int, ...]]:
    """Preshapes (five positions 0..254) by mode from a YAML file of lines `mode: [p0, p1, p2, p3, p4]`.

    Only this form is read, so that the driver needs no YAML library. Every mode must be present once.
    A ValueError names file, line and field of the first error.
    """
    file = Path(path) if path is not None else grasps_file()
    table: dict[str, tuple[int, ...]] = {}
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        where = f"{file}:{number}"
        match = re.fullmatch(r"(\w+)\s*:\s*\[([^\]]*)\]", text)
        if match is None:
            raise ValueError(f"{where}: expected `mode: [p0, p1, p2, p3, p4]`, got {text!r}")
        mode, values = match[1], [item.strip() for item in match[2].split(",")]
        if mode not in MODES:
            raise ValueError(f"{where}: mode {mode!r} is not one of {', '.join(MODES)}")
        if mode in table:
            raise ValueError(f"{where}: mode {mode} is given a second time")
        if len(values) != WIRE.motors or not all(re.fullmatch(r"\d+", item) for item in values):
            raise ValueError(f"{where}: {mode} needs {WIRE.motors} whole numbers, got {match[2]!r}")
        positions = tuple(int(item) for item in values)
        if max(positions) > WIRE.position_max:
            raise ValueError(f"{where}: {mode} has {max(positions)}, positions are 0..{WIRE.position_max}")
        table[mode] = positions
    missing = [mode for mode in MODES if mode not in table]
    if missing:
        raise ValueError(f"{file}: no preshape for {', '.join(missing)}")
    return table
