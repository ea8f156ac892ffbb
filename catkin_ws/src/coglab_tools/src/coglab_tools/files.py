"""Writes files completely or not at all."""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from coglab_tools.command import CheckFailed


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file under another name first and move it to its place, so that no reader sees a part of it.
    Creates its folder. Returns the path. CheckFailed: it cannot be written; the earlier file is kept."""
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with half.open("wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
            stream.flush()
            os.fsync(stream.fileno())
        half.replace(path)
    except OSError as error:
        why = error.strerror or error
        raise CheckFailed(f"{path} cannot be written: {why}; the earlier file is kept") from None
    finally:
        with suppress(OSError):
            half.unlink(missing_ok=True)
    return path


def write_by(path: Path, write: Callable[[Path], object]) -> Path:
    """Lets `write` create the file, then moves it into place. `write` gets a path with the same name in a temporary
    folder. CheckFailed as above; other exceptions of `write` pass through, and nothing is left of its file."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".part-", dir=path.parent) as part:
            made = Path(part) / path.name
            write(made)
            made.replace(path)
    except OSError as error:
        why = error.strerror or error
        raise CheckFailed(f"{path} cannot be written: {why}; the earlier file is kept") from None
    return path


@contextmanager
def alone(folder: Path, limit: float = 10.0) -> Iterator[None]:
    """While the block runs, nobody else can enter `alone` for this folder: no process, no thread. CheckFailed if it is
    not free within `limit` s, or cannot be opened."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise CheckFailed(f"{folder} cannot be opened: {error.strerror}; nothing was written") from None
    try:
        end = time.monotonic() + limit
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > end:
                    raise CheckFailed(f"another program has written in {folder} for {limit:g} s: try again") from None
                time.sleep(0.02)
        yield
    finally:
        os.close(descriptor)
