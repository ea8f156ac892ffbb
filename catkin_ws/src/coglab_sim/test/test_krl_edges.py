"""What each KRL program answers beyond its plain start and stop: requests that were left over, refused, repeated or
given up, and how long it waits for what."""

import numpy as np
import pytest
from fri_client import COMMAND, JOINT_IMPEDANCE, MONITOR, parse, set_point


def ints(s):
    return parse(s.measurement)["ints"]


def to_bool(s, index):
    return bool(parse(s.measurement)["bools"] >> (index - 1) & 1)


def until(s, condition, limit=20.0, **answers):
    """s until the condition holds of the newest measurement; fails after the limit."""
    begin = s.cell.time
    while s.cell.time - begin < limit:
        s.tick(**answers)
        if s.measurement is not None and condition():
            return s.cell.time - begin
    raise AssertionError(f"not within {limit} s; {ints(s)}, {s.texts()[-3:]}")


# -- our own ------------------------------------------------------------------------------------------------------


def test_coglab_a_request_that_was_left_over_is_none(session):
    """By the run of the program before, which the operator has started anew."""
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


def test_coglab_what_is_so_already_is_done_at_once(session):
    s = session()
    s.command(10)
    states = []
    s.client.ints[0:3] = [1, 10, 77]
    until(s, lambda: states.append(s.cell.fri_state) or ints(s)[0] == 77, 0.2)
    assert ints(s)[1] == 1 and set(states) == {COMMAND}
    s.client.ints[0:3] = [2, 0, 78]
    until(s, lambda: ints(s)[0] == 78, 0.2)
    s.client.ints[0:3] = [2, 0, 79]
    until(s, lambda: ints(s)[0] == 79, 0.2)
    assert ints(s)[1] == 1 and s.cell.fri_state == MONITOR
    s.client.ints[0:3] = [3, 10, 80]
    until(s, lambda: ints(s)[0] == 80, 0.2)
    assert ints(s)[1] == -1


def test_coglab_says_how_a_start_failed_and_waits_no_longer_than_it_says(session):
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


# -- Centro Piaggio -----------------------------------------------------------------------------------------------


def test_centro_epiaggio_a_level_has_to_rise(session):
    s = session(krc__convention="centro_epiaggio")
    s.client.ints[0:2] = [10, 1]
    s.monitor()
    s.run(1.0)
    assert ints(s)[1] == 10 and s.cell.fri_state == MONITOR, "it was up from the beginning"
    s.client.ints[1] = 0
    s.run(0.1)
    s.client.ints[0:2] = [25, 1]
    until(s, lambda: ints(s)[1] == 1, 2.0)
    assert s.cell.fri_state == COMMAND and parse(s.measurement)["control"] == 1, "25 is no strategy: it stays"
    s.cell.leave_command_mode("fault injected")
    until(s, lambda: ints(s)[1] == 0, 0.2)
    s.client.ints[1] = 0
    s.run(0.1)
    s.client.ints[0:2] = [10, 1]
    until(s, lambda: ints(s)[1] == 1, 3.0)
    assert s.cell.fri_state == COMMAND


def test_centro_epiaggio_a_start_can_be_given_up(session):
    s = session(krc__convention="centro_epiaggio", krc__power_up=2.0)
    s.run(0.5)
    s.client.ints[0:2] = [10, 1]
    s.run(1.0)
    s.client.ints[1] = 0
    s.run(3.0)
    assert s.cell.fri_state == MONITOR and ints(s)[1] == 10
    assert parse(s.measurement)["power"] == 0x7F


# -- Stanford -----------------------------------------------------------------------------------------------------


def test_stanford_starts_again_as_long_as_it_is_asked(session):
    s = session(krc__convention="stanford")
    s.monitor()
    s.client.ints[14], s.client.ints[15] = 25, 10
    until(s, lambda: ints(s)[15] == 20, 1.0)
    assert parse(s.measurement)["control"] == 1, "25 is no strategy: it stays"
    s.cell.leave_command_mode("fault injected")
    until(s, lambda: ints(s)[15] == 10, 0.2)
    assert until(s, lambda: ints(s)[15] == 20, 3.0) > 0.8, "drives and brakes first"
    s.client.ints[14], s.client.ints[15] = 30, 20
    until(s, lambda: s.cell.fri_state == MONITOR, 0.2)
    s.client.ints[15] = 10
    s.client.flags = JOINT_IMPEDANCE
    until(s, lambda: ints(s)[15] == 20, 1.0)
    assert parse(s.measurement)["control"] == 3


