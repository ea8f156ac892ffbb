"""Keys and lists in a real browser: Space is STOP at any focus; a choice is made or restored."""

import shutil
import time

import pytest

if shutil.which("chromedriver") is None:
    pytest.skip("chromium-driver is missing: ./coglab install browser", allow_module_level=True)
from page_browser import PageBrowser
from page_check import PAGES, look
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys


def test_refused_choice_shows_reason_and_old_value(live):
    """For an observer, the list of objects and the speed show the current value, not the wish."""
    objects = {"rows": [{"id": "ball", "name": "ball", "mass": 0.1, "text": ""}], "asked": True, "problems": []}
    live.loop.call_soon_threadsafe(live.console.documents.put, "objects", objects)
    with PageBrowser() as page:
        page.open(live.console.link())
        page.until("return document.getElementById('object').textContent.includes('(default)')", 60.0)
        for field, wish, shown in (("object", "ball", ""), ("speed", "40", "100")):
            page.js("document.getElementById('refusal').hidden = true")
            page.js(
                "const f = document.getElementById(arguments[0]); f.focus(); f.value = arguments[1];"
                "f.dispatchEvent(new Event('change'))",
                field,
                wish,
            )
            page.until(
                "const t = document.getElementById('refusal'); return !t.hidden && /watches/.test(t.textContent)", 60.0
            )
            assert page.js("return document.getElementById(arguments[0]).value", field) == shown
    assert live.console.desk.object_id == "" and ("speed_scale", {"value": 0.4}) not in live.robot.calls


def test_space_is_stop_also_while_a_list_is_open_and_enter_chooses(live):
    rows = [{"id": name, "name": name, "mass": 0.1, "text": ""} for name in ("ball", "mug", "tea_box")]
    objects = {"rows": rows, "asked": True, "problems": []}
    live.loop.call_soon_threadsafe(live.console.documents.put, "objects", objects)
    page = live.browser
    page.tab("Live")
    page.until("return document.getElementById('object').textContent.includes('(default)')", 60.0)
    time.sleep(0.5)  # what other tests have pressed is answered
    page.driver.find_element(By.ID, "object").click()
    page.until("return document.getElementById('object').ariaExpanded === 'true'", 60.0)
    stops = len(live.robot.stops)
    ActionChains(page.driver).send_keys(Keys.SPACE).perform()
    end = time.monotonic() + 60.0
    while len(live.robot.stops) == stops and time.monotonic() < end:
        time.sleep(0.02)
    assert len(live.robot.stops) > stops and live.console.desk.object_id == ""
    # STOP is not covered by the list.
    assert look(page)[0] == []
    ActionChains(page.driver).send_keys(Keys.ARROW_DOWN, Keys.ARROW_DOWN, Keys.ENTER).perform()
    page.until("return coglab.docs().desk.object === 'mug'", 60.0)
    page.until("return document.getElementById('object').textContent.includes('mug')", 60.0)
    assert page.js("return document.getElementById('object').ariaExpanded") == "false"
    # By the mouse, and left without a choice.
    page.driver.find_element(By.ID, "object").click()
    page.driver.find_element(By.XPATH, "//li[text()='ball']").click()
    page.until("return coglab.docs().desk.object === 'ball'", 60.0)
    page.driver.find_element(By.ID, "object").click()
    ActionChains(page.driver).send_keys(Keys.ARROW_DOWN, Keys.ESCAPE).perform()
    page.until("return document.getElementById('object').ariaExpanded === 'false'", 60.0)
    assert live.console.desk.object_id == "ball"
    assert page.js("return document.querySelectorAll('select').length") == 0


def test_space_is_stop_wherever_the_focus_is_and_presses_nothing_else(live):
    """In a text field with Ctrl."""

    def plain(keys):
        keys.send_keys(Keys.SPACE).perform()

    def with_ctrl(keys):
        keys.key_down(Keys.CONTROL).send_keys(Keys.SPACE).key_up(Keys.CONTROL).perform()

    page = live.browser
    some = "[...document.querySelectorAll(arguments[0])].filter((one) => one.checkVisibility())"
    before, seen = len(live.robot.calls), 0
    for name in PAGES:
        page.tab(name)
        for selector, press in (
            ("button, summary, input[type=range]", plain),
            ("textarea, input:not([type=range])", with_ctrl),
        ):
            for i in range(page.js(f"return {some}.length", selector)):
                page.js(f"{some}[arguments[1]].focus()", selector, i)
                stops = len(live.robot.stops)
                press(ActionChains(page.driver))
                # The page sends each press twice, so that none of the next one's is taken for this one's.
                end = time.monotonic() + 60.0
                while len(live.robot.stops) < stops + 2 and time.monotonic() < end:
                    time.sleep(0.01)
                assert len(live.robot.stops) == stops + 2, (name, selector, i)
                time.sleep(0.05)  # more than 50 a second of one browser are taken together
                seen += 1
    assert seen > 100
    assert [name for name, _ in live.robot.calls[before:] if name != "parameters"] == []
    page.tab("Live")
