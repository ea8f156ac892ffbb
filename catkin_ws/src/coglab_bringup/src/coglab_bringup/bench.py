"""./coglab bench: runs the benches of all packages and prints every figure beside its goal and its peer.

A bench is an executable `bench/bench_<name>.py` in a package; it prints a JSON list of rows
{bench, figure, value, unit, goal, peer, peer_value, ok} and nothing else on standard output, and ends with status 0,
also where a figure misses its goal. A row that may be of fewer trials than were asked for has `done` and `asked`, too:
while they differ it is a sample, which can miss a goal and not meet it. Another status is a failure of its own,
whatever rows were printed. Packages that have one of the same name share the bench: each gives its rows. The rows are
kept; `--report` writes docs/figures.md from what was kept, and runs nothing but the benches named (figures.py).
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from coglab_bringup import figures, process_tree
from coglab_bringup.arguments import bench_options, find_benches
from coglab_bringup.sources import sources_of
from coglab_bringup.usage import Refused

COLUMNS = ("bench", "figure", "value", "unit", "goal", "peer", "peer_value", "ok")
COUNTS = ("done", "asked")
"""of a row that may be a sample: trials that it is of, and trials that were asked for"""
TIME_LIMIT = 1800.0  # s, per bench
LONG_TIME_LIMIT = 7200.0  # s, with --long


def failed_row(name: str, reason: str) -> dict:
    """The row of a bench that gave no figures."""
    return dict(zip(COLUMNS, (name, f"did not run: {reason}", None, "", "runs", None, None, False), strict=False))


def run_bench(name: str, path: Path, python: str, limit: float = TIME_LIMIT) -> list[dict]:
    """The rows of one bench, and one more that says how it failed; nothing that it started outlives it."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        status = process_tree.run([python, str(path)], limit, stdout=output, stderr=errors)
        output.seek(0)
        errors.seek(0)
        text, last = output.read(), (errors.read().strip().splitlines() or ["no message"])[-1]
    if status is None:
        return [failed_row(name, f"no end within {limit:.0f} s")]
    failed = [failed_row(name, f"exit status {status}: {last}")] if status != 0 else []
    try:
        rows = [
            {column: row[column] for column in COLUMNS} | {count: row[count] for count in COUNTS if count in row}
            for row in json.loads(text)
        ] + failed
        return rows or [failed_row(name, "no row on standard output")]
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        return failed or [failed_row(name, f"no list of rows on standard output ({error})")]


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
    told = {figures.UNJUDGED: None, figures.SAMPLE: figures.SAMPLE}
    shown = [
        {**row, "figure": row["figure"] + figures.sampled(row), "ok": told.get(figures.verdict(row), row["ok"])}
        for row in rows
    ]
    cells = [[as_text(row[column]) for column in COLUMNS] for row in shown]
    widths = [max(len(column), *(len(line[i]) for line in cells)) for i, column in enumerate(COLUMNS)]
    for line in [list(COLUMNS), *cells]:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=False)).rstrip(), flush=True)


def main(arguments: list[str]) -> int:
    """Exit status 0 if every row is ok, 1 if one is not, 2 for an unknown name."""
    top = Path(os.environ["COGLAB_TOP"])
    sources = top / "catkin_ws" / "src"
    try:
        options = bench_options(top, arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    # One word for all benches, and for the record: some ask whether it is set, others whether it is 1.
    long = options.long or os.environ.pop("COGLAB_LONG", "") == "1"
    if long:
        os.environ["COGLAB_LONG"] = "1"
    limit = LONG_TIME_LIMIT if long else TIME_LIMIT
    benches = find_benches(sources)
    python = os.environ.get("COGLAB_TEST_PYTHON", "/usr/bin/python3")
    rows: list[dict] = []
    for name in options.names or ([] if options.report else benches):
        print(f"[coglab] bench {name} ...", file=sys.stderr, flush=True)
        before = sources_of(top, name)
        found = [row for path in benches[name] for row in run_bench(name, path, python, limit)]
        if not figures.record(top, name, found, long, before):
            print(f"[coglab] bench {name}: its sources changed while it ran; its rows are not kept", file=sys.stderr)
        rows += found
    if rows:
        print_table(rows)
    if options.report:
        print(f"[coglab] wrote {figures.write_report(top)}", file=sys.stderr)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if all(row["ok"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
