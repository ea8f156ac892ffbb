"""All texts can be read: last event with its reason, condition of a wait, cause of a standstill. Focus and mouse unfold
texts that are cut off. In a real browser with a double of the robot."""

import time

import pytest
from coglab_console.desk import words
from coglab_console.scene.graph_layout import Container, Layout
from page_browser import PageBrowser
from page_check import focus_order, look
from page_double import STATUS, needs_browser
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

pytestmark = needs_browser
ROOT = "/coglab_master/exchange_human_to_robot/approach"
SWITCHED = (
    "pattern 'high' recognised with confidence 1.00: primitive 'reach_human_middle' replaced by 'reach_human_high'"
)
FELL = (
    "the arm does not follow any more: command mode was lost because the robot controller was not run for "
    "259 ms (load), because the robot controller changed its quality from PERFECT to UNACCEPTABLE"
)


def shown_of(last, reason):
    """Documents of a machine in the middle of a reach, whose last transition was `last`."""
    containers = {
        ROOT: Container(ROOT, ("arm_motion", "monitor_dmp"), ()),
        f"{ROOT}/arm_motion": Container(f"{ROOT}/arm_motion", ("execute_dmp", "wait_stop"), ()),
    }
    picture = {**Layout("no-such-program").of(containers), "problem": "", "roots": [ROOT]}
    step = {"path": ROOT, "from": last[0], "outcome": last[1], "to": last[2], "reason": reason}
    return {
        "graph:/coglab": picture,
        "active": {"/coglab": {"active": [f"{ROOT}/arm_motion/wait_stop"], "last": step}},
    }


def in_the_middle_of_a_reach(live):
    live.state = {
        "words": "reaches and receives",
        "waits": "contact of an object with the hand, or the end of the reach",
        "left": 7.5,
        "dmp": ["running", 0.4, 0.23, 0.9],
        "ages": {"hand": 0.047, "object": 0.051},
    }
    live.put(**shown_of(("monitor_dmp", "switched", "monitor_dmp"), SWITCHED))
    live.put(status={**STATUS, "manager": {**STATUS["manager"], "state": "running"}})
    for before, how, after, reason in (
        ("execute_dmp", "succeeded", "wait_stop", ""),
        ("monitor_dmp", "switched", "monitor_dmp", SWITCHED),
    ):
        live.event(words.transition(ROOT, before, how, after, reason))
    return SWITCHED


def stopped(live):
    live.state = {"words": "stopped", "phase": "/coglab_master/stopped"}
    machine = {**STATUS["machine"], "state": "/coglab_master/stopped", "words": "stopped", "why": FELL, "object": "mug"}
    arm = {**STATUS["arm"], "supervisor": "stopped", "words": "stopped", "quality": "UNACCEPTABLE", "reason": FELL,
           "held": True, "power": False, "allowed": False}  # fmt: skip
    manager = {**STATUS["manager"], "state": "fault", "reason": FELL}
    hand = {**STATUS["hand"], "connected": False, "message": f"no answer of the hand for 0.5 s: {FELL}"}
    live.put(status={**STATUS, "machine": machine, "arm": arm, "manager": manager, "hand": hand})
    live.put(**shown_of(("arm_motion", "failed", "failed"), FELL))
    live.event(words.transition(ROOT, "arm_motion", "failed", "failed", FELL))
    return FELL


@pytest.mark.parametrize("moment", [in_the_middle_of_a_reach, stopped])
def test_every_cut_off_text_can_be_unfolded(live, moment):
    """Least of all the reason of the last event: its first words stand in the column, without a press of any key."""
    page = live.browser
    reason = moment(live)
    page.until("return document.getElementById('log').textContent.includes(arguments[0])", 60.0, reason)
    page.until("return document.getElementById('status').textContent.includes(arguments[0])", 60.0, reason)
    page.until("return document.querySelector('#graph p.last').textContent.includes(arguments[0])", 60.0, reason)
    page.tab("Machine")
    assert look(page)[0] == []
    page.tab("Live")
    assert look(page)[0] == []
    ActionChains(page.driver).send_keys(Keys.TAB).perform()
    assert page.js("return document.activeElement.id") == "tab-Live", "the look has moved the focus"
    assert focus_order(page)[1] == []
    # The clock stands before it, and nothing else.
    last = page.js("return [...document.querySelectorAll('#status dt')].at(-1).nextSibling.innerText")
    assert last.split(" ", 1)[1].startswith(reason[:40]), last
    assert page.js("return document.querySelector('#graph p.last').innerText").startswith(reason[:40])


def test_a_tablet_shows_the_whole_column_also_when_it_is_turned(live):
    stopped(live)
    with PageBrowser(size=(768, 1024), touch=True) as tablet:
        tablet.open(live.console.link())
        tablet.until("return document.getElementById('now').innerText.includes('stopped')", 60.0)
        tablet.resize((1024, 768))
        end = time.monotonic() + 60.0  # a busy computer lays the column out later than it fills it
        while look(tablet)[0] and time.monotonic() < end:
            time.sleep(0.2)
        assert look(tablet)[0] == []


def test_cut_off_text_unfolds_under_mouse_without_blocking_buttons(live):
    page = live.browser
    stopped(live)
    height = "return document.getElementById('log').getBoundingClientRect().height"
    page.until("return document.getElementById('log-place').tabIndex === 0", 60.0)
    folded = page.js(height)
    ActionChains(page.driver).move_to_element(page.driver.find_element(By.ID, "log-place")).perform()
    page.until(f"{height} > arguments[0] + 20", 60.0, folded)
    # What the unfolded text lies over is pressed as before.
    over = (
        "const box = document.getElementById('log').getBoundingClientRect();"
        "return document.elementFromPoint(box.left + 40, box.top + 4).closest('#log') === null"
    )
    assert page.js(over)
    ActionChains(page.driver).move_to_element(page.driver.find_element(By.ID, "world")).perform()
    page.until(f"{height} === arguments[0]", 60.0, folded)


def test_new_event_does_not_move_the_focus(live):
    page = live.browser
    stopped(live)
    page.until("return document.getElementById('log-place').tabIndex === 0", 60.0)
    page.js("document.getElementById('log-place').focus()")
    live.event("one more")
    page.until("return document.getElementById('log').textContent.includes('one more')", 60.0)
    assert page.js("return document.activeElement.id") == "log-place"
    ActionChains(page.driver).send_keys(Keys.TAB).perform()
    assert page.js("return document.activeElement.id") != "log-place"


def test_a_change_of_the_phase_is_read_out(live):
    read_out = "return [...document.querySelectorAll('#live dd [aria-live=polite]')].map((one) => one.closest('dd'))"
    (cell,) = live.browser.js(read_out)
    assert "phase" in cell.get_attribute("class").split()
