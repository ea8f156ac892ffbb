"""The page in a real browser with a double of the robot: dead connection, slow computer, reasons, touch."""

import time

import pytest
from coglab_console.desk.control_conditions import Standing
from coglab_console.scene.graph_layout import Container, Layout
from coglab_console.web.fan_out import WINDOW, Client
from console_double import PAGE_DOCUMENTS, READY
from page_browser import PageBrowser
from page_check import PAGES, focus_order, look
from page_double import IN_HAND, Desk, needs_browser

pytestmark = needs_browser


def test_dead_open_connection_is_replaced_without_losing_events(live):
    page = live.browser
    live.event("before")
    page.until("return coglab.events().some((e) => e.text === 'before')", 60.0)
    page.js("window.connections.at(-1).deaf = true")
    live.event("meanwhile")
    page.until("return document.body.classList.contains('lost')", 60.0)
    page.until("return !document.body.classList.contains('lost')", 60.0)
    live.event("after")
    page.until("return coglab.events().some((e) => e.text === 'after')", 60.0)
    seen = page.js("return coglab.events().map((e) => e.seq)")
    assert seen == list(range(1, len(seen) + 1))
    opened = page.js("return window.connections.map((one) => one.opened)")  # ms
    gaps = [after - before for before, after in zip(opened, opened[1:], strict=False)]
    assert min(gaps) > 400.0, "it comes back with pauses, however slow this computer is"


def history_of_states(monkeypatch):
    """By connection: whether a state was published or shown by the page, and its number, in this order."""
    history, put, seen = {}, Client.state, Client.seen

    def note_put(client, number, text):
        history.setdefault(client, []).append(("published", number))
        put(client, number, text)

    def note_seen(client, number):
        known = seen(client, number)
        if known:
            history.setdefault(client, []).append(("shown", number))
        return known

    monkeypatch.setattr(Client, "state", note_put)
    monkeypatch.setattr(Client, "seen", note_seen)
    return history


def test_a_slow_page_shows_the_newest_state_and_every_event(live, monkeypatch):
    """A state leaves after the page has shown the WINDOW-th before it. It is then the newest one: the next one is
    published later. In a queue it would be old."""
    page, history = live.browser, history_of_states(monkeypatch)
    page.js("window.slow = 100")
    for number in range(40):
        live.event(f"slow {number}")
        time.sleep(0.1)
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        if any(sum(what == "shown" for what, _ in one) > 5 * WINDOW for one in list(history.values())):
            break
        time.sleep(0.1)
    page.js("window.slow = 0")
    page.until("return coglab.events().some((e) => e.text === 'slow 39')", 60.0)
    texts = page.js("return coglab.events().map((e) => e.text).filter((text) => text.startsWith('slow'))")
    assert texts == [f"slow {number}" for number in range(40)]
    compared = 0
    for one in history.values():
        place = {entry: i for i, entry in enumerate(one)}
        shown = [number for what, number in one if what == "shown"]
        for earlier, number in zip(shown, shown[WINDOW:], strict=False):
            assert place.get(("published", number + 1), len(one)) > place["shown", earlier]
            compared += 1
    assert compared > 2 * WINDOW


def test_late_page_shows_its_delay(live):
    page = live.browser
    page.js("window.slow = 300")
    page.until("return /s behind/.test(document.getElementById('lost').textContent)", 60.0)
    page.js("window.slow = 0")
    page.until("return document.getElementById('lost').hidden", 60.0)


@pytest.mark.parametrize(
    "shown, words",
    [
        ({"kind": "refused", "reason": "goal is 0.8 m outside the box", "points": []}, "0.8 m outside"),
        (
            {"kind": "running", "motion": "reach_human", "stamp": 0.0, "goal": [0.4, 0, 0.3],
             "points": [[0.1, 0, 0.3], [0.4, 0, 0.3]], "times": [0.0, 1.24]},
            "Path of this motion: reach_human, 1.2 s",
        ),
    ],
)  # fmt: skip
def test_the_path_ahead_in_words(live, shown, words):
    page = live.browser
    robot = {"root": "world", "joints": [], "shapes": {}}
    live.loop.call_soon_threadsafe(live.console.documents.put, "model", {**PAGE_DOCUMENTS["model"], "robot": robot})
    live.loop.call_soon_threadsafe(live.console.documents.put, "path", shown)
    page.until("return document.getElementById('view-words').textContent.includes(arguments[0])", 60.0, words)


