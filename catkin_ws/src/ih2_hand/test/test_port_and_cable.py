"""The driver on a real pty and a socket: opening, silence, slowness, a pulled cable, threads."""

from __future__ import annotations

import os
import socket
import threading
import time

import pytest
from ih2_hand import transport
from ih2_hand.driver import HandSerialDriver
from ih2_hand.emulator.faults import Faults
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.pty_server import PtyServer
from ih2_hand.errors import (
    HandCalibratingError,
    HandConnectionLost,
    HandPortError,
    HandTimeoutError,
)
from patience import opened, until


@pytest.fixture
def server(tmp_path):
    hand = EmulatedHand(calibration_scale=0.2, greeting=True)
    server = PtyServer(hand, Faults(hand), link=str(tmp_path / "hand"))
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    thread.join(60.0)
    assert not thread.is_alive()


@pytest.fixture
def driver(server):
    with opened(server.path) as driver:
        yield driver


def test_link_follows_the_pty(server, tmp_path):
    assert os.path.realpath(tmp_path / "hand") == server.path
    with opened(str(tmp_path / "hand")) as driver:
        assert driver.get_finger_status(0)["fully_open"]
    server.fault("unplug")
    assert not (tmp_path / "hand").exists()
    server.fault("replug")
    with opened(str(tmp_path / "hand")) as driver:
        assert driver.get_finger_status(0)["fully_open"]


def test_control_characters_are_ordinary_data(server, driver):
    for position in (0x03, 0x0A, 0x0D, 0x11, 0x13):
        driver.set_finger_position(2, position)
        until(lambda position=position: driver.get_finger_position(2) == position)


def test_answers_slower_than_the_limit_end_in_one_exception(server, driver):
    server.fault("slow 3000")
    with pytest.raises(HandTimeoutError, match="0x08"):
        driver.get_finger_status(1)
    assert driver.counters.retries == 1
    server.fault("clear")
    time.sleep(3.5)  # s, until the late answers have come
    assert driver.get_finger_status(1)["mode"] == "stop"
    assert driver.get_finger_position(1) == 0


def test_unplugged_cable_names_port_and_last_byte(server, driver):
    driver.get_finger_status(0)
    path = server.path
    server.fault("unplug")
    with pytest.raises(HandConnectionLost, match=f"{path} .*0x08"):
        driver.get_finger_status(0)
    with pytest.raises(HandConnectionLost):
        driver.stop_all()


def test_calibration_over_the_pty(server, driver):
    driver.set_hand_posture([100] * 5)
    until(lambda: driver.get_finger_position(1) == 100)
    server.hand.calibration_scale = 3.0  # 5 s, so that the requests of a slow test come before its end
    outcome = []
    thread = threading.Thread(target=lambda: outcome.append(driver.calibration("fast")))
    thread.start()
    until(lambda: driver.calibrating)
    with pytest.raises(HandCalibratingError, match="discards every"):
        driver.get_finger_position(1)
    driver.stop_all()
    thread.join(60.0)
    assert outcome == [None]
    assert driver.get_finger_position(1) == 0


def test_calibration_broken_by_the_cable(server, driver):
    server.hand.calibration_scale = 3.0  # so long that the cable is pulled before its end
    errors = []

    def calibrate():
        try:
            driver.calibration("complete")
        except HandConnectionLost as error:
            errors.append(error)

    thread = threading.Thread(target=calibrate)
    thread.start()
    until(lambda: driver.calibrating)
    server.fault("unplug")
    thread.join(60.0)
    assert len(errors) == 1
    assert not driver.calibrating


def test_many_threads_share_one_driver(server, driver):
    driver.set_hand_posture([10, 20, 30, 40, 50])
    until(lambda: [driver.get_finger_position(motor) for motor in range(5)] == [10, 20, 30, 40, 50])
    wrong: list[tuple[int, int]] = []

    def read(motor: int) -> None:
        for _ in range(60):
            value = driver.get_finger_position(motor)
            if value != (motor + 1) * 10:
                wrong.append((motor, value))

    threads = [threading.Thread(target=read, args=(motor,)) for motor in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert wrong == []
    assert driver.counters.resynchronisations == 0


def test_socket_url():
    hand = EmulatedHand(greeting=True)
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = listener.accept()
        with connection:
            while data := connection.recv(4096):
                for _, answer in hand.receive(data):
                    connection.sendall(answer)

    threading.Thread(target=serve, daemon=True).start()
    url = f"socket://127.0.0.1:{listener.getsockname()[1]}"
    with opened(url) as driver:
        assert driver.port == url
        driver.set_finger_position(2, 20)
        until(lambda: driver.get_finger_position(2) == 20)
        until(lambda: driver.get_motor_current(2) == 0)  # it stands
    listener.close()
    with pytest.raises(HandPortError, match=url):
        HandSerialDriver(url)


# -- ports that cannot be opened -------------------------------------------------------------------


def test_busy_port(server, driver):
    with pytest.raises(HandPortError, match=f"{server.path} .*busy"):
        HandSerialDriver(server.path)


@pytest.mark.parametrize(
    ("ports", "words"),
    [([], "no serial"), (["/dev/ttyUSB0", "/dev/ttyUSB1"], "/dev/ttyUSB0, /dev/ttyUSB1")],
)
def test_the_only_port(monkeypatch, ports, words):
    monkeypatch.setattr(transport, "serial_ports", lambda: ports)
    with pytest.raises(HandPortError, match=words):
        HandSerialDriver()
