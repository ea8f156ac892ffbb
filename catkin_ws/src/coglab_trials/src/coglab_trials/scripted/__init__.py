"""Scripted ports: what the state machines need of arm, hand, perception, database and contact, without ROS and physics.

For unit tests of machines: order, times and outcomes. Everything that is asked for is accepted, unless the test says
otherwise (``cell.faults``), and the person does what the test says (``cell.partner``). What the real robot refuses, and
why, is found in a World.
"""

from coglab_trials.scripted.cell import Faults, Partner, ScriptedCell
from coglab_trials.scripted.ports import scripted_context

__all__ = ["Faults", "Partner", "ScriptedCell", "scripted_context"]