def test_stanford_a_start_can_be_given_up(session):
    s = session(krc__convention="stanford", krc__power_up=2.0)
    s.run(0.5)
    s.client.ints[14], s.client.ints[15] = 10, 10
    s.run(1.0)
    s.client.ints[15] = 0
    s.run(3.0)
    assert s.cell.fri_state == MONITOR and ints(s)[15] == 10


# -- RCPRG and TUM ------------------------------------------------------------------------------------------------


def rcprg(session):
    s = session(krc__convention="rcprg_tum")
    s.client.flags = JOINT_IMPEDANCE
    s.monitor()
    return s


def ask(s, code):
    """One request with its flag, until it was seen and taken back; then the flag down."""
    s.client.ints[0], s.client.bools = code, 1
    until(s, lambda: to_bool(s, 1), 0.2)
    until(s, lambda: not to_bool(s, 1), 2.0)
    s.client.bools = 0
    s.run(0.1)


def test_rcprg_tum_a_request_is_served_once_until_its_flag_is_down(session):
    s = rcprg(session)
    s.client.ints[0], s.client.bools = 7, 1
    s.run(0.5)
    assert s.texts() == ["fri_start: unknown request 7"] and not to_bool(s, 1)
    s.client.ints[0] = 1
    s.run(0.5)
    assert s.cell.fri_state == MONITOR, "the flag is still up"
    s.client.bools = 0
    s.run(0.1)
    s.client.ints[0], s.client.bools = 1, 1
    until(s, lambda: s.cell.fri_state == COMMAND, 1.0)


def test_rcprg_tum_acknowledges_and_moves_a_little_on_request(session):
    s = rcprg(session)
    s.cell.leave_command_mode("fault injected")
    s.run(2.0)
    assert parse(s.measurement)["power"] == 0
    s.client.ints[0], s.client.bools = 10, 1
    s.run(0.3)
    s.client.bools = 0
    until(s, lambda: parse(s.measurement)["power"] == 0x7F, 1.0)
    assert s.texts() == ["fault injected", "messages acknowledged"]
    ask(s, 1)
    assert s.cell.fri_state == COMMAND
    s.client.ints[0], s.client.bools = 1, 1
    s.run(0.3)
    assert s.cell.fri_state == COMMAND and not to_bool(s, 1)


# -- rtt_lwr ------------------------------------------------------------------------------------------------------


def test_rtt_lwr_a_start_has_to_be_taken_back_before_the_next(session):
    s = session(krc__convention="rtt_lwr")
    s.client.ints[0:3] = [1, 10, 5]
    s.monitor()
    s.run(0.5)
    assert s.cell.fri_state == MONITOR and ints(s)[2] == 5, "it was up from the beginning"
    s.client.ints[0] = 0
    s.run(0.1)
    s.client.flags = JOINT_IMPEDANCE
    s.client.ints[0:2] = [1, 30]
    until(s, lambda: ints(s)[0] == COMMAND, 1.0)
    assert parse(s.measurement)["control"] == 3
    s.cell.leave_command_mode("fault injected")
    s.run(2.0)
    assert s.cell.fri_state == MONITOR and ints(s)[0] == MONITOR
    s.client.ints[0] = 2
    s.run(0.1)
    s.client.ints[0] = 1
    until(s, lambda: ints(s)[0] == COMMAND, 2.0)
    s.client.ints[0] = 3
    s.run(0.2)
    assert s.cell.fri_state == 0
    s.client.ints[0] = 1
    s.run(2.0)
    assert s.cell.fri_state == 0, "the program has ended"


def test_rtt_lwr_a_start_can_be_given_up(session):
    s = session(krc__convention="rtt_lwr", krc__power_up=2.0)
    s.run(0.5)
    s.client.ints[0:2] = [1, 10]
    s.run(1.0)
    s.client.ints[0] = 0
    s.run(3.0)
    assert s.cell.fri_state == MONITOR and parse(s.measurement)["power"] == 0x7F


# -- OpenKC -------------------------------------------------------------------------------------------------------


def openkc(session, **parameters):
    s = session(krc__convention="openkc", **parameters)
    s.monitor()
    return s


