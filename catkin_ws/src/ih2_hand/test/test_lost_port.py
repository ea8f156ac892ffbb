"""A port that goes away, or takes bytes slowly, at the worst moment; and the node's side of it."""

from __future__ import annotations

import os
import select
import termios
import threading
import time

import pytest
import serial
from ih2_hand import transport
from ih2_hand.driver import HandSerialDriver
from ih2_hand.errors import HandConnectionLost, HandPortError
from ih2_hand.line import HandLine
from ih2_hand.transport import SerialTransport


def raise_termios(*_, **__):
    raise termios.error(5, "Input/output error")


def test_a_port_that_fails_in_termios_while_it_is_opened_cannot_be_opened(monkeypatch):
    monkeypatch.setattr(serial, "Serial", raise_termios)
    with pytest.raises(HandPortError, match="/dev/null"):
        SerialTransport("/dev/null")


def test_failed_driver_start_closes_the_port(monkeypatch):
    link = Recorder()
    monkeypatch.setattr(HandLine, "resynchronise", raise_termios)
    with pytest.raises(termios.error):
        HandSerialDriver(transport=link)
    assert link.closed


class Recorder:
    """A transport whose reads last until `go` is set."""

    port, last_byte = "recorder", None

    def __init__(self):
        self.reading, self.go = threading.Event(), threading.Event()
        self.closed = self.closed_while_reading = False

    def write(self, data):
        pass

    def read(self, count, timeout):
        self.reading.set()
        self.go.wait(60.0)
        self.closed_while_reading = self.closed
        return b"\x08"

    def pending(self):
        return False

    def flush_input(self):
        pass

    def close(self):
        self.closed = True


def test_closing_waits_for_the_read_under_way():
    link = Recorder()
    line = HandLine(link)
    reader = threading.Thread(target=line.answers, args=(b"\x4b\x00", 1))
    reader.start()
    assert link.reading.wait(60.0)
    closer = threading.Thread(target=line.close)
    closer.start()
    with pytest.raises(HandConnectionLost):  # from now on, though the port is not closed yet
        while closer.is_alive():
            line.send(b"\x41")
            time.sleep(0.001)
    link.go.set()
    for thread in (reader, closer):
        thread.join(60.0)
    assert link.closed and not link.closed_while_reading


@pytest.mark.parametrize("piece", [1, 3])
def test_a_line_that_takes_few_bytes_at_a_time_loses_none(monkeypatch, piece):
    far, near = os.openpty()
    line = SerialTransport(os.ttyname(near))
    write, calls = os.write, []

    def slow(descriptor, data):
        calls.append(data)
        if len(calls) % 2:
            raise BlockingIOError
        return write(descriptor, data[:piece])

    monkeypatch.setattr(transport.os, "write", slow)
    frame = bytes.fromhex("48 00 1E FE C8 64 48")
    line.write(frame)
    monkeypatch.undo()
    came = b""
    while len(came) < len(frame) and select.select([far], [], [], 60.0)[0]:
        came += os.read(far, 64)
    assert came == frame
    line.close()
    for descriptor in (near, far):
        os.close(descriptor)
