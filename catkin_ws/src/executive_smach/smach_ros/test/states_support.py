"""Common parts of the tests of states."""

import threading
import time

LIMIT = 60.0


def in_thread(function, *args):
    """Runs it; .result after .join()."""
    thread = threading.Thread(target=lambda: setattr(thread, "result", function(*args)), daemon=True)
    thread.result = "did not end"
    thread.start()
    return thread


def wait_for(condition, limit=LIMIT):
    end = time.monotonic() + limit
    while time.monotonic() < end and not condition():
        time.sleep(0.01)
    return condition()