def test_a_click_on_a_disabled_button_says_why(live):
    page = live.browser
    button = "[data-action=exchange_robot_to_human]"
    page.until(f"return document.querySelector('{button}').hasAttribute('aria-disabled')", 60.0)
    page.js(f"document.querySelector('{button}').click()")
    words = page.js(
        "const refusal = document.getElementById('refusal'); return refusal.checkVisibility() && refusal.textContent"
    )
    assert "Give" in words and "empty" in words
    assert not live.robot.calls


def test_a_button_is_held_by_touch(live, monkeypatch):
    """As on a tablet: a long touch starts the command; one that ends early, or that slides off, does not."""
    monkeypatch.setattr("coglab_console.desk.motion_guard.LONGEST_GAP", 5.0)  # s, for a busy computer
    page = live.browser
    live.loop.call_soon_threadsafe(live.console.desk.guard.stop, "a test")
    live.loop.call_soon_threadsafe(lambda: live.console.desk.guard.acknowledge(live.console.desk.guard.stops))
    page.until("return document.getElementById('why-home').textContent.includes('hold')", 60.0)
    button = "document.querySelector('[data-action=home]')"
    box = page.js(f"const b = {button}.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]")

    def touch(kind, *points):
        page.driver.execute_cdp_cmd(
            "Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in points]}
        )

    held = f"{button}.classList.contains('holding')"
    with monkeypatch.context() as patience:
        # however slow this browser is, it ends early
        patience.setattr("coglab_console.desk.motion_guard.HOLD_TIME", 3600.0)
        for end in (("touchEnd",), ("touchMove", [box[0], box[1] - 200])):
            touch("touchStart", box)
            page.until(f"return {held}", 60.0)
            touch(*end)
            page.until(f"return !{held}", 60.0)
        touch("touchEnd")
    time.sleep(1.2)  # s: longer than a button is held
    assert not live.robot.calls
    touch("touchStart", box)
    end = time.monotonic() + 60.0
    while not live.robot.calls and time.monotonic() < end:
        time.sleep(0.05)
    touch("touchEnd")
    assert live.robot.calls == [("home", {})]
    assert live.robot.now == Standing(**READY)


def test_a_tablet_has_stop_and_every_page_within_reach_of_a_finger(live):
    with PageBrowser(size=(1024, 768), touch=True) as tablet:
        tablet.open(live.console.link())
        tablet.until("return navigator.maxTouchPoints > 0", 60.0)
        for name in PAGES:
            tablet.touch(f"#tab-{name}")
            tablet.until("return document.getElementById('tab-' + arguments[0]).ariaSelected === 'true'", 60.0, name)
            assert look(tablet)[0] == [], name
        before = len(live.robot.stops)
        tablet.touch("#stop")
        end = time.monotonic() + 60.0
        while len(live.robot.stops) == before and time.monotonic() < end:
            time.sleep(0.02)
        assert len(live.robot.stops) > before


def test_every_page_shows_an_overloaded_computer(live):
    page = live.browser
    live.put(busy="This computer is too busy", real_time_factor=0.5)
    page.until("return document.getElementById('busy').innerText.includes('too busy')", 60.0)
    assert "0.5" in page.js("return document.getElementById('world').innerText")
    assert look(page)[0] == []
    live.put(busy="", real_time_factor=1.0)
    page.until("return document.getElementById('busy').hidden", 60.0)


def test_the_keyboard_reaches_everything_in_order_on_every_page(live):
    for name in PAGES:
        live.browser.tab(name)
        names, problems = focus_order(live.browser)
        assert problems == [] and f"tab-{name}" in names, (name, problems)
    live.browser.tab("Live")


def test_diagnostics_are_a_tree_by_node_whose_branches_show_their_worst(live):
    def row(name, level):
        return {"name": name, "level": level, "message": "words", "values": [["key", "value"]]}

    rows = [row("robot: FRI connection", 0), row("robot: arm", 1), row("ih2_hand: hand", 0), row("camera", 2)]
    page = live.browser
    page.tab("Health")
    health = {"rows": rows, "versions": {}, "browsers": []}
    live.loop.call_soon_threadsafe(live.console.documents.put, "health", health)
    tree = (
        "const words = (one, what) => [...one.querySelectorAll(what)].map((summary) => summary.textContent);"
        "return [...document.querySelectorAll('#diagnostics > details')].map((branch) =>"
        " [...words(branch, ':scope > summary'), words(branch, ':scope details > summary')])"
    )
    page.until("return document.querySelectorAll('#diagnostics > details').length === 3", 60.0)
    assert page.js(tree) == [
        ["▲robot: warning", ["●FRI connection: ok, words", "▲arm: warning, words"]],
        ["●ih2_hand: ok", ["●hand: ok, words"]],
        ["■camera: error", ["■camera: error, words"]],
    ]
    assert look(page)[0] == [] and focus_order(page)[1] == []
    # What was opened or closed stays so when the next second's diagnostics come, and so does the focus.
    page.js("const d = document.querySelectorAll('#diagnostics details'); d[0].open = false; d[3].open = true;")
    page.js("document.querySelectorAll('#diagnostics summary')[3].focus()")
    time.sleep(0.2)
    live.loop.call_soon_threadsafe(live.console.documents.put, "health", {**health, "rows": rows[:3]})
    page.until("return document.querySelectorAll('#diagnostics > details').length === 2", 60.0)
    kept = "return [...document.querySelectorAll('#diagnostics details')].map((one) => one.open)"
    assert page.js(kept) == [False, False, False, True, False]
    assert page.js("return document.activeElement.dataset.name") == "ih2_hand"
    page.tab("Live")


