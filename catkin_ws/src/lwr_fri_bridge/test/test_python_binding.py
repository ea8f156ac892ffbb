"""The Python module: parameters go where their names say, dictionaries are complete, what is wrong is named."""

from __future__ import annotations

import pathlib

import lwr_fri_bridge
import pytest

LIMITS = str(pathlib.Path(__file__).parents[2] / "lwr_description" / "config" / "joint_limits.yaml")
IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]


def test_a_parameter_out_of_range_is_refused_by_its_name() -> None:
    leash = {"leash_" + name: "set_point_leash/" + name for name in ("position", "impedance", "load")}
    times = ("velocity_filter_time", "command_timeout", "topic_timeout", "receive_timeout", "start_timeout")
    names = ("position_margin", *times, "stop_timeout", "silent_stop_timeout", "tool_number")
    for name, told in (leash | {name: name for name in names}).items():
        with pytest.raises(ValueError, match=f"{told} = -7"):
            lwr_fri_bridge.Bridge(LIMITS, **{name: -7})


def test_parameters_that_are_words_and_those_that_are_unknown() -> None:
    with pytest.raises(ValueError, match="unknown krl_convention 'orocos'"):
        lwr_fri_bridge.Bridge(LIMITS, krl_convention="orocos")
    with pytest.raises(ValueError, match="unknown event 'jump'"):
        lwr_fri_bridge.Bridge(LIMITS, control_mode="jump")
    with pytest.raises(ValueError, match="unknown parameter 'leash'"):
        lwr_fri_bridge.Bridge(LIMITS, leash=0.1)
    with pytest.raises(Exception, match="t9"):
        lwr_fri_bridge.Bridge(LIMITS, "t9")


class Controller:
    """Our own KRL program in lockstep, as short as it can be."""

    def __init__(self, **parameters: object) -> None:
        self.bridge = lwr_fri_bridge.Bridge(LIMITS, **parameters)
        self.fields: dict[str, object] = {
            "size": 916,
            "id": 0x2006,
            "state": 1,
            "quality": 3,
            "control": 1,
            "power": 0x7F,
            "measurement_period": 0.005,
            "command_period": 0.005,
            "commanded_frame": IDENTITY,
            "commanded_frame_offset": IDENTITY,
        }
        self.counter = self.reflected = self.finished = 0
        self.position = [0.1] * 7
        self.now = 10**9

    def cycle(self) -> dict[str, object]:
        """One cycle; the answer."""
        self.counter += 1
        self.now += 5_000_000
        answer = self.bridge.answer(
            lwr_fri_bridge.encode_measurement(
                self.fields
                | {
                    "counter": self.counter,
                    "reflected": self.reflected,
                    "measured_position": self.position,
                    "commanded_position": self.position,
                    "krl_ints": [self.finished, 1] + [0] * 13 + [4010],
                }
            ),
            self.now,
        )
        command = lwr_fri_bridge.decode_command(answer)
        self.reflected = command["counter"]
        request, strategy, number = command["krl_ints"][:3]
        if self.fields["state"] == 2:
            self.position = command["joint_position"]
        if request in (1, 2) and number != self.finished:
            self.finished = number
            self.fields |= {"state": 2 if request == 1 else 1, "control": strategy // 10}
        return command


def test_a_start_and_a_motion_in_lockstep() -> None:
    cell = Controller()
    cell.cycle()
    before = cell.bridge.snapshot()
    assert before["motion_allowed"] is False and "monitor" in before["reason"]
    assert (before["supervisor"], before["fri_state"]) == ("monitor", "MON")
    ticket = cell.bridge.submit("start")
    assert cell.bridge.outcome(ticket) is None
    for _ in range(4):
        cell.cycle()
    success, message = cell.bridge.outcome(ticket)
    assert success and "POSITION" in message
    state = cell.bridge.snapshot()
    assert state["motion_allowed"] is True and state["reason"] == ""
    assert (state["supervisor"], state["fri_state"], state["quality"]) == ("command", "CMD", "PERFECT")
    assert (state["control_mode"], state["hold_latched"], state["loss"]) == ("POSITION", False, "")
    for _ in range(60):
        cell.bridge.send_velocity([0.2, 0, 0, 0, 0, 0, -0.1], cell.now)
        cell.cycle()
    state = cell.bridge.snapshot()
    assert list(state["commanded_velocity"]) == pytest.approx([0.2, 0, 0, 0, 0, 0, -0.1], abs=1e-9)
    assert cell.position[0] > 0.1 + 0.03 and cell.position[6] < 0.1 - 0.015
    assert state["accepted"] == state["sequence"] == cell.counter
    assert state["stamp_ns"] == cell.now and state["cycle_time"] == pytest.approx(0.005)


def test_lenient_headers_and_the_tool_are_taken() -> None:
    zeros = Controller(lenient_headers=True)
    zeros.fields |= {"size": 0, "id": 0}
    assert zeros.cycle()["size"] == 376
    strict = Controller()
    strict.fields |= {"size": 0, "id": 0}
    data = lwr_fri_bridge.encode_measurement(strict.fields)
    assert strict.bridge.answer(data, strict.now) is None
    assert Controller(krl_convention="rtt_lwr", tool_number=7).cycle()["krl_ints"][2] == 7
    assert Controller(control_mode="joint_impedance").cycle()["flags"] == 0x0035


def test_dictionaries_leave_out_and_refuse() -> None:
    assert lwr_fri_bridge.encode_command({}) == bytes(376) == bytes(lwr_fri_bridge.COMMAND_SIZE)
    assert lwr_fri_bridge.encode_measurement({}) == bytes(916) == bytes(lwr_fri_bridge.MEASUREMENT_SIZE)
    for count in (6, 8):
        with pytest.raises(ValueError, match=rf"^joint_torque: .*\b7\b.*\b{count}$"):
            lwr_fri_bridge.encode_command({"joint_torque": [0.0] * count})
    with pytest.raises(ValueError, match=r"\b376\b.*\b3$"):
        lwr_fri_bridge.decode_command(bytes(3))


def test_limits_have_profiles() -> None:
    full, slow = lwr_fri_bridge.JointLimits(LIMITS), lwr_fri_bridge.JointLimits(LIMITS, "t1")
    assert max(slow.velocity) == pytest.approx(0.24 / 1.04)
    assert min(full.velocity) > 1.0
    assert list(full.upper_position) == list(-full.lower_position)
    assert lwr_fri_bridge.known_events().startswith("start, hold, reset, stop, position")
