"""Scripted ports for arm, hand, perception, database and contact, without ROS and physics.

For unit tests of the state machines: order, times and outcomes. Every request is accepted unless ``cell.faults`` says
otherwise. The person follows ``cell.partner``. A World shows which requests the real robot refuses, and why.
"""

from coglab_trials.scripted.cell import Faults, Partner, ScriptedCell
from coglab_trials.scripted.ports import scripted_context

__all__ = ["Faults", "Partner", "ScriptedCell", "scripted_context"]
