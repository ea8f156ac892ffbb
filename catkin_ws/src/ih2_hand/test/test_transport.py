"""The two ends of a port, byte by byte: what the host reads of it, and what the emulator's pty serves."""

from __future__ import annotations

import errno
import os
import pty
import select
import time
import tty
from collections.abc import Callable
from types import SimpleNamespace

import pytest
import serial
from ih2_hand import transport
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.pty_server import PtyServer
from ih2_hand.errors import HandConnectionLost, HandPortError
from ih2_hand.transport import SerialTransport


class Far:
    """The far end of an open port."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.port = SerialTransport(os.ttyname(self.slave))

    def says(self, data: bytes) -> None:
        os.write(self.master, data)
        end = time.monotonic() + 60.0
        while not self.port.pending():
            assert time.monotonic() < end, "what was written does not arrive"
            time.sleep(0.001)

    def close(self) -> None:
        self.port.close()
        for descriptor in (self.master, self.slave):
            os.close(descriptor)


@pytest.fixture
def far():
    far = Far()
    yield far
    far.close()


def test_what_is_there_is_read_at_once_with_what_was_not_expected(far):
    assert far.port.last_byte is None and not far.port.pending()
    far.says(b"\x01\x02\x03")
    assert far.port.read(2, 5.0) == b"\x01\x02\x03" and far.port.last_byte == 3
    assert not far.port.pending()


@pytest.mark.parametrize(("there", "last"), [(b"", None), (b"\x07", 7)])
def test_what_does_not_come_is_waited_for_no_longer_than_told(far, there, last):
    if there:
        far.says(there)
    begun = time.monotonic()
    assert far.port.read(2, 0.1) == there and far.port.last_byte == last
    assert 0.09 <= time.monotonic() - begun < 60.0


def test_bytes_that_come_one_by_one_are_one_answer(far, monkeypatch):
    pieces = [b"\x01", b"\x02", b"\x03"]
    monkeypatch.setattr(transport.os, "read", lambda descriptor, most: pieces.pop(0))
    monkeypatch.setattr(far.port, "_poll", SimpleNamespace(poll=lambda milliseconds: True))
    assert far.port.read(3, 5.0) == b"\x01\x02\x03"


def test_an_end_of_file_is_a_lost_port(far, monkeypatch):
    pieces = [b"\x01", b""]
    monkeypatch.setattr(transport.os, "read", lambda descriptor, most: pieces.pop(0))
    monkeypatch.setattr(far.port, "_poll", SimpleNamespace(poll=lambda milliseconds: True))
    with pytest.raises(HandConnectionLost, match="is gone .*end of file.*last byte received none; check the cable"):
        far.port.read(2, 5.0)


def test_forgotten_bytes_are_gone_and_new_ones_come(far):
    far.says(b"\x01\x02\x03")
    far.port.flush_input()
    assert not far.port.pending() and far.port.last_byte == 3
    far.port.flush_input()
    far.says(b"\x04")
    assert far.port.read(1, 5.0) == b"\x04"


def test_a_port_may_be_closed_twice_and_is_then_lost(far):
    far.port.close()
    far.port.close()
    with pytest.raises(HandConnectionLost, match=f"the hand's port {far.port.port} is gone"):
        far.port.write(b"\x41")


@pytest.mark.parametrize(
    ("error", "exists", "words"),
    [
        (OSError(errno.ENOENT, "x"), True, "no such port PORT .serial devices here: /dev/a, /dev/b.: plug it in"),
        (OSError(errno.EIO, "x"), False, "no such port PORT"),
        (OSError(errno.EACCES, "x"), True, "no permission for PORT: .*sudo adduser"),
        (OSError(errno.EPERM, "x"), True, "no permission for PORT"),
        (OSError(errno.EBUSY, "x"), True, "port PORT is busy: end the other program .*fuser PORT"),
        (OSError(errno.EAGAIN, "x"), True, "port PORT is busy"),
        (serial.SerialException("Could not exclusively lock port"), True, "port PORT is busy"),
        (OSError(errno.EIO, "x"), True, "port PORT cannot be opened .*check that it is the hand's serial device"),
    ],
)
def test_a_port_that_cannot_be_opened_is_told_with_what_to_do(monkeypatch, tmp_path, error, exists, words):
    port = tmp_path / "port"
    if exists:
        port.touch()

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(transport.serial, "Serial", fail)
    monkeypatch.setattr(transport, "serial_ports", lambda: ["/dev/a", "/dev/b"])
    with pytest.raises(HandPortError, match=words.replace("PORT", str(port))):
        SerialTransport(str(port))


# -- the emulator's end --------------------------------------------------------------------------


class Served:
    """A pty whose serving is done here, step by step."""

    def __init__(self, link: str | None = None) -> None:
        self.ports: list[str] = []
        self.traced: list[tuple[str, bytes]] = []
        self.hand = EmulatedHand(greeting=True)
        self.faults = Faults(self.hand)
        trace = lambda way, data, _: self.traced.append((way, data))  # noqa: E731
        self.server = PtyServer(self.hand, self.faults, link, self.ports.append, trace)
        self.host = os.open(self.server.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def asks(self, data: bytes, count: int = 0) -> bytes:
        """Sends, and serves until `count` bytes have come back; a crowded machine may take its time."""
        os.write(self.host, data)
        return self.serves_until(lambda came: len(came) >= count)

    def serves_until(self, enough: Callable[[bytes], object]) -> bytes:
        """What has come back when it is enough."""
        came, end = self.serves(), time.monotonic() + 60.0
        while not enough(came):
            assert time.monotonic() < end, f"it waits for ever, with {came!r}"
            came += self.serves()
        return came

    def serves(self) -> bytes:
        """Serves for a moment, without a sleep; what has come back."""
        end = time.monotonic() + 0.02

        def ended() -> bool:
            self.server._wake()
            return time.monotonic() >= end

        self.server.serve(ended)
        return os.read(self.host, 100) if select.select([self.host], [], [], 0.0)[0] else b""


@pytest.fixture
def served(tmp_path):
    served = Served(str(tmp_path / "hand"))
    yield served
    os.close(served.host)
    served.server.shutdown()


def test_a_slow_hand_answers_late_and_in_order(served):
    served.server.fault("slow 100")
    begun = time.monotonic()
    assert served.asks(b"\x45\x02\x4b\x02") == b""
    assert served.serves_until(lambda came: len(came) == 2) == b"\x00\x08"
    assert time.monotonic() - begun >= 0.1


def test_a_cable_can_be_pulled_and_plugged_in_again(served, tmp_path):
    link, first = tmp_path / "hand", served.server.path
    assert os.readlink(link) == first and served.ports == [first]
    os.write(served.host, b"\x45")
    served.serves_until(lambda _: served.hand.parser.waiting)
    served.server.fault("unplug")
    served.server.fault("unplug")
    assert served.server.path == "" and served.ports == [first, ""] and not link.is_symlink()
    assert served.hand.parser.waiting == b"", "what was cut off is forgotten"
    served.server.fault("replug")
    served.server.fault("replug")
    assert len(served.ports) == 3 and os.readlink(link) == served.server.path == served.ports[2]


def test_a_cable_plugs_itself_in_again_after_its_time(served):
    begun = time.monotonic()
    served.server.fault("unplug 0.1")
    assert served.server.path == ""
    served.serves_until(lambda _: served.server.path)
    assert time.monotonic() - begun >= 0.1


def test_answers_that_were_late_do_not_survive_the_cable(served):
    served.server.fault("slow 60000")
    os.write(served.host, b"\x45\x02")
    served.serves_until(lambda _: served.server._late)
    served.server.fault("unplug")
    served.server.fault("replug")
    assert served.server._late == []


def test_the_loop_sleeps_until_something_is_due(served):
    assert served.server._wait_s() == 1.0
    served.server._late = [(time.monotonic() + 0.5, b"")]
    assert 0.3 < served.server._wait_s() <= 0.5
    served.server._replug_at = time.monotonic() - 1.0
    assert served.server._wait_s() == 0.0
    served.server._late, served.server._replug_at = [], None


def test_bytes_beyond_a_full_line_are_lost_and_not_waited_for(served, monkeypatch):
    def full(*_: object) -> int:
        raise BlockingIOError

    monkeypatch.setattr(os, "write", full)
    served.server._send(b"\x00")
    assert served.traced == []
