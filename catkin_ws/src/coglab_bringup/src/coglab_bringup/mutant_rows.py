"""The rows of `./coglab bench mutants`: the share of changed lines that a test notices, and what stands beside it."""

from __future__ import annotations

from coglab_bringup import bench
from coglab_bringup.mutant import EQUIVALENT, Equivalent, Mutant, named_equivalent, sentence

GOAL_ALL, GOAL_EACH = 85.0, 75.0
FEWEST = 12
"""mutants of each package: fewer say too little, and the row is missed"""
MOST_EQUIVALENT = 20
"""of so many mutants over all, one may be named equivalent"""


def row(figure: str, value: float | None, unit: str, goal: str, ok: bool) -> dict:
    """As ./coglab bench prints it."""
    return dict(zip(bench.COLUMNS, ("mutants", figure, value, unit, goal, None, None, ok), strict=True))


def rows_of(
    drawn: dict[str, list[Mutant | None]],
    seeds: dict[str, int],
    named: list[Equivalent],
    red: list[str],
    own: bool = False,
) -> list[dict]:
    """The table of the bench: one row per package, one over all, the equivalent ones, and what was left out.

    `drawn`: by package, None for a change that did not compile; `seeds`: by package, what they were drawn with; `red`:
    test programs that tell nothing because the unchanged sources turn them red; `own`: nothing that stands on a package
    has judged. Where more are named equivalent than may be, none is subtracted.
    """
    judged = {package: [m for m in mutants if m is not None] for package, mutants in drawn.items()}
    everything = [m for mutants in judged.values() for m in mutants]
    equivalent, most = named_equivalent(everything, named), len(everything) // MOST_EQUIVALENT
    alone = ", by the package's own tests alone" if own else ""
    subtracted = [m for m, _ in equivalent] if len(equivalent) <= most else []

    one_seed = len(set(seeds.values())) == 1
    every = f"seed {min(seeds.values())}" if one_seed else "seeds of the packages' last commits"

    def share(what: str, mutants: list[Mutant], goal: float, enough: bool) -> dict:
        counted = [m for m in mutants if not any(m is other for other in subtracted)]
        killed = sum(m.verdict == "killed" for m in counted)
        value = 100.0 * killed / len(counted) if counted else None
        beside = f", {len(mutants) - len(counted)} equivalent left out" if len(mutants) > len(counted) else ""
        figure = f"changed lines that a test notices{alone}, {what}, of {len(mutants)}{beside}"
        ok = enough and value is not None and value >= goal
        return row(figure, value if value is None else round(value, 1), "%", f">= {goal:g}, of >= {FEWEST} each", ok)

    rows = [
        share(f"{name}, seed {seeds[name]}", mutants, GOAL_EACH, len(mutants) >= FEWEST)
        for name, mutants in judged.items()
    ]
    if len(judged) > 1:
        rows.append(share(f"all, {every}", everything, GOAL_ALL, all(len(m) >= FEWEST for m in judged.values())))
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
