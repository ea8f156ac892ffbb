"""`./coglab people VERB`: read recordings of people"""

from __future__ import annotations

import argparse
from typing import Any

HELP = "read recordings of people"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `people`."""
