"""Rows as ./coglab bench reads them, and progress for people."""

from __future__ import annotations

import sys


def row(
    figure: str,
    value: float | None,
    unit: str,
    goal: str,
    ok: bool,
    peer: str | None = None,
    peer_value: float | None = None,
) -> dict:
    """A row as coglab_bringup.bench reads it."""
    return dict(
        bench="console", figure=figure, value=value, unit=unit, goal=goal, peer=peer, peer_value=peer_value, ok=ok
    )


def say(text: str) -> None:
    """Progress, for people."""
    print(f"[console bench] {text}", file=sys.stderr, flush=True)
