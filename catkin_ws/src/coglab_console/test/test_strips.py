"""The strip charts show the sent data: values, planned speed, limit, order of the fingers, phases, one axis. Series of
a strip differ by more than colour. In a real browser with a double of the robot."""

import time
from pathlib import Path

import pytest
from page_double import Desk, needs_browser

pytestmark = [
    needs_browser,
    pytest.mark.skipif(
        not Path("/usr/share/javascript/dygraphs").is_dir(), reason="libjs-dygraphs is missing: ./coglab install run"
    ),
]
SENT = {
    "rate": [0.01, -0.02, 0.9, 0.04, 0.9, 0.9, 0.9],
    "threshold": [0.5, 0.4, 0.1, 0.45, 0.2, 0.7, 0.7],
    "watched": [True, True, False, True, False, False, False],
    "speed": 0.12,
    "fri": 0.7,
    "answer": 0.2,
    "current": [10, 20, 30, 40, 50],
}
NAMES = ["Speed, m/s", "Torque change, Nm", "FRI, ms", "Finger current, counts"]
# Motor 0 swings the thumb out (abduction), motor 1 bends it; the joints are A1, A2 and A3, without E1 between them.
SHOWN = [[0.12, 0.0], [0.01, 0.02, 0.04, 0.4], [0.7, 0.2], [20, 10, 30, 40, 50]]
NEWEST = "return coglab.strips().map((strip) => strip.rows.at(-1).slice(1))"


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    found = Desk(tmp_path_factory.mktemp("console"), {"charts": True})
    found.browser.until("return coglab.strips().every((strip) => strip.axis)", 60.0)
    yield found
    found.close()


def until_shown(desk, wanted):
    script = f"const found = JSON.stringify(({NEWEST.replace('return', '')})); return found === arguments[0] && found"
    desk.browser.until(script, 60.0, desk.browser.js("return JSON.stringify(arguments[0])", wanted))


def path_that_began(ago):
    """0.1 m/s for 30 s, then 0.3 m/s for 30 s."""
    return {"kind": "running", "motion": "m", "stamp": time.monotonic() - ago, "goal": [3, 9, 0],
            "points": [[0, 0, 0], [3, 0, 0], [3, 9, 0]], "times": [0.0, 30.0, 60.0]}  # fmt: skip


def test_each_value_is_the_one_that_was_sent(desk):
    desk.state = SENT
    until_shown(desk, SHOWN)
    assert desk.browser.js("return coglab.strips().map((strip) => strip.name)") == NAMES
    # The limit is that of the joints that count; one that is not watched limits nothing.
    desk.state = {**SENT, "watched": [False] * 4 + [True, True, False]}
    until_shown(desk, [SHOWN[0], [0.01, 0.02, 0.04, 0.2], *SHOWN[2:]])
    # Unknown values are not shown as zero.
    desk.state = {**SENT, "rate": [], "threshold": [], "watched": [], "fri": None, "answer": None, "current": []}
    until_shown(desk, [SHOWN[0], [None] * 4, [None] * 2, [None] * 5])
    desk.state = {}


@pytest.mark.parametrize("ago, speed", [(1.0, 0.1), (40.0, 0.3), (90.0, 0.0)])
def test_the_planned_speed_is_that_of_the_path_now(desk, ago, speed):
    desk.state = SENT
    desk.put(path=path_that_began(ago))
    until_shown(desk, [[0.12, speed], *SHOWN[1:]])
    desk.put(path={**path_that_began(ago), "kind": "ahead"})
    until_shown(desk, SHOWN)
    desk.state = {}


def test_every_shown_sample_has_its_own_stamp(desk):
    newest = "return coglab.strips()[0].rows.at(-1)[1] === arguments[0]"
    desk.state = {"speed": 0.5}
    desk.browser.until(newest, 60.0, 0.5)
    began = time.monotonic()
    for number in range(5):
        desk.state = {"speed": round(0.01 * number, 2)}
        desk.browser.until(newest, 60.0, round(0.01 * number, 2))
    rows = desk.browser.js("return coglab.strips()[0].rows")
    stamps = [row[0] for row in rows]
    assert stamps == sorted(set(stamps)) and stamps[-1] - stamps[0] <= 23.0
    steps = [row[1] for row in rows if row[0] > began and row[1] != 0.5]
    assert list(dict.fromkeys(steps)) == [round(0.01 * number, 2) for number in range(5)]
    desk.state = {}


def test_bars_are_the_phases_and_lie_on_the_axis_of_the_charts(desk):
    page = desk.browser
    began, shown = {}, {}
    for words in ("reaches", "closes the hand", "goes home"):
        began[words] = time.monotonic()
        desk.state = {"words": words}
        page.until("return coglab.bars().at(-1).label === arguments[0]", 60.0, words)
        shown[words] = time.monotonic()
        time.sleep(0.5)
    time.sleep(0.5)
    both = "return [coglab.bars(), coglab.strips().map(({ axis, edges }) => [...axis, ...edges])]"
    bars, strips = page.js(both)
    assert [bar["label"] for bar in bars][-3:] == list(began)
    assert all(began[bar["label"]] <= bar["from"] <= shown[bar["label"]] for bar in bars[-3:])
    # One time axis: 20 s up to the newest state, from the same left edge to the same right edge.
    assert all(abs(a - b) < 0.01 for strip in strips for a, b in zip(strip[:2], strips[0][:2], strict=True)), strips
    assert all(abs(a - b) <= 2.0 for strip in strips for a, b in zip(strip[2:], strips[0][2:], strict=True)), strips
    low, high, left, right = strips[0]
    assert abs(high - low - 20.0) < 0.01
    for bar, after in zip(bars[-3:], [*bars[-2:], None], strict=True):
        assert abs(bar["left"] - (left + (bar["from"] - low) / 20.0 * (right - left))) < 4.0
        assert after is None or abs(bar["right"] - after["left"]) < 1.0
    desk.state = {}


def test_series_of_a_strip_differ_by_more_than_colour(desk):
    page = desk.browser
    strips = page.js("return coglab.strips().map(({ series, drawn }) => [series, drawn])")
    legend = page.js(
        "return [...document.querySelectorAll('#charts .strip')].slice(1).map((strip) =>"
        " [...strip.querySelectorAll('.name i')].map((one) => { const line = one.querySelector('line');"
        " return [one.textContent, line.getAttribute('stroke-dasharray'), line.getAttribute('stroke')]; }))"
    )
    for (series, drawn), names in zip(strips, legend, strict=True):
        dashes = [dash and " ".join(map(str, dash)) for dash, _ in drawn]
        assert len(set(dashes)) == len(series), (series, dashes)
        assert names == [[name, dash, colour] for name, dash, (_, colour) in zip(series, dashes, drawn, strict=True)]
