#!/usr/bin/python3
"""The page in Debian's chromium at 1280x720 against the running cell: an exchange by mouse, STOP by key, every tab
looked at, the scene's hand against tf. Pictures are kept beside the logs."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph
import rospkg
import rospy
import rostest
import tf2_ros
from coglab_console.browser import fresh_link
from coglab_msgs.msg import LwrState, MasterState
from other_machine import OtherMachine, show_machine
from page_browser import PageBrowser, acknowledge, press_and_hold
from page_check import PAGES, look
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from std_msgs.msg import String

LIMIT = 60.0  # s, limit of every wait; the computer may be busy
HUBS = ("/wait_without_object", "/wait_with_object")
RESULTS = "coglab.events().filter((one) => one.source === 'result').length"
# Lines of chromium about its own drawing, and about a refused command, whose reason is on the page: on a busy computer
# the robot may stop by itself while a button is pressed.
KNOWN = ("WebGL", "GPU stall", "willReadFrequently", "409 (Conflict)", "points out of X bounds")
LATE = "closed before the connection is established"  # a page that a late computer loads again; it connects anew


class Console(unittest.TestCase):
    """One browser for all cases; they run in the order of their numbers, and each needs the ones before."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("console_test")
        cls.machine, cls.arm = MasterState(), LwrState()
        rospy.Subscriber("/coglab/state", MasterState, lambda message: setattr(cls, "machine", message))
        rospy.Subscriber("/lwr/state", LwrState, lambda message: setattr(cls, "arm", message), tcp_nodelay=True)
        cls.frames = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.frames)
        home = Path(rospkg.get_ros_home())
        cls.pictures = home / "pictures"
        cls.link = fresh_link(home, limit=LIMIT)
        cls.browser = PageBrowser()
        cls.browser.open(cls.link, LIMIT)

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()

    def wait_for_hub(self, name, limit=LIMIT):
        end = time.monotonic() + limit
        while not self.machine.state.endswith(name):
            self.assertLess(
                time.monotonic(), end, f"{name}: the machine is in {self.machine.state}, {self.machine.why}"
            )
            time.sleep(0.05)

    def page_in(self, name, limit=LIMIT):
        """Waits until the page itself shows this state: on a busy computer it is later than the topic."""
        self.wait_for_hub(name, limit)
        self.browser.until("return coglab.state().phase.endsWith(arguments[0])", limit, name)

    def enabled(self, action, limit=LIMIT):
        """Waits until a button is enabled and returns it."""
        button = f"[data-action={action}]"
        self.browser.until("return !document.querySelector(arguments[0]).hasAttribute('aria-disabled')", limit, button)
        return self.button(action)

    def says(self, action, word, limit=LIMIT):
        """Waits for a text below a button."""
        self.browser.until(
            "return document.getElementById('why-' + arguments[0]).textContent.includes(arguments[1])",
            limit,
            action,
            word,
        )

    def button(self, action):
        return self.browser.driver.find_element(By.CSS_SELECTOR, f"[data-action={action}]")

    def test_01_everything_is_on_the_page_without_scrolling(self):
        self.page_in(self.in_a_hub())
        self.browser.until(
            "return coglab.docs()['graph:/coglab'] && document.querySelectorAll('#graph .node.active').length", LIMIT
        )
        self.browser.until("return document.querySelectorAll('#charts canvas').length >= 5", LIMIT)
        for page in PAGES:
            with self.subTest(page=page):
                self.browser.tab(page)
                problems, texts = self.looked()
                self.browser.picture(self.pictures / f"{page.lower()}.png")
                self.assertEqual(problems, [], json.dumps(problems, indent=1))
                self.assertGreater(texts, 10)
        self.browser.tab("Live")
        self.assertEqual(self.browser.js("return document.getElementById('band').className"), "simulation")

    def looked(self, browser=None):
        """Faults of the page after it is laid out."""
        end = time.monotonic() + LIMIT
        while (found := look(browser or self.browser))[0] and time.monotonic() < end:
            time.sleep(0.4)
        return found

    def test_03_scene_shows_hand_at_its_tf_pose(self):
        self.palm_comes_to_its_frame()

    def test_03b_held_button_calibrates_hand_and_shows_its_end(self):
        self.page_in(self.in_a_hub())
        self.browser.tab("Health")
        self.addCleanup(self.browser.tab, "Live")
        found = "[...document.querySelectorAll('#page button')].find((one) => one.innerText === 'Forced calibration')"
        self.browser.until(f"return {found} && !{found}.hasAttribute('aria-disabled')", LIMIT)
        button = self.browser.js(f"const one = {found}; one.scrollIntoView(); return one")
        told = "return coglab.events().some((one) => one.source === arguments[0] && one.text.includes(arguments[1]))"
        press_and_hold(self.browser, button, lambda: self.browser.js(told, "command", "complete started"), LIMIT)
        self.browser.until(told, LIMIT, "hand", "calibration complete ended")

    def palm_comes_to_its_frame(self):
        """Waits until the page draws the palm within 2 mm of its frame."""
        end = time.monotonic() + LIMIT
        while (distance := self._distance_to_tf()) >= 0.002 and time.monotonic() < end:
            time.sleep(0.2)
        self.assertLess(distance, 0.002)

    def _distance_to_tf(self):
        """Distance (m) of the drawn palm to its frame; infinite while it is not drawn."""
        place = self.frames.lookup_transform(
            "world", "ih2_palm", rospy.Time(0), rospy.Duration(LIMIT)
        ).transform.translation
        drawn = self.browser.js("return coglab.palm()")
        return float(np.linalg.norm(np.array(drawn) - [place.x, place.y, place.z])) if drawn else float("inf")

    def receive(self):
        """Receives once, until the machine is in a hub again or has stopped. On a crowded computer it may stop by
        itself, or refuse what it sees too late."""
        self.page_in("wait_without_object")
        path = self.path_ahead(4 * LIMIT)  # the slowest cell runs at a quarter of real time
        self.assertEqual(path.get("kind"), "ahead", path)
        self.assertGreater(len(path["points"]), 10)
        self.browser.js("document.activeElement.blur()")
        self.says("exchange_robot_to_human", "empty")
        before = self.browser.js(f"return {RESULTS}")
        self.enabled("exchange_human_to_robot").click()
        running = self.browser.until(
            "const p = coglab.docs().path;"
            "return (p && p.kind === 'running' && p) || coglab.state().phase.endsWith('/stopped') ||"
            f" {RESULTS} > arguments[0]",
            LIMIT,
            before,
        )
        if running is not True:
            self.browser.picture(self.pictures / "reaching.png")
            self.assertEqual(self.looked()[0], [])
            self.assertGreater(len(running["points"]), 10)
        end = time.monotonic() + 3 * LIMIT
        while not self.machine.in_hub and time.monotonic() < end:
            if self.machine.state.endswith(("/stopped", "/fault")):
                return
            time.sleep(0.05)

    def path_ahead(self, limit):
        """Document of the path on the page: waits until it leads ahead. If it does not, returns what is there."""
        end = time.monotonic() + limit
        while True:
            path = self.browser.js("return coglab.docs().path") or {}
            if path.get("kind") == "ahead" or time.monotonic() > end:
                return path
            time.sleep(0.1)

    def holds_the_mug(self):
        """In the hub with the mug in the hand, received again where it is not there."""
        for _ in range(3):
            if self.in_a_hub().endswith("wait_with_object"):
                break
            self.receive()
        self.page_in("wait_with_object")

    def test_04_an_exchange_by_mouse(self):
        self.holds_the_mug()
        self.browser.until("return document.getElementById('status').innerText.includes('mug in the hand')", LIMIT)
        self.browser.until(
            "return coglab.events().some(e => e.source === 'result' && e.text.includes('Receive mug'))", LIMIT
        )
        self.browser.until("return coglab.state().speed < 0.001", LIMIT)
        self.palm_comes_to_its_frame()
        self.browser.picture(self.pictures / "holds.png")

    def in_a_hub(self):
        """Returns the machine's state when it waits in a hub, by the two acts after a stop where it has stopped by
        itself: on a crowded computer the simulated controller loses command mode."""
        end = time.monotonic() + 3 * LIMIT
        while not self.machine.state.endswith(HUBS):  # not in_hub: it is true after a stop too
            self.assertLess(time.monotonic(), end, f"no hub: {self.machine.state}, {self.machine.why}")
            if self.machine.state.endswith(("/stopped", "/fault")):
                self.go_on()
            time.sleep(0.05)
        return self.machine.state

    def go_on(self):
        """Does the two steps after a stop or a fault: acknowledge, hold a button. Which hub follows depends on how far
        a handover had come: the person may have taken the mug before the arm stood."""
        leaf = "/fault" if self.machine.state.endswith("/fault") else "/stopped"
        self.page_in(leaf)
        self.browser.until("return document.getElementById('acknowledge').offsetParent !== null", LIMIT)
        acknowledge(self.browser, self.browser.driver.find_element(By.ID, "acknowledge").click, LIMIT)
        button = self.enabled("initialise" if leaf == "/fault" else "reset")
        press_and_hold(self.browser, button, lambda: not self.machine.state.endswith(leaf), LIMIT)
        self.page_in(self.in_a_hub())

    def reach(self):
        """Until the arm is on its way to the person, again where the machine has stopped by itself."""
        for _ in range(3):
            self.holds_the_mug()
            before = self.browser.js(f"return {RESULTS}")
            self.enabled("exchange_robot_to_human").click()
            # One look for all: a moment later the reach may be over, and that is no stop.
            seen = self.browser.until(
                "const s = coglab.state();"
                "return s.dmp[0] === 'running' ? 'running' :"
                f" (s.phase.endsWith('/stopped') || {RESULTS} > arguments[0]) && 'ended'",
                LIMIT,
                before,
            )
            if seen == "running":
                return
        self.fail(f"no reach in three attempts: {self.machine.why}")

    def test_05_stop_by_key_then_acknowledge_then_hold(self):
        self.reach()
        ActionChains(self.browser.driver).send_keys(Keys.SPACE).perform()
        end = time.monotonic() + LIMIT
        while not self.arm.hold_latched:
            self.assertLess(time.monotonic(), end, "no hold")
            time.sleep(0.002)
        self.page_in("/stopped", LIMIT)
        self.browser.until("return document.getElementById('acknowledge').offsetParent !== null", LIMIT)
        self.browser.picture(self.pictures / "stopped.png")
        self.assertEqual(self.looked()[0], [])
        self.says("reset", "acknowledge")
        self.button("reset").click()  # refused, and a click would not be enough
        self.browser.until("return document.getElementById('refusal').textContent.includes('acknowledge')", LIMIT)
        time.sleep(0.3)
        self.assertTrue(self.arm.hold_latched)
        self.go_on()
        self.assertFalse(self.arm.hold_latched)

    def test_06_stop_waits_neither_for_the_master_nor_for_a_frozen_brain(self):
        self.in_a_hub()
        master = rosgraph.Master("/console_test")
        frozen = [self._process_of("/coglab"), master.getPid()]
        for process in frozen:
            os.kill(process, signal.SIGSTOP)
        try:
            ActionChains(self.browser.driver).send_keys(Keys.SPACE).perform()
            end = time.monotonic() + LIMIT
            while not self.arm.hold_latched and time.monotonic() < end:
                time.sleep(0.002)
            held = self.arm.hold_latched
        finally:
            for process in frozen:
                os.kill(process, signal.SIGCONT)
        self.assertTrue(held, "no hold while they were frozen")
        self.go_on()

    @staticmethod
    def _process_of(node):
        uri = rosgraph.Master("/console_test").lookupNode(node)
        return ServerProxy(uri).getPid("/console_test")[2]

    def test_08_state_machine_of_another_node_is_shown(self):
        with OtherMachine() as other_machine:
            picture = self.browser.until("return coglab.docs()['graph:/other_machine']", LIMIT)
            self.assertEqual({node["label"] for node in picture["nodes"]}, {"ALPHA", "BETA"})
            self.assertEqual([edge["outcomes"] for edge in picture["edges"]], ["on"])
            self.browser.tab("Machine")
            show_machine(self.browser, "other_machine")
            self.browser.until("return document.querySelectorAll('#graph .node').length === 2", LIMIT)
            other_machine.begin()
            self.browser.until("return document.querySelectorAll('#graph .edge.last').length === 1", LIMIT)
            texts = "return [...document.querySelectorAll('#graph rect.active.node + text')].map((t) => t.textContent)"
            self.assertEqual(self.browser.js(texts), ["BETA"])
            self.assertEqual(
                self.browser.js("return document.querySelector('#graph p.last').innerText"), "ALPHA → BETA"
            )
        show_machine(self.browser, "coglab")
        self.browser.tab("Live")

    def test_08b_notes_and_the_next_object_go_both_ways(self):
        heard = {"note": [], "next_object": []}
        for name, rows in heard.items():
            rospy.Subscriber(f"/coglab/{name}", String, rows.append)
        publishers = {name: rospy.Publisher(f"/coglab/{name}", String, queue_size=5) for name in heard}
        end = time.monotonic() + LIMIT
        while not all(one.get_num_connections() > 1 for one in publishers.values()):  # this test and the console
            self.assertLess(time.monotonic(), end, "the console does not listen")
            time.sleep(0.05)
        publishers["note"].publish("cup slipped <b>twice</b>")
        publishers["next_object"].publish("ball")
        self.browser.until("return coglab.events().some(e => e.text.endsWith('cup slipped <b>twice</b>'))", LIMIT)
        # The hand holds the mug, which the page goes on showing.
        self.browser.until("return coglab.events().some(e => e.text.endsWith('the next object is ball'))", LIMIT)
        publishers["next_object"].publish("../ball")
        self.browser.until("return coglab.events().some(e => e.source === 'command' && e.level === 'warning')", LIMIT)
        self.browser.js("document.activeElement.blur()")
        ActionChains(self.browser.driver).send_keys("m").send_keys("by hand").send_keys(Keys.TAB, Keys.ENTER).perform()
        while not any(row.data == "by hand" for row in heard["note"]):
            self.assertLess(time.monotonic(), end + LIMIT, [row.data for row in heard["note"]])
            time.sleep(0.05)
        self.browser.tab("Live")
        self.browser.js(
            "const o = document.getElementById('object'); o.value = ''; o.dispatchEvent(new Event('change'))"
        )
        while not any(row.data == "" for row in heard["next_object"]):
            self.assertLess(time.monotonic(), end + LIMIT, [row.data for row in heard["next_object"]])
            time.sleep(0.05)

    def test_09_a_second_console_of_this_master_is_refused_and_says_so(self):
        command = ["rosrun", "coglab_console", "console_node.py"]
        with tempfile.TemporaryDirectory() as home:
            # In parallel. The other one has the same name but its own ROS_HOME, as from a second terminal: it would end
            # the first one.
            begun = [
                subprocess.Popen([*command, *name], stderr=subprocess.PIPE, text=True, env={**os.environ, **changed})
                for name, changed in ((["__name:=another_console"], {}), ([], {"ROS_HOME": home}))
            ]
            try:
                said = [one.communicate(timeout=3 * LIMIT)[1] for one in begun]
            finally:
                for one in begun:
                    one.kill()
        self.assertEqual([one.returncode for one in begun], [1, 1], said)
        self.assertIn("another console", said[0])
        self.assertRegex(said[1], "another console.* http")
        self.browser.until("return !document.body.classList.contains('lost')", LIMIT)

    def test_10_browser_logged_no_errors(self):
        rows = [row for row in self.browser.complaints() if not any(word in row for word in (*KNOWN, LATE))]
        self.assertEqual(rows, [])

    def test_11_without_webgl_the_view_is_2d(self):
        hub = self.in_a_hub()
        used = self.link
        with PageBrowser(webgl=False) as other:
            other.open(fresh_link(Path(rospkg.get_ros_home()), used, LIMIT), LIMIT)
            self.assertEqual(other.js("return coglab.view()"), "2D")
            other.until(
                "return document.getElementById('role').innerText.includes('you watch')",
                LIMIT,
            )
            other.until("return coglab.state().phase.endsWith(arguments[0])", LIMIT, hub)
            other.picture(self.pictures / "flat.png")
            self.assertEqual(self.looked(other)[0], [])
            place = self.frames.lookup_transform("world", "ih2_palm", rospy.Time(0)).transform.translation
            self.assertLess(
                np.linalg.norm(np.array(other.js("return coglab.palm()")) - [place.x, place.y, place.z]), 0.002
            )


if __name__ == "__main__":
    rostest.rosrun("coglab_console", "console", Console, sys.argv)
