"""The rows of `./coglab bench mutants`: the share of changed lines that a test notices, and what stands beside it."""

from __future__ import annotations

from coglab_bringup import bench
from coglab_bringup.mutant import ALONE, EQUIVALENT, Equivalent, Mutant, named_equivalent, sentence

GOAL_ALL, GOAL_EACH = 85.0, 75.0
FEWEST = 12
"""mutants of each package: fewer say too little, and the row is missed"""
MOST_EQUIVALENT = 20
"""of so many mutants over all, one may be named equivalent, and subtracted there: of a package's twelve that is none"""


def row(figure: str, value: float | None, unit: str, goal: str, ok: bool) -> dict:
    """As ./coglab bench prints it."""
    return dict(zip(bench.COLUMNS, ("mutants", figure, value, unit, goal, None, None, ok), strict=True))


def share(what: str, mutants: list[Mutant], subtracted: list[Mutant], goal: float, enough: bool) -> dict:
    """A row: how many of the mutants a test has noticed, those that are subtracted apart."""
    counted = [m for m in mutants if not any(m is other for other in subtracted)]
    killed = sum(m.verdict == "killed" for m in counted)
    value = round(100.0 * killed / len(counted), 1) if counted else None
    ok = enough and value is not None and 100.0 * killed / len(counted) >= goal
    return row(f"changed lines that a test notices{what}", value, "%", f">= {goal:g}, of >= {FEWEST} each", ok)


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
    has judged. What is named equivalent is subtracted from the row over all alone, and there only where it is not more
    than may be named: in the row of its package it counts as a survivor, and is told.
    """
    judged = {package: [m for m in mutants if m is not None] for package, mutants in drawn.items()}
    everything = [m for mutants in judged.values() for m in mutants]
    equivalent, most = named_equivalent(everything, named), len(everything) // MOST_EQUIVALENT
    alone = ALONE if own else ""

    rows = []
    for package, mutants in judged.items():
        told = [sentence(m) for m, _ in equivalent if any(m is other for other in mutants)]
        beside = f", {len(told)} named equivalent counted as survivors ({'; '.join(told)})" if told else ""
        what = f"{alone}, {package}, seed {seeds[package]}, of {len(mutants)}{beside}"
        rows.append(share(what, mutants, [], GOAL_EACH, len(mutants) >= FEWEST))
    if len(judged) > 1:
        one_seed = len(set(seeds.values())) == 1
        every = f"seed {min(seeds.values())}" if one_seed else "seeds of the packages' last commits"
        subtracted = [m for m, _ in equivalent] if len(equivalent) <= most else []
        beside = f", {len(subtracted)} equivalent left out" if subtracted else ""
        what = f"{alone}, all, {every}, of {len(everything)}{beside}"
        rows.append(share(what, everything, subtracted, GOAL_ALL, all(len(m) >= FEWEST for m in judged.values())))
    rows.append(equivalent_row(equivalent, most, len(everything)))
    uncompiled = sum(m is None for mutants in drawn.values() for m in mutants)
    figure = (
        f"left out: {uncompiled} changes that did not compile, drawn again, and {len(red)} test programs that are red "
        f"on the unchanged sources ({', '.join(sorted(red)) or 'none'})"
    )
    rows.append(row(figure, uncompiled + len(red), "left out", "reported", True))
    return rows


def equivalent_row(equivalent: list[tuple[Mutant, Equivalent]], most: int, every: int) -> dict:
    """Which survivors the list names, each with its reason; more than `most` of all are too many."""
    told = "; ".join(f"{sentence(m)}: {entry.reason}" for m, entry in equivalent) or "none"
    beyond = "" if len(equivalent) <= most else ", too many, so that none is left out"
    figure = f"survivors named equivalent in {EQUIVALENT} ({told}){beyond}"
    return row(figure, len(equivalent), f"of {every}", f"<= {most}", len(equivalent) <= most)
