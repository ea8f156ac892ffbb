"""Gives the records of a logger to Python's `logging`."""

from __future__ import annotations

import atexit
import logging
import threading

from ctrl_more._core import Logger, LogRecord

LEVELS = {"debug": logging.DEBUG, "info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


def to_logging(logger: Logger, name: str = "ctrl_more", period: float = 0.05) -> None:
    """Drain `logger` into `logging.getLogger(name.source)` every `period` seconds.

    A separate thread does this, so a control cycle never waits for Python's handlers. The rest is
    written when the program ends; `logger.drain()` writes it at once.
    """

    def write(record: LogRecord) -> None:
        logging.getLogger(f"{name}.{record.source}").log(
            LEVELS[record.level], record.message, extra={"cycle": record.cycle}
        )

    ended = threading.Event()

    def drain() -> None:
        while not ended.wait(period):
            logger.drain()

    def end() -> None:
        ended.set()
        thread.join(timeout=1.0)
        logger.drain()

    logger.add_sink(write)
    thread = threading.Thread(target=drain, name="ctrl_more log", daemon=True)
    thread.start()
    atexit.register(end)
