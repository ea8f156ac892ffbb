"""Common parts of the commands `./coglab NOUN VERB`: answers, errors with exit codes, progress bars.

A noun is a module `coglab_tools.NOUN.commands` with `HELP`, one sentence, and `add(verbs)`, which adds its verbs to an
argparse subparsers object and sets `run` of each to a function from the options to a CommandResult::

    def add(verbs):
        parser = verbs.add_parser("list", help="lists the trials of a folder")
        parser.add_argument("folder", type=Path)
        parser.set_defaults(run=list_trials)

Heavy libraries (pandas, matplotlib, distributed, rospy) are imported in these functions, so that help stays quick.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

OK, CHECK_FAILED, USAGE, NOT_THERE = 0, 1, 2, 3
"""exit codes: done; a check failed; invalid arguments; robot, ROS or a library is missing"""

Item = TypeVar("Item")


@dataclass(frozen=True)
class CommandResult:
    """Result of a command. ``--json`` prints ``data``, otherwise ``text`` and the next command are printed."""

    text: str
    """for people: sentences or a table"""
    data: dict[str, Any] = field(default_factory=dict)
    """for programs: values of JSON, units in the names of the keys, such as duration_s"""
    next: str = ""
    """the sensible next command, such as "./coglab trial report out/trial_3" """
    status: int = OK
    """exit code"""


class CommandError(Exception):
    """A command ended without an answer. The message has the expected and the actual value and the next step."""

    status = CHECK_FAILED


class CheckFailed(CommandError):
    """The input was read and checked, and is unusable: exit code 1."""


class UsageError(CommandError):
    """The arguments cannot be used: exit code 2."""

    status = USAGE


class NotThere(CommandError):
    """The robot, ROS, a file or a library is missing: exit code 3."""

    status = NOT_THERE


def plural(count: int, name: str) -> str:
    """Such as "1 trial" or "2 trials"."""
    return f"{count} {name}{'s' * (count != 1)}"


_bar: Any = None  # of the command that runs: rich's Progress with one task


@contextmanager
def working(title: str) -> Iterator[None]:
    """On a terminal a bar moves once the block has taken more than 2 s. Nothing else may write or read there."""
    global _bar
    if _bar is not None or not sys.stderr.isatty():
        yield
        return
    from threading import Timer

    from rich.console import Console
    from rich.progress import Progress

    _bar = Progress(console=Console(stderr=True), transient=True)
    _bar.add_task(title, total=None)
    late = Timer(2.0, _bar.start)
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()
        late.join()
        _bar.stop()
        _bar = None


def progress(items: Iterable[Item], total: int, title: str) -> Iterator[Item]:
    """Yield the items. On a terminal a bar shows how many of `total` are done once this has taken more than 2 s."""
    with working(title):
        if _bar is None:
            yield from items
            return
        bar = _bar
        (before,) = bar.tasks
        bar.remove_task(before.id)
        task = bar.add_task(title, total=total)
        for done, item in enumerate(items):
            bar.update(task, completed=done)
            yield item
        bar.remove_task(task)
        bar.add_task(before.description, total=None)
