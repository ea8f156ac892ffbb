"""What the controller counts and tells of answers: rates, round trips, misses, refused datagrams, qualities."""

import numpy as np
import pytest
from fri_client import COMMAND, MONITOR, parse


def period(s, latency=None):
    """One period whose answer takes so long (s); None: no answer."""
    if latency is not None and s.measurement is not None:
        s.cell.receive(s.client.answer(s.measurement), latency)
    s.measurement = s.cell.step(None)
    return parse(s.measurement)


def test_round_trips_are_means_over_the_answered_ones(session):
    s = session()
    period(s)
    assert period(s, 0.004)["latency"] == pytest.approx(0.004)
    assert parse(s.measurement)["jitter"] == 0.0, "of one answer there is none"
    fields = period(s, 0.001)
    assert fields["latency"] == pytest.approx(0.0025) and fields["jitter"] == pytest.approx(0.003)
    period(s)
    fields = period(s, 0.003)
    assert fields["latency"] == pytest.approx(0.008 / 3) and fields["jitter"] == pytest.approx(0.0025)
    assert fields["answer_rate"] == pytest.approx(0.03) and fields["miss_rate"] == pytest.approx(0.97)


def test_the_window_is_the_last_hundred_packets(session):
    s = session()
    period(s)
    for _ in range(100):
        fields = period(s, 0.002)
    assert fields["answer_rate"] == 1.0 and fields["latency"] == pytest.approx(0.002)
    before = fields["miss_counter"]
    for missed in range(1, 11):
        fields = period(s)
        assert fields["answer_rate"] == pytest.approx(1.0 - missed / 100)
        assert fields["miss_counter"] == before + missed
    for _ in range(90):
        fields = period(s, 0.004)
    assert fields["answer_rate"] == pytest.approx(0.90) and fields["latency"] == pytest.approx(0.004)
    fields = period(s, 0.004)
    assert fields["answer_rate"] == pytest.approx(0.91) and fields["miss_counter"] == before + 10


@pytest.mark.parametrize("missing, quality", [(1, 3), (2, 2), (5, 2), (6, 1), (20, 1), (21, 0)])
def test_qualities_by_the_share_that_is_answered(session, missing, quality):
    s = session()
    period(s)
    for _ in range(100):
        period(s, 0.0)
    for _ in range(missing):
        fields = period(s)
    assert fields["quality"] == quality and s.cell.quality == quality


def test_what_is_no_answer_is_counted_by_its_reason(session):
    s = session()
    for _ in range(3):
        s.tick()
    counted = {"wrong_size": 0, "wrong_header": 0, "stale": 0, "repeated": 0}
    assert s.cell.rejections == counted

    def refused(data, reason):
        s.cell.receive(bytes(data))
        counted[reason] += 1
        assert s.cell.rejections == counted

    good = bytearray(s.client.answer(s.measurement))
    refused(good[:375], "wrong_size")
    refused(good + b"\0", "wrong_size")
    refused(good[:4] + bytes([0x77, 0x01]) + good[6:], "wrong_header")
    refused(good[:6] + bytes([0x06]) + good[7:], "wrong_header")
    refused(good[:2] + bytes([good[2] ^ 1]) + good[3:], "stale")
    s.cell.receive(bytes(good))
    assert s.cell.rejections == counted
    refused(good, "repeated")
    refused(s.client.answer(s.measurement), "repeated")
    s.measurement = s.cell.step(None)
    s.client.counter -= 1
    again = bytearray(s.client.answer(s.measurement))
    refused(good, "stale")
    again[0:2] = (s.client.counter - 1).to_bytes(2, "little")
    refused(again, "repeated")
    early = session()
    early.cell.receive(bytes(good))
    assert early.cell.rejections["stale"] == 1, "nothing was asked yet"


