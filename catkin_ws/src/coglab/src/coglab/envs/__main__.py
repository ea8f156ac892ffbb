"""Commands of the environments: ``python3 -m coglab.envs leaderboard``."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns the exit code."""
    parser = argparse.ArgumentParser(prog="python3 -m coglab.envs", description="Environments for handovers.")
    commands = parser.add_subparsers(dest="command", required=True)
    board = commands.add_parser(
        "leaderboard",
        help="compare the shipped brain, a straight-line reach and random actions on the test people",
        description="Runs the missing episodes, keeps them in a folder, and prints the table. Stop it at any time: the "
        "next call continues.",
    )
    board.add_argument("--people", type=int, default=300, help="number of people of each split (default 300)")
    board.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: one per core)")
    board.add_argument("--out", type=Path, default=Path("out/leaderboard"), help="folder of the results")
    board.add_argument("--environment", choices=("receive", "give"), action="append", help="default: both")
    board.add_argument(
        "--split", choices=("validation", "test", "test_hard"), action="append", help="default: the tests"
    )
    board.add_argument("--policy", choices=("brain", "straight", "random"), action="append", help="default: all three")
    given = parser.parse_args(arguments)
    if given.people < 1 or given.workers < 1:
        parser.error(f"--people and --workers are at least 1, got {given.people} and {given.workers}")

    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # a worker has one core
        os.environ.setdefault(name, "1")
    from coglab.envs.leaderboard import POLICIES, leaderboard

    tasks, splits = given.environment or ("receive", "give"), given.split or ("test", "test_hard")
    text, failed = leaderboard(given.out, given.people, given.workers, tasks, splits, given.policy or POLICIES)
    print(text, end="")
    if failed:
        print(f"{failed} episodes have no result; the same command runs them again", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
