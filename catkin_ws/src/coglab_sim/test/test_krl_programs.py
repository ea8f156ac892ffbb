"""The KRL programs: each convention with exactly the requests of its own PC stack (table of exchange arrays)."""

import numpy as np
import pytest
from fri_client import COMMAND, JOINT_IMPEDANCE, JOINT_POSITION, MONITOR, parse, set_point


def ints(s):
    return parse(s.measurement)["ints"]


def test_coglab_numbers_requests_and_results(session):
    s = session()
    s.monitor()
    assert ints(s)[15] == 4010
    s.client.ints[0:3] = [1, 10, 41]
    s.run(1.0)
    assert ints(s)[0:3] == (41, 1, 0) and s.cell.fri_state == COMMAND
    s.client.ints[0:3] = [7, 10, 42]
    s.run(0.2)
    assert ints(s)[0:2] == (42, -1) and s.cell.fri_state == COMMAND
    s.client.ints[0:3] = [2, 0, 43]
    s.run(0.2)
    assert ints(s)[0:2] == (43, 1) and s.cell.fri_state == MONITOR
    s.client.ints[0:3] = [1, 25, 44]
    s.run(0.2)
    assert ints(s)[0:2] == (44, -1)


def test_coglab_changes_strategy_by_leaving_command_mode(session):
    s = session()
    s.command(10)
    s.client.ints[0:3] = [1, 30, s.client.ints[2] + 1]
    states = []
    for _ in range(300):
        fields = s.tick(
            flags=JOINT_POSITION if s.cell.fri_state == COMMAND and not states.count(MONITOR) else JOINT_IMPEDANCE
        )
        states.append(fields["state"])
    assert MONITOR in states and states[-1] == COMMAND and fields["control"] == 3


def test_client_that_waits_for_each_datagram_receives_the_end(session):
    """A common client: receive, answer, look whether the program has closed. It hangs where no datagram comes."""
    s = session(krc__convention="stanford")
    s.monitor()
    s.client.ints[14], s.client.ints[15] = 10, 20
    measurement, asked = s.measurement, False
    for _ in range(400):
        assert measurement is not None, "the client hangs in its receive"
        fields = parse(measurement)
        if fields["ints"][15] == 30:
            break
        if not asked:
            s.client.ints[15], asked = fields["ints"][14], True
        measurement = s.cell.step(s.client.answer(measurement))
    assert fields["ints"][15] == 30


@pytest.mark.parametrize(
    "convention", ["coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc", "kuka_sample"]
)
def test_nothing_starts_without_a_request(session, convention):
    s = session(krc__convention=convention)
    s.run(5.0)
    assert s.cell.fri_state == MONITOR


def until(s, condition, limit=20.0, **answers):
    """s until the condition holds of the newest measurement; fails after the limit."""
    begin = s.cell.time
    while s.cell.time - begin < limit:
        s.tick(**answers)
        if s.measurement is not None and condition():
            return s.cell.time - begin
    raise AssertionError(f"not within {limit} s; {ints(s)}, {s.texts()[-3:]}")


def test_coglab_request_of_an_earlier_run_is_ignored(session):
    """The request belongs to the run before the operator restarted the program."""
    s = session()
    s.monitor()
    s.client.ints[0:3] = [1, 10, 9]
    until(s, lambda: ints(s)[0] == 9, 1.0)
    assert s.cell.fri_state == COMMAND
    s.cell.restart_program(0.005, 0.0)
    s.run(2.0)
    assert ints(s)[0:3] == (9, 0, 0) and ints(s)[15] == 4010 and s.cell.fri_state == MONITOR
    s.client.ints[2] = -3
    s.run(0.3)
    assert ints(s)[0:3] == (9, 0, 0), "a number is above 0"
    s.client.ints[2] = 10
    until(s, lambda: ints(s)[2] == 10, 0.2)  # it works on this one
    until(s, lambda: ints(s)[0] == 10, 1.0)
    assert ints(s)[1:3] == (1, 0) and s.cell.fri_state == COMMAND


def test_coglab_reports_failed_start_within_its_time_limit(session):
    s = session(krc__krl_drive_wait=1.0, krc__krl_quality_wait=2.0)
    s.monitor()
    s.cell.drive_error(2)
    s.client.ints[0:3] = [1, 10, 5]
    assert until(s, lambda: ints(s)[0] == 5) == pytest.approx(1.1, abs=0.12) and ints(s)[1] == -4
    s.cell.drive_error(2, False)
    s.client.ints[2] = 6
    until(s, lambda: ints(s)[0] == 6)
    assert ints(s)[1] == 1, "acknowledged by the program, and started"
    s.client.ints[0:3] = [2, 0, 7]
    until(s, lambda: ints(s)[0] == 7)
    for packet in range(120):
        s.tick(answer=packet % 20 != 0)
    s.client.ints[0:3] = [1, 10, 8]
    begin, packet = s.cell.time, 0
    while ints(s)[0] != 8:
        s.tick(answer=packet % 20 != 7)
        packet += 1
    assert ints(s)[1] == -2 and s.cell.time - begin == pytest.approx(2.1, abs=0.12)
    s.run(1.0)
    wrong = np.array(set_point(parse(s.measurement))) + 0.01
    s.client.ints[2] = 9
    until(s, lambda: ints(s)[0] == 9, position=wrong)
    assert ints(s)[1] == -3


@pytest.mark.parametrize(
    "convention, start, taken_back",
    [
        ("centro_epiaggio", {0: 10, 1: 1}, {1: 0}),
        ("stanford", {14: 10, 15: 10}, {15: 0}),
        ("rtt_lwr", {0: 1, 1: 10}, {0: 0}),
    ],
)
def test_a_start_can_be_given_up(session, convention, start, taken_back):
    s = session(krc__convention=convention, krc__power_up=2.0)
    s.run(0.5)
    for values, seconds in ((start, 1.0), (taken_back, 3.0)):
        for index, value in values.items():
            s.client.ints[index] = value
        s.run(seconds)
    assert s.cell.fri_state == MONITOR and parse(s.measurement)["power"] == 0x7F