@pytest.mark.parametrize("every, entry_quality, starts", [(25, 2, True), (25, 3, False), (13, 2, False), (13, 1, True)])
def test_a_start_needs_the_entry_quality(session, every, entry_quality, starts):
    """4 % missing is OK, nearly 8 % is BAD; the program of Stanford does not wait for a quality by itself."""
    s = session(krc__convention="stanford", krc__entry_quality=entry_quality)
    for packet in range(300):
        s.tick(answer=packet % every != 0)
    s.client.ints[14], s.client.ints[15] = 10, 10
    for packet in range(400):
        fields = s.tick(answer=packet % every != 0)
        if fields["state"] == COMMAND:
            break
    assert (fields["state"] == COMMAND) is starts and fields["quality"] == (2 if every == 25 else 1)
    told = [text for text in s.texts() if text.startswith("friStart: quality too low, answer rate 0.9")]
    assert bool(told) is not starts


def test_too_many_losses_end_command_mode_by_their_number_or_by_the_quality(session):
    s = session()
    s.command()
    for _ in range(5):
        assert s.tick(answer=False)["state"] == COMMAND
    s.tick()
    for _ in range(5):
        assert s.tick(answer=False)["state"] == COMMAND, "an answer in between begins the count anew"
    s.tick(answer=False)
    assert s.texts() == ["FRI timing: 6 successive answers missing"]
    patient = session(krc__extrapolated_packets=100)
    patient.command()
    lost = 0
    while patient.tick(answer=False)["state"] == COMMAND:
        lost += 1
    # The answer to the measurement of before counts in the period after it.
    assert lost == 20 and patient.texts() == ["FRI quality unacceptable"]


def test_none_is_bridged_where_none_may_be(session):
    s = session(krc__extrapolated_packets=0)
    s.command()
    assert s.tick(answer=False)["state"] == MONITOR
    assert s.texts() == ["FRI timing: 1 successive answers missing"]


def test_drives_come_after_power_and_brakes(session):
    for parameters, seconds in (({}, 0.8), ({"krc__power_up": 0.2, "krc__brake_release": 0.1}, 0.3)):
        s = session(**parameters)
        while s.tick() is None or parse(s.measurement)["power"] == 0:
            assert s.cell.time < 2.0
        assert s.cell.time == pytest.approx(seconds, abs=2.1 * s.cell.period)


def test_silence_lasts_as_long_as_it_was_asked_for(session):
    s = session()
    s.monitor()
    s.cell.silence(0.1)
    silent = 0
    while s.tick() is None:
        silent += 1
    assert silent == pytest.approx(20, abs=1)


def test_drives_warm_up_with_the_square_of_their_load(session):
    s = session(krc__drive_heating_time=1.0)
    first = s.tick() or s.tick()
    assert first["temperature"] == pytest.approx([25.0] * 7, abs=0.05) and first["warning"] == 0
    s.monitor()
    fields = s.run(6.0)
    limits = np.array([176.0, 176.0, 100.0, 100.0, 100.0, 38.0, 38.0])
    expected = 25.0 + 20.0 * (np.array(fields["gravity"]) / limits) ** 2
    assert fields["temperature"] == pytest.approx(expected, abs=0.05) and max(expected) > 25.3
    warm = int(np.argmax(expected))
    between = (np.sort(expected)[-1] + np.sort(expected)[-2]) / 2
    s = session(krc__drive_heating_time=1.0, krc__drive_warning=float(between))
    s.monitor()
    assert s.run(6.0)["warning"] == 1 << warm


def test_a_drive_takes_its_time_to_get_warm(session):
    s = session(krc__drive_heating_time=10.0)
    s.monitor()
    begin = np.array(s.tick()["temperature"]) - 25.0
    later = np.array(s.run(4.0)["temperature"]) - 25.0
    limits = np.array([176.0, 176.0, 100.0, 100.0, 100.0, 38.0, 38.0])
    final = 20.0 * (np.array(parse(s.measurement)["gravity"]) / limits) ** 2
    joint = int(np.argmax(final))
    expected = final[joint] - (final[joint] - begin[joint]) * np.exp(-0.4)
    assert later[joint] == pytest.approx(expected, rel=0.03)
