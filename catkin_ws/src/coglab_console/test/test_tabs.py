"""The pages Feedback, Primitives, Objects and Contact show the sent data in words and numbers; in a real browser with
a double of the robot."""

import re
import time

import pytest
from page_browser import press_and_hold
from page_double import STATUS, needs_browser

pytestmark = needs_browser
TABLE = (
    "return [...[...document.querySelectorAll('#page table')][arguments[0]].querySelectorAll('tbody tr')]"
    ".map((row) => [...row.children].map((cell) => cell.innerText))"
)
# Name, share of the row's width that is filled, place of the black line in it, and the number beside it.
BARS = (
    "return [...document.querySelectorAll('#page .bar')].map((row) => { const [name, track, value] = row.children;"
    " const inner = track.clientWidth, of = (one) => one && one.getBoundingClientRect();"
    " const fill = of(track.querySelector('i')), line = of(track.querySelector('b')), box = of(track);"
    " return [name.innerText, fill.width / inner, line && (line.left - box.left) / inner, value.innerText]; })"
)


def controller(name, **more):
    row = {"name": name, "type": "t", "stage": "task", "enabled": True, "paused": False, "safety": False, "waiting": "",
           "activity": "active", "reasons": [], "fault": "", "faults": 0, "overruns": 0}  # fmt: skip
    return {**row, **more}


def test_feedback_controllers_are_shown(live):
    page = live.browser
    page.tab("Feedback")
    yields = controller("yield", activity="waits", waiting="for the wrench", faults=2, overruns=7)
    reasons = ["the hand closes", "the arm stands still"]
    limit = controller("limit", stage="safety", paused=True, activity="paused", reasons=reasons, fault="NaN in x")
    rows = [
        {"controller": "yield", "signal": "velocity", "size": 0.0125, "angle": 0.034},
        {"controller": "limit", "signal": "stiffness", "size": 12.5, "angle": 0.0},
    ]
    inside = [{"controller": "yield", "values": [["force", 3.25, "N"], ["offset", 0.004, "m"]]}]
    live.put(feedback={"profile": "approach", "rows": [yields, limit]}, attribution={"rows": rows, "inside": inside})
    page.until("return document.querySelectorAll('#page table').length === 2", 60.0)
    shown = page.js(TABLE, 0)
    assert [row[:6] for row in shown] == [
        ["1", "yield", "task", "waits for the wrench", "·", "2 / 7"],
        ["2", "limit", "safety", "paused", "the hand closes; the arm stands still; fault: NaN in x", "0 / 0"],
    ]
    assert [row[6].split() for row in shown] == [["disable", "pause"], ["disable", "resume"]]
    assert page.js("return document.getElementById('feedback-profile').innerText") == "Profile: approach"
    assert page.js(TABLE, 1) == [["yield", "velocity", "0.0125", "0.034"], ["limit", "stiffness", "12.5", "0"]]
    assert "3.25 N, offset 0.004 m" in page.js("return document.getElementById('page').innerText")
    # Another order gives another table, and a cycle without corrections is shown as such.
    live.put(feedback={"profile": "", "rows": [limit, yields]}, attribution={"rows": [], "inside": []})
    page.until("return document.getElementById('page').innerText.includes('No controller')", 60.0)
    assert [row[:2] for row in page.js(TABLE, 0)] == [["1", "limit"], ["2", "yield"]]
    assert page.js("return document.getElementById('feedback-profile').innerText") == "Profile: none"
    page.tab("Live")


def test_recognition_with_the_confidence_of_each_pattern(live):
    page = live.browser
    page.tab("Primitives")
    rows = [["low", 0.07], ["high", 0.9], ["middle", 0.03]]
    seen = {"pattern": "high", "decided": True, "progress": 0.4, "stamp": time.monotonic() - 7.0, "rows": rows}
    live.put(recognition=seen)
    page.until("return document.querySelectorAll('#page .bar').length === 3", 60.0)
    bars = page.js(BARS)
    assert [[name, value] for name, _, _, value in bars] == [["low", "0.07"], ["high", "0.90"], ["middle", "0.03"]]
    assert [width for _, width, _, _ in bars] == pytest.approx([0.07, 0.9, 0.03], abs=0.01)
    words = page.js("return document.getElementById('page').innerText")
    assert re.search(r"Decided: high\b.*\b40 %.*\b7 s", words)
    live.put(recognition={**seen, "decided": False})
    page.until("return document.getElementById('page').innerText.includes('Not decided: high')", 60.0)
    page.tab("Live")


def test_objects_with_what_the_database_has_against_a_file(live):
    page = live.browser
    page.tab("Objects")
    sizes = {"mug": {"type": "cylinder", "radius": 0.04, "height": 0.1}, "box": {"type": "box"}}
    rows = [
        {
            "id": name,
            "name": f"a {name}",
            "mass": mass,
            "shape": sizes[name],
            "size": [0.1] * 3,
            "text": f"id: {name}\n",
        }
        for name, mass in (("box", 0.5), ("mug", 0.25))
    ]
    problem = "ball.yaml: mass: -1 is less than the minimum of 0"
    live.put(objects={"rows": rows, "asked": True, "problems": [problem]})
    page.until("return document.getElementById('object-problems').innerText.includes('ball.yaml')", 60.0)
    assert page.js("return document.getElementById('object-problems').innerText") == f"▲{problem}"
    assert [row[:4] for row in page.js(TABLE, 0)] == [
        ["box", "a box", "0.5", "box"],
        ["mug", "a mug", "0.25", "cylinder"],
    ]
    assert page.js("return document.querySelector('#page pre').innerText").strip() == "id: box"
    page.js("document.querySelector('#page [aria-label=\"Show mug\"]').click()")
    assert page.js("return document.querySelector('#page pre').innerText").strip() == "id: mug"
    live.put(objects={"rows": rows, "asked": True, "problems": []})
    page.until("return document.getElementById('object-problems').innerText.includes('2 objects')", 60.0)
    live.put(objects={"rows": [], "asked": False, "problems": []})
    page.until("return document.getElementById('object-problems').innerText.includes('not read')", 60.0)
    page.tab("Live")


