"""The emulated hand on a pseudo-terminal that can be unplugged and plugged in again."""

from __future__ import annotations

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand

IDLE_S = 1.0  # s, longest sleep of the serving loop


class PtyServer:
    """Serves one EmulatedHand on a pty. `serve` blocks. The other methods are thread-safe.

    `link` is a symlink that always points to the pty. `on_port` is called with the path whenever it changes
    (empty while unplugged). `trace` is called with direction, bytes and time of everything the hand receives or sends.
    """

    def __init__(
        self,
        hand: EmulatedHand,
        faults: Faults | None = None,
        link: str | None = None,
        on_port: Callable[[str], None] = lambda _path: None,
        trace: Callable[[str, bytes, float], None] | None = None,
    ):
        self.hand = hand
        self.faults = faults or Faults(hand)
        self.faults.on_unplug, self.faults.on_replug = self.unplug, self.replug
        self.lock = threading.RLock()
        """Held during every access to the hand."""
        self.path = ""
        self._link = Path(link) if link else None
        self._on_port = on_port
        self._trace = trace
        self._master = self._slave = -1
        self._plugs = 0
        self._late: list[tuple[float, bytes]] = []
        self._replug_at: float | None = None
        self._running = True
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        self.replug()

    # -- plug ------------------------------------------------------------------------------------

    def replug(self) -> None:
        """Open a pty, raw and without echo; no effect if it is open."""
        with self.lock:
            self._replug_at = None
            if self._master >= 0:
                return
            self._master, self._slave = pty.openpty()
            self._plugs += 1
            # The slave stays open in this process, too: without a reader the master would report an error.
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
            if self._link:
                fresh = self._link.with_name(self._link.name + f".{os.getpid()}")
                fresh.symlink_to(self.path)
                fresh.replace(self._link)
        self._on_port(self.path)
        self._wake()

    def unplug(self, seconds: float | None = None) -> None:
        """Close the pty: readers see the device vanish. It is plugged in again after `seconds` (None: never)."""
        with self.lock:
            if self._master < 0:
                return
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1
            self.path = ""
            self._late.clear()
            self.hand.parser.clear()
            if self._link:
                self._link.unlink(missing_ok=True)
            if seconds is not None:
                self._replug_at = time.monotonic() + seconds
        self._on_port("")
        self._wake()

    # -- serving ---------------------------------------------------------------------------------

    def serve(self, ended: Callable[[], bool] = lambda: False) -> None:
        """Answer until `shutdown`, or until `ended()` returns True. It is called at least once a second."""
        while self._running and not ended():
            with self.lock:
                master, plug = self._master, self._plugs
            poll = select.poll()
            poll.register(self._wake_read, select.POLLIN)
            if master >= 0:
                poll.register(master, select.POLLIN)
            self._serve_port(poll, master, plug, ended)

    def _serve_port(self, poll: select.poll, master: int, plug: int, ended: Callable[[], bool]) -> None:
        """Serve while the same pty is open. `plug` identifies it, because descriptor numbers are reused."""
        while self._running and self._master == master and self._plugs == plug and not ended():
            events = poll.poll(self._wait_s() * 1000.0)
            with self.lock:
                for descriptor, _ in events:
                    if descriptor == self._wake_read:
                        _read(self._wake_read)
                    elif self._master == master and self._plugs == plug:
                        self._receive(_read(master))
                if self._master >= 0:
                    self._send_due()
                replug = self._replug_at is not None and time.monotonic() >= self._replug_at
            if replug:
                self.replug()

    def _wait_s(self) -> float:
        due = [moment for moment, _ in self._late[:1]]
        if self._replug_at is not None:
            due.append(self._replug_at)
        return max(0.0, min([IDLE_S, *(moment - time.monotonic() for moment in due)]))

    def _receive(self, data: bytes) -> None:
        data = self.faults.incoming(data)
        if self._trace and data:
            self._trace(">", data, time.time())
        for _, answer in self.hand.receive(data):
            answer = self.faults.outgoing(answer)
            if answer and self.faults.delay_s:
                self._late.append((time.monotonic() + self.faults.delay_s, answer))
            elif answer:
                self._send(answer)

    def _send_due(self) -> None:
        while self._late and self._late[0][0] <= time.monotonic():
            self._send(self._late.pop(0)[1])
        stray = self.faults.take_stray() if self.faults.stray else b""
        if stray:
            self._send(stray)

    def _send(self, answer: bytes) -> None:
        try:
            os.write(self._master, answer)
        except BlockingIOError:
            return  # no reader and a full buffer: a cable would lose the bytes, too
        if self._trace:
            self._trace("<", answer, time.time())

    def fault(self, command: str) -> str:
        """Execute a fault command and return a text that describes it."""
        with self.lock:
            done = self.faults.command(command)
        self._wake()
        return done

    def _wake(self) -> None:
        os.write(self._wake_write, b"x")

    def request_shutdown(self) -> None:
        """Make `serve` return. Safe in a signal handler."""
        self._running = False
        self._wake()

    def shutdown(self) -> None:
        """End `serve` and close the port."""
        self.request_shutdown()
        self.unplug()


def _read(descriptor: int) -> bytes:
    """Bytes that can be read; empty if the event belonged to a descriptor that was closed and reused."""
    try:
        return os.read(descriptor, 4096)
    except BlockingIOError:
        return b""
