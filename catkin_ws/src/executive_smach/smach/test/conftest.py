"""Fixtures of the engine's tests: captured log, and loggers restored after each test."""

import pytest
import smach


class Log:
    """What the engine has logged, by level."""

    def __init__(self):
        self.info, self.warn, self.debug, self.error = [], [], [], []

    def text(self, level):
        return "\n".join(map(str, getattr(self, level)))


@pytest.fixture(autouse=True)
def log():
    """The engine's log during one test."""
    before = (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr)
    shutdown = smach.is_shutdown
    record = Log()
    smach.set_loggers(record.info.append, record.warn.append, record.debug.append, record.error.append)
    smach.set_shutdown_check(lambda: False)
    yield record
    smach.set_loggers(*before)
    smach.set_shutdown_check(shutdown)
