"""Fixtures of the machine tests: a script operates the master in virtual time on simulated ports."""

from pathlib import Path

import pytest
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_py.packages import package_path
from coglab_smach.context.config import Config
from coglab_smach.machines import build_master
from coglab_trials.scripted import scripted_context
from coglab_trials.virtual_clock import VirtualClock, using

SHARE = Path(__file__).resolve().parent.parent
LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))


class Trial:
    """The master on simulated ports. ``run(script)`` executes script(trial) beside the machine, in virtual time."""

    def __init__(self, **overrides):
        self.clock = VirtualClock()
        self.database = ObjectDatabase(objects_folder())
        assert self.database.reload() == []
        config = Config.load(
            str(SHARE / "config" / "machines.yaml"), {"auto_trigger": True, "dmp_library": LIBRARY, **overrides}
        )
        self.ctx, self.cell = scripted_context(self.clock, self.database, config)
        with using(self.clock):
            self.master = build_master(self.ctx)
        self.error = None

    @property
    def grip(self):
        """The grip record that the states of a handover share."""
        return self.master.userdata.grip

    def run(self, script, limit=600.0):
        """Run the machine until the script ends. Raises the script's exception."""
        with using(self.clock):

            def scripted():
                try:
                    script(self)
                except BaseException as error:
                    self.error = error
                finally:
                    self.master.request_preempt()

            self.clock.start_thread(scripted, "script")
            outcome = self.master.execute()
        if self.error is not None:
            raise self.error
        assert outcome == "preempted"
        return self

    def wait_hub(self, label, limit=120.0):
        """Wait until a hub (or stopped, fault) is open."""
        end = self.clock.now() + limit
        while self.ctx.requests.hub() != label:
            assert self.clock.now() < end, (
                f"{label} not reached in {limit} s; hub '{self.ctx.requests.hub()}', why: {self.ctx.journal.why()}\n"
                + "\n".join(t.sentence() for t in self.ctx.journal.transitions[-15:])
            )
            self.clock.sleep(0.05)

    def until(self, condition, limit=60.0):
        """Wait until ``condition()``; fails after ``limit`` s."""
        end = self.clock.now() + limit
        while not condition():
            assert self.clock.now() < end, f"not within {limit} s; why: {self.ctx.journal.why()}"
            self.clock.sleep(0.01)

    def start(self, action, object_id="mug"):
        """Trigger an action; it must be accepted."""
        ok, message, _ = self.ctx.requests.submit(action, object_id)
        assert ok, message
        self.clock.sleep(0.1)

    def begin(self, action="exchange_human_to_robot", object_id="mug"):
        """Trigger an action as soon as the hub of the empty hand is open."""
        self.wait_hub("wait_without_object")
        self.start(action, object_id)

    def receive(self):
        """Run the action that receives the mug."""
        self.begin()
        self.wait_hub("wait_with_object")

    def labels(self, path_end):
        """Labels of the states that ended in the container whose path ends with ``path_end``, in order."""
        return [t.from_state for t in self.ctx.journal.transitions if t.path.endswith(path_end)]

    def result(self):
        """The newest finished action."""
        return self.ctx.journal.results[-1]


@pytest.fixture
def trial():
    """A fresh master."""
    return Trial()
