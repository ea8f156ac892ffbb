"""Waits for an emulated hand that a busy computer holds back."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from ih2_hand.driver import LARGEST_READ_TIMEOUT_S, HandSerialDriver
from ih2_hand.errors import HandPortError

if TYPE_CHECKING:
    from collections.abc import Callable

LIMIT = 60.0  # s


def until(condition: Callable[[], bool]) -> None:
    """Waits until `condition()`. AssertionError after LIMIT."""
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def opened(port: str) -> HandSerialDriver:
    """A driver of the hand on `port`. Tries again while no hand answers, for up to LIMIT; then HandPortError."""
    end = time.monotonic() + LIMIT
    while True:
        try:
            return HandSerialDriver(port, read_timeout=LARGEST_READ_TIMEOUT_S)
        except HandPortError:
            if time.monotonic() > end:
                raise
