"""`./coglab dmp VERB`: teach motions: record, import, learn, inspect and check primitives"""

from __future__ import annotations

import argparse
from typing import Any

HELP = "teach motions: record, import, learn, inspect and check primitives"


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the verbs of `dmp`."""
