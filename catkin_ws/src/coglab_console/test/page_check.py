"""Finds faults of a console page in a browser."""

from __future__ import annotations

from pathlib import Path

from page_browser import PageBrowser

PAGES = ("Live", "Machine", "Experiment", "Contact", "Objects", "Primitives", "Feedback", "Events", "Health", "Help")
_LOOK = Path(__file__).with_name("look_at_page.js").read_text()
MOST_STEPS = 300
_BEGIN = "const b = document.body; b.tabIndex = -1; b.focus(); b.removeAttribute('tabindex')"  # Tab goes on from there
_MARK = """
const all = [...document.querySelectorAll('*')];
const kinds = 'button, input, select, textarea, summary, a, [tabindex]';
const wanted = all.filter((one) => one.tabIndex >= 0 && one.matches(kinds)
  && one.checkVisibility({ checkOpacity: false }) && one.getClientRects().length && !one.disabled);
wanted.forEach((one) => one.setAttribute('data-wanted', ''));
return wanted.length;
"""
_HERE = """
const at = document.activeElement;
if (at === document.body || at === document.documentElement) return null;
const style = getComputedStyle(at), box = at.getBoundingClientRect();
at.removeAttribute('data-wanted');
return { place: [...document.querySelectorAll('*')].indexOf(at),
  ring: style.outlineStyle === 'solid' && style.outlineWidth === '3px',
  seen: box.right > 0 && box.bottom > 0 && box.left < innerWidth && box.top < innerHeight,
  name: at.id || at.dataset.action || at.textContent.slice(0, 20) || at.tagName };
"""


def look(browser: PageBrowser) -> tuple[list[str], int]:
    """Faults (scroll bars, STOP hidden, controls without a name or too small, pale text), and the number of texts."""
    browser.painted()  # before that, the page has neither its final layout nor measured its own room
    found = browser.js(_LOOK)
    return found["problems"], found["texts"]


def focus_order(browser: PageBrowser) -> tuple[list[str], list[str]]:
    """Goes through the page with the Tab key. Returns the names in order, and the faults: controls not reached, out of
    order, out of sight or without a focus ring, or STOP missing."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    browser.js(_BEGIN)
    wanted = browser.js(_MARK)
    names: list[str] = []
    problems: list[str] = []
    before = -1
    for _ in range(MOST_STEPS):
        ActionChains(browser.driver).send_keys(Keys.TAB).perform()
        here = browser.js(_HERE)
        if here is None or here["name"] in names[:1] and here["place"] <= before:
            break
        names.append(here["name"])
        if here["place"] <= before:
            problems.append(f"{here['name']} is out of order")
        before = here["place"]
        if not here["ring"]:
            problems.append(f"{here['name']} has no ring")
        if not here["seen"]:
            problems.append(f"{here['name']} is out of sight")
    missed = browser.js(
        "const left = [...document.querySelectorAll('[data-wanted]')];"
        "left.forEach((one) => one.removeAttribute('data-wanted'));"
        "return left.map((one) => one.id || one.outerHTML.slice(0, 60))"
    )
    problems += [f"{name} is not reached" for name in missed]
    if "stop" not in names:
        problems.append(f"STOP is not reached within {wanted} controls")
    return names, problems
