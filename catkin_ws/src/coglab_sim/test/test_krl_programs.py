"""The KRL programs: each convention asked exactly as its own PC stack asks (table of exchange arrays)."""

import pytest
from fri_client import COMMAND, JOINT_IMPEDANCE, JOINT_POSITION, MONITOR, parse


def ints(s):
    return parse(s.measurement)["ints"]


def to_bool(s, index):
    return bool(parse(s.measurement)["bools"] >> (index - 1) & 1)


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


def test_coglab_says_poor_quality(session):
    s = session()
    s.monitor()
    for packet in range(30000):  # every tenth answer is missing: never PERFECT
        if packet == 100:
            s.client.ints[0:3] = [1, 10, 5]
        s.tick(answer=packet % 10 != 4)
        if ints(s)[0] == 5:
            break
    assert ints(s)[0:2] == (5, -2) and s.cell.fri_state == MONITOR


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


def test_centro_epiaggio(session):
    s = session(krc__convention="centro_epiaggio")
    s.monitor()
    assert ints(s)[1] == 10
    s.client.ints[0:2] = [30, 1]
    s.client.flags = JOINT_IMPEDANCE
    s.run(1.5)
    assert ints(s)[1] == 1 and s.cell.fri_state == COMMAND and parse(s.measurement)["control"] == 3
    s.client.ints[1] = 0
    s.run(0.5)
    assert ints(s)[1] == 0 and s.cell.fri_state == MONITOR
    s.client.ints[1] = 1
    s.run(1.5)
    s.cell.leave_command_mode("fault injected")
    s.run(3.0)
    assert s.cell.fri_state == MONITOR  # a level left standing does not start the robot again


def test_stanford(session):
    s = session(krc__convention="stanford")
    s.monitor()
    assert ints(s)[15] == 10 and ints(s)[14] == 30
    s.client.ints[14], s.client.ints[15] = 10, 10
    s.run(1.0)
    assert ints(s)[15] == 20 and s.cell.fri_state == COMMAND
    s.client.ints[15] = 20
    s.run(0.5)
    assert ints(s)[15] == 10 and s.cell.fri_state == MONITOR
    s.client.ints[15] = 30  # equals TO_INT[15]: close and end
    fields = s.run(0.5)
    assert s.cell.fri_state == 0
    assert fields["state"] == MONITOR and fields["ints"][15] == 30  # told after the close, and OFF never
    assert s.run(1.5) is None


def test_a_client_that_waits_for_each_datagram_hears_the_end(session):
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


def test_how_long_it_sends_after_the_close_is_a_parameter(session):
    for linger in (0.0, 0.3):
        s = session(krc__convention="rtt_lwr", krc__close_linger=linger)
        s.monitor()
        s.client.ints[0] = 3
        while s.cell.fri_state != 0:
            s.tick()
        sent = 0
        while s.tick() is not None:
            sent += 1
        assert sent * s.cell.period == pytest.approx(linger, abs=2 * s.cell.period)


def openkc(s, command):
    """One command as OpenKC's client gives it: flag and code until it is acknowledged, then the flag back."""
    s.client.ints[15], s.client.bools = command, 1
    for _ in range(400):
        s.tick()
        if to_bool(s, 1):
            break
    told = ints(s)[13:16]
    s.client.ints[15], s.client.bools = 0, 0
    for _ in range(100):
        s.tick()
        if not to_bool(s, 1):
            return told
    raise AssertionError("the flag stays")


def test_openkc(session):
    s = session(krc__convention="openkc")
    s.monitor()
    s.client.flags = JOINT_IMPEDANCE
    assert openkc(s, 7) == (1, 7, 105) and parse(s.measurement)["control"] == 3
    s.client.ints[8:15], s.client.reals[9:16] = [300] * 7, [0.5] * 7
    assert openkc(s, 5) == (2, 5, 103)
    assert openkc(s, 1) == (3, 1, 100) and s.cell.fri_state == COMMAND
    s.run(0.3)
    assert openkc(s, 2) == (4, 2, 101) and s.cell.fri_state == MONITOR
    assert openkc(s, 9) == (5, 9, 107) and parse(s.measurement)["control"] == 1
    assert openkc(s, 6) == (6, 6, 104) and parse(s.measurement)["control"] == 2
    assert openkc(s, 3) == (0, 3, 111)  # the count begins anew
    s.client.ints[1] = 30
    openkc(s, 30)
    assert parse(s.measurement)["control"] == 3
    s.client.ints[15], s.client.bools = 10, 1
    s.run(0.3)
    assert not to_bool(s, 1) and any("command 10" in text for text in s.texts())  # said, and not acknowledged
    s.client.ints[15], s.client.bools = 0, 0
    s.run(0.2)
    s.client.ints[15], s.client.bools = 99, 1
    s.run(0.3)
    assert s.cell.fri_state == 0


def test_rcprg_tum(session):
    s = session(krc__convention="rcprg_tum")
    s.monitor()
    assert parse(s.measurement)["control"] == 3
    s.client.flags = JOINT_IMPEDANCE
    s.client.ints[0], s.client.bools = 1, 1
    busy = []
    for _ in range(200):
        s.tick()
        busy.append(to_bool(s, 1))
    assert any(busy) and not busy[-1] and s.cell.fri_state == COMMAND
    s.client.bools = 0
    s.run(0.2)
    s.client.ints[0], s.client.bools = 2, 1
    s.run(0.5)
    assert s.cell.fri_state == MONITOR


def test_rtt_lwr(session):
    s = session(krc__convention="rtt_lwr")
    s.monitor()
    assert ints(s)[0] == MONITOR
    s.client.ints[0:3] = [1, 10, 7]
    s.run(1.0)
    assert ints(s)[0] == COMMAND and ints(s)[2] == 7 and s.cell.fri_state == COMMAND
    assert parse(s.measurement)["reals"][:6] == (0.0,) * 6
    s.client.ints[0] = 2
    s.run(0.5)
    assert ints(s)[0] == MONITOR
    s.client.ints[0] = 3
    s.run(0.5)
    assert s.cell.fri_state == 0


def test_kuka_sample(session):
    s = session(krc__convention="kuka_sample")
    s.client.ints[0] = 1
    s.monitor()
    first = parse(s.measurement)["reals"][1]
    s.run(0.5)
    assert parse(s.measurement)["reals"][1] > first
    assert s.cell.fri_state == MONITOR
    s.client.ints[0] = 10
    s.run(1.0)
    assert s.cell.fri_state == COMMAND
    s.cell.leave_command_mode("end of the sample")
    s.run(0.5)
    assert ints(s)[0] == -1


@pytest.mark.parametrize(
    "convention", ["coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc", "kuka_sample"]
)
def test_nothing_starts_unasked(session, convention):
    s = session(krc__convention=convention)
    s.run(5.0)
    assert s.cell.fri_state == MONITOR
