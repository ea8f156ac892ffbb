"""The rows of `./coglab bench mutants`: the share of changed lines that a test notices, and what stands beside it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from coglab_bringup import bench
from coglab_bringup.figures import EQUIVALENT
from coglab_bringup.usage import Refused

GOAL_ALL, GOAL_EACH = 85.0, 75.0
FEWEST = 12
"""mutants of each package: fewer say too little, and the row is missed"""
MOST_EQUIVALENT = 20
"""of so many mutants over all, one may be named equivalent"""


@dataclass
class Mutant:
    """One changed line and what became of it."""

    package: str
    file: str
    line: int
    kind: str
    before: str
    after: str
    text: str  # the line as it ships, without the blanks at its ends
    changed: str  # the same, as changed
    verdict: str  # killed, survived
    by: str  # the test program that was red first
    seconds: float


@dataclass(frozen=True)
class Equivalent:
    """A change with which the program does the same, so that no test can notice it, and the reason why it does."""

    file: str
    line: str  # the whole text of the line
    change: str  # the whole text of the line as changed
    reason: str

    def is_of(self, mutant: Mutant) -> bool:
        """Whether it speaks of this mutant; one that a test has noticed is none."""
        here = (mutant.file, mutant.text, mutant.changed) == (self.file, self.line, self.change)
        return here and mutant.verdict == "survived"


def read_equivalent(top: Path) -> list[Equivalent]:
    """The kept list; Refused, with what is wrong, if it cannot be read or has an entry without a reason."""
    path = top / EQUIVALENT
    try:
        named = [Equivalent(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError) as error:
        raise Refused(f"{path}: expected a list of {{file, line, change, reason}}: {error}") from error
    for entry in named:
        if not all(isinstance(text, str) and text.strip() for text in vars(entry).values()):
            raise Refused(f"{path}: {entry.file}: expected four texts, and a reason that says something")
    return named


def named_equivalent(mutants: list[Mutant], named: list[Equivalent]) -> list[tuple[Mutant, Equivalent]]:
    """The mutants that the list names; each entry names one."""
    found: list[tuple[Mutant, Equivalent]] = []
    for entry in named:
        taken = [mutant for mutant, _ in found]
        found += [(m, entry) for m in mutants if entry.is_of(m) and not any(m is other for other in taken)][:1]
    return found


def sentence(mutant: Mutant) -> str:
    """File, line and change."""
    after = mutant.after or "nothing"
    return f"{mutant.file}:{mutant.line}: {mutant.kind}: '{mutant.before}' -> '{after}'"


def row(figure: str, value: float | None, unit: str, goal: str, ok: bool) -> dict:
    """As ./coglab bench prints it."""
    return dict(zip(bench.COLUMNS, ("mutants", figure, value, unit, goal, None, None, ok), strict=True))


def rows_of(
    drawn: dict[str, list[Mutant | None]], seed: int, named: list[Equivalent], red: list[str], own: bool = False
) -> list[dict]:
    """The table of the bench: one row per package, one over all, the equivalent ones, and what was left out.

    `drawn`: by package, None for a change that did not compile; `red`: test programs that tell nothing because the
    unchanged sources turn them red; `own`: nothing that stands on a package has judged. Where more are named equivalent
    than may be, none is subtracted.
    """
    judged = {package: [m for m in mutants if m is not None] for package, mutants in drawn.items()}
    everything = [m for mutants in judged.values() for m in mutants]
    equivalent, most = named_equivalent(everything, named), len(everything) // MOST_EQUIVALENT
    alone = ", by the package's own tests alone" if own else ""
    subtracted = [m for m, _ in equivalent] if len(equivalent) <= most else []

    def share(what: str, mutants: list[Mutant], goal: float, enough: bool) -> dict:
        counted = [m for m in mutants if not any(m is other for other in subtracted)]
        killed = sum(m.verdict == "killed" for m in counted)
        value = 100.0 * killed / len(counted) if counted else None
        beside = f", {len(mutants) - len(counted)} equivalent left out" if len(mutants) > len(counted) else ""
        figure = f"changed lines that a test notices{alone}, {what}, seed {seed}, of {len(mutants)}{beside}"
        ok = enough and value is not None and value >= goal
        return row(figure, value if value is None else round(value, 1), "%", f">= {goal:g}, of >= {FEWEST} each", ok)

    rows = [share(name, mutants, GOAL_EACH, len(mutants) >= FEWEST) for name, mutants in judged.items()]
    if len(judged) > 1:
        rows.append(share("all", everything, GOAL_ALL, all(len(m) >= FEWEST for m in judged.values())))
    told = "; ".join(f"{sentence(m)}: {entry.reason}" for m, entry in equivalent) or "none"
    beyond = "" if len(equivalent) <= most else ", too many, so that none is left out"
    rows.append(
        row(
            f"survivors named equivalent in {EQUIVALENT} ({told}){beyond}",
            len(equivalent),
            f"of {len(everything)}",
            f"<= {most}",
            len(equivalent) <= most,
        )
    )
    uncompiled = sum(m is None for mutants in drawn.values() for m in mutants)
    figure = (
        f"left out: {uncompiled} changes that did not compile, drawn again, and {len(red)} test programs that are red "
        f"on the unchanged sources ({', '.join(sorted(red)) or 'none'})"
    )
    rows.append(row(figure, uncompiled + len(red), "left out", "reported", True))
    return rows