def test_contact_by_joint_against_its_threshold_and_learning(live):
    page = live.browser
    page.tab("Contact")
    rate = [0.3, -0.15, 0.0, 0.9, 0.01, 0.0, 0.02]
    threshold = [0.6, 0.3, 0.24, 0.6, 0.01, 0.36, 0.18]
    watched = [True, True, False, True, False, False, False]
    contact = {**STATUS["contact"], "k": 6.0, "samples": 321, "window": 0.04, "mode": "contact", "state": "watching"}
    live.state = {"rate": rate, "threshold": threshold, "watched": watched, "margin": 1.5}
    live.put(status={**STATUS, "contact": contact})
    words = "return document.getElementById('page').innerText"
    page.until(f"{words}.includes('321 samples')", 60.0)
    page.until("return [...document.querySelectorAll('#page .bar')][3].innerText.includes('0.900')", 60.0)
    bars = page.js(BARS)
    names = ["A1 ●", "A2 ●", "E1 ○", "A3 ●", "A4 ○", "A5 ○", "A6 ○"]
    assert [name for name, *_ in bars] == names
    assert [value for *_, value in bars] == [f"{abs(value):.3f}" for value in rate]
    # The bar's end is half as much again as the threshold, and 0.05 Nm at least.
    ends = [max(1.5 * value, 0.05) for value in threshold]
    full = [min(1.0, abs(value) / end) for value, end in zip(rate, ends, strict=True)]
    assert [width for _, width, _, _ in bars] == pytest.approx(full, abs=0.02)
    lines = [value / end for value, end in zip(threshold, ends, strict=True)]
    assert [line for _, _, line, _ in bars] == pytest.approx(lines, abs=0.02)
    shown = page.js(words)
    assert "40 ms, Nm" in shown and "contact: margin 1.50" in shown
    assert "A1 0.100, A2 0.050, E1 0.040" in shown and "k 6" in shown
    assert "321" in shown
    live.state = {**live.state, "margin": None}
    live.put(status={**STATUS, "contact": {**contact, "learnt": False, "state": "waiting", "samples": 12}})
    page.until(f"{words}.includes('12 samples')", 60.0)
    page.until(f"{words}.includes('Armed for contact')", 60.0)
    button = page.js(
        "return [...document.querySelectorAll('#page button')].find((b) => b.innerText === 'Learn again at rest')"
    )
    press_and_hold(page, button, lambda: live.robot.calls == [("contact_learn", {})], 60.0)
    live.state = {}
    page.tab("Live")


def test_questionnaire_recordings_and_primitive_preview(live):
    page = live.browser
    page.tab("Experiment")
    asked = {"name": "tlx", "title": "Workload", "low": 0, "high": 100, "step": 5, "ends": ["low", "high"],
             "items": [["effort", "How hard?"], ["pace", "How hurried?"]]}  # fmt: skip
    of = ["P03", "1", "calm"]
    study = {"study": "s", "participant": "P03", "condition": "calm", "of": of, "problem": ""}
    row = {"name": "x", "started": "2026-11-28T13:41:48.795+00:00", "action": "take", "object": "mug",
           "participant": "P03", "condition": "calm", "outcome": "succeeded", "duration_s": 9.4,
           "notes": "looked away"}  # fmt: skip
    live.put(
        study={**study, "questionnaires": [asked, {**asked, "name": "other", "items": [["calm", "How calm?"]]}]},
        recordings={"folder": "/x", "recording": True, "rows": [row]},
    )
    field = "document.querySelector('#page input[aria-label=\"How hard?\"]')"
    page.until(f"return {field} !== null && document.body.innerText.includes('looked away')", 60.0)
    page.js(f"{field}.value = '55'")
    live.put(study={**study, "questionnaires": [asked]})  # the other one was written
    live.put(recordings={"folder": "/y", "recording": True, "rows": [row]})
    page.until("return document.body.innerText.includes('/y')", 60.0)
    assert page.js(f"return {field}.value") == "55"  # what is being filled in stays
    page.js(
        "[...document.querySelectorAll('#page button')].find((one) => one.innerText === 'Write the answers').click()"
    )
    page.until("return document.querySelector('#page p[aria-live]').innerText.includes('done')", 60.0)
    assert live.robot.calls[-1] == ("answer", {"questionnaire": "tlx", "of": of, "answers": {"effort": 55}})
    page.tab("Primitives")
    shown = {
        "name": "reach_me",
        "description": "",
        "duration": 1.0,
        "mapping": "none",
        "basis": 3,
        "plot": [[0, 0, 0, 0, 0]],
    }
    live.put(primitives={"file": "f", "problem": "", "rows": [shown]})
    button = "[...document.querySelectorAll('#page button')].find((one) => one.innerText === 'Preview')"
    page.until(f"return {button} !== undefined", 60.0)
    page.js(f"{button}.click()")
    page.until("return document.querySelector('#page p[aria-live]').innerText.includes('done')", 60.0)
    assert live.robot.calls[-1] == ("preview", {"primitive": "reach_me"})
