"""Transports to the hand: a serial device, a pty, or a `socket://host:port` URL."""

from __future__ import annotations

import errno
import os
import select
import termios
import time
from typing import Any, Protocol

import serial
from serial.tools import list_ports

from ih2_hand.errors import HandConnectionLost, HandPortError
from ih2_hand.wire_choices import WIRE

WRITE_TIMEOUT_S = 0.5  # s, longest wait until the line accepts a frame


PORT_ERRORS = (OSError, serial.SerialException, termios.error, TypeError, ValueError)
"""Errors of pyserial and the kernel when a port disappears during a call. termios.error is not an
OSError; TypeError and ValueError come from a descriptor that is no longer valid."""


class Transport(Protocol):
    """Interface of a line to the hand. `port` is a text for messages; `last_byte` is the last byte received or None."""

    port: str
    last_byte: int | None

    def write(self, data: bytes) -> None:
        """Send a frame at once. Raises HandConnectionLost."""

    def read(self, count: int, timeout: float) -> bytes:
        """Return all bytes that have arrived: at least `count`, fewer only after `timeout` (s). More than `count`
        means stray bytes. Raises HandConnectionLost."""

    def pending(self) -> bool:
        """True if bytes wait to be read."""

    def flush_input(self) -> None:
        """Discard the bytes that wait to be read."""

    def close(self) -> None:
        """Close the line; no effect if it is closed."""


class SerialTransport:
    """A device, a pty or a URL, opened by pyserial.

    Devices are read with poll and read on pyserial's descriptor. This takes a third of the time of
    `serial.read` and shows bytes beyond the expected ones. URLs are read by pyserial.
    """

    def __init__(self, port: str | None):
        self.port = port if port is not None else find_port()
        self.last_byte: int | None = None
        self._serial = _open(self.port)
        self._fd: int | None = None
        if isinstance(self._serial, serial.Serial) and "://" not in self.port:
            self._fd = self._serial.fileno()
            self._poll = select.poll()
            self._poll.register(self._fd, select.POLLIN)

    def write(self, data: bytes) -> None:
        try:
            if self._fd is None:
                self._serial.write(data)
                return
            while data:
                data = data[self._write_some(data) :]
        except PORT_ERRORS as error:
            raise self._lost(error) from error

    def _write_some(self, data: bytes) -> int:
        """Number of bytes that the line accepted; may wait up to WRITE_TIMEOUT_S."""
        assert self._fd is not None
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            _, ready, _ = select.select([], [self._fd], [], WRITE_TIMEOUT_S)
        if not ready:
            raise HandConnectionLost(
                f"{self.port} took no byte for {WRITE_TIMEOUT_S} s (last byte "
                f"received {format_byte(self.last_byte)}): the other end is "
                "stuck; unplug and replug the hand's cable"
            )
        return 0

    def read(self, count: int, timeout: float) -> bytes:
        try:
            if self._fd is None:
                data = self._read_url(count, timeout)
            elif self._poll.poll(timeout * 1000.0):
                data = os.read(self._fd, 256)
                if len(data) < count:
                    data = self._read_rest(data, count, timeout)
            else:
                return b""
        except PORT_ERRORS as error:
            raise self._lost(error) from error
        if data:
            self.last_byte = data[-1]
        return data

    def _read_rest(self, data: bytes, count: int, timeout: float) -> bytes:
        assert self._fd is not None
        end = time.monotonic() + timeout
        more = data
        while more and len(data) < count:
            left = end - time.monotonic()
            if left <= 0 or not self._poll.poll(left * 1000.0):
                return data
            more = os.read(self._fd, 256)
            data += more
        if not more:
            raise OSError(errno.EIO, "end of file")
        return data

    def _read_url(self, count: int, timeout: float) -> bytes:
        self._serial.timeout = timeout
        data = self._serial.read(count)
        if len(data) == count and self._serial.in_waiting:
            self._serial.timeout = 0
            data += self._serial.read(256)
        return data

    def pending(self) -> bool:
        try:
            if self._fd is None:
                return bool(self._serial.in_waiting)
            return bool(self._poll.poll(0))
        except PORT_ERRORS as error:
            raise self._lost(error) from error

    def flush_input(self) -> None:
        deadline = time.monotonic() + WRITE_TIMEOUT_S
        while self.pending() and time.monotonic() < deadline:
            self.read(1, 0.0)

    def close(self) -> None:
        try:
            self._serial.close()
        except PORT_ERRORS:
            pass  # the device was unplugged: nothing is left to close

    def _lost(self, error: Exception) -> HandConnectionLost:
        return HandConnectionLost(
            f"the hand's port {self.port} is gone ({error}); "
            f"last byte received {format_byte(self.last_byte)}; "
            "check the cable"
        )


def format_byte(value: int | None) -> str:
    """A byte as text for messages, e.g. `0x4c`, or `none`."""
    return "none" if value is None else f"0x{value:02x}"


def serial_ports() -> list[str]:
    """Serial devices of this computer that have a hardware driver."""
    return sorted(info.device for info in list_ports.comports() if info.hwid != "n/a")


def find_port() -> str:
    """The only serial device. If there is none or more than one, HandPortError lists the devices."""
    ports = serial_ports()
    if len(ports) == 1:
        return ports[0]
    if not ports:
        raise HandPortError(
            "no serial device found: plug in the hand's USB adapter, or name the "
            "port (a device, a pty or socket://host:port)"
        )
    raise HandPortError(f"several serial devices found ({', '.join(ports)}): name the hand's one")


def _open(port: str) -> Any:
    try:
        if "://" in port:
            return serial.serial_for_url(
                port, baudrate=WIRE.baud, timeout=WIRE.read_timeout_s, write_timeout=WRITE_TIMEOUT_S
            )
        device = serial.Serial(
            port, baudrate=WIRE.baud, timeout=WIRE.read_timeout_s, write_timeout=WRITE_TIMEOUT_S, exclusive=True
        )
    except ValueError as error:
        raise HandPortError(f"{port!r} is not a port: give a device, a pty or socket://host:port ({error})") from error
    except PORT_ERRORS as error:
        raise HandPortError(_why_not(port, error)) from error
    _shorten_latency(device)
    return device


def _shorten_latency(device: serial.Serial) -> None:
    """USB adapters may delay each answer by 16 ms; request 1 ms from the kernel."""
    try:
        device.set_low_latency_mode(True)
    except (AttributeError, *PORT_ERRORS):
        pass  # a pty, or an adapter without this setting


def _why_not(port: str, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if "://" in port:
        return f"{port} does not answer ({error}): start the other end or correct the address"
    if code == errno.ENOENT or not os.path.exists(port):
        there = ", ".join(serial_ports()) or "none"
        return f"no such port {port} (serial devices here: {there}): plug it in or correct the name"
    if code in (errno.EACCES, errno.EPERM):
        return (
            f"no permission for {port}: add the user to the group that owns it "
            "(`sudo adduser $USER dialout`) and log in again"
        )
    if code in (errno.EAGAIN, errno.EBUSY) or "exclusively lock" in str(error):
        return f"port {port} is busy: end the other program that has it open (`fuser {port}`)"
    return f"port {port} cannot be opened ({error}): check that it is the hand's serial device"
