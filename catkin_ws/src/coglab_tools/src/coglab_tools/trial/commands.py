"""`./coglab trial VERB`: recorded handovers: list, show, plot, replay, explain"""

from __future__ import annotations

import argparse
from typing import Any

HELP = "recorded handovers: list, show, plot, replay, explain"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `trial`."""
