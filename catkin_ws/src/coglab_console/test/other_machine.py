"""Another state machine on the same ROS master: ALPHA, then BETA until a request to end; and a helper to show it on the
page."""

import threading

import smach
import smach_ros
from selenium.webdriver.common.by import By


class OtherMachine:
    """Publishes itself as `/other_machine` while the context lasts; `begin` runs it."""

    def __init__(self):
        self._over = threading.Event()
        self._machine = smach.StateMachine(outcomes=["done"])
        with self._machine:
            smach.StateMachine.add("ALPHA", smach.CBState(lambda _: "on", outcomes=["on"]), {"on": "BETA"})
            smach.StateMachine.add("BETA", smach.CBState(self._beta, outcomes=["done"]))
        self._server = smach_ros.IntrospectionServer("other_machine", self._machine, "/OTHER_MACHINE")
        self._runner = threading.Thread(target=self._machine.execute, daemon=True)

    def _beta(self, _data):
        self._over.wait(60.0)
        return "done"

    def begin(self):
        self._runner.start()

    def __enter__(self):
        self._server.start()
        return self

    def __exit__(self, *_error):
        self._over.set()
        self._server.stop()


def show_machine(browser, name):
    """Chooses this machine in the list above the page's graph."""
    browser.driver.find_element(By.CSS_SELECTOR, "[aria-label='State machine to show']").click()
    line = "[...document.querySelectorAll('ul.choice li')].find((one) => one.textContent === arguments[0])"
    browser.until(f"return {line}", 10.0, name).click()
