"""Every control of every page shows why it is disabled, also to observers. Risky commands need a held button. Silent
sources are shown. In a real browser with a double of the robot."""

import time
from dataclasses import replace

import pytest
from coglab_console.desk.words import BUTTONS
from page_browser import PageBrowser
from page_check import PAGES, look
from page_double import STATUS, Desk, needs_browser

pytestmark = needs_browser
FEEDBACK = {
    "profile": "p",
    "rows": [
        {"name": name, "type": "t", "stage": "task", "enabled": True, "paused": False, "safety": False, "activity": "x",
         "waiting": "", "reasons": [], "fault": "", "faults": 0, "overruns": 0}
        for name in ("yield", "limit")
    ],
}  # fmt: skip
# Every button that sends an operator's command, and the text below it.
DISABLED = """
return [...document.querySelectorAll('[aria-disabled=true]')].filter((one) => one.getClientRects().length)
  .map((one) => [one.getAttribute('aria-label') || one.labels?.[0]?.innerText || one.innerText,
    document.getElementById(one.getAttribute('aria-describedby'))?.innerText ?? '']);
"""
OPERATORS = {
    "Live": {
        "1 Initialise",
        "2 Calibrate hand",
        "3 Home",
        "4 Receive",
        "5 Give",
        "6 Take",
        "7 Put",
        "8 Go on",
        "Object",
    },
    "Experiment": {"Begin the session"},
    "Contact": {"Learn again at rest", "Watch for contact", "Off"},
    "Objects": {"Read the files again"},
    "Feedback": {"disable yield", "pause yield", "yield later", "limit earlier"},
    "Health": {"Complete calibration", "Forced calibration"},
    "Help": {"A link for one more browser"},
}


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A crowded computer makes gaps between the messages of a held button; gaps have tests of their own."""
    monkeypatch.setattr("coglab_console.desk.motion_guard.LONGEST_GAP", 5.0)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    found = Desk(tmp_path_factory.mktemp("console"))
    for name, value in (("feedback", FEEDBACK), ("status", STATUS)):
        found.loop.call_soon_threadsafe(found.console.documents.put, name, value)
    yield found
    found.close()


def soon(condition, limit=60.0, what=lambda: "not in time"):
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, what()
        time.sleep(0.02)


def words_of(label):
    return " ".join(label.split())


def test_every_control_shows_observers_who_operates(desk):
    with PageBrowser() as other:
        other.open(desk.console.link())
        other.until("return document.getElementById('role').innerText.includes('you watch')", 60.0)
        for page in PAGES:
            other.tab(page)
            wanted, found = OPERATORS["Live"] | OPERATORS.get(page, set()), {}

            def shown(wanted=wanted, found=found):
                found.clear()
                found.update({words_of(name): why for name, why in other.js(DISABLED)})
                return wanted <= {name.removesuffix(" (default) ▾") for name in found} and all(
                    "browser 1" in why for why in found.values()
                )

            soon(shown, what=lambda page=page, found=found: (page, found))
            assert look(other)[0] == [], page


def test_observers_see_cause_of_stop_and_why_they_cannot_acknowledge(desk):
    with PageBrowser() as other:
        other.open(desk.console.link())
        desk.loop.call_soon_threadsafe(desk.console.desk.guard.stop, "the arm is blocked")
        other.until("return document.getElementById('stop-cause').innerText.includes('the arm is blocked')", 60.0)
        other.until(
            "return document.getElementById('why-acknowledge').innerText.startsWith('browser 1 operates')", 60.0
        )
        assert other.js("return document.getElementById('acknowledge').getAttribute('aria-disabled')") == "true"
        assert look(other)[0] == []
        other.js("document.getElementById('acknowledge').click()")
        other.until("return document.getElementById('refusal').innerText.includes('browser 1')", 60.0)
    assert desk.console.desk.guard.unacknowledged
    desk.browser.until("return !document.getElementById('acknowledge').hasAttribute('aria-disabled')", 60.0)
    desk.browser.js("document.getElementById('acknowledge').click()")
    soon(lambda: not desk.console.desk.guard.unacknowledged)


def test_disabled_controls_show_the_operator_the_reason_in_every_tab(desk):
    page = desk.browser
    desk.robot.now = replace(desk.robot.now, manager_alive=False, detector_alive=False, database_alive=False)
    try:
        for name, part in (
            ("Contact", "contact detector"),
            ("Objects", "object database"),
            ("Feedback", "controllers"),
        ):
            page.tab(name)
            page.until(f"return {DISABLED.strip()[7:-1]}.some((one) => one[1].includes(arguments[0]))", 60.0, part)
            assert look(page)[0] == [], name
        page.tab("Live")
        page.until("return document.getElementById('why-side').innerText === 'no motion control'", 60.0)
    finally:
        desk.robot.now = replace(desk.robot.now, manager_alive=True, detector_alive=True, database_alive=True)
    page.tab("Experiment")
    desk.loop.call_soon_threadsafe(desk.console.desk.experiment.begin, "P1", ["receive ball"], 1, "as_listed", 0)
    page.until("return document.getElementById('page').innerText.includes('no trial')", 60.0)
    assert look(page)[0] == []
    desk.loop.call_soon_threadsafe(desk.console.desk.experiment.trial_begin)
    page.until("return document.getElementById('page').innerText.includes('trial 1')", 60.0)
    page.tab("Contact")
    page.until(f"return {DISABLED.strip()[7:-1]}.some((one) => one[1].includes('under way'))", 60.0)
    desk.loop.call_soon_threadsafe(desk.console.desk.experiment.trial_end, "done")
    desk.loop.call_soon_threadsafe(desk.console.desk.experiment.end)
    page.tab("Live")


@pytest.mark.parametrize(
    "tab, label, command",
    [
        ("Contact", "Watch for contact", "contact_arm"),
        ("Contact", "Learn again at rest", "contact_learn"),
        ("Objects", "Read the files again", "objects_reload"),
        ("Health", "Forced calibration", "calibrate"),
        ("Feedback", "disable", "feedback"),
    ],
)
def test_single_click_changes_no_threshold_and_opens_no_hand(desk, tab, label, command):
    page = desk.browser
    page.tab(tab)
    found = f"[...document.querySelectorAll('#page button')].find((one) => one.innerText === '{label}')"
    page.until(f"const b = {found}; return b && !b.hasAttribute('aria-disabled')", 60.0)
    before = len(desk.robot.calls)
    page.js(f"{found}.click()")
    time.sleep(0.3)
    assert len(desk.robot.calls) == before
    again, end = 0.0, time.monotonic() + 60.0
    while len(desk.robot.calls) == before:
        if time.monotonic() > again:  # a slow page loses its connection, which ends the holding
            assert again < end, "no command"
            page.js(f"{found}.dispatchEvent(new PointerEvent('pointerup', {{ bubbles: true }}))")
            page.js(f"{found}.dispatchEvent(new PointerEvent('pointerdown', {{ button: 0, bubbles: true }}))")
            again = time.monotonic() + 10.0
        time.sleep(0.02)
    page.js(f"{found}.dispatchEvent(new PointerEvent('pointerup', {{ bubbles: true }}))")
    assert desk.robot.calls[-1][0] == command
    page.tab("Live")


@pytest.mark.parametrize(
    "source, row, words",
    [
        ("brain", "Phase", "the brain has been silent for 1.2 s"),
        ("brain", "Why", "not known, the brain is silent"),
        ("arm", "Arm", "not known, the arm is silent"),
        ("controllers", "Motion", "silent for 1.2 s"),
        ("contact", "Contact", "silent for 1.2 s"),
    ],
)
def test_row_of_silent_source_shows_duration(desk, source, row, words):
    page = desk.browser
    shown = (
        "return [...document.querySelectorAll('#live dt')]"
        ".find((one) => one.innerText === arguments[0]).nextSibling.innerText"
    )
    assert "silent" not in page.js(shown, row)
    desk.state = {"silent": {source: 1.2}}
    try:
        page.until(f"{shown}.includes(arguments[1])", 60.0, row, words)
    finally:
        desk.state = {}
    page.until(f"{shown}.includes('silent') === false", 60.0, row)


def test_reasons_use_the_labels_of_the_buttons(desk):
    shown = desk.browser.js(
        "return [...document.querySelectorAll('[data-action]')].map((one) => [one.dataset.action, one.innerText])"
    )
    assert {name: words.split(" ", 1)[1] for name, words in shown} == BUTTONS


def test_old_values_show_their_age(desk):
    page = desk.browser
    contact = {**STATUS["contact"], "words": "contact by momentum, margin 2.2", "stamp": time.monotonic() - 12.0}
    desk.loop.call_soon_threadsafe(desk.console.documents.put, "status", {**STATUS, "contact": contact})
    page.until("return /margin 2.2, 1[2-9] s ago/.test(document.getElementById('status').innerText)", 60.0)
    desk.event("a touch")
    page.until("return /[0-9:]{8} a touch/.test(document.getElementById('status').innerText)", 60.0)
    desk.loop.call_soon_threadsafe(desk.console.documents.put, "status", STATUS)


def test_an_event_says_in_which_phase_it_was(desk):
    desk.console.events.phase = lambda: "reaches and receives"
    try:
        desk.event("a touch")
        desk.browser.until(
            "return document.getElementById('log').innerText.includes('a touch [reaches and receives]')", 60.0
        )
    finally:
        desk.console.events.phase = lambda: ""