def test_refused_note_stays_in_its_field_with_the_reason(live):
    page = live.browser
    page.tab("Experiment")
    write = (
        "const n = document.getElementById('note'); n.value = arguments[0];"
        "n.closest('div').querySelector('button').click()"
    )
    here, told = "return document.getElementById('note').value", "return document.getElementById('page').innerText"
    page.js("window.kept = window.fetch; window.fetch = () => Promise.reject(new Error('no network'))")
    page.js(write, "the cup slipped")
    page.until(f"{told}.includes('no network')", 60.0)
    assert page.js(here) == "the cup slipped"
    page.js("window.fetch = window.kept")
    page.js(write, "the cup slipped")
    page.until("return coglab.events().some((e) => e.text.endsWith('the cup slipped'))", 60.0)
    page.until("return document.getElementById('note').value === ''", 60.0)
    page.tab("Live")


def test_without_graphviz_the_page_has_the_states_and_says_what_is_missing(live):
    containers = {"/M": Container("/M", ("A", "B", "C"), (("ok", "A", "B"),))}
    picture = {**Layout("no-such-program").of(containers), "roots": ["/M"]}
    live.loop.call_soon_threadsafe(live.console.documents.put, "graph:/coglab", picture)
    live.browser.until("return document.querySelectorAll('#graph .node').length >= 3", 60.0)
    words = live.browser.js("return document.getElementById('graph').innerText")
    assert "apt install graphviz" in words


def test_path_to_active_state_shows_its_name_in_full(live):
    """Without room for all containers, the outer ones are left out."""
    leaf = "/M/exchange_human_to_robot/approach/arm_motion/wait_stop"
    picture = {**Layout("no-such-program").of({"/M": Container("/M", ("A",), ())}), "problem": "", "roots": ["/M"]}
    live.loop.call_soon_threadsafe(live.console.documents.put, "graph:/coglab", picture)
    live.loop.call_soon_threadsafe(live.console.documents.put, "active", {"/coglab": {"active": [leaf], "last": {}}})
    live.browser.tab("Machine")
    live.browser.until("return document.querySelector('.crumbs').textContent.endsWith('wait_stop')", 60.0)
    cut = "const c = document.querySelector('.crumbs'); return c.scrollHeight - c.clientHeight"
    assert live.browser.js(cut) <= 1
    live.browser.tab("Live")


@pytest.mark.parametrize("promised", [False, True])
def test_without_libjs_the_view_is_2d_with_a_message(tmp_path, promised):
    """Also if a library existed when the console started but is only partly served."""
    live = Desk(tmp_path, {"three": promised, "charts": promised}, libraries=tmp_path)
    try:
        page = live.browser
        assert page.js("return coglab.view()") == "2D"
        page.until("return /Strip charts/.test(document.getElementById('charts').innerText)", 60.0)
        assert look(page)[0] == []
        page.js("document.getElementById('stop').click()")
        end = time.monotonic() + 60.0
        while not live.robot.stops and time.monotonic() < end:
            time.sleep(0.02)
        assert live.robot.stops == ["browser 1"] or len(live.robot.stops) == 2  # by both ways
    finally:
        live.close()


def test_page_without_session_shows_what_to_do_and_that_stop_failed(live):
    """As after a restart of the console, which does not know earlier sessions."""
    with PageBrowser() as page:
        page.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": IN_HAND})
        page.open(live.console.link())
        page.driver.delete_all_cookies()
        page.js("window.connections.at(-1).close()")
        page.until("return document.getElementById('lost').textContent.includes('console.url')", 60.0)
        stops = len(live.robot.stops)
        page.js("document.getElementById('stop').click()")
        page.until("return document.getElementById('refusal').textContent.includes('red button')", 60.0)
        assert len(live.robot.stops) == stops