def command(s, code, acknowledged=True):
    """One command of OpenKC; the count, its echo and its result."""
    s.client.ints[15], s.client.bools = code, 1
    if acknowledged:
        until(s, lambda: to_bool(s, 1), 2.0)
    else:
        s.run(0.3)
    told = ints(s)[13:16]
    s.client.ints[15], s.client.bools = 0, 0
    until(s, lambda: not to_bool(s, 1), 0.3)
    return told


def test_openkc_a_command_is_served_once_until_its_flag_is_down(session):
    s = openkc(session)
    assert command(s, 1) == (1, 1, 100) and s.cell.fri_state == COMMAND
    assert command(s, 1) == (2, 1, 100), "in command mode already"
    s.client.ints[15], s.client.bools = 9, 1
    s.run(0.3)
    assert ints(s)[13] == 2 and s.texts() == ["$STIFFNESS.STRATEGY cannot change in command mode"]
    s.client.bools = 0
    s.run(0.1)
    s.client.ints[15], s.client.bools = 2, 1
    s.run(0.2)
    assert ints(s)[13:16] == (3, 2, 101) and s.cell.fri_state == MONITOR
    s.client.ints[15] = 9
    s.run(0.2)
    assert ints(s)[13:16] == (3, 2, 101), "the flag is still up"
    s.client.ints[15], s.client.bools = 0, 0
    s.run(0.1)
    assert command(s, 6)[2] == 104 and command(s, 7)[2] == 105 and command(s, 9)[2] == 107


def test_openkc_sets_a_strategy_without_an_echo_and_refuses_an_unknown_one(session):
    s = openkc(session)
    s.client.ints[1] = 20
    assert command(s, 30) == (0, 0, 0) and parse(s.measurement)["control"] == 2
    s.client.ints[1] = 25
    s.client.ints[15], s.client.bools = 30, 1
    s.run(0.3)
    assert not to_bool(s, 1) and parse(s.measurement)["control"] == 2
    assert s.texts() == ["$STIFFNESS.STRATEGY 25 unknown, expected 10, 20 or 30"]


def test_openkc_opens_again_and_ends(session):
    s = openkc(session)
    assert parse(s.measurement)["quality"] == 3
    s.client.ints[15], s.client.bools = 98, 1
    until(s, lambda: parse(s.measurement)["quality"] == 0, 0.2)
    s.run(1.0)
    assert parse(s.measurement)["quality"] == 3 and s.cell.fri_state == MONITOR, "served once"
    s.client.bools = 0
    s.run(0.1)
    s.client.ints[15], s.client.bools = 99, 1
    s.run(0.2)
    assert s.cell.fri_state == 0
    s.client.bools = 0
    s.run(0.1)
    s.client.ints[15], s.client.bools = 98, 1
    s.run(1.0)
    assert s.cell.fri_state == 0, "the program has ended"


def test_openkc_a_start_that_fails_is_not_acknowledged(session):
    s = openkc(session, krc__krl_drive_wait=0.3)
    s.cell.drive_error(1)
    s.client.ints[15], s.client.bools = 1, 1
    s.run(1.5)
    assert ints(s)[13:16] == (0, 0, 0) and not to_bool(s, 1) and s.cell.fri_state == MONITOR


# -- KUKA's sample ------------------------------------------------------------------------------------------------


def test_kuka_sample_counts_its_looks_and_runs_once(session):
    s = session(krc__convention="kuka_sample")
    s.monitor()
    before = parse(s.measurement)["reals"][1]
    fields = s.run(5.0)
    # A look each 50 ms, as far as periods of 5 ms and sums of them hit it.
    assert 88 <= fields["reals"][1] - before <= 101 and fields["ints"][0] == 0
    s.client.ints[0] = 10
    until(s, lambda: s.cell.fri_state == COMMAND, 1.0)
    assert ints(s)[0] == 0
    s.cell.leave_command_mode("end of the sample")
    until(s, lambda: ints(s)[0] == -1, 0.2)
    s.run(3.0)
    assert s.cell.fri_state == MONITOR, "one run"
    slow = session(krc__convention="kuka_sample", krc__krl_poll=0.5)
    slow.monitor()
    before = parse(slow.measurement)["reals"][1]
    assert 9 <= slow.run(5.0)["reals"][1] - before <= 10
