"""./coglab bench: runs the benches of all packages and prints every figure beside its goal and its peer.

A bench is an executable `bench/bench_<name>.py` in a package; it prints a JSON list of rows
{bench, figure, value, unit, goal, peer, peer_value, ok} and nothing else on standard output. Packages that have one of
the same name share the bench: each gives its rows.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

COLUMNS = ("bench", "figure", "value", "unit", "goal", "peer", "peer_value", "ok")
TIME_LIMIT = 1800.0  # s, per bench
LONG_TIME_LIMIT = 7200.0  # s, with --long


def find_benches(sources: Path) -> dict[str, list[Path]]:
    """The files of each bench by its name, from the packages below `sources`."""
    benches: dict[str, list[Path]] = {}
    for path in sorted(sources.rglob("bench/bench_*.py")):
        benches.setdefault(path.stem.removeprefix("bench_"), []).append(path)
    return benches


def failed_row(name: str, reason: str) -> dict:
    """The row of a bench that gave no figures."""
    return dict(zip(COLUMNS, (name, f"did not run: {reason}", None, "", "runs", None, None, False), strict=False))


def run_bench(name: str, path: Path, python: str, limit: float = TIME_LIMIT) -> list[dict]:
    """The rows of one bench, whatever its exit status; a bench that gives none gives one row that says how."""
    try:
        done = subprocess.run([python, str(path)], capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return [failed_row(name, f"no end within {limit:.0f} s")]
    try:
        rows = json.loads(done.stdout)
        return [{column: row[column] for column in COLUMNS} for row in rows]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        if done.returncode != 0:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            return [failed_row(name, f"exit status {done.returncode}: {last}")]
        return [failed_row(name, f"no list of rows on standard output ({error})")]


def as_text(value: object) -> str:
    """A cell of the table."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "ok" if value else "MISSED"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def print_table(rows: list[dict]) -> None:
    """Prints rows in aligned columns."""
    cells = [[as_text(row[column]) for column in COLUMNS] for row in rows]
    widths = [max(len(column), *(len(line[i]) for line in cells)) for i, column in enumerate(COLUMNS)]
    for line in [list(COLUMNS), *cells]:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=False)).rstrip(), flush=True)


def main(arguments: list[str]) -> int:
    """Exit status 0 if every row is ok, 1 if one is not, 2 for an unknown name."""
    parser = argparse.ArgumentParser(prog="coglab bench", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="default: all")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows as a JSON list")
    parser.add_argument("--long", action="store_true", help="the campaigns too (hours)")
    options = parser.parse_args(arguments)
    if options.long:
        os.environ["COGLAB_LONG"] = "1"
    limit = LONG_TIME_LIMIT if options.long else TIME_LIMIT
    benches = find_benches(Path(os.environ["COGLAB_TOP"]) / "catkin_ws" / "src")
    unknown = [name for name in options.names if name not in benches]
    if unknown:
        print(f"[coglab] error: no bench named {', '.join(unknown)}; there are: {', '.join(benches)}", file=sys.stderr)
        return 2
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    rows: list[dict] = []
    for name in options.names or benches:
        print(f"[coglab] bench {name} ...", file=sys.stderr, flush=True)
        for path in benches[name]:
            rows += run_bench(name, path, python, limit)
    print_table(rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if all(row["ok"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
