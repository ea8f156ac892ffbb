"""`./coglab study VERB`: studies: plan, run, resume, report"""

from __future__ import annotations

import argparse
from typing import Any

HELP = "studies: plan, run, resume, report"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `study`."""
