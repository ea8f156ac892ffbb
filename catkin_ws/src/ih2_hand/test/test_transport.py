"""The host's end of a port, byte by byte."""

from __future__ import annotations

import errno
import os
import pty
import time
import tty

import pytest
import serial
from ih2_hand import transport
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


def test_available_bytes_are_read_at_once_including_unexpected_ones(far):
    assert far.port.last_byte is None and not far.port.pending()
    far.says(b"\x01\x02\x03")
    assert far.port.read(2, 5.0) == b"\x01\x02\x03" and far.port.last_byte == 3
    assert not far.port.pending()


@pytest.mark.parametrize(("there", "last"), [(b"", None), (b"\x07", 7)])
def test_read_of_missing_bytes_ends_at_its_time_limit(far, there, last):
    if there:
        far.says(there)
    begun = time.monotonic()
    assert far.port.read(2, 0.1) == there and far.port.last_byte == last
    assert 0.09 <= time.monotonic() - begun < 60.0


def test_bytes_that_come_one_by_one_are_one_answer(far, monkeypatch):
    pieces = [b"\x01", b"\x02", b"\x03"]
    far.says(b"\x00")  # never read: the port always has bytes
    monkeypatch.setattr(transport.os, "read", lambda descriptor, most: pieces.pop(0))
    assert far.port.read(3, 5.0) == b"\x01\x02\x03"


def test_an_end_of_file_is_a_lost_port(far, monkeypatch):
    pieces = [b"\x01", b""]
    far.says(b"\x00")  # never read: the port always has bytes
    monkeypatch.setattr(transport.os, "read", lambda descriptor, most: pieces.pop(0))
    with pytest.raises(HandConnectionLost, match="end of file.*none"):
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
    with pytest.raises(HandConnectionLost, match=far.port.port):
        far.port.write(b"\x41")


@pytest.mark.parametrize(
    ("error", "exists", "words"),
    [
        (OSError(errno.ENOENT, "x"), True, "no such port PORT .* /dev/a, /dev/b"),
        (OSError(errno.EIO, "x"), False, "no such port PORT"),
        (OSError(errno.EACCES, "x"), True, "no permission for PORT: .*sudo adduser"),
        (OSError(errno.EPERM, "x"), True, "no permission for PORT"),
        (OSError(errno.EBUSY, "x"), True, "port PORT is busy: .*fuser PORT"),
        (OSError(errno.EAGAIN, "x"), True, "port PORT is busy"),
        (serial.SerialException("Could not exclusively lock port"), True, "port PORT is busy"),
        (OSError(errno.EIO, "x"), True, "port PORT cannot be opened"),
    ],
)
def test_unopenable_port_error_says_what_to_do(monkeypatch, tmp_path, error, exists, words):
    port = tmp_path / "port"
    if exists:
        port.touch()

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(transport.serial, "Serial", fail)
    monkeypatch.setattr(transport, "serial_ports", lambda: ["/dev/a", "/dev/b"])
    with pytest.raises(HandPortError, match=words.replace("PORT", str(port))):
        SerialTransport(str(port))
