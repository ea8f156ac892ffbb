"""Refusal of arguments, and types of values that several commands accept. Standard library only."""

from __future__ import annotations

import argparse
import os
import re
import shutil
from pathlib import Path
from typing import NoReturn

RESULTS_SPACE = 50e6  # bytes for the results of a demo or of the tests


class Refused(Exception):
    """An argument that cannot be used. The message states what was expected."""


class Parser(argparse.ArgumentParser):
    """An argument parser that refuses with one sentence instead of a usage block."""

    def error(self, message: str) -> NoReturn:
        """Raise Refused; argparse calls this."""
        raise Refused(f"{message}; the options: ./{self.prog} --help")


def seed(text: str) -> int:
    """Parse a seed: a whole number from 0 to 2147483647."""
    if not re.fullmatch(r"\d{1,10}", text) or int(text) > 2147483647:
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 to 2147483647, got '{text}'")
    return int(text)


def writable_folder(text: str) -> Path:
    """Parse a folder that can be written to. It exists or can be created."""
    path = Path(text).absolute()
    there = next(parent for parent in (path, *path.parents) if parent.exists())
    # For root, os.access returns True even where the file system cannot be written, as in /proc
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK) or str(there).split("/")[1] in ("proc", "sys"):
        raise argparse.ArgumentTypeError(f"{text} cannot be written: {there} is no folder that takes files")
    free = shutil.disk_usage(there).free
    if free < RESULTS_SPACE:
        need = f"{free / 1e6:.0f} MB left, and results need {RESULTS_SPACE / 1e6:.0f} MB"
        raise argparse.ArgumentTypeError(f"{text} cannot be written: {there} has {need}")
    return path


def writable_file(text: str) -> Path:
    """Parse a file name in an existing folder that can be written to."""
    path = Path(text)
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"expected a file in a folder that exists, got {text}")
    writable_folder(str(path.absolute().parent))
    return path


def master_port(text: str) -> int:
    """Parse a TCP port."""
    if not text.isdigit() or not 0 < int(text) < 65536:
        raise argparse.ArgumentTypeError(f"expected a port number, such as 11411, got '{text}'")
    return int(text)
