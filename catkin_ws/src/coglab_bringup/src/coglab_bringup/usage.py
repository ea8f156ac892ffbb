"""How arguments are refused, and the kinds of values that several commands take. Python's own library alone."""

from __future__ import annotations

import argparse
import os
import re
import shutil
from pathlib import Path
from typing import NoReturn

RESULTS_SPACE = 50e6  # bytes, for the results of a demo or of the tests


class Refused(Exception):
    """An argument that cannot be used; the sentence says what was expected."""


class Parser(argparse.ArgumentParser):
    """Refuses in one sentence instead of a usage block."""

    def error(self, message: str) -> NoReturn:
        """Called by argparse."""
        raise Refused(f"{message}; what there is: ./{self.prog} --help")


def seed(text: str) -> int:
    """A seed: a whole number from 0 to 2147483647."""
    if not re.fullmatch(r"\d{1,10}", text) or int(text) > 2147483647:
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 to 2147483647, got '{text}'")
    return int(text)


def writable_folder(text: str) -> Path:
    """A folder that exists or can be made, and written to."""
    path = Path(text).absolute()
    there = next(parent for parent in (path, *path.parents) if parent.exists())
    # os.access says yes to root even where the file system does not write, as in /proc
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK) or str(there).split("/")[1] in ("proc", "sys"):
        raise argparse.ArgumentTypeError(f"{text} cannot be written: {there} is no folder that takes files")
    free = shutil.disk_usage(there).free
    if free < RESULTS_SPACE:
        need = f"{free / 1e6:.0f} MB left, and results need {RESULTS_SPACE / 1e6:.0f} MB"
        raise argparse.ArgumentTypeError(f"{text} cannot be written: {there} has {need}")
    return path


def writable_file(text: str) -> Path:
    """A file in a folder that exists and can be written to."""
    path = Path(text)
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"expected a file in a folder that exists, got {text}")
    writable_folder(str(path.absolute().parent))
    return path


def master_port(text: str) -> int:
    """A TCP port."""
    if not text.isdigit() or not 0 < int(text) < 65536:
        raise argparse.ArgumentTypeError(f"expected a port number, such as 11411, got '{text}'")
    return int(text)
