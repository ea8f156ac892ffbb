"""Golden vectors of the wire, typed by hand a second time: driver against raw bytes.

The other end is a script, not the emulator, so that a slip shared by both ends is seen here.
"""

from __future__ import annotations

import pytest
from ih2_hand.clock import SteppedClock
from ih2_hand.driver import HandSerialDriver

RESYNC = "41 " * 13


class Scripted:
    """Answers each written frame from a table of hex -> hex; keeps what was written."""

    def __init__(self, answers: dict[str, str]):
        self.port, self.last_byte = "scripted", None
        self.answers = {bytes.fromhex(ask): bytes.fromhex(tell) for ask, tell in answers.items()}
        self.frames: list[str] = []
        self._input = b""

    def write(self, data: bytes) -> None:
        self.frames.append(data.hex(" ").upper())
        self._input += self.answers.get(data, b"")

    def read(self, count: int, timeout: float) -> bytes:
        data, self._input = self._input, b""
        return data

    def pending(self) -> bool:
        return bool(self._input)

    def flush_input(self) -> None:
        self._input = b""

    def close(self) -> None:
        pass


def connect(answers: dict[str, str] | None = None, dialect: str = "legacy", **options):
    line = Scripted({"4B 00": "08"} | (answers or {}))
    driver = HandSerialDriver(transport=line, clock=SteppedClock(), dialect=dialect, **options)
    assert line.frames == [RESYNC.strip(), "4B 00"], "constructor: 13 times StopALL, one probe"
    line.frames.clear()
    return driver, line


@pytest.mark.parametrize(
    ("call", "arguments", "expected"),
    [
        ("move_motor", (0, 511, True), "C1 FF"),
        ("move_motor", (3, 256, False), "8D 00"),
        ("move_motor", (2, 300, True), "C9 2C"),
        ("move_motor", (4, 0, True), "D0 00"),
        ("move_motor", (1, 1, False), "84 01"),
        ("set_finger_position", (4, 100), "44 04 64"),
        ("set_finger_position", (0, 254), "44 00 FE"),
        ("set_finger_force", (2, 25), "4A 02 64"),
        ("set_finger_force", (4, 128), "4A 84 00"),
        ("set_finger_force", (3, 64), "4A 43 00"),
        ("set_finger_force", (1, 254), "4A C1 F8"),
        ("stop_all", (), "41"),
        ("set_hand_posture", ([0, 30, 254, 200, 100],), "48 00 1E FE C8 64 48"),
        ("set_finger_current", (3, 100), "5F 03 61 00 64 03"),
        ("set_finger_current", (4, 1023), "5F 04 61 03 FF 04"),
    ],
)
@pytest.mark.parametrize("dialect", ["legacy", "v17"])
def test_commands(dialect, call, arguments, expected):
    driver, line = connect(dialect=dialect)
    getattr(driver, call)(*arguments)
    assert line.frames == [expected]


@pytest.mark.parametrize(
    ("call", "motor", "ask", "tell", "value"),
    [
        ("get_finger_position", 2, "45 02", "1E", 30),
        ("get_finger_position", 4, "45 04", "FF", 254),
        ("get_raw_position", 4, "45 04", "FF", 255),
        ("get_finger_force", 3, "03", "03 33", 204),
        ("get_finger_force", 1, "01", "03 FF", 254),
        ("get_motor_current", 3, "49 03", "03 D4", 980),
        ("get_motor_current", 0, "49 00", "00 00", 0),
    ],
)
def test_readings(call, motor, ask, tell, value):
    driver, line = connect({f"4B 0{number}": "08" for number in range(5)} | {ask: tell})
    assert getattr(driver, call)(motor) == value
    assert line.frames == [ask] * 3, "a value counts when three readings agree"
    driver.get_all_finger_status()
    getattr(driver, call)(motor)
    line.frames.clear()
    assert getattr(driver, call)(motor) == value
    assert line.frames == [ask], "a known value of a resting hand costs one request"


def test_all_status_asks_motor_by_motor():
    driver, line = connect({f"4B 0{motor}": "08" for motor in range(5)})
    driver.get_all_finger_status()
    driver.get_all_finger_status()
    line.frames.clear()
    assert [status["motor"] for status in driver.get_all_finger_status()] == [0, 1, 2, 3, 4]
    assert line.frames == ["4B 00", "4B 01", "4B 02", "4B 03", "4B 04"]


@pytest.mark.parametrize(("kind", "code"), [("fast", "46"), ("complete", "42")])
def test_calibration_sends_one_byte_and_polls(kind, code):
    driver, line = connect({f"4B 0{motor}": "08" for motor in range(5)})
    driver.calibration(kind)
    assert line.frames[:3] == [code, "4B 02", "4B 02"]
    assert code not in line.frames[1:]


LEGACY = {
    ("cylindrical", "low"): ("60", "50"),
    ("cylindrical", "medium"): ("61", "51"),
    ("cylindrical", "high"): ("62", "52"),
    ("lateral", "high"): ("63", "53"),
    ("tridigit", "low"): ("64", "54"),
    ("tridigit", "medium"): ("65", "55"),
    ("tridigit", "high"): ("66", "56"),
    ("bidigit", "low"): ("67", "57"),
    ("bidigit2", "low"): ("69", "68"),
    ("tridigit2", "low"): ("71", "70"),
}
PRESHAPES = {
    "cylindrical": (1, 2, 3, 4, 5),
    "lateral": (6, 7, 8, 9, 10),
    "tridigit": (11, 12, 13, 14, 15),
    "bidigit": (16, 17, 18, 19, 20),
    "tridigit2": (21, 22, 23, 24, 25),
    "bidigit2": (26, 27, 28, 29, 30),
}


@pytest.mark.parametrize(("grasp", "codes"), LEGACY.items())
@pytest.mark.parametrize("is_current", [True, False])
def test_legacy_grasps(grasp, codes, is_current):
    driver, line = connect(preshapes=PRESHAPES)
    driver.set_grasp_mode(*grasp, is_current)
    posture = " ".join(f"{position:02X}" for position in PRESHAPES[grasp[0]])
    assert line.frames == [f"48 {posture} 48"]
    driver.grasp_mode_close()
    assert line.frames[1:] == [codes[0] if is_current else codes[1]]


@pytest.mark.parametrize(
    ("grasp", "expected"),
    [
        (("cylindrical", "high"), "6F 04 C8 14"),
        (("cylindrical", "low"), "6F 04 50 14"),
        (("lateral", "medium"), "6F 01 8C 14"),
        (("bidigit", "high"), "6F 02 C8 14"),
        (("tridigit", "low"), "6F 03 50 14"),
        (("bidigit2", "low"), "6F 15 50 14"),
        (("tridigit2", "medium"), "6F 1F 8C 14"),
    ],
)
def test_v17_grasps(grasp, expected):
    driver, line = connect(dialect="v17")
    driver.set_grasp_mode(*grasp)
    driver.grasp_mode_close()
    assert line.frames[-1] == expected


def test_preshape_can_be_omitted():
    driver, line = connect(send_preshape=False)
    driver.set_grasp_mode("cylindrical", "medium")
    assert line.frames == []
    driver.grasp_mode_close()
    assert line.frames == ["61"]
