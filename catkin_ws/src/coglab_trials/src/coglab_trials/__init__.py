"""Simulated handovers in virtual time, without a ROS master: World, VirtualTrial, and scripted ports for unit tests."""

from coglab_trials.conditions import Conditions
from coglab_trials.trial import GIVE, RECEIVE, TrialResult, VirtualTrial
from coglab_trials.virtual_clock import VirtualClock, using
from coglab_trials.world import World

__all__ = ["GIVE", "RECEIVE", "Conditions", "TrialResult", "VirtualClock", "VirtualTrial", "World", "using"]
